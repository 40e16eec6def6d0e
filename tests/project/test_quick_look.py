"""A quick look: the small picture shows what the whole one will, and a second look reads no photograph."""

from __future__ import annotations

import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from relume.capture.exposure.bracket import Bracket
from relume.cli import main
from relume.image.files import read_radiance, write
from relume.image.photograph import Exposure, Photograph
from relume.image.radiance import SATURATED, RadianceMap
from relume.project.insertion import insert as inserting
from relume.project.insertion import quick_look
from relume.project.insertion.photographs import Calibrated
from relume.project.insertion.quick_look import _made_from, _smaller
from relume.project.insertion.render_change import AROUND_PIXELS, _part_about
from relume.project.shot_file.shot import Shot, read_shot
from relume.project.stages import packed, unpacked
from relume.renderers.progressive.fingerprint import fingerprint
from relume.scene.cameras.camera import Camera
from relume.scene.cameras.fit import CameraFit
from relume.sphere.environment_files import as_radiance_map
from relume.sphere.environment_map import EnvironmentMap

ROOM = Path(__file__).parents[2] / "examples" / "room"
SHOT = f"""
[plate]
photographs = "plate.exr"
[camera]
pose = {{ position = [0.2, 0.6, 1.0], look_at = [0.2, 0.0, 0.1] }}
focal_length = 240
[light]
map = "light.exr"
[[local]]
shape = "plane"
size = [1.0, 1.0]
[[objects]]
mesh = "{ROOM}/objects/cube_gold.glb"
[render]
samples = 32
"""


@pytest.fixture
def shot(tmp_path: Path) -> Path:
    plate = np.random.default_rng(3).uniform(0.2, 0.4, (146, 193, 3)).astype(np.float32)
    write(tmp_path / "plate.exr", RadianceMap(plate))
    light = np.ones((16, 32, 3), np.float32)
    light[:, 20:28] = 4
    write(tmp_path / "light.exr", as_radiance_map(EnvironmentMap(light)))
    path = tmp_path / "shot.toml"
    path.write_text(SHOT, encoding="utf-8")
    return path


def test_the_small_plate_is_of_whole_squares_and_its_camera_looks_through_their_middles():
    radiance = np.arange(10 * 13 * 3, dtype=np.float32).reshape(10, 13, 3)
    clipped = np.zeros((10, 13), np.uint8)
    clipped[4, 7] = SATURATED
    pixels = radiance.astype(np.uint16)
    photograph = Photograph(pixels, exposure=Exposure(1.0), focal_length=30.0, profile=b"\x01\x02")
    plate = RadianceMap(radiance, np.ones_like(radiance), clipped, "cd/m²")
    camera = Camera.looking_at(np.array([0, 1.0, 3]), np.zeros(3), width=13, height=10, focal_length=30.0)
    whole = Calibrated(plate, Bracket((photograph,)), 30.0, None, {})  # pyright: ignore[reportArgumentType]
    small = _smaller(whole, CameraFit(camera, np.ones((4, 2)), np.full((4, 2), 0.5)), 3)
    # Squares of nine pixels; the tenth row and the thirteenth column make none.
    found = small.calibrated.plate
    assert found.radiance.shape == (3, 4, 3) and found.unit == "cd/m²"
    assert np.allclose(found.radiance[1, 2], radiance[3:6, 6:9].mean((0, 1))) and found.clipped is not None
    assert found.clipped[1, 2] == SATURATED and np.count_nonzero(found.clipped) == 1
    assert small.calibrated.bracket is not None
    (picture,) = small.calibrated.bracket.photographs
    assert np.array_equal(picture.pixels[1, 2], pixels[3:6, 6:9].mean((0, 1))) and picture.focal_length == 10
    assert small.calibrated.focal_length == 10 and small.fit.residual == pytest.approx(np.sqrt(0.5) / 3)
    middles = np.array([[1.5, 1.5], [7.5, 4.5], [10.5, 7.5]])
    assert np.allclose(small.fit.camera.rays_through(middles / 3), camera.rays_through(middles), atol=1e-12)
    # What is kept holds the photographs' colour profile.
    kept = unpacked(packed(small.calibrated.bracket))
    assert kept.photographs[0].profile == b"\x01\x02"


def test_a_look_depends_on_the_photographs_and_not_on_the_objects(shot):
    def key() -> str:
        return fingerprint(_made_from(read_shot(shot)))

    before = key()
    shot.write_text(SHOT.replace("[render]", "translate = [0.1, 0, 0]\n[render]"))
    assert key() == before
    shot.write_text(SHOT.replace("focal_length = 240", "focal_length = 250"))
    assert key() != before
    shot.write_text(SHOT)
    (shot.parent / "times.txt").write_text("plate.exr 1/60")
    listed = key()
    assert listed != before
    write(shot.parent / "light.exr", as_radiance_map(EnvironmentMap(np.ones((16, 32, 3), np.float32))))
    assert key() != listed


