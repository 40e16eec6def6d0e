"""Camera raws measured: right where they lie well, and doubted where they moved, for they are merged as they lie."""

from __future__ import annotations

import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from dng_files import RGGB, sensed
from relume.capture.brackets.merging import merge_brackets
from relume.capture.brackets.one_camera import preview
from relume.capture.brackets.result import MergeResult
from relume.capture.brackets.settings import MergeSettings
from relume.capture.lens.vignetting import Vignetting, corrected
from relume.capture.raw.merging import calibrate_raw, merge_raw
from relume.capture.raw.sensor import Sensor, SensorNoise
from relume.capture.response.camera_profile import CameraProfile
from relume.capture.scale.absolute import Scale, apply_scale, scale_from_saturation
from relume.capture.scale.readings import ChannelGains, SpotReading, apply_balance
from relume.errors import NotABracket
from relume.image.files import read_raw
from relume.image.photograph import Exposure, RawPhotograph, Settings
from relume.image.radiance import SATURATED
from shoots import raw_files, textured

SECONDS = (0.25, 1.0, 4.0, 16.0)


@pytest.fixture(scope="module")
def light() -> np.ndarray:
    """A luminance that is white, in places, in all but the shortest exposure."""
    return textured(480, 320).mean(2) / 30


@pytest.fixture(scope="module")
def sound(light, tmp_path_factory) -> list[Path]:
    return raw_files(tmp_path_factory.mktemp("raws"), [light] * 4, SECONDS)


@pytest.fixture(scope="module")
def whole(sound) -> MergeResult:
    return merge_brackets(sound)


def raw(mosaic: np.ndarray, **fields) -> RawPhotograph:
    return RawPhotograph(mosaic, np.array(RGGB), np.full((2, 2), 512.0), 16383.0, np.eye(3), np.ones(3), **fields)


def taken(light: np.ndarray, f_number: float | None = None, iso: float | None = None, full: int = 16383) -> list:
    """A bracket of raws of the times SECONDS, by a sensor that is full at a level."""
    return [
        raw(np.minimum(sensed(light, t, seed=i), full), name=f"{i}.dng", exposure=Exposure(t, f_number, iso))
        for i, t in enumerate(SECONDS)
    ]


def test_a_sound_bracket_is_measured_and_nothing_is_said_against_it(light, sound, whole):
    (one,) = whole.brackets
    assert whole.warnings == whole.notes == whole.messages == ()
    assert np.array_equal(one.picture.radiance, merge_raw(sound).radiance)
    found = one.picture.radiance[..., 1][one.picture.clipped == 0] / light[one.picture.clipped == 0]
    # The virtual sensor gathers at f/4 what it gathers at f/1.
    assert np.median(found) / 16 == pytest.approx(1 / np.median(1 / (found / 16)), rel=0.01)
    assert np.percentile(found / np.median(found), (5, 95)) == pytest.approx((1, 1), abs=0.06)
    assert whole.camera.name == "Virtual One" and whole.camera.response is None and whole.camera.calibration is None
    assert one.aligned is None and one.deghosted is None and one.scale is None
    assert [Path(frame.name).name for frame in one.frames] == [f"raw_{i}.dng" for i in range(4)]
    assert [frame.seconds for frame in one.frames] == pytest.approx(SECONDS, rel=1e-3)
    assert list(whole.seconds) == ["exposures and noise", "check", "merge"]


def test_a_frame_that_moved_is_doubted_by_how_far(light, tmp_path):
    moved = [light, light, np.roll(light, 3, axis=1), light]
    doubts = merge_brackets(raw_files(tmp_path, moved, SECONDS)).brackets[0].doubts
    (doubt,) = [doubt for doubt in doubts if "pixels off the others" in doubt.what]
    assert doubt.degraded and doubt.frame.endswith("raw_2.dng")
    # Seen in a picture of half the size.
    assert float(doubt.what.split()[1]) == pytest.approx(3, abs=0.3)
    assert not any("something moved" in doubt.what for doubt in doubts)


