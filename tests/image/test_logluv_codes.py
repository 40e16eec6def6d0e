"""LogLuv's codes against the paper's formulas and libtiff's numbers, and every legal code there and back."""

import math

import numpy as np
import pytest
from scipy.spatial import ConvexHull

import naive_logluv
from naive_logluv import luminance_codes
from relume.image.bands import in_threads
from relume.image.files.logluv import codes as logluv_codes
from relume.image.files.logluv import kernels
from relume.image.primaries import REC709

NO_LINES = (np.empty(0), np.empty(0, np.int64), np.empty(0, np.int64))
# CIE 15:2004, table T.5: x, y of monochromatic light from 380 to 700 nm, rounded to four digits.
LOCUS = (
    (0.1741, 0.0050), (0.1733, 0.0048), (0.1714, 0.0051), (0.1644, 0.0109), (0.1440, 0.0297), (0.1241, 0.0578),
    (0.0913, 0.1327), (0.0687, 0.2007), (0.0454, 0.2950), (0.0235, 0.4127), (0.0082, 0.5384), (0.0039, 0.6548),
    (0.0139, 0.7502), (0.0389, 0.8120), (0.0743, 0.8338), (0.1142, 0.8262), (0.1547, 0.8059), (0.2296, 0.7543),
    (0.3016, 0.6923), (0.3731, 0.6245), (0.4441, 0.5547), (0.5125, 0.4866), (0.5752, 0.4242), (0.6270, 0.3725),
    (0.6658, 0.3340), (0.6915, 0.3083), (0.7260, 0.2740), (0.7347, 0.2653),
)  # fmt: skip


def decoded(words, bits):
    """(N, 3) float32 linear pixels of words, as a file is read."""
    luminances = logluv_codes.scale_of(bits).luminances().astype(np.float32)
    colours = logluv_codes.colours(bits) @ np.linalg.inv(REC709.to_xyz()).T if bits != 16 else np.ones((1, 3))
    picture = np.empty((1, len(words), 3), np.float32)
    kernels.paint(words[None].astype(np.uint32), luminances, colours.astype(np.float32), picture)
    return picture[0]


def encoded(pixels, bits):
    """(N,) words of linear pixels, as a file is written, and what was doubtful in them."""
    scale = logluv_codes.scale_of(bits)
    words, doubts = np.empty(len(pixels), np.uint32), np.zeros(kernels.KINDS, np.int64)
    lines = logluv_codes.lines() if bits == 24 else NO_LINES
    parts = (scale.steps, scale.lowest, scale.codes, scale.signed)
    kernels.encode(pixels, REC709.to_xyz(), parts, *lines, words, doubts)
    return words, doubts


def assert_same(words, bits):
    found, doubts = encoded(decoded(words, bits), bits)
    if bits == 16:
        found &= np.uint32(0xFFFF0000)
    np.testing.assert_array_equal(found, words)
    assert doubts[: kernels.COLOURED].sum() == 0


# Larson 1998: 2^((1 + ½)/64 − 12), printed as 0.000248, and so on.
@pytest.mark.parametrize(
    ("bits", "code", "luminance"),
    [
        (24, 0, 0.0),
        (24, 1, 0.000248139),
        (24, 768, 1.005430),
        (24, 1023, 15.913591),
        (32, 0, 0.0),
        (32, 1, 5.443085e-20),
        (32, 16384, 1.001355),
        (32, 32767, 1.8421794e19),
        (32, 32768, 0.0),
        (32, 32768 + 16384, -1.001355),
    ],
)
def test_a_luminance_code_means_the_middle_of_its_step(bits, code, luminance):
    assert logluv_codes.scale_of(bits).luminances()[code] == pytest.approx(luminance, rel=1e-6)


@pytest.mark.parametrize(("scale", "largest"), [(logluv_codes.SHORT, 0.0054299), (logluv_codes.LONG, 0.0013547)])
def test_luminance_is_off_by_at_most_half_a_step_and_not_biased(scale, largest):
    luminance = 2.0 ** np.random.default_rng(1).uniform(1 / 32 - scale.lowest, scale.codes / scale.steps - 12, 200_000)
    luminance = luminance[luminance < 2.0 ** (scale.codes / scale.steps - scale.lowest)]
    error = scale.luminances()[luminance_codes(scale, luminance)] / luminance - 1
    assert np.abs(error).max() == pytest.approx(largest, rel=2e-4)
    assert np.abs(error).max() <= 2 ** (0.5 / scale.steps) - 1 + 1e-12
    assert abs(error.mean()) < 4 * error.std() / math.sqrt(len(error))