def test_a_quick_look_shows_what_the_whole_job_does_and_reads_no_photograph_again(shot, monkeypatch, capsys):
    monkeypatch.setattr(quick_look, "PIXELS", 3000)
    out = shot.parent / "out"
    assert main(["insert", str(shot), "-o", str(out), "--preview"]) == 0
    assert "64 × 48" in capsys.readouterr().out
    assert sorted(each.name for each in out.iterdir()) == ["preview.exr", "preview.png", "stages"]
    small = read_radiance(out / "preview.exr").radiance
    # The whole job begins with what the look found, and shows the same picture.
    whole = inserting.insert(read_shot(shot), out)
    means = whole.composite[:144, :192].reshape(48, 3, 64, 3, 3).mean((1, 3))
    assert np.abs(small - means).mean() < 0.03 * means.mean()
    assert np.abs(small - whole.plate.radiance[:144, :192].reshape(48, 3, 64, 3, 3).mean((1, 3))).max() > 0.05
    # Once more with the object elsewhere.
    monkeypatch.setattr(quick_look, "read_photographs", lambda shot: pytest.fail("photographs were read"))
    shot.write_text(SHOT.replace("[render]", "translate = [-0.2, 0, 0]\n[render]"))
    assert main(["insert", str(shot), "-o", str(out), "--preview"]) == 0
    moved = read_radiance(out / "preview.exr").radiance
    assert np.abs(moved - small).max() > 0.05


def test_a_second_look_begins_with_a_rough_picture(shot, monkeypatch):
    monkeypatch.setattr(quick_look, "PIXELS", 3000)
    out = shot.parent / "out"
    sizes: dict[str, tuple[int, int]] = {}

    def look() -> tuple[int, int]:
        def progress(step: str, share: float) -> None:
            if step == "first picture":
                sizes[step] = read_radiance(out / "preview.exr").size

        return inserting.insert(read_shot(shot), out, preview=True, progress=progress).plate.size

    assert look() == (64, 48) and sizes == {}
    shot.write_text(SHOT.replace("[render]", "translate = [-0.2, 0, 0]\n[render]"))
    rough: list[np.ndarray] = []
    written = inserting.write_picture
    monkeypatch.setattr(inserting, "write_picture", lambda r, *rest: (rough.append(r.composite), written(r, *rest)))
    assert look() == (64, 48) and sizes == {"first picture": (32, 24)}
    # Both show the same.
    first, last = rough
    means = last.reshape(24, 2, 32, 2, 3).mean((1, 3))
    assert np.abs(first - means).mean() < 0.05 * means.mean()
    assert read_radiance(out / "preview.exr").size == (64, 48)


def test_what_is_looked_at_comes_first_and_the_look_stays_the_same_to_the_bit(shot, monkeypatch):
    monkeypatch.setattr(quick_look, "PIXELS", 3000)
    out, plain, begun = shot.parent / "out", shot.parent / "plain", []
    inserting.insert(read_shot(shot), out, preview=True, about=(0.5, 0.5), progress=lambda step, _: begun.append(step))
    assert "around the pointer" not in begun  # a first look has no rough picture to lay it in
    shutil.copytree(out, plain)
    shot.write_text(SHOT.replace("[render]", "translate = [-0.2, 0, 0]\n[render]"))
    written: dict[str, np.ndarray] = {}

    def progress(step: str, share: float) -> None:
        if step in ("first picture", "around the pointer"):
            written[step] = read_radiance(out / "preview.exr").radiance

    found, sought = inserting.find_place, []
    monkeypatch.setattr(inserting, "find_place", lambda *given: (sought.append(given[4]), found(*given))[1])
    last = inserting.insert(read_shot(shot), out, preview=True, about=(0.5, 0.6), progress=progress).composite
    assert sought == [None] * 3  # alike each time: what one keeps the next takes, and none takes a minute again
    assert list(written) == ["first picture", "around the pointer"]
    rough, around = (np.repeat(np.repeat(written["first picture"], 2, 0), 2, 1), written["around the pointer"])
    assert around.shape == last.shape == (48, 64, 3)
    # About the place the small plate's own pixels, elsewhere the rough picture's.
    part = np.zeros((48, 64), bool)
    part[20:37, 21:43] = True  # 0.35 of each side about (32, 28.8)
    changed = np.any(around != rough, axis=-1)
    assert not changed[~part].any() and changed[part].mean() > 0.9
    assert np.abs(around - last)[part].mean() < 0.3 * np.abs(rough - last)[part].mean()
    # The look itself is the one without.
    without = inserting.insert(read_shot(shot), plain, preview=True)
    assert np.array_equal(without.composite, last)
    assert (plain / "preview.png").read_bytes() == (out / "preview.png").read_bytes()


