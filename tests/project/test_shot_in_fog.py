"""Shots of a place in fog, and of one that a real surface lights, from the shot file to the composite."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
import trimesh

from relume.errors import InvalidShot
from relume.image.files import read_radiance, write
from relume.image.radiance import RadianceMap
from relume.project.insertion.insert import insert
from relume.project.shot_file.objects import placed_meshes
from relume.renderers.mitsuba.path_tracer import Mitsuba
from relume.scene.materials.media import Medium
from relume.sphere.environment_files import as_radiance_map
from relume.sphere.environment_map import EnvironmentMap
from relume.sphere.mappings.mapping import LatLong, pixel_directions
from toml_files import shot_of

SHOT = """
[plate]
photographs = "plate.exr"
[camera]
pose = { position = [0, 0.7, 2], look_at = [0, 0.2, 0] }
focal_length = 48
[light]
map = "map.exr"
scale = 1.0
probe = [0, 0.5, 0]
distant = { shape = "box", low = [-3, -0.01, -3], high = [3, 3, 3] }
[[local]]
shape = "plane"
size = [5.9, 5.9]
[[objects]]
mesh = "ball.glb"
material = { preset = "porcelain", base_color = [0.1, 0.2, 0.4] }
[match]
grain = false
sharpness = false
[render]
samples = 128
preview = false
"""
FOG = "[medium]\nabsorption = 0.02\nscattering = [0.2, 0.25, 0.3]\nanisotropy = 0.3\n"


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return with_ball_and_light(tmp_path)


def with_ball_and_light(folder: Path) -> Path:
    ball = trimesh.creation.icosphere(3, 0.25).apply_translation([0, 0.26, 0])
    (folder / "ball.glb").write_bytes(bytes(ball.export(file_type="glb")))
    towards = np.array([0.5, 0.7, 0.5]) / np.linalg.norm([0.5, 0.7, 0.5])
    lamp = pixel_directions(LatLong(), 32) @ towards > 0.95
    light = EnvironmentMap(np.where(lamp[..., None], 20.0, 0.3) * np.ones(3, np.float32))
    write(folder / "map.exr", as_radiance_map(light))
    return folder


def with_known_floor(text: str) -> str:
    """The shot with the floor's reflectance as it is, which nothing has to find then."""
    return text.replace("size = [5.9, 5.9]\n", "size = [5.9, 5.9]\nreflectance = [0.6, 0.5, 0.4]\n")


def plate_of(folder: Path, text: str) -> tuple[RadianceMap, RadianceMap]:
    """What the camera sees of the place without the objects and with them; the first is written as the plate."""
    write(folder / "plate.exr", RadianceMap(np.ones((32, 48, 3), np.float32)))
    shot = shot_of(folder, with_known_floor(text).replace("samples = 128", "samples = 2"))
    place = insert(shot, folder / "known").place
    scene = place.relit(shot)
    pictures = [
        Mitsuba(384).render(each, place.camera, seed=1).radiance for each in (scene, scene.adding(*placed_meshes(shot)))
    ]
    write(folder / "plate.exr", RadianceMap(pictures[0]))
    return RadianceMap(pictures[0]), RadianceMap(pictures[1])


@dataclass(frozen=True)
class Foggy:
    """The place in fog, in a folder: as it is photographed without the objects, and what it is with them."""

    folder: Path
    plate: RadianceMap
    whole: RadianceMap


@pytest.fixture(scope="module")
def foggy(tmp_path_factory: pytest.TempPathFactory) -> Foggy:
    folder = with_ball_and_light(tmp_path_factory.mktemp("fog"))
    return Foggy(folder, *plate_of(folder, FOG + SHOT))


def blocks(picture: np.ndarray) -> np.ndarray:
    """Means of 8 × 8 pixels, in which little of the noise is left."""
    return picture.reshape(4, 8, 6, 8, 3).mean((1, 3))


def test_a_composite_in_fog_is_the_picture_of_all_in_fog(foggy: Foggy, tmp_path: Path):
    plate, whole = foggy.plate, foggy.whole
    result = insert(shot_of(foggy.folder, FOG + SHOT), tmp_path)
    assert result.place.bare.medium == Medium((0.02, 0.02, 0.02), (0.2, 0.25, 0.3), 0.3)
    composite = read_radiance(tmp_path / "composite.exr").radiance
    change = np.abs(blocks(whole.radiance - plate.radiance)).mean()
    assert np.abs(blocks(composite - whole.radiance)).mean() < 0.2 * change
    np.testing.assert_allclose(composite.mean((0, 1)), whole.radiance.mean((0, 1)), rtol=0.01)
    # The floor's own reflectance was found through the fog.
    found = result.place.recovered
    assert found is not None
    floor = found.surfaces[0].measured
    assert floor is not None
    np.testing.assert_allclose(floor, [0.6, 0.5, 0.4], rtol=0.05)


def test_without_objects_the_plate_comes_back_to_the_bit(foggy: Foggy, tmp_path: Path):
    bare = FOG + SHOT[: SHOT.index("[[objects]]")] + SHOT[SHOT.index("[match]") :]
    insert(shot_of(foggy.folder, with_known_floor(bare)), tmp_path)
    np.testing.assert_array_equal(read_radiance(tmp_path / "composite.exr").radiance, foggy.plate.radiance)


def test_a_real_surface_that_shines_lights_the_object_and_stays_the_plates(folder: Path):
    panel = '[[local]]\nshape = "box"\nlow = [-1, 0.1, -0.9]\nhigh = [1, 0.9, -0.8]\nreflectance = [0, 0, 0]\n'
    dark = SHOT.replace("[[objects]]", panel + "[[objects]]")
    lit = SHOT.replace("[[objects]]", panel + "emission = [6, 5, 4]\n[[objects]]")
    plate, whole = plate_of(folder, lit)
    insert(shot_of(folder, lit), folder / "lit")
    insert(shot_of(folder, with_known_floor(dark)), folder / "dark")
    found, without = (read_radiance(folder / name / "composite.exr").radiance for name in ("lit", "dark"))
    change = np.abs(blocks(whole.radiance - plate.radiance)).mean()
    wrong = np.abs(blocks(found - whole.radiance)).mean()
    assert wrong < 0.2 * change
    assert np.abs(blocks(without - whole.radiance)).mean() > 1.5 * wrong
    # The panel, wherever the ball does not hide it.
    panel = (plate.radiance[..., 0] > 5.9) & (np.abs(whole.radiance - plate.radiance).max(-1) < 1e-3)
    assert panel.sum() > 50
    np.testing.assert_array_equal(found[panel], plate.radiance[panel])


@pytest.mark.parametrize(
    ("keys", "part"),
    [
        ("emission = [1, 1, 1]", "the reflectance is given"),
        ("emission = [1, 1, 1]\nmirror = true\nreflectance = [0.9, 0.9, 0.9]", "is matte here"),
        ("emission = [-1, 1, 1]\nreflectance = [0, 0, 0]", "emission"),
    ],
)
def test_what_cannot_shine_is_one_line(folder: Path, keys: str, part: str):
    with pytest.raises(InvalidShot, match=part) as error:
        shot_of(folder, SHOT.replace("size = [5.9, 5.9]", f"size = [5.9, 5.9]\n{keys}"))
    assert "\n" not in str(error.value)


def test_a_medium_that_is_none_is_one_line(folder: Path):
    with pytest.raises(InvalidShot, match="medium: scattering of the medium is") as error:
        shot_of(folder, "[medium]\nscattering = -1\n" + SHOT)
    assert "\n" not in str(error.value)