def test_a_thing_that_moved_is_doubted_by_its_share(light, tmp_path):
    instants = [light.copy() for _ in SECONDS]
    for index, instant in enumerate(instants):
        instant[100:180, 60 + 90 * index : 110 + 90 * index] = 2.5 * light.mean()
    found = merge_brackets(raw_files(tmp_path, instants, SECONDS))
    (line,) = [line for line in found.warnings if "something moved" in line]
    # Four places of 80 × 50 pixels, all but where one is too alike to the wall behind.
    share = float(line.split("something moved in ")[1].split(" %")[0])
    assert 0.7 * 100 * 4 * 80 * 50 / light.size < share < 1.3 * 100 * 4 * 80 * 50 / light.size
    assert "raw_0.dng … " in line and "raw_3.dng" in line


def test_a_raw_alone_is_measured(light, tmp_path):
    (path,) = raw_files(tmp_path, [light], (1.0,))
    found = merge_brackets([path])
    assert found.warnings == () and found.brackets[0].name == str(path)


def test_what_the_lens_did_and_the_scale_count(sound):
    seen = []

    def scale(picture, bracket, known):
        seen.append((picture, known))
        # In pixels of the map, not of the small pictures.
        assert bracket.focal_length == read_raw(sound[0]).focal_length and bracket.photographs[0].exposure.f_number == 4
        warnings.warn("the meter is old", stacklevel=2)
        return scale_from_saturation(known.saturation, known.exposures)

    vignetting, gains = Vignetting((-0.3,)), ChannelGains((2.0, 1.0, 0.5))
    settings = MergeSettings(vignetting=[vignetting], balance=lambda _: gains, focal_length=500.0)
    found = merge_brackets(sound, settings=replace(settings, scale=scale))
    one = found.brackets[0]
    plain = apply_balance(corrected(merge_raw(sound), vignetting), gains)
    ((picture, known),) = seen
    assert np.array_equal(picture.radiance, plain.radiance)
    wanted = scale_from_saturation(known.saturation, calibrate_raw(sound).exposures)
    assert one.scale == wanted and one.balance is gains
    assert np.array_equal(one.picture.radiance, apply_scale(plain, wanted).radiance) and one.picture.unit == "cd/m²"
    assert one.picture.attributes["f_number"] == "4"
    assert found.messages == ("the meter is old",) and found.notes == found.messages


def test_times_and_white_that_are_given_count(light, sound, whole):
    doubled = merge_brackets(sound, times=[2 * t for t in SECONDS])
    # Given by hand, the times are the whole exposure: the f/4 of the files counts no more.
    ratio = whole.brackets[0].picture.radiance / doubled.brackets[0].picture.radiance
    assert np.median(ratio) == pytest.approx(2 * 16, rel=1e-4)
    assert {frame.f_number for frame in doubled.brackets[0].frames} == {None}
    assert {frame.source for frame in doubled.brackets[0].frames} == {"given"}
    # A balance of the merged map, to the bit; the camera's own white, in camera colours, is that for daylight.
    gains = ChannelGains((1.0, 1.0, 2.0))
    warm = merge_brackets(sound, settings=MergeSettings(balance=gains)).brackets[0].picture
    assert np.array_equal(warm.radiance, apply_balance(merge_raw(sound), gains).radiance)
    own = whole.brackets[0].picture.radiance
    assert np.array_equal(merge_raw(sound, balance=read_raw(sound[0]).daylight).radiance, own)
    assert not np.array_equal(merge_raw(sound, balance=gains.gains).radiance, own)
    assert not np.array_equal(warm.radiance, own)
    with pytest.raises(NotABracket, match="2 times were given for 4 photographs"):
        merge_brackets(sound, times=[1.0, 2.0])


