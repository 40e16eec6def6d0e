"""The photographs of a shot: on one scale, by one response and one white for each camera, or refused."""

from __future__ import annotations

import mmap
import re
import shutil
import warnings
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from dng_files import sensed, write_dng
from half_room import RIM as FULL_RIM
from half_room import ROOM
from relume.capture.brackets.result import MergedBracket, MergedCamera
from relume.capture.exposure.bracket import Bracket
from relume.capture.lens.vignetting import Vignetting
from relume.capture.response.camera_profile import CameraProfile, write_profile
from relume.errors import BallNotFound, InvalidShot, NotABracket, UnreadableFile
from relume.image import mapped_arrays
from relume.image.radiance import RadianceMap
from relume.probe.ball.blending import Probe
from relume.project.insertion.ball_light import blended
from relume.project.insertion.photographs import Calibrated, calibrate, read_photographs
from relume.project.merging.merged_photographs import merged_brackets
from relume.project.shot_file.shot import Shot, read_shot
from relume.project.stages import Stages, Steps
from shoots import textured

RIM = (FULL_RIM[0] / 2, FULL_RIM[1] / 2, FULL_RIM[2] / 2)


@pytest.fixture
def shot(half_room: Path, tmp_path: Path) -> Shot:
    """The room with one ball, merged as it lies: what is asked here needs no more."""
    shutil.copytree(half_room, tmp_path / "room")
    return as_it_lies(read_shot(tmp_path / "room" / "shot.toml"))


def as_it_lies(room: Shot) -> Shot:
    """Not aligned nor deghosted, and of the ball four photographs: four stops apart are enough."""
    ball = {"photographs": ["ball_0/IMG_000[3579].jpg"], "align": False, "deghost": False}
    return changed(room, {"align": False, "deghost": False, "denoise": False}, ball)


def changed(shot: Shot, plate: Mapping[str, object], ball: Mapping[str, object]) -> Shot:
    assert shot.light.balls is not None
    first = shot.light.balls[0].model_copy(update=ball)
    light = shot.light.model_copy(update={"balls": [first], "size": 32})
    return shot.model_copy(update={"plate": shot.plate.model_copy(update=plate), "light": light})


def calibrated(shot: Shot, out: Path) -> Calibrated:
    return calibrate(shot, read_photographs(shot), Steps(Stages(out)))


def raws(shot: Shot, name: str, f_number: float | None, seconds: float | None = 1.0) -> list[str]:
    mosaic = sensed(textured(96, 64).mean(2) / 30, 1.0)
    return [write_dng(shot.folder / name, mosaic, f_number=f_number, seconds=seconds).name]


def test_camera_raws_beside_encoded_photographs_are_refused(shot: Shot) -> None:
    """Times have no aperture: at f/4 the two differed by 16, unseen."""
    plate = {"photographs": raws(shot, "plate.dng", 4.0)}
    with pytest.raises(NotABracket, match=r"plate\.dng is a camera raw .*scales differ") as refusal:
        read_photographs(changed(shot, plate, {"times": [2.0**stop for stop in range(4)]}))
    assert "\n" not in str(refusal.value)


def test_camera_raws_without_the_facts_of_the_others_are_refused(shot: Shot) -> None:
    plate = {"photographs": raws(shot, "plate.dng", 4.0)}
    known = changed(shot, plate, {"photographs": raws(shot, "known.dng", 5.6)})
    assert len(read_photographs(known).balls) == 1
    lens = changed(shot, plate, {"photographs": raws(shot, "ball.dng", None)})
    with pytest.raises(NotABracket, match=r"ball\.dng has no f_number .*plate\.dng has one"):
        read_photographs(lens)
    timeless = changed(shot, plate, {"photographs": raws(shot, "timeless.dng", 4.0, None)})
    with pytest.raises(NotABracket, match=r"timeless\.dng: no exposure time"):
        read_photographs(timeless)


