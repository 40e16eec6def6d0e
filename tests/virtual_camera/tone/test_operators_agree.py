"""What every tone operator owes: finite light, none below 0 but by the screen's black, order kept, greys grey."""

from __future__ import annotations

import importlib.util

import numpy as np
import pytest

from relume.image.photograph import Exposure
from relume.virtual_camera.protocols import ToneOperator
from relume.virtual_camera.tone.black_white_point import BlackWhitePoint
from relume.virtual_camera.tone.display.encoding import Srgb, encoded_and_clipped
from relume.virtual_camera.tone.display_range import DisplayRange
from relume.virtual_camera.tone.ferwerda import Ferwerda
from relume.virtual_camera.tone.histogram.adjustment import HistogramAdjustment
from relume.virtual_camera.tone.metered import CameraExposure, FixedExposure, MeteredExposure
from relume.virtual_camera.tone.ocio import Ocio
from relume.virtual_camera.tone.pattanaik.pattanaik import Pattanaik
from relume.virtual_camera.tone.reinhard import Reinhard, ReinhardLocal
from relume.virtual_camera.tone.tumblin_rushmeier import TumblinRushmeier
from relume.virtual_camera.view import View

VIEW = View(300.0)
ROUNDING = 1e-6
"""Of a display's white: what single precision and OpenColorIO's matrices leave of an exact 0."""

needs_ocio = pytest.mark.skipif(not importlib.util.find_spec("PyOpenColorIO"), reason="the extra ocio is not installed")
OPERATORS = [
    pytest.param(MeteredExposure(), id="metered"),
    pytest.param(FixedExposure(), id="fixed"),
    pytest.param(Reinhard(), id="reinhard"),
    pytest.param(ReinhardLocal(), id="reinhard-local"),
    pytest.param(TumblinRushmeier(), id="tumblin-rushmeier"),
    pytest.param(Ferwerda(), id="ferwerda"),
    pytest.param(HistogramAdjustment(), id="histogram"),
    pytest.param(Pattanaik(DisplayRange(100.0, 1e-3)), id="pattanaik"),
    pytest.param(Ocio("ocio://cg-config-v2.2.0_aces-v1.3_ocio-v2.4"), id="aces-1.3", marks=needs_ocio),
    pytest.param(Ocio("ocio://cg-config-v4.0.0_aces-v2.0_ocio-v2.5"), id="aces-2.0", marks=needs_ocio),
]


# OpenColorIO and plain gain leave the light in units of its own, however much there is.
ADAPTING = [one for one in OPERATORS if not isinstance(one.values[0], Ocio | FixedExposure)]


def lowest(tone: ToneOperator) -> float:
    """What a display value may be: below 0 by the black that the operator's screen adds by itself, no more."""
    screen = getattr(tone, "screen", None)
    return -ROUNDING - (screen.black / (screen.white - screen.black) if screen else 0)


def shown(tone: ToneOperator, radiance: np.ndarray) -> np.ndarray:
    before = radiance.copy()
    picture = tone.display_values(radiance, VIEW, tone.adapt(radiance, VIEW))
    assert np.array_equal(radiance, before), "the operator changed what it was given"
    assert picture.shape == radiance.shape and picture.dtype == np.float32
    return picture


def ramp(darkest: float, brightest: float) -> np.ndarray:
    """Grey, in even ratios from left to right: (12, 360, 3)."""
    light = np.geomspace(darkest, brightest, 360).astype(np.float32)
    return np.repeat(np.tile(light, (12, 1))[..., None], 3, axis=2)