def test_exposures_are_refined_unless_that_is_switched_off(light, tmp_path):
    short = tuple(t * f for t, f in zip(SECONDS, (1.0, 1.05, 1.0, 1.0), strict=True))
    photographs = [
        raw(sensed(light, t, seed=i), name=f"{i}.dng", exposure=Exposure(said))
        for i, (t, said) in enumerate(zip(short, SECONDS, strict=True))
    ]
    assert calibrate_raw(photographs, refine_exposures=False).factors == pytest.approx(SECONDS, rel=1e-12)
    refined = np.array([frame.seconds for frame in merge_brackets(photographs).brackets[0].frames])
    assert refined / refined[0] == pytest.approx(np.array(short) / short[0], rel=3e-3)


def test_corrections_are_reported_with_errors_that_are_true(light):
    """How far the corrections lie from the truth, in their own errors, over fifteen brackets."""
    factors, deviations = np.array([1.0, 1.05, 0.97, 1.0]), []
    names = [f"{i}.dng" for i in range(4)]
    for seed in range(15):
        photographs = [
            raw(sensed(light[::2, ::2], t * f, seed=4 * seed + i), name=name, exposure=Exposure(t, 2.0, 100.0))
            for i, (t, f, name) in enumerate(zip(SECONDS, factors, names, strict=True))
        ]
        corrections = calibrate_raw(photographs).corrections()
        stops, errors = np.array([corrections[name] for name in names]).T
        deviations.append((stops - np.log2(factors) + np.log2(factors).mean()) / errors)
    assert 0.6 < np.std(deviations) < 1.4
    assert np.abs(stops).max() > 0.06 and np.all((errors > 1e-4) & (errors < 0.01))
    assert calibrate_raw(photographs, refine_exposures=False).corrections() == {}
    assert calibrate_raw(photographs[:1]).corrections() == {}
    # In the brightest part no pixel is measured in both of the longest two: there the marked speeds are what is known.
    bright = [replace(p, mosaic=sensed(light[:, :160], t)) for p, t in zip(photographs, SECONDS, strict=True)]
    bright[1] = replace(bright[1], exposure=Exposure(1.1, 2.0, 100.0))
    errors = [error for _, error in calibrate_raw(bright).corrections().values()]
    assert min(errors) > 0.01


def test_several_brackets_share_what_is_read_in_the_first(light, tmp_path):
    first = raw_files(tmp_path / "a", [light] * 3, (0.25, 1.0, 4.0))
    second = raw_files(tmp_path / "b", [light[::-1].copy()] * 2, (0.5, 2.0))
    asked = []

    def scale(picture, bracket, known):
        asked.append(bracket.name)
        return Scale.grey(50 / float(picture.radiance.max()), 0.1, "a reading")

    def balance(picture):
        mean = picture.radiance.mean((0, 1))
        return ChannelGains((2 * float(mean[1] / mean[0]), 1.0, float(mean[1] / mean[2])))

    found = merge_brackets([first, second], settings=MergeSettings(scale=scale, balance=balance))
    one, other = found.brackets
    assert asked == [one.name] and one.scale is other.scale is not None and one.balance is other.balance is not None
    assert [len(each.frames) for each in found.brackets] == [3, 2] and found.warnings == ()
    assert {Path(name).parent.name for name in one.corrections} == {"a"}
    assert {Path(name).parent.name for name in other.corrections} == {"b"}
    assert one.picture.clipped is not None and other.picture.clipped is not None
    both = (one.picture.clipped == 0) & (other.picture.clipped[::-1] == 0) & (light > np.median(light))
    ratio = (other.picture.radiance[::-1] / one.picture.radiance)[both]
    assert np.median(ratio) == pytest.approx(1, abs=2e-3)
    # Times that are given go bracket after bracket.
    times = merge_brackets([first, second], times=[1, 4, 16, 2, 8]).brackets
    assert [[frame.seconds for frame in each.frames] for each in times] == [
        pytest.approx((1, 4, 16), rel=1e-2), pytest.approx((2, 8), rel=1e-2)
    ]  # fmt: skip
    with pytest.raises(NotABracket, match="2 times were given for 5 photographs"):
        merge_brackets([first, second], times=[1, 4])
    with pytest.raises(ValueError, match="photographs and brackets of them together"):
        merge_brackets([first, second[0]])  # type: ignore[list-item]
    with pytest.raises(NotABracket, match="no photographs"):
        merge_brackets([])