@pytest.mark.skipif(not mapped_arrays.MAPS, reason="files are not mapped here")
def test_the_plates_photographs_lie_in_files_until_they_are_looked_at_again(
    shot: Shot, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    read = read_photographs(changed(shot, {}, {"rim": RIM}))
    assert isinstance(read.plate, Bracket)
    monkeypatch.setattr(mapped_arrays, "LARGE", read.plate.photographs[0].pixels.nbytes)
    bracket = calibrate(changed(shot, {}, {"rim": RIM}), read, Steps(Stages(tmp_path / "stages"))).bracket
    assert bracket is not None
    for own, away in zip(read.plate.photographs, bracket.photographs, strict=True):
        base = away.pixels
        while isinstance(base, np.ndarray):
            base = base.base
        assert isinstance(base, mmap.mmap) and np.array_equal(away.pixels, own.pixels)


@pytest.fixture(scope="module")
def merged(half_room: Path) -> tuple[list[MergedBracket], MergedCamera]:
    """The room's one ball, and its camera."""
    shot = as_it_lies(read_shot(half_room / "shot.toml"))
    (_, *balls), cameras = merged_brackets(shot, read_photographs(shot))
    (camera,) = cameras.values()
    return balls, camera


@pytest.fixture
def profiled(shot: Shot, merged: tuple[list[MergedBracket], MergedCamera]) -> Shot:
    """With two profiles of the room's camera beside it that balance white differently."""
    _, found = merged
    fall_off = Vignetting((-0.2,)).to_dict()
    for name, balance in (("one.json", (1.5, 1.0, 0.7)), ("other.json", (1.0, 1.0, 2.0))):
        profile = CameraProfile(found.name, found.response, vignetting=fall_off, balance=balance)
        write_profile(shot.folder / name, profile)
    return shot


def test_the_profile_of_a_camera_counts_for_its_plate_and_its_light(profiled: Shot, tmp_path: Path) -> None:
    def of(name: str, plate: str | None, ball: str | None) -> Calibrated:
        known = changed(profiled, {"profile": plate}, {"profile": ball, "rim": RIM})
        return calibrated(known, tmp_path / name)

    both = of("both", "one.json", "one.json")
    for name, plate, ball in (("plate", "one.json", None), ("ball", None, "one.json")):
        found = of(name, plate, ball)
        assert np.array_equal(found.plate.radiance, both.plate.radiance)
        assert np.array_equal(found.probe.light.radiance, both.probe.light.radiance)


def test_two_whites_of_one_camera_are_refused(profiled: Shot, tmp_path: Path) -> None:
    with pytest.raises(InvalidShot, match=r"one\.json and other\.json .*the same one"):
        calibrated(changed(profiled, {"profile": "one.json"}, {"profile": "other.json"}), tmp_path)


@pytest.mark.parametrize("own", [{"method": "robertson"}, {"neutral": 128}, {"refine": True}])
def test_two_ways_to_one_response_are_refused(shot: Shot, tmp_path: Path, own: dict[str, object]) -> None:
    with pytest.raises(InvalidShot, match=f"^{next(iter(own))}: differs between .*recovered once"):
        calibrated(changed(shot, {}, own), tmp_path)


def test_the_rim_of_a_ball_may_be_picked_or_given_in_the_shot_file(
    shot: Shot, merged: tuple[list[MergedBracket], MergedCamera]
) -> None:
    balls, _ = merged
    assert balls[0].picture.size == (320, 320)
    off = (RIM[0] + 0.5, RIM[1], 0.985 * RIM[2])

    def lit(**ball: object) -> Probe:
        return blended(changed(shot, {}, ball), balls, None)

    given, picked, exact = lit(rim=RIM), lit(pick=off), lit(rim=off)
    differences = [float(np.abs(np.log(each.light.radiance / given.light.radiance)).mean()) for each in (picked, exact)]
    assert differences[0] < 0.5 * differences[1]
    # A chrome ball gives back 0.55 of what falls in steeply: seen straight on, towards its camera.
    assert shot.light.ball is not None
    chrome = shot.light.ball.model_copy(update={"reflectance": "chrome"})
    light = changed(shot, {}, {"rim": RIM}).light.model_copy(update={"ball": chrome})
    brighter = blended(shot.model_copy(update={"light": light}), balls, None).light.radiance / given.light.radiance
    assert brighter.max() == pytest.approx(1 / 0.550, rel=0.02) and brighter.min() >= 0.999


def test_a_ball_that_is_not_found_is_given_by_a_key_of_the_shot_file(
    shot: Shot, merged: tuple[list[MergedBracket], MergedCamera]
) -> None:
    ((bracket,), _) = merged
    cut = RadianceMap(np.ascontiguousarray(bracket.picture.radiance[:, 80:]))
    with pytest.raises(BallNotFound, match="cuts off") as refused:
        blended(changed(shot, {}, {}), [replace(bracket, picture=cut)], None)
    said = re.fullmatch(
        r".*; take it whole; or write the ball's rim into light\.balls\.0: pick = \[(.*)\]; `relume probe.*",
        str(refused.value),
    )
    assert said is not None and "--pick " not in said[0]
    given = [float(value) for value in said[1].split(", ")]
    assert given == pytest.approx([RIM[0] - 80, *RIM[1:]], abs=1.5)


def test_a_coloured_ball_whose_reflectance_is_given_is_no_doubt(
    shot: Shot, merged: tuple[list[MergedBracket], MergedCamera]
) -> None:
    (ball, *_), _ = merged
    picture = ball.picture
    y, x = np.mgrid[: picture.size[1], : picture.size[0]] + 0.5
    inside = (np.hypot(x - RIM[0], y - RIM[1]) < RIM[2])[..., None]
    red = (0.8, 0.2, 0.2)
    coloured = replace(
        ball, picture=replace(picture, radiance=picture.radiance * np.where(inside, red, 1).astype(np.float32))
    )

    def light(bracket: MergedBracket, reflectance: object) -> np.ndarray:
        one = changed(shot, {}, {"rim": RIM})
        assert one.light.ball is not None
        mirror = one.light.ball.model_copy(update={"reflectance": reflectance})
        known = one.model_copy(update={"light": one.light.model_copy(update={"ball": mirror})})
        return blended(known, [bracket], None).light.radiance

    with warnings.catch_warnings():
        warnings.simplefilter("error")
        found, neutral = light(coloured, red), light(ball, 1.0)
    assert float(np.abs(np.log(found / neutral)).mean()) < 0.01
    # One number for it leaves the doubt.
    with pytest.warns(UserWarning, match=r"nothing in the ball is as \w+ as .*give its reflectance"):
        assert light(coloured, 0.5) == pytest.approx(light(coloured, 1.0) / 0.5, rel=1e-5)


def test_a_folder_and_a_photograph_may_have_brackets_in_their_names(tmp_path: Path) -> None:
    folder = tmp_path / "shoot [day 2]"
    folder.mkdir()
    for name in ("a_2.jpg", "a_10.jpg", "b[1].jpg"):
        (folder / name).touch()
    shot = read_shot(ROOM / "shot.toml").model_copy(update={"folder": folder})
    assert [path.name for path in shot.files(["a_*.jpg", "b[1].jpg"])] == ["a_2.jpg", "a_10.jpg", "b[1].jpg"]
    assert [path.name for path in shot.files(["a_[0-9].jpg"])] == ["a_2.jpg"]
    with pytest.raises(UnreadableFile, match="no such photographs"):
        shot.files(["c_*.jpg"])


def test_files_are_named_without_detours(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "a" / "b").mkdir(parents=True)
    (tmp_path / "plate.jpg").touch()
    monkeypatch.chdir(tmp_path)
    shot = read_shot(ROOM / "shot.toml").model_copy(update={"folder": Path("a/b")})
    assert shot.files(["../../plate.jpg"]) == shot.files(["../../*.jpg"]) == [Path("plate.jpg")]
    assert str(shot.path("../../light.exr")) == "light.exr" and shot.path("own.exr") == Path("a/b/own.exr")
    deep = shot.model_copy(update={"folder": Path("..") / tmp_path.name})
    assert deep.path("x.glb") == Path("x.glb")