def test_luminances_beyond_the_scale_are_0_below_and_past_its_codes_above():
    short = np.array([0.0, 2.0**-12, 2.0**-11.9, 15.999, 16.0, 1e9, -1.0])
    assert luminance_codes(logluv_codes.SHORT, short).tolist() == [
        0, 0, 6, 1023, 1024, 1024, 0,
    ]  # fmt: skip
    assert luminance_codes(logluv_codes.LONG, np.array([1e-30, 1e30, -1.0, -1e-30])).tolist() == [
        0,
        32768,
        16384 | 32768,
        0,
    ]


def test_the_gamut_has_163_lines_and_16289_cells():
    starts, counts, firsts = logluv_codes.lines()
    assert (len(starts), counts.sum(), firsts[-1] + counts[-1]) == (163, 16289, 16289)
    # Every line, weighed by its place: the sums that libtiff's table has.
    assert np.rint(starts * 1e6) @ np.arange(1, 164) == 575400680
    assert counts @ np.arange(1, 164) == 1615040
    # u′, v′ as libtiff 4.7 decodes them.
    colours = logluv_codes.chromaticities(24)
    for code, u, v in (
        (0, 0.249413, 0.018690),
        (4, 0.245529, 0.022190),
        (5, 0.249029, 0.022190),
        (16288, 0.095409, 0.585690),
        (16289, 0.210526, 0.473684),
        (16383, 0.210526, 0.473684),
    ):
        assert colours[code] == pytest.approx((u, v), abs=1e-6)


def test_the_gamut_is_that_of_the_visible_colours():
    x, y = np.array(LOCUS).T
    seen = np.stack([4 * x, 9 * y]) / (-2 * x + 12 * y + 3)  # eq. 2
    cells = logluv_codes.chromaticities(24)[: logluv_codes.CODES]
    nearest = np.hypot(*(cells[:, None] - seen.T).reshape(-1, 2).T).reshape(len(cells), -1).min(axis=0)
    assert nearest.max() < logluv_codes.CELL
    visible = ConvexHull(seen.T)
    beyond = (cells @ visible.equations[:, :2].T + visible.equations[:, 2]).max(axis=1)
    assert beyond.max() < 2.2 * logluv_codes.CELL
    assert 1 < len(cells) * logluv_codes.CELL**2 / visible.volume < 1.03  # of two dimensions the "volume" is the area


def test_a_colour_outside_the_cells_takes_the_nearest():
    outside = np.array([[0.7, 0.5], [0.0, 0.0], [0.2, 0.7], [-1.0, 0.3], [0.25, 0.0168]])
    code, within = naive_logluv.gamut_codes(*outside.T)
    middles = logluv_codes.chromaticities(24)[: logluv_codes.CODES]
    assert not within.any()
    assert code.tolist() == [int(np.argmin(np.hypot(*(middles - colour).T))) for colour in outside]


def test_every_24_bit_code_survives_decoding_and_encoding():
    colours = np.arange(logluv_codes.CODES, dtype=np.uint32)

    def check(begin, end):
        luminances = np.arange(begin + 1, end + 1, dtype=np.uint32)
        assert_same((luminances[:, None] << 16 | colours).ravel(), 24)
        return len(luminances) * len(colours)

    assert sum(in_threads(check, 1023, chunk=33)) == 1023 * 16289


def test_every_16_bit_code_survives_decoding_and_encoding():
    codes = np.arange(2**16, dtype=np.uint32)
    assert_same(codes[codes & 0x7FFF > 0] << 16, 16)


@pytest.mark.parametrize("luminance", [1, 2, 8191, 16384, 20000, 32767, 32768 + 1, 32768 + 16384, 65535])
def test_every_colour_of_32_bits_survives_decoding_and_encoding(luminance):
    assert_same(np.arange(2**16, dtype=np.uint32) | np.uint32(luminance << 16), 32)