@pytest.mark.parametrize("tone", OPERATORS)
@pytest.mark.parametrize(("darkest", "brightest"), [(1e-6, 1e6), (0.5, 200.0), (1e-6, 1e-3), (1e3, 1e6)])
def test_a_ramp_stays_a_grey_ramp(tone: ToneOperator, darkest: float, brightest: float) -> None:
    picture = shown(tone, ramp(darkest, brightest))
    assert np.isfinite(picture).all() and picture.min() >= lowest(tone)
    # ACES leaves greys grey to a few units in the last place of its matrices.
    np.testing.assert_allclose(np.ptp(picture, axis=2), 0, rtol=0, atol=3e-5 * max(float(picture.max()), ROUNDING))
    line = picture[6, :, 1]
    # Dodging and burning divides by surroundings, whose size it chooses in steps: on a steep ramp these show.
    slack = 0.05 if isinstance(tone, ReinhardLocal) else 1e-5
    assert np.diff(line).min() >= -slack * max(float(line.max()), 0.1)
    assert line[-1] > line[0] or line.max() == 0


@pytest.mark.parametrize("tone", OPERATORS)
@pytest.mark.parametrize("light", [0.0, 1e-6, 0.18, 1.0, 1e6])
def test_uniform_light_stays_uniform(tone: ToneOperator, light: float) -> None:
    picture = shown(tone, np.full((20, 30, 3), light, np.float32))
    assert np.isfinite(picture).all() and picture.min() >= lowest(tone)
    assert np.ptp(picture) <= 3e-5 * max(float(picture.max()), ROUNDING)
    if light == 0:
        assert picture.max() <= ROUNDING


@pytest.mark.parametrize("tone", OPERATORS)
def test_a_pixel_of_light_in_the_dark_is_no_trouble(tone: ToneOperator) -> None:
    scene = np.zeros((20, 30, 3), np.float32)
    scene[9, 14] = (1e6, 1e4, 1e2)
    picture = shown(tone, scene)
    assert np.isfinite(picture).all() and picture[9, 14].max() > 0.01
    one = shown(tone, scene[9:10, 14:15])
    assert np.isfinite(one).all()


@pytest.mark.parametrize("tone", [*ADAPTING, pytest.param(HistogramAdjustment.human(), id="human")])
@pytest.mark.parametrize("scale", [1e-12, 1e-6, 1.0, 1e4, 1e12])
@pytest.mark.parametrize("size", [1, 9])
@pytest.mark.parametrize("huge", [3e38, float(np.finfo(np.float32).max)])
def test_the_greatest_numbers_stay_numbers(tone: ToneOperator, scale: float, size: int, huge: float) -> None:
    scene = np.random.default_rng(13).gamma(0.6, 10.0, (24, 40, 3)).astype(np.float32)
    scene[6 : 6 + size, 9 : 9 + size] = huge
    view = View(300.0, scale)
    adaptation = tone.adapt(scene, view)
    picture = tone.display_values(scene, view, adaptation)
    assert np.isfinite(adaptation.values).all()
    assert np.isfinite(picture).all() and picture.min() >= lowest(tone)


def test_what_is_darker_than_the_screens_black_is_reported() -> None:
    # A screen with a tenth of its white as black: most of a dim ramp is below it.
    screen, scene = DisplayRange(100.0, 10.0), ramp(1e-3, 1e3)
    for tone in (TumblinRushmeier(screen), Ferwerda(screen, acuity=False), Pattanaik(screen)):
        picture = shown(tone, scene)
        below = encoded_and_clipped(picture, Srgb())[1].below
        assert below == pytest.approx((np.count_nonzero(picture < 0) / picture.size,) * 3) and min(below) > 0.3


@pytest.mark.parametrize("tone", OPERATORS)
def test_any_layout_in_memory_gives_the_same_picture(tone: ToneOperator) -> None:
    scene = np.random.default_rng(11).gamma(0.6, 10.0, (24, 40, 3)).astype(np.float32)
    turned = np.asfortranarray(scene)
    assert np.array_equal(shown(tone, turned), shown(tone, scene))