@pytest.mark.slow
def test_a_render_shows_what_is_looked_at_first_says_its_noise_and_stays_the_same_to_the_bit(shot):
    found = read_shot(shot)
    plain = inserting.insert(found, shot.parent / "plain").composite

    def watched(shot: Shot, out: Path, about: tuple[float, float] | None):
        """The result and, by what was said last, every preview with its noise and its variance."""
        shown = dict[str, tuple[np.ndarray, str | None, np.ndarray | None]]()

        def progress(step: str, share: float) -> None:
            if (out / "preview.exr").exists():
                picture = read_radiance(out / "preview.exr")
                shown[f"{step} {share:.2f}"] = picture.radiance, picture.attributes.get("noise"), picture.variance

        return inserting.insert(shot, out, about=about, progress=progress), shown

    out = shot.parent / "out"
    result, shown = watched(found, out, (0.5, 0.5))
    assert np.array_equal(result.composite, plain)
    assert not (out / "preview.exr").exists()
    # First the plate with what the objects change about the place.
    first, noise, _ = next(iter(shown.values()))
    assert next(iter(shown)) == "around the pointer 1.00" and noise is None
    changed = np.any(first != result.plate.radiance, axis=-1)
    rows, columns = (np.flatnonzero(changed.any(axis)) for axis in (1, 0))
    assert changed.any() and np.ptp(rows) < 0.36 * 146 and np.ptp(columns) < 0.36 * 193
    # Then the whole, with the noise that is left once the passes' scatter says it, less and less of it.
    said = [float(noise) for _, noise, _ in shown.values() if noise is not None]
    assert len(set(said)) >= 2 and said == sorted(said, reverse=True) and 0 < said[-1] < 0.5
    last, noise, variance = list(shown.values())[-1]
    assert variance is not None and noise == f"{said[-1]:.3g}"
    # That is the mean error to be expected: of another seed's picture this one differs by √2 of it.
    shot.write_text(SHOT.replace("samples = 32", "samples = 32\nseed = 7"))
    other = list(watched(read_shot(shot), shot.parent / "other", None)[1].values())[-1][0]
    where = np.any(np.abs(last - result.plate.radiance) > 0.001, axis=-1)
    there = np.abs(last - other)[where].mean() / np.sqrt(2) / last[where].mean()
    assert 0.5 * said[-1] < there < 2 * said[-1]


@pytest.mark.parametrize("about, part", [
    ((0.0, 0.0), (0, 35, 0, 70)), ((1.0, 1.0), (65, 100, 130, 200)), ((0.5, 0.5), (32, 67, 65, 135)),
])  # fmt: skip
def test_the_part_about_a_place_lies_within_the_picture(about, part):
    rows, columns = _part_about(200, 100, about)
    assert (rows.start, rows.stop, columns.start, columns.stop) == part
    rows, columns = _part_about(6000, 4000, about)  # of a large one no more than is traced in half a second
    assert 0.9 * AROUND_PIXELS < (rows.stop - rows.start) * (columns.stop - columns.start) < 1.1 * AROUND_PIXELS


def test_a_quick_look_is_of_one_picture(shot, capsys):
    assert main(["insert", str(shot), "-o", str(shot.parent / "out"), "--preview", "--to", "usd"]) == 2
    assert "--preview shows one picture, and --to asks for more" in capsys.readouterr().err
    shot.write_text(SHOT + '[sequence]\nframes = "1-3"\nrate = 24\n')
    assert main(["insert", str(shot), "-o", str(shot.parent / "out"), "--preview"]) == 2
    assert "[sequence] asks for more" in capsys.readouterr().err


def test_a_bracket_of_raws_has_no_photographs_to_make_smaller():
    plate = RadianceMap(np.ones((9, 9, 3), np.float32))
    camera = Camera.looking_at(np.array([0, 1.0, 3]), np.zeros(3), width=9, height=9, focal_length=30.0)
    whole = Calibrated(plate, None, None, None, {})  # pyright: ignore[reportArgumentType]
    small = _smaller(replace(whole), CameraFit(camera), 3).calibrated
    assert small.bracket is None and small.focal_length is None and small.plate.size == (3, 3)
