"""The radiance of a shot's photographs: what `insert` goes on with, how its frames agree, and its absolute scale."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest

import relume as rl
from relume.project.insertion.photographs import calibrate, read_photographs
from relume.project.stages import Stages, Steps

TEXT = """\
[plate]
photographs = ["{plate}/*.png"]
{spot}
[camera]
pose = {{ position = [0.0, 0.5, 1.0], look_at = [0.0, 0.0, 0.0] }}
focal_length = 200
[light]
map = "light.exr"
"""
CURVE = 255 * (np.linspace(0, 1, 4096) ** (1 / 2.2))


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Four photographs of a ramp by a camera of gamma 2.2; the third says half a stop less than it had."""
    place = tmp_path_factory.mktemp("radiance")
    rng = np.random.default_rng(3)
    light = np.exp(np.linspace(-5, 2, 192))[None, :, None] * np.linspace(0.7, 1.3, 128)[:, None, None] * [1, 0.9, 0.8]
    for name, extra in (("plate", 1.0), ("wrong", 2**0.5)):
        (place / name).mkdir()
        for number, seconds in enumerate((0.125, 0.5, 2.0, 8.0)):
            exposure = seconds * light * (extra if number == 2 else 1)
            codes = np.interp(np.clip(exposure, 0, 1), np.linspace(0, 1, 4096), CURVE) + rng.normal(0, 0.6, light.shape)
            rl.write(place / name / f"p{number}.png", rl.Photograph(np.clip(np.rint(codes), 0, 255).astype(np.uint8)))
    rl.write(place / "light.exr", rl.as_radiance_map(rl.EnvironmentMap(np.full((16, 32, 3), 0.3, np.float32))))
    return place


def shot(folder: Path, spot: str = "", plate: str = "plate") -> rl.Shot:
    path = folder / "shot.toml"
    path.write_text(TEXT.format(plate=plate, spot=f"times = [0.125, 0.5, 2.0, 8.0]\n{spot}"), encoding="utf-8")
    return rl.read_shot(path)


def test_the_photograph_whose_exposure_is_wrong_departs_from_the_others(folder: Path):
    found = rl.report.merge_shot(shot(folder, plate="wrong"))
    assert found.names == ("plate",)
    away = {Path(name).name: stops or 0.0 for name, stops in found.residuals[0].items()}
    assert list(away) == ["p0.png", "p1.png", "p2.png", "p3.png"]
    # By half a stop from the mean of those that show the same places, as far as the curve does not bend to it.
    assert away["p2.png"] == pytest.approx(0.5, abs=0.2)
    assert away["p2.png"] > 2 * max(abs(away[name]) for name in ("p0.png", "p1.png"))


def test_a_spot_puts_plate_and_light_in_cd_m2_and_changes_no_picture(folder: Path):
    bare, scaled = shot(folder), shot(folder, "spot = { at = [150, 64], luminance = 120.0, radius = 3 }")
    relative = rl.report.merge_shot(bare).brackets[0]
    absolute = rl.report.merge_shot(scaled).brackets[0]
    assert (relative.picture.unit, absolute.picture.unit) == ("relative", "cd/m²")
    y, x = np.mgrid[:128, :192]
    disc = (x - 150) ** 2 + (y - 64) ** 2 <= 9
    weights = np.array([0.2126, 0.7152, 0.0722])
    assert float((absolute.picture.radiance[disc] @ weights).mean()) == pytest.approx(120, rel=1e-5)
    assert absolute.scale is not None
    factor = absolute.scale.luminance
    assert factor == pytest.approx(120 / float((relative.picture.radiance[disc] @ weights).mean()), rel=1e-5)
    np.testing.assert_allclose(absolute.picture.radiance, factor * relative.picture.radiance, rtol=1e-5)
    assert absolute.clipping.brightest == pytest.approx(factor * relative.clipping.brightest, rel=1e-5)
    # What develops the plate takes cd/m² as it took relative radiance: the picture is the photograph's.
    from relume.project.insertion.composite import development_of

    pictures = []
    for each in (bare, scaled):
        with rl.errors.GatheredDoubts():
            calibrated = calibrate(each, read_photographs(each), Steps(Stages(folder / f"out{len(pictures)}")))
        film = development_of(each, calibrated).film
        pictures.append(rl.develop(calibrated.plate.radiance, film).pixels)
    assert np.abs(pictures[0].astype(int) - pictures[1]).max() <= 1
    assert 20 < np.median(pictures[0]) < 235


@pytest.mark.parametrize(
    ("spot", "says"),
    [
        ("spot = { at = [400, 64], luminance = 120.0 }", r"plate\.spot: pixel 400, 64 is not in a picture of 192×128"),
        ("spot = { at = [150, 64], luminance = 0 }", r"plate\.spot\.luminance"),
    ],
)
def test_a_spot_that_is_none_is_one_line(folder: Path, spot: str, says: str):
    with pytest.raises(rl.RelumeError, match=says):
        rl.report.merge_shot(shot(folder, spot))


def test_maps_alone_have_nothing_to_merge_and_no_spot(folder: Path, tmp_path: Path):
    shutil.copytree(folder, tmp_path / "maps")
    rl.write(tmp_path / "maps" / "plate.exr", rl.RadianceMap(np.full((128, 192, 3), 0.3, np.float32)))
    text = TEXT.replace("{plate}/*.png", "plate.exr")
    path = tmp_path / "maps" / "shot.toml"
    path.write_text(text.format(spot=""), encoding="utf-8")
    with pytest.raises(rl.RelumeError, match="nothing to merge"):
        rl.report.merge_shot(rl.read_shot(path))
    path.write_text(text.format(spot="spot = { at = [9, 9], luminance = 5 }"), encoding="utf-8")
    with pytest.raises(rl.RelumeError, match=r"plate\.spot: the plate is a radiance map"):
        given = rl.read_shot(path)
        calibrate(given, read_photographs(given), Steps(Stages(tmp_path / "out")))