@pytest.mark.parametrize("tone", OPERATORS)
def test_two_adaptations_mix_to_one_between(tone: ToneOperator) -> None:
    dim, bright = (np.random.default_rng(12).gamma(2.0, mean, (24, 40, 3)).astype(np.float32) for mean in (1.0, 30.0))
    first, later = tone.adapt(dim, VIEW), tone.adapt(bright, VIEW)
    assert np.isfinite(first.values).all() and first.values.shape == later.values.shape
    means = [
        float(tone.display_values(bright, VIEW, adaptation).clip(0, 1).mean())
        for adaptation in (first, first.mixed(later, 0.5), later)
    ]
    assert min(means[0], means[2]) - 1e-6 <= means[1] <= max(means[0], means[2]) + 1e-6


@pytest.mark.parametrize(
    "tone",
    [
        *(MeteredExposure(), FixedExposure(2.0), CameraExposure(Exposure(1 / 100, 8.0, 100.0)), TumblinRushmeier()),
        *(Reinhard(), Reinhard(None), Reinhard(white=np.inf), Reinhard(white=1e-3), ReinhardLocal()),
        *(Ferwerda(), Ferwerda(DisplayRange(), acuity=False), Ferwerda(colour=False), Ferwerda(percentile=100.0)),
    ],
    ids=repr,
)
def test_black_stays_black_and_a_spark_in_the_dark_overflows_nothing(tone: ToneOperator) -> None:
    # What rods and cones add leaves black without the screen's own; a factor on light leaves it 0.
    screen = tone.screen if isinstance(tone, Ferwerda) else None
    black = -screen.black / (screen.white - screen.black) if screen else 0
    assert shown(tone, np.zeros((4, 5, 3), np.float32)) == pytest.approx(black, abs=0)
    dim = np.full((40, 50, 3), 1e-6, np.float32)
    dim[3, 4] = 1e6
    lights = shown(tone, dim)
    assert np.all(np.isfinite(lights))
    if isinstance(tone, Reinhard | ReinhardLocal):
        assert np.all(lights > 0)


@pytest.mark.parametrize(
    ("operator", "settings", "message"),
    [
        *((Reinhard, {"key": key}, r"key is .*expected") for key in (0.0, -1.0, np.nan, np.inf)),
        (Reinhard, {"white": 0.0}, r"white is .*expected"),
        (ReinhardLocal, {"key": 0.0}, "key is .*expected"),
        (ReinhardLocal, {"sharpening": np.nan}, "sharpening is .*expected"),
        (ReinhardLocal, {"threshold": 0.0}, "threshold is .*expected"),
        *((ReinhardLocal, {"scales": scales}, "scales is .*expected") for scales in (0, 13)),
        *((MeteredExposure, {"percentile": percent}, "percentile is .*expected") for percent in (0.0, 101.0)),
        *((MeteredExposure, {"grey": grey}, "grey is .*expected") for grey in (0.0, np.nan)),
        (MeteredExposure, {"percentile": -1.0, "grey": None}, "percentile is .*expected"),
        (MeteredExposure, {"percentile": None, "grey": None}, "percentile and grey are both None"),
        *((FixedExposure, {"display_per_radiance": factor}, "expected a positive number") for factor in (0.0, np.inf)),
        (CameraExposure, {"exposure": Exposure(0.01, None, 100.0)}, "has no f-number"),
        (CameraExposure, {"exposure": Exposure(0.01, 8.0, None)}, "has no ISO"),
        (Ferwerda, {"percentile": 0.0}, r"percentile is 0.*expected"),
        *(
            (Pattanaik, {"screen_adaptation": wrong}, "screen_adaptation is .*expected a positive luminance")
            for wrong in (0.0, -1.0, np.nan, np.inf)
        ),
        *((BlackWhitePoint, {"black": black}, "expected 0 < black / 255 < white") for black in (0.0, -1.0, 255.0)),
        *((BlackWhitePoint, {"white": white}, "expected 0 < black / 255 < white") for white in (0.001, np.inf)),
        *((Ocio, {"grey": grey}, "grey is .*expected") for grey in (0.0, np.inf)),
        (Ocio, {"looks": "warm"}, "looks is .*expected"),
    ],
)
def test_settings_that_mean_nothing_are_refused(operator: type, settings: dict, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        operator(**settings)
