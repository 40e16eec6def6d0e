"""The look-up table gives what rounding the curve gives, for every float; its slow twin is `rounded`."""

import numpy as np
import pytest

from relume.image.colour import encode_srgb
from relume.image.response import Response
from relume.virtual_camera.developing import develop
from relume.virtual_camera.film.film import Film
from relume.virtual_camera.tone.display.code_table import Clipping, CodeTable, code_table, coded
from relume.virtual_camera.tone.display.code_table_kernels import lookup

INFINITY = 0x7F800000


def rounded(values: np.ndarray, curve, bits: int = 8, gain: object = 1.0) -> np.ndarray:
    """The definition: round((2^bits − 1) · curve), negative values as 0, the product with the gain in float32."""
    with np.errstate(over="ignore"):
        exposed = (values * np.asarray(gain, np.float32)).astype(np.float32)
    with np.errstate(all="ignore"):
        shown = np.clip(curve(np.maximum(exposed.astype(np.float64), 0)), 0, 1)
    return np.rint((2**bits - 1) * shown).astype(np.uint8 if bits <= 8 else np.uint16)


def gamma(exponent: float):
    return lambda exposure: exposure ** (1 / exponent)


def camera() -> Response:
    """Three different curves with a black below which nothing is seen, and a shoulder."""
    values = np.linspace(0, 1, 256)
    curves = [np.log(0.002 * (c + 1) + values**2.2 * (1 + 0.3 * c) + 0.5 * values**9) for c in range(3)]
    return Response(np.array(curves), np.ones(3))


def film(exposure: np.ndarray) -> np.ndarray:
    """Lifted blacks, and whites that are never quite reached."""
    return 0.03 + 0.96 * exposure / (exposure + 0.3)


def stairs(exposure: np.ndarray) -> np.ndarray:
    """Leaps over forty codes at once."""
    return np.floor(6 * np.clip(exposure, 0, 1)) / 6


CURVES = {
    "sRGB": encode_srgb,
    "gamma 1.4": gamma(1.4),
    "gamma 2.2": gamma(2.2),
    "camera": lambda exposure: camera().pixel_values(exposure) / 255,
    "film": lambda exposure: np.where(np.isfinite(exposure), film(np.minimum(exposure, 1e30)), 0.99),
    "stairs": stairs,
    "threshold": lambda exposure: np.where(exposure >= 0.5, 1.0, 0.0),  # where a bin begins
}


def picture(floats: np.ndarray) -> np.ndarray:
    """Floats as grey pixels (H, 7, 3), so that every channel gets each of them."""
    short = -len(floats) % 7
    return np.repeat(np.concatenate([floats, np.zeros(short, np.float32)]).reshape(-1, 7)[..., None], 3, axis=2)