def test_brackets_of_two_cameras_are_merged_apart_but_not_by_a_reading_in_one_of_them(light):
    def bracket(camera: str) -> list[RawPhotograph]:
        seen = [(t, sensed(light[::2, ::2], t)) for t in (0.25, 1.0)]
        return [raw(mosaic, name=f"{camera} {t}", exposure=Exposure(t), camera=camera) for t, mosaic in seen]

    both = [bracket("One"), bracket("Two")]
    found = merge_brackets(both)
    assert list(found.cameras) == [each.camera for each in found.brackets] == ["One", "Two"]
    with pytest.raises(NotABracket, match=r"spot .* several cameras \(One, Two\)"):
        merge_brackets(both, settings=MergeSettings(scale=SpotReading(20, 20, 100.0)))


def test_what_was_measured_of_the_sensor_is_reported_and_used_again(light):
    photographs = taken(light, 2.0, 200.0, 13600)
    said = merge_brackets(photographs).camera.sensor
    assert said is not None and said.noise is not None
    assert (said.black, said.white, said.noise.iso) == ((512.0,) * 4, 16383.0, 200.0)
    assert said.saturation == pytest.approx((13600 - 512) / 15871, abs=1e-3)
    assert 1 / said.noise.shot == pytest.approx(20_000, rel=0.05)
    assert said.noise.read * 20_000 == pytest.approx(3, rel=0.2)
    # Alone, a photograph says nothing of its saturation: what is known counts, at the sensitivity it was seen at.
    longest = photographs[-1:]

    def saturated(iso: float, sensor: Sensor | None) -> int:
        alone = [replace(longest[0], exposure=Exposure(SECONDS[-1], 2.0, iso))]
        (one,) = merge_brackets(alone, profile=sensor and CameraProfile("", sensor=sensor)).brackets
        assert one.picture.clipped is not None
        return int((one.picture.clipped == SATURATED).sum())

    assert saturated(200.0, None) == saturated(400.0, said) == 0
    assert saturated(200.0, said) > 1000


def test_noise_that_is_known_counts_at_the_photographs_own_sensitivity(light):
    known = Sensor((512.0, 512.0, 512.0, 512.0), 16383.0, 1.0, SensorNoise(5e-5, 1.5e-4, 100.0))
    photographs = taken(light, 2.0, 800.0)
    for times in (None, SECONDS):
        noise = calibrate_raw(photographs, times=times, sensor=known).noise
        assert (noise.shot, noise.read, noise.iso) == pytest.approx((4e-4, 1.2e-3, 800.0))
        # Times that are given say no sensitivity; what is measured is of the files' own.
        measured = calibrate_raw(photographs, times=times).sensor.noise
        assert measured is not None and measured.iso == 800 and 1 / measured.shot == pytest.approx(20_000, rel=0.05)
    plain, noisy = (
        merge_brackets(photographs, profile=s and CameraProfile("", sensor=s)).brackets[0].picture
        for s in (None, known)
    )
    assert plain.variance is not None and noisy.variance is not None
    lit = (plain.clipped == 0) & (light > np.median(light))
    assert np.median(noisy.variance[lit] / plain.variance[lit]) == pytest.approx(8, rel=0.06)