@pytest.mark.parametrize("colour", [0x0000, 0x00FF, 0xFF00, 0xFFFF, 0x56C2, 0x51C0, 0x0BF0])
def test_every_luminance_of_32_bits_survives_decoding_and_encoding(colour):
    codes = np.arange(2**16, dtype=np.uint32)
    assert_same(codes[codes & 0x7FFF > 0] << 16 | np.uint32(colour), 32)


@pytest.mark.slow
def test_every_32_bit_code_survives_decoding_and_encoding():
    colours = np.arange(2**16, dtype=np.uint32)

    def check(begin, end):
        for luminance in range(begin, end):
            if luminance & 0x7FFF:
                assert_same(colours | np.uint32(luminance << 16), 32)
        return end - begin

    assert sum(in_threads(check, 2**16, chunk=512)) == 2**16


@pytest.mark.parametrize(("bits", "black"), [(32, 0x56C2), (24, 12266), (16, 0x56C2)])
def test_black_has_the_colour_of_equal_energy(bits, black):
    words, doubts = encoded(np.zeros((1, 3), np.float32), bits)
    assert doubts.sum() == 0
    assert words.tolist() == [black]
    assert decoded(words, bits).tolist() == [[0, 0, 0]]


@pytest.mark.parametrize("bits", [16, 24, 32])
def test_kernels_do_as_their_slow_twin(bits):
    generator = np.random.default_rng(bits)
    pixels = generator.uniform(-0.02 if bits == 24 else -0.5, 1, (20_000, 3)).astype(np.float32)
    pixels = (pixels * 2.0 ** generator.uniform(-8, 3, (len(pixels), 1))).astype(np.float32)
    xyz = pixels.astype(np.float64) @ REC709.to_xyz().T
    if bits == 24:  # which have no sign
        pixels, xyz = pixels[xyz[:, 1] > 0], xyz[xyz[:, 1] > 0]
    words, _ = encoded(pixels, bits)
    slow = naive_logluv.encode(xyz, bits)
    # The two sum in other orders, so that a value at the very edge of a step may fall to either side.
    assert np.count_nonzero((words & np.uint32(0xFFFF0000) if bits == 16 else words) != slow) <= 2
    twin = naive_logluv.decode(words.astype(np.int64), bits)
    if bits != 16:
        twin = twin @ np.linalg.inv(REC709.to_xyz()).T
    assert np.all(np.abs(decoded(words, bits) - twin) <= 1e-6 * np.abs(twin).max(axis=1, keepdims=True))


def test_colours_are_off_by_at_most_half_a_cell():
    generator = np.random.default_rng(2)
    pixels = generator.uniform(0.01, 1, (50_000, 3)).astype(np.float32)
    u, v = naive_logluv.chromaticity(pixels.astype(np.float64) @ REC709.to_xyz().T)
    for bits, cell in ((24, 0.0035), (32, 1 / 410)):
        words, doubts = encoded(pixels, bits)
        assert doubts[kernels.NO_SUCH_COLOUR] == 0
        found = logluv_codes.chromaticities(bits)[words & 0xFFFF]
        error = found - np.stack([u, v], axis=-1)
        assert 0.49 * cell < np.abs(error).max() <= 0.5 * cell + 1e-9
        assert np.abs(error.mean(axis=0)).max() < 0.01 * cell


@pytest.mark.parametrize(
    ("pixel", "doubt"),
    [
        ((math.nan, 1, 1), kernels.NOT_FINITE),
        ((math.inf, 1, 1), kernels.NOT_FINITE),
        ((17, 17, 17), kernels.TOO_BRIGHT),
        ((1e-5, 1e-5, 1e-5), kernels.TOO_DARK),
        ((-1, -1, -1), kernels.NEGATIVE),
        ((-2, 1, -2), kernels.NO_SUCH_COLOUR),
        ((5, -1, 3), kernels.NO_SUCH_COLOUR),
        ((0.1, 1e-9, 100), kernels.COLOURED),
    ],
)
def test_what_24_bits_do_not_hold_is_counted(pixel, doubt):
    _, doubts = encoded(np.array([pixel] * 3, np.float32), 24)
    assert doubts[doubt] == 3
    assert doubts[: kernels.COLOURED].sum() - doubts[doubt] * (doubt != kernels.COLOURED) == 0
