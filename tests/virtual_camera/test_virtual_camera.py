"""The virtual camera: light in physical order, adaptation that is steady, and one call from radiance to a picture."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest

from relume.image.files import read_photograph
from relume.image.photograph import Exposure
from relume.image.radiance import RadianceMap
from relume.virtual_camera.developing import develop, develop_frames
from relume.virtual_camera.film.darkroom import Darkroom
from relume.virtual_camera.film.film import Film
from relume.virtual_camera.film.stocks import black_and_white_negative, black_and_white_paper
from relume.virtual_camera.lens.glare.camera import CameraGlare
from relume.virtual_camera.lens.glare.eye import EyeGlare
from relume.virtual_camera.lens.motion.straight import StraightMotion
from relume.virtual_camera.lens.vignetting import CosineFourth
from relume.virtual_camera.protocols import Adaptation
from relume.virtual_camera.tone.display.encoding import HLG, PQ, DisplayP3, HdrGainMap, Srgb, encoded_and_clipped
from relume.virtual_camera.tone.display.writing import profile_of
from relume.virtual_camera.tone.ferwerda import Ferwerda
from relume.virtual_camera.tone.histogram.adjustment import HistogramAdjustment
from relume.virtual_camera.tone.metered import CameraExposure, FixedExposure, MeteredExposure
from relume.virtual_camera.tone.pattanaik.pattanaik import Pattanaik
from relume.virtual_camera.tone.reinhard import Reinhard, ReinhardLocal
from relume.virtual_camera.tone.tumblin_rushmeier import TumblinRushmeier
from relume.virtual_camera.view import View, log_mean
from relume.virtual_camera.virtual_camera import IN_ORDER, VirtualCamera


def lamp(height: int = 24, width: int = 48, *, brightness: float = 50.0) -> RadianceMap:
    radiance = np.full((height, width, 3), 0.1, np.float32)
    radiance[height // 2, width // 2] = brightness
    return RadianceMap(radiance)


@dataclass(frozen=True)
class Noted:
    """Optics that notes when it was passed."""

    name: str
    passed: list

    @property
    def absolute(self) -> bool:
        return False

    def apply(self, radiance: np.ndarray, view: View) -> np.ndarray:
        self.passed.append(self.name)
        return radiance


def test_light_meets_every_part_in_physical_order():
    passed: list = []
    parts: dict[str, Any] = {name: Noted(name, passed) for name in reversed(IN_ORDER)}
    camera = VirtualCamera(**parts)
    develop(lamp(), camera)
    assert passed == ["motion", "defocus", "soft_focus", "glare", "geometry", "vignetting"]


def test_plain_pixels_are_those_of_srgb():
    ramp = np.array([[[0, 0.0031308, 0.18], [0.5, 1, 4]]], np.float32)
    assert develop(RadianceMap(ramp), VirtualCamera(tone=FixedExposure())).pixels.tolist() == [
        [[0, 10, 118], [188, 255, 255]]
    ]


def test_blur_comes_before_saturation_whatever_was_written_first():
    blurred = develop(lamp(), VirtualCamera(tone=FixedExposure(), motion=StraightMotion(9, 0))).pixels
    # 50 over 9 pixels is far above white: as many pixels saturate; a lamp cut off at 1 first would leave none.
    assert np.count_nonzero(blurred[12, :, 0] == 255) == 9


def test_a_stop_is_a_factor_of_two_behind_every_tone():
    picture = RadianceMap(np.full((4, 4, 3), 0.09, np.float32))
    for tone in (FixedExposure(), MeteredExposure(percentile=None)):
        camera = VirtualCamera(tone=tone)
        values = camera.tone_map(picture).display_values
        assert np.allclose(replace(camera, stops=1.5).tone_map(picture).display_values, values * 2**1.5, rtol=1e-6)
    # The adaptation stays where it was, so that Reinhard's curve is entered further up.
    camera = VirtualCamera(tone=Reinhard(key=0.18, white=np.inf))
    assert np.allclose(camera.tone_map(picture).display_values, 0.18 / 1.18, rtol=1e-5)
    assert np.allclose(replace(camera, stops=1).tone_map(picture).display_values, 0.36 / 1.36, rtol=1e-5)


@pytest.mark.parametrize("tone", [MeteredExposure(percentile=None), Reinhard(white=np.inf)])
def test_a_flickering_sequence_is_steadied(tone):
    frames = [RadianceMap(np.full((4, 4, 3), level, np.float32)) for level in [1.0, 4.0] * 12]
    camera = VirtualCamera(tone=tone)

    def greys(settling: float) -> np.ndarray:
        made = camera.tone_map_frames(frames, frames_per_second=24, settling=settling)
        return np.array([each.adaptation.values[0] for each in made])

    alone, steady = greys(0), greys(1.0)
    assert np.ptp(alone[-2:]) == pytest.approx(np.log(4), rel=1e-3)
    # The share of a 24th of a second in a settling of one is 0.0408, of each leap of ln 4.
    assert np.abs(np.diff(steady)).max() < 0.05 * np.log(4)


def test_adaptation_arrives_after_its_settling():
    frames = [RadianceMap(np.full((4, 4, 3), level, np.float32)) for level in [1.0] + [8.0] * 24]
    values = [each.adaptation.values[0] for each in VirtualCamera().tone_map_frames(frames, settling=1.0)]
    assert (values[0] - values[-1]) / np.log(8) == pytest.approx(1 - np.exp(-1), rel=1e-3)


def test_a_sequence_knows_its_luminance_from_the_first_frame():
    camera = VirtualCamera(tone=Absolute())
    frames = [RadianceMap(np.full((4, 4, 3), level, np.float32)) for level in (1.0, 2.0)]
    with pytest.warns(UserWarning, match="100 cd/m²") as caught:
        made = [each.adaptation.values[0] for each in camera.tone_map_frames(frames, settling=0)]
    assert len(caught) == 1 and made == pytest.approx([100, 200], rel=1e-5)


@dataclass(frozen=True)
class Absolute:
    """A tone that asks for cd/m²."""

    absolute = True

    def adapt(self, radiance: np.ndarray, view: View) -> Adaptation:
        return Adaptation(np.array([float(radiance.max()) * view.luminance_scale]))

    def display_values(self, radiance: np.ndarray, view: View, adaptation: Adaptation) -> np.ndarray:
        return radiance


def test_bad_radiance_never_becomes_a_picture():
    picture = lamp()
    picture.radiance[3, 4] = np.nan
    with pytest.raises(ValueError, match="x 4, y 3"):
        develop(picture)
    with pytest.raises(ValueError, match="frame 2: the radiance at x 4, y 3"):
        list(VirtualCamera().tone_map_frames([lamp(), picture]))


@pytest.mark.parametrize("display", [Srgb(), Srgb(16), DisplayP3()])
@pytest.mark.parametrize("stops", [0.0, 1.5])
def test_rows_that_are_shown_as_they_are_encoded_are_the_whole_picture(display, stops, tmp_path):
    light = np.random.default_rng(4).lognormal(0, 2, (70, 1500, 3)).astype(np.float32)
    made = VirtualCamera(tone=Reinhard(white=2.0), stops=stops, display=display).tone_map(RadianceMap(light))
    whole, clipping = encoded_and_clipped(made.values, display)
    np.testing.assert_array_equal(made.photograph().pixels, whole)
    assert made.write(tmp_path / "a.png") == clipping
    assert 0 < max(clipping.above) < 1
    np.testing.assert_array_equal(read_photograph(tmp_path / "a.png").pixels, whole)


def test_files_are_for_their_display(tmp_path):
    made = VirtualCamera(tone=FixedExposure(), display=DisplayP3()).tone_map(lamp())
    clipping = made.write(tmp_path / "a.png")
    assert max(clipping.above) == pytest.approx(1 / (24 * 48))
    with pytest.raises(ValueError, match=r"written to \.avif"):
        VirtualCamera(display=HLG()).tone_map(lamp()).write(tmp_path / "a.png")
    # In memory P3 carries its profile, or its codes would be taken for sRGB; what only a file can hold is refused.
    assert made.photograph().profile == profile_of(DisplayP3())
    for display in (HLG(), PQ(), HdrGainMap()):
        with pytest.raises(ValueError, match=f"only a file can hold a picture for {type(display).__name__}"):
            develop(lamp(), VirtualCamera(display=display))


def test_a_tone_operator_or_a_film_alone_is_a_camera_without_a_lens():
    picture = lamp()
    for tone in (FixedExposure(), MeteredExposure(), Reinhard()):
        assert np.array_equal(develop(picture, tone).pixels, develop(picture, VirtualCamera(tone=tone)).pixels)
    film = Film(2.0)
    assert np.array_equal(develop(picture, film).pixels, develop(picture.radiance, VirtualCamera(tone=film)).pixels)


def test_a_developed_sequence_is_photographs_with_one_adaptation():
    frames = [RadianceMap(np.full((4, 4, 3), level, np.float32)) for level in (1.0, 8.0)]
    first, second = develop_frames(frames, MeteredExposure(percentile=None), settling=1.0)
    assert np.array_equal(first.pixels, develop(frames[0], MeteredExposure(percentile=None)).pixels)
    assert second.pixels.mean() > first.pixels.mean() + 50 and second.name == "frame 2"


def test_a_film_alone_refuses_what_is_not_a_number():
    bad = np.ones((2, 3, 3), np.float32)
    bad[1, 2] = np.nan
    with pytest.raises(ValueError, match="x 2, y 1"):
        develop(bad, Film())


def test_the_view_is_checked():
    picture, camera = lamp(), VirtualCamera()
    assert camera.view(picture, field_of_view=np.pi / 2).focal_length == pytest.approx(24)
    assert camera.view(picture, field_of_view=np.pi / 2).degrees_per_pixel == pytest.approx(2.3859, rel=1e-4)
    with pytest.raises(ValueError, match="the depth map is 48×23 pixels and the picture 48×24"):
        camera.view(picture, depth=np.ones((23, 48), np.float32))
    with pytest.raises(ValueError, match=r"the depth at x 2, y 1 is 0\.0"):
        depth = np.ones((24, 48), np.float32)
        depth[1, 2] = 0
        camera.view(picture, depth=depth)
    with pytest.raises(ValueError, match="motion is"):
        camera.view(picture, motion=np.zeros((24, 48), np.float32))
    with pytest.raises(ValueError, match="in cd/m² already"):
        camera.view(replace(picture, unit="cd/m²"), luminance_scale=2.0)
    with pytest.raises(ValueError, match="field_of_view is 180°"):
        camera.view(picture, field_of_view=np.pi)
    with pytest.warns(UserWarning, match="log mean is taken to be 100 cd/m²"):
        scale = VirtualCamera(tone=TumblinRushmeier()).view(picture).luminance_scale
    assert scale * log_mean(picture.radiance[..., 0]) == pytest.approx(100, rel=1e-4)


def test_the_corners_darken_by_the_fourth_power():
    view = VirtualCamera().view(lamp(), field_of_view=np.pi / 2)
    even = RadianceMap(np.ones((24, 48, 3), np.float32))
    made = VirtualCamera(tone=FixedExposure(), vignetting=CosineFourth()).tone_map(even, view).display_values
    across, down = 23.5 / 24, 11.5 / 24
    assert made[0, 0, 0] == pytest.approx((1 + across**2 + down**2) ** -2, rel=1e-5)


SHUTTER = Exposure(0.01, 8.0, 400.0)


@pytest.mark.parametrize(
    ("camera", "absolute"),
    [
        (VirtualCamera(tone=Ferwerda()), True),
        (VirtualCamera(tone=TumblinRushmeier()), True),
        (VirtualCamera(tone=Pattanaik()), True),
        (VirtualCamera(tone=HistogramAdjustment.human()), True),
        (VirtualCamera(tone=CameraExposure(SHUTTER)), True),
        (VirtualCamera(tone=Darkroom(black_and_white_negative(), black_and_white_paper(), exposure=SHUTTER)), True),
        (VirtualCamera(glare=EyeGlare()), True),
        (VirtualCamera(glare=EyeGlare(adaptation=10.0)), False),
        (VirtualCamera(glare=CameraGlare()), False),
        (VirtualCamera(tone=HistogramAdjustment()), False),
        (VirtualCamera(tone=Darkroom(black_and_white_negative(), black_and_white_paper())), False),
        (VirtualCamera(tone=Reinhard()), False),
        (VirtualCamera(tone=ReinhardLocal()), False),
        (VirtualCamera(), False),
    ],
)
def test_what_models_an_eye_or_a_real_exposure_says_so_of_a_relative_map(camera, absolute):
    assert camera.is_absolute == absolute
    if absolute:
        with pytest.warns(UserWarning, match="log mean is taken to be 100 cd/m²"):
            camera.view(lamp())
    else:
        camera.view(lamp())


def test_grain_is_another_in_every_frame_and_the_eyes_needles_stay():
    grey = RadianceMap(np.full((48, 48, 3), 0.18, np.float32))
    film = VirtualCamera(tone=Darkroom(black_and_white_negative(), black_and_white_paper()))
    first, second = (each.display_values for each in film.tone_map_frames([grey, grey]))
    assert not np.array_equal(first, second)
    assert np.array_equal(first, film.tone_map(grey).display_values)
    eye = VirtualCamera(tone=FixedExposure(), glare=EyeGlare(adaptation=10.0))
    first, second = (each.display_values for each in eye.tone_map_frames([lamp(), lamp()]))
    assert np.array_equal(first, second)


def test_an_eyes_own_adaptation_settles_over_a_sequence():
    @dataclass(frozen=True)
    class Eye:
        seen: list

        @property
        def absolute(self) -> bool:
            return False

        def apply(self, radiance: np.ndarray, view: View) -> np.ndarray:
            self.seen.append(view.settled)
            return radiance

    glare = Eye([])
    frames = [RadianceMap(np.full((4, 4, 3), level, np.float32), unit="cd/m²") for level in (1.0, 100.0)]
    list(VirtualCamera(tone=FixedExposure(), glare=glare).tone_map_frames(frames, settling=1.0))
    assert glare.seen == pytest.approx([1.0, 100 ** (1 - np.exp(-1 / 24))], rel=1e-5)


def test_a_fade_to_black_keeps_its_adaptation():
    black = RadianceMap(np.zeros((4, 4, 3), np.float32))
    grey = RadianceMap(np.full((4, 4, 3), 0.5, np.float32))
    made = list(VirtualCamera().tone_map_frames([black, grey, black, grey]))
    assert [float(each.display_values.max()) for each in made] == pytest.approx([0, 1, 0, 1], rel=1e-2)


def test_every_frame_has_its_view():
    view = VirtualCamera().view(lamp())
    with pytest.raises(ValueError, match="frame 2 has no view"):
        list(VirtualCamera().tone_map_frames([lamp(), lamp()], [view]))
