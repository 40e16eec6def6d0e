"""Marks and radiance maps in, a textured place out: its radiance against the truth, its seams, and what is refused."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import place_shoot
import relume as rl
from relume.errors import InvalidPlace
from relume.image.files import read_radiance, write
from relume.image.photograph import Photograph
from relume.image.radiance import RadianceMap


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A place file without noise, and a radiance map of each of its photographs."""
    path = tmp_path_factory.mktemp("place")
    (path / "marks.toml").write_text(place_shoot.toml(noise=0.0), encoding="utf-8")
    place_shoot.radiance_maps(path)
    return path


def maps(folder: Path) -> list[Path]:
    return sorted(folder.glob("photo?.exr"))


@pytest.fixture(scope="module")
def made(folder: Path) -> rl.report.TexturedPlace:
    return rl.report.texture_place(
        folder / "marks.toml", maps(folder), folder / "place.glb", out=folder / "place.toml", texel=0.15
    )


def test_the_blocks_shine_as_they_were_photographed(folder: Path, made: rl.report.TexturedPlace):
    read = {mesh.name: mesh for mesh in rl.read_meshes(folder / "place.glb")}
    assert set(read) == {"house", "roof", "tower", "annex"} and (folder / "place.toml").is_file()
    for part in made.baked.parts:
        seen = part.used & part.seen
        off = np.abs(part.radiance[seen] / place_shoot.radiance_at(part.points[seen]) - 1)
        assert np.median(off) < 0.01 and np.quantile(off, 0.95) < 0.08
        assert isinstance(read[part.mesh.name].material, rl.Material)


def test_seams_and_holes_are_told_in_numbers(made: rl.report.TexturedPlace):
    # Nobody sees the house's bottom and its top, on which the roof stands: 96 of its 236 m². The tower hides more.
    house = made.baked.parts[0]
    assert 0.41 < house.holes < 0.55 and 0.3 < made.baked.holes < 0.5
    seams = made.seams
    assert 0.4 < seams.shared < 1 and seams.typical < 0.02 and seams.worst < 0.15
    assert list(seams.gains) == [f"photo{k}" for k in range(5)]
    assert np.allclose(list(seams.gains.values()), 1, atol=0.02)
    facts = made.facts()
    assert facts["filled"] == f"{made.baked.holes:.1%} of the surface"
    assert facts["brightness"] == {name: f"{gain:.3f} of the middle one" for name, gain in seams.gains.items()}


def test_a_photograph_on_another_scale_is_named(folder: Path, tmp_path: Path):
    paths = maps(folder)
    brighter = tmp_path / "photo2.exr"
    picture = read_radiance(paths[2])
    write(brighter, RadianceMap(1.5 * picture.radiance))
    with pytest.warns(UserWarning, match=r"photo2 is 1\.5\d? times as bright as the others where they show one place"):
        found = rl.report.texture_place(
            folder / "marks.toml", [*paths[:2], brighter, *paths[3:]], tmp_path / "place.glb", texel=0.3
        )
    assert found.seams.gains["photo2"] == pytest.approx(1.5, rel=0.02)


def test_photographs_of_eight_bits_need_a_profile(folder: Path, tmp_path: Path):
    plain = tmp_path / "photo0.png"
    write(plain, Photograph(np.full((180, 240, 3), 90, np.uint8)))
    with pytest.raises(ValueError, match=r"photo0\.png: a photograph, whose radiance needs the camera's profile"):
        rl.report.texture_place(folder / "marks.toml", [plain], tmp_path / "place.glb")


def test_what_does_not_go_together_is_refused_in_one_line(folder: Path, tmp_path: Path):
    marks, first = folder / "marks.toml", maps(folder)[0]
    other = tmp_path / "north.exr"
    write(other, RadianceMap(np.ones((18, 24, 3), np.float32)))
    cropped = tmp_path / "photo1.exr"
    write(cropped, RadianceMap(np.ones((18, 18, 3), np.float32)))
    for pictures, words in (
        ([other], "no photograph of the place is called so; it has photo0, photo1,"),
        ([first, first], "another file is of 'photo0' already"),
        ([cropped], "18×18 pixels; 'photo1' was marked in 1600×1200, another shape"),
    ):
        with pytest.raises(InvalidPlace, match=words) as caught:
            rl.report.texture_place(marks, pictures, tmp_path / "place.glb", out=folder / "refused.toml")
        assert "\n" not in str(caught.value)
    with pytest.raises(ValueError, match=r"written as \.glb or \.usda"):
        rl.report.texture_place(marks, [first], tmp_path / "place.obj")
    with pytest.raises(ValueError, match="there are no photographs to lay"):
        rl.report.texture_place(marks, [], tmp_path / "place.glb")
    # Finer texels than a texture has are refused with their number, and so are those of no width.
    for texel, words in (
        (0.0, r"texel is 0\.0; expected its width in metres"),
        (-0.1, r"texel is -0\.1; expected its width"),
        (
            1e-5,
            r"texel is 1e-05 m, of which 'house' with its \d+ m² has 2\.\de\+12; a texture has 2\.7e\+08 at most: give",
        ),
    ):
        with pytest.raises(InvalidPlace, match=words):
            rl.report.texture_place(marks, [first], tmp_path / "place.glb", out=folder / "refused.toml", texel=texel)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["north.exr", "photo1.exr"]
    assert not (folder / "refused.toml").exists()
