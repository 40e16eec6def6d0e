"""A plate that is one photograph: its curve, its scale and its whites, with photographs of a ball and with a map."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from relume.capture.brackets.settings import MergeSettings
from relume.capture.exposure.bracket import Bracket
from relume.capture.exposure.consistency import BracketDoubt
from relume.errors import DoubtWarning
from relume.image.colour import decode_srgb
from relume.image.files import read_photograph, read_radiance, write
from relume.image.photograph import Exposure, Photograph
from relume.image.radiance import BLACK, SATURATED
from relume.image.response import srgb_response
from relume.project.insertion.insert import insert
from relume.project.insertion.outcome import Inserted
from relume.project.insertion.photographs import read_photographs
from relume.project.merging.single_plate import merge_single, read_single, why_untied
from relume.project.shot_file.shot import Shot, read_shot
from relume.renderers.renderer import ConstantRenderer
from relume.virtual_camera.film.film import Film

Room = tuple[Inserted, Path]
FAKE = ConstantRenderer((3.0, 2.0, 1.0))
EVERY = np.arange(256, dtype=np.uint8)


def photograph(pixels: np.ndarray, **details: object) -> Photograph:
    return replace(Photograph(pixels, "P.jpg", Exposure(0.25, 4.0, 200.0)), **details)  # type: ignore[arg-type]


def ramp() -> Photograph:
    """Every value of a byte, in three orders for the channels."""
    return photograph(np.stack([EVERY, EVERY[::-1], np.roll(EVERY, 100)], -1).reshape(16, 16, 3))


def test_developing_a_single_plate_gives_its_bytes_back_whites_and_blacks_too() -> None:
    shown = ramp()
    for response in (srgb_response(), None):
        given = response
        if response is None:
            with pytest.warns(UserWarning, match=r"^P\.jpg: one photograph, and the curve of its camera is not known"):
                merged, camera = merge_single(Bracket((shown,)), None, MergeSettings())
        else:
            merged, camera = merge_single(Bracket((shown,)), given, MergeSettings())
        assert camera.response is not None and shown.exposure is not None
        values = Film(shown.exposure.factor, camera.response).pixel_values(merged.picture.radiance)
        assert np.array_equal(np.rint(values).astype(np.uint8), shown.pixels)
        clipped = merged.picture.clipped
        assert clipped is not None
        assert np.array_equal(clipped == SATURATED, (shown.pixels >= 250).any(-1))
        assert not (clipped == BLACK).any()


def test_the_assumed_curve_is_srgb_on_the_scale_of_recovered_curves() -> None:
    with pytest.warns(UserWarning, match="taken for sRGB"):
        merged, camera = merge_single(Bracket((ramp(),)), None, MergeSettings())
    # Middle grey, 118 of 255, is 0.18 on sRGB's own scale; the zero of a recovered curve is the value 127.
    factor = 0.25 * 2 / 16
    grey = merged.picture.radiance[..., 0].ravel()[118]
    assert grey * factor == pytest.approx(0.18116 / 0.21223, rel=1e-4)
    assert float(decode_srgb(np.array(118 / 255))) == pytest.approx(0.18116, rel=1e-4)
    assert camera.response is not None and camera.response.log_exposure[1, 127] == 0


def test_noise_of_an_assumed_camera_is_what_its_flat_patches_show() -> None:
    generator = np.random.default_rng(0)
    flat = np.repeat(np.repeat(generator.uniform(60, 180, (8, 12)), 40, 0), 40, 1)[..., None]
    noisy = np.rint(np.clip(flat + generator.normal(0, 3, (320, 480, 3)), 0, 255)).astype(np.uint8)
    with pytest.warns(UserWarning, match="taken for sRGB"):
        _, camera = merge_single(Bracket((photograph(noisy),)), None, MergeSettings())
    assert camera.response is not None
    assert camera.response.deviation[:, 120] == pytest.approx(3, rel=0.15)


def test_sixteen_bits_go_by_the_response_of_eight() -> None:
    deep = photograph(257 * ramp().pixels.astype(np.uint16))
    merged, _ = merge_single(Bracket((deep,)), srgb_response(), MergeSettings())
    eight, _ = merge_single(Bracket((ramp(),)), srgb_response(), MergeSettings())
    np.testing.assert_allclose(merged.picture.radiance, eight.picture.radiance, rtol=1e-5)


def test_what_ties_a_single_plate_to_the_ball() -> None:
    plate = ramp()
    same, plain = Bracket((plate,)), Bracket((photograph(plate.pixels, exposure=Exposure(1.0)),))
    assert why_untied(plate, [same]) is None and why_untied(plain.photographs[0], [plain]) is None
    assert why_untied(plate, [same, plain]) == "P.jpg holds an f-number and P.jpg none"
    assert why_untied(replace(plate, exposure=None), [same]) == "P.jpg holds no exposure"
    assert why_untied(plate, [(Path("a.dng"),)]) == "P.jpg is encoded and the ball's photographs are camera raws"


def test_aperture_and_iso_of_plate_and_ball_may_differ(tmp_path: Path) -> None:
    """The same light at the same place, exposed alike in three ways: one radiance."""
    pixels = ramp().pixels
    found = []
    for exposure in (Exposure(0.25, 4.0, 200.0), Exposure(0.5, 4.0, 100.0), Exposure(0.25, 4.0 / np.sqrt(2), 100.0)):
        write(tmp_path / "P.png", photograph(pixels, exposure=exposure))
        merged, _ = merge_single(read_single(tmp_path / "P.png", None), srgb_response(), MergeSettings())
        found.append(merged.picture.radiance)
    assert found[1] == pytest.approx(found[0], rel=1e-5) and found[2] == pytest.approx(found[0], rel=1e-3)


def single(shot: Shot, name: str = "plate/IMG_0003.jpg") -> Shot:
    """The room with one photograph as plate, and three of one ball, as they lie."""
    assert shot.light.balls is not None
    plate = shot.plate.model_copy(update={"photographs": [name], "denoise": False})
    few = {"photographs": ["ball_0/IMG_000[357].jpg"], "align": False, "deghost": False}
    light = {"balls": [shot.light.balls[0].model_copy(update=few)], "size": 64}
    return shot.model_copy(update={"plate": plate, "light": shot.light.model_copy(update=light)})


def test_a_jpeg_and_a_finished_map_make_a_composite(room: Room, copied_room: tuple[Path, Path]) -> None:
    path, out = copied_room
    own = read_photograph(path.parent / "plate/IMG_0003.jpg")
    shot = single(read_shot(path))
    light = type(shot.light)(map=str(room[1] / "light.exr"), probe=(0.0, 0.05, 0.0))
    shot = shot.model_copy(update={"light": light})
    result = insert(shot, out, renderer=FAKE)
    untouched = result.change.matte == 0
    assert np.array_equal(result.picture.pixels[untouched], own.pixels[untouched])
    assert not np.array_equal(result.picture.pixels[~untouched], own.pixels[~untouched])
    # Its own bytes come out of the radiance too, by the curve that the report names.
    response = result.calibrated.response(own.camera)
    assert own.exposure is not None
    values = Film(own.exposure.factor, response).pixel_values(read_radiance(out / "composite.exr").radiance)
    assert np.array_equal(np.rint(values).astype(np.uint8)[untouched], own.pixels[untouched])
    assert sum("taken for sRGB" in note for note in result.notes) == 1
    assert sum("is a finished map, so no exposure gives its scale" in note for note in result.notes) == 1


def test_the_ball_of_the_same_camera_gives_the_curve(room: Room, copied_room: tuple[Path, Path]) -> None:
    path, out = copied_room
    result = insert(single(read_shot(path)), out, renderer=FAKE)
    (camera,) = result.calibrated.cameras.values()
    assert camera.calibration is not None and camera.response is not None
    assert result.calibrated.untied is None and not any("sRGB" in note for note in result.notes)
    assert np.isfinite(result.composite).all()
    # As bright as the bracket has it, where that is well exposed.
    both = (result.plate.clipped == 0) & (room[0].plate.clipped == 0)
    ratio = np.median(result.plate.radiance[both] / room[0].plate.radiance[both])
    assert ratio == pytest.approx(1, abs=0.05)


def test_a_plate_without_exif_is_taken_with_photographs_of_the_ball(copied_room: tuple[Path, Path]) -> None:
    path, out = copied_room
    bare = replace(read_photograph(path.parent / "plate/IMG_0003.jpg"), exposure=None, camera="")
    write(path.parent / "plate/bare.png", bare)
    result = insert(single(read_shot(path), "plate/bare.png"), out, renderer=FAKE)
    (note,) = (each for each in result.notes if "no exposure gives its scale" in each)
    assert "bare.png holds no exposure" in note and "by the reflectance given" in note
    assert np.array_equal(result.composited.before.pixels, bare.pixels)


def test_one_photograph_of_plate_and_ball_each_make_a_composite(copied_room: tuple[Path, Path]) -> None:
    path, out = copied_room
    shot = single(read_shot(path))
    assert shot.light.balls is not None
    balls = [shot.light.balls[0].model_copy(update={"photographs": ["ball_0/IMG_0006.jpg"]})]
    shot = shot.model_copy(update={"light": shot.light.model_copy(update={"balls": balls})})
    result = insert(shot, out, renderer=FAKE)
    assert sum("taken for sRGB" in note for note in result.notes) == 1
    assert result.calibrated.untied is None and len(result.calibrated.cameras) == 1


def test_crops_of_a_ball_that_differ_in_size_are_laid_on_one_another(copied_room: tuple[Path, Path]) -> None:
    path, _ = copied_room
    shot = read_shot(path)
    assert shot.light.balls is not None
    for index, cut in ((6, 20), (7, 28)):
        whole = read_photograph(path.parent / f"ball_0/IMG_000{index}.jpg")
        pixels = np.ascontiguousarray(whole.pixels[cut:-cut:2, cut:-cut:2])
        write(path.parent / f"crop_{index}.png", replace(whole, pixels=pixels))
    balls = [shot.light.balls[0].model_copy(update={"photographs": ["crop_*.png"], "rim": None})]
    shot = shot.model_copy(update={"light": shot.light.model_copy(update={"balls": balls})})
    with pytest.warns(UserWarning, match=r"crop_6\.png … crop_7\.png: of different sizes, so taken for crops"):
        (bracket,) = read_photographs(shot).balls
    assert isinstance(bracket, Bracket) and len({each.size for each in bracket.photographs}) == 1
    assert bracket.focal_length is None


def test_what_a_single_plate_is_doubted_for_keeps_its_effect(monkeypatch: pytest.MonkeyPatch) -> None:
    wrong = BracketDoubt("P.jpg", "is doubted", "look at it", True, 0.6)
    monkeypatch.setattr("relume.capture.brackets.one_camera.check", lambda *_: (wrong,))
    with pytest.warns(DoubtWarning, match="is doubted") as caught:
        merge_single(Bracket((ramp(),)), srgb_response(), MergeSettings())
    assert [each.message.effect for each in caught if isinstance(each.message, DoubtWarning)] == [0.6]