def test_levels_that_are_not_the_profile_s_are_reported(light):
    photographs = taken(light)
    known = Sensor((512.0, 512.0, 512.0, 512.0), 16383.0, 1.0, SensorNoise(5e-5, 1.5e-4))
    assert merge_brackets(photographs, profile=CameraProfile("", sensor=known)).notes == ()
    other = replace(known, black=(512.0, 512.0, 512.0, 600.0), white=16000.0)
    (line,) = merge_brackets(photographs, profile=CameraProfile("", sensor=other)).notes
    assert line.startswith(
        "0.dng: its black is 512 and its white 16383, those of the profile 512, 512, 512, 600 and 16000"
    )


def test_noise_that_could_not_be_measured_is_kept_by_no_profile():
    flat = [raw(np.full((60, 80), 4000, np.uint16), name="flat.dng", exposure=Exposure(1.0))]
    with pytest.warns(UserWarning, match="its noise cannot be measured"):
        known = calibrate_raw(flat)
    assert known.sensor.noise is None and known.noise.shot == pytest.approx(1 / 15871)
    # And one that lacks it serves for the levels alone.
    with pytest.warns(UserWarning, match="its noise cannot be measured"):
        assert calibrate_raw(flat, sensor=replace(known.sensor, saturation=0.2)).saturation == 1


def test_raws_that_do_not_go_together_are_refused(sound, light):
    others = raw(sensed(light[:100], 1.0), name="small.dng", exposure=Exposure(1.0), camera="Virtual One")
    with pytest.raises(NotABracket, match=r"small\.dng: its size is 480×100"):
        merge_brackets([sound[0], others])


def test_a_preview_is_linear_from_black_to_saturation():
    mosaic = np.full((8, 12), 512, np.uint16)
    mosaic[0::2, 0::2] = 512 + 15871 // 4  # red a quarter
    mosaic[0::2, 1::2], mosaic[1::2, 0::2] = 512 + 2000, 512 + 4000  # the two greens
    settings = Settings(focal_length=35.0)
    small = preview(raw(mosaic, name="a.dng", camera="C", focal_length=600.0, settings=settings), 4)
    assert small.pixels.shape == (2, 3, 3) and small.pixels.dtype == np.uint16
    assert small.pixels[..., 0] == pytest.approx(65535 * (15871 // 4) / 15871, abs=1)
    assert small.pixels[..., 1] == pytest.approx(65535 * 3000 / 15871, abs=1)
    assert small.pixels[..., 2].max() == 0
    assert (small.name, small.camera, small.settings, small.focal_length) == ("a.dng", "C", settings, 150.0)
    assert preview(raw(mosaic - np.uint16(300)), 4).pixels[..., 2].max() == 0  # below black is black


def test_a_preview_leaves_out_the_rows_and_columns_that_fill_no_block():
    mosaic = np.full((11, 15), 512, np.uint16)
    mosaic[8:], mosaic[:, 12:] = 16383, 16383
    assert preview(raw(mosaic), 4).pixels.shape == (2, 3, 3)
    assert preview(raw(mosaic), 4).pixels.max() == 0


@pytest.mark.parametrize("row, column, channel", [(0, 0, 0), (0, 1, 1), (1, 0, 1), (1, 1, 2)])
def test_a_preview_is_saturated_where_one_photosite_is(row, column, channel):
    mosaic = np.full((8, 8), 2000, np.uint16)
    mosaic[4 + row, column] = 16383
    pixels = preview(raw(mosaic), 4).pixels
    assert pixels[1, 0, channel] == 65535
    pixels[1, 0, channel] = pixels[0, 0, channel]
    assert np.ptp(pixels) == 0
    # A sensor that is full below the white its file says.
    mosaic[4 + row, column] = 14000
    assert preview(raw(mosaic), 4).pixels.max() < 65535
    assert preview(raw(mosaic), 4, 0.84).pixels[1, 0, channel] == 65535


def test_a_sensor_that_is_full_below_its_white_does_not_look_as_if_things_moved(light):
    found = merge_brackets(taken(light, full=13600))
    assert found.warnings == () and found.notes == found.messages
    assert any("saturated at" in line for line in found.messages)