@pytest.mark.parametrize("count", [1_000_000, pytest.param(10_000_000, marks=pytest.mark.slow)])
def test_every_random_float_is_rounded_exactly(count):
    generator = np.random.default_rng(7)
    anything = generator.integers(0, INFINITY, count // 3, np.int32).view(np.float32)
    lit = generator.uniform(0, 1.1, count - len(anything)).astype(np.float32)
    values = np.concatenate([anything, lit, -lit[:4], [np.float32(np.inf)]])
    values = values[: len(values) // 3 * 3].reshape(-1, 1, 3)
    codes, _ = coded(values, code_table(encode_srgb))
    assert np.array_equal(codes, rounded(values, encode_srgb))


@pytest.mark.parametrize("name", CURVES)
@pytest.mark.parametrize("bits", [1, 8, 10])
def test_every_float_around_every_boundary_is_rounded_exactly(name, bits):
    curve = CURVES[name]
    table = code_table(curve, bits)
    around = table.thresholds[~np.isnan(table.thresholds)].view(np.int32)[:, None] + np.arange(-9, 10)
    floats = np.clip(around, 0, INFINITY).astype(np.int32).ravel().view(np.float32)
    values = picture(np.concatenate([floats, np.array([0, -0.0, -1, 1e-45, 3e38, np.inf], np.float32)]))
    assert np.array_equal(coded(values, table)[0], rounded(values, curve, bits))


def test_sixteen_bits_are_rounded_exactly_too():
    table = code_table(encode_srgb, 16)
    around = table.thresholds[0, :-1].view(np.int32)[:, None] + np.arange(-2, 3)
    values = picture(
        np.concatenate([around.astype(np.int32).ravel().view(np.float32), np.array([-1, 0, 1, 9], np.float32)])
    )
    codes = coded(values, table)[0]
    assert codes.dtype == np.uint16
    assert np.array_equal(codes, rounded(values, encode_srgb, 16))
    assert table.comparisons == 1


@pytest.mark.parametrize(
    "linear, code", [(0.0, 0), (0.0002, 1), (0.0031308, 10), (0.18, 118), (0.5, 188), (1.0, 255), (-0.5, 0), (7.0, 255)]
)
def test_srgb_codes_are_those_of_iec_61966(linear, code):
    assert coded(np.full((1, 1, 3), linear, np.float32), code_table(encode_srgb))[0].tolist() == [[[code] * 3]]


@pytest.mark.parametrize("exponent", [1.4, 1.8, 2.2])
def test_eight_bits_of_mantissa_hold_the_common_gammas(exponent):
    """As Tchou & Debevec say; of these exponents none needs a second comparison in such a bin."""
    table = code_table(gamma(exponent))
    assert table.comparisons == 1 and 23 - table.shift <= 8


def test_a_gain_is_a_product_in_float32_and_one_a_channel_where_asked():
    values = np.random.default_rng(1).uniform(0, 3, (40, 50, 3)).astype(np.float32)
    table = code_table(encode_srgb)
    for gain in (0.37, (0.2, 0.5, 1.1)):
        assert np.array_equal(coded(values, table, gain)[0], rounded(values, encode_srgb, gain=gain))


def test_a_camera_s_response_is_the_film_s_photograph():
    radiance = np.exp(np.random.default_rng(2).uniform(-7, 2, (30, 41, 3))).astype(np.float32)
    codes = coded(radiance, code_table(CURVES["camera"]))[0]
    assert np.array_equal(codes, develop(radiance, Film(1.0, camera())).pixels)
    assert len(np.unique(codes)) > 200


def test_it_counts_what_is_beyond_white_and_below_black():
    values = np.zeros((2, 5, 3), np.float32)
    values[0, :3, 0] = 1.0, np.nextafter(np.float32(1), np.float32(2)), np.inf
    values[1, :4, 2] = -1e-30, -5, -0.0, 0
    clipping = coded(values, code_table(encode_srgb))[1]
    assert clipping == Clipping((0.2, 0.0, 0.0), (0.0, 0.0, 0.2))
    assert clipping.sentence == "20 % of the pixels are beyond white, 20 % below black"


def test_a_camera_s_black_and_white_are_its_own():
    low, high = np.exp(camera().log_exposure[:, [0, -1]].astype(np.float32)).T
    values = np.stack([low * 0.99, low * 1.01, high * 0.99, high * 1.01])[:, None].astype(np.float32)
    clipping = coded(values, code_table(CURVES["camera"]))[1]
    assert clipping == Clipping((0.25, 0.25, 0.25), (0.25, 0.25, 0.25))


def test_a_film_that_never_reaches_white_clips_nothing_there():
    values = np.full((1, 2, 3), 1e6, np.float32)
    codes, clipping = coded(values, code_table(film_or_end))
    assert codes[0, 0].tolist() == [252] * 3 and clipping.above == (0, 0, 0)  # 255 · 0.99 = 252.45
    assert coded(np.full((1, 1, 3), -1, np.float32), code_table(film_or_end))[0].tolist() == [[[8] * 3]]  # 255 · 0.03


def film_or_end(exposure: np.ndarray) -> np.ndarray:
    return CURVES["film"](exposure)


def test_a_lone_pixel_of_many_is_reported():
    assert Clipping((1e-7, 0, 0), (0, 0, 0)).sentence.startswith("less than 0.01 % of the pixels are beyond white")


def test_nan_is_refused_with_its_place_and_never_a_code():
    values = np.zeros((3, 4, 3), np.float32)
    values[2, 1, 1] = np.nan
    with pytest.raises(ValueError, match=r"1 values are NaN, the first at x 1, y 2"):
        coded(values, code_table(encode_srgb))
    codes, counts = np.full(values.shape, 9, np.uint8), np.zeros((3, 3), np.int64)
    table = code_table(film_or_end)  # whose 0 has the code 8
    bins = (table.starts, table.lowest, table.shift, table.comparisons)
    bounds = np.zeros((2, 3), np.float32)
    lookup(values, np.ones(3, np.float32), table.thresholds, *bins, bounds, codes, counts)
    assert codes[2, 1].tolist() == [8, 0, 8]
    assert counts[2].tolist() == [0, 1, 0]


@pytest.mark.parametrize(
    "curve, said",
    [
        (lambda exposure: np.where(exposure > 0.5, 0.2, exposure), "falls above 0"),
        (lambda exposure: exposure * np.nan, "no numbers"),
        (lambda exposure: exposure[:, 0], "no numbers"),
    ],
)
def test_a_curve_that_no_table_holds_is_refused(curve, said):
    with pytest.raises(ValueError, match=said):
        code_table(curve)


def test_other_input_is_refused():
    table: CodeTable = code_table(encode_srgb)
    with pytest.raises(ValueError, match=r"expected \(H, W, 3\) float32"):
        coded(np.zeros((2, 2, 3)), table)
    with pytest.raises(ValueError, match="gain is -1"):
        coded(np.zeros((2, 2, 3), np.float32), table, -1)
    with pytest.raises(ValueError, match="bits is 17"):
        code_table(encode_srgb, 17)
