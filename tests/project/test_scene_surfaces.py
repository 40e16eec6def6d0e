"""Measured and scratched surfaces and gloss maps in a scene file, and what is refused of them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from measured_tables import write_merl
from relume.errors import InvalidScene, InvalidShot
from relume.image import files
from relume.image.photograph import Photograph
from relume.project.shot_file.objects import placed_meshes
from relume.project.shot_file.shot import read_shot
from relume.scene.materials.abc_facets import ABCFacets
from relume.scene.materials.materials import Material, Ward
from relume.scene.materials.measured import MeasuredBRDF
from toml_files import SCENE_BALL as BALL
from toml_files import SCENE_CAMERA, scene_of

HEAD = (
    SCENE_CAMERA
    + """\
[light]
colour = 1.0
"""
)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    codes = np.zeros((2, 4, 3), np.uint8)
    codes[:, 2:] = 204
    files.write(tmp_path / "map.png", Photograph(codes + 51))
    write_merl(tmp_path / "felt.binary", np.full((90, 90, 180, 3), 0.125))
    return tmp_path


def material_of(folder: Path, words: str):
    return scene_of(folder, f"{HEAD}[materials.ball]\n{words}\n{BALL}").scene.objects[0].material


def test_a_measured_surface_is_read_from_its_file_or_taken_from_a_fit(folder):
    felt = material_of(folder, 'kind = "measured"\nfile = "felt.binary"\nscale = 2.0')
    assert isinstance(felt, MeasuredBRDF) and felt.name == "ball"
    np.testing.assert_allclose(felt.values[40, 40, 40], 0.25, rtol=1e-6)
    teflon = material_of(folder, 'kind = "measured"\npreset = "merl/teflon"')
    assert isinstance(teflon, ABCFacets) and teflon.diffuse == (0.321152, 0.313597, 0.305526)
    by_pbr = material_of(folder, 'kind = "pbr"\npreset = "merl/teflon"')
    assert isinstance(by_pbr, ABCFacets) and by_pbr.b == teflon.b


def test_a_gloss_map_is_linear_from_black_to_white(folder):
    made = material_of(folder, 'kind = "pbr"\nroughness = "map.png"\nmetallic = "map.png"\nior = 1.4')
    assert isinstance(made, Material) and made.ior == 1.4
    # The code value 51 of 255 is 0.2, whatever a screen makes of it.
    np.testing.assert_allclose(made.roughness, [[0.2, 0.2, 1, 1]] * 2, rtol=1e-6)
    np.testing.assert_allclose(made.metallic, made.roughness)
    assert np.shape(made.base_color) == (3,)


def test_scratches_take_numbers_and_images(folder):
    made = material_of(
        folder,
        'kind = "ward"\nreflectance = [0.3, 0.2, 0.1]\nalpha_x = 0.1\nalpha_y = "map.png"\nrotation = "map.png"\n'
        "crossed = 0.25\ncrossing = 60",
    )
    assert isinstance(made, Ward)
    np.testing.assert_allclose(made.alpha_y, [[0.2, 0.2, 1, 1]] * 2, rtol=1e-6)
    # Directions go from 0° at black to 180° at white.
    np.testing.assert_allclose(np.degrees(made.rotation), [[36, 36, 180, 180]] * 2, rtol=1e-6)
    assert (made.alpha_x, made.crossed, np.degrees(made.crossing)) == pytest.approx((0.1, 0.25, 60))
    plain = material_of(
        folder, 'kind = "ward"\nreflectance = [0.3, 0.2, 0.1]\nalpha_x = 0.1\nalpha_y = 0.2\nrotation = 90'
    )
    assert isinstance(plain, Ward)
    assert np.degrees(plain.rotation) == pytest.approx(90) and np.degrees(plain.crossing) == pytest.approx(90)


@pytest.mark.parametrize(
    ("words", "line"),
    [
        ('kind = "measured"', "materials.ball: has neither; give one of file and preset"),
        ('kind = "measured"\nfile = "felt.binary"\npreset = "merl/teflon"', "materials.ball: has both"),
        ('kind = "measured"\npreset = "gold"', "materials.ball: preset: there is no measured surface 'gold'"),
        ('kind = "measured"\nfile = "map.png"', "map.png: begins with .*, not with 90×90×180"),
        ('kind = "measured"\npreset = "merl/teflon"\nscale = 5', "diffuse of material 'merl/teflon' is"),
        ('kind = "pbr"\nroughness = "none.png"', r"materials.ball.roughness: .*none.png"),
        (
            'kind = "pbr"\npreset = "merl/teflon"\nroughness = "map.png"',
            "materials.ball: roughness: the preset has none",
        ),
        ('kind = "ward"\nreflectance = [1, 1, 1]\nalpha_x = 2\nalpha_y = 0.1', "alpha_x of material 'ball' is"),
        (
            'kind = "ward"\nreflectance = [1, 1, 1]\nalpha_x = 0.1\nalpha_y = "no.png"',
            r"materials.ball.alpha_y: .*no.png",
        ),
    ],
)
def test_a_fault_is_one_line_with_its_key(folder, words, line):
    with pytest.raises(InvalidScene, match=line) as caught:
        material_of(folder, words)
    assert "\n" not in str(caught.value)


SQUARE = "v 0 0 0\nv 1 0 0\nv 1 0 -1\nf 1 2 3\n"
SHOT = """
[plate]
photographs = ["plate.jpg"]
[camera]
pose = { position = [0, 1, 2], look_at = [0, 0, 0] }
focal_length = 500
[light]
map = "light.exr"
[[objects]]
mesh = "square.obj"
material = { %s }
"""


def test_a_mesh_without_coordinates_takes_no_image(folder):
    (folder / "square.obj").write_text(SQUARE)
    text = (
        HEAD + '[materials.m]\nkind = "pbr"\nroughness = "map.png"\n[[objects]]\nmesh = "square.obj"\nmaterial = "m"\n'
    )
    with pytest.raises(InvalidScene, match=r"'m' has an image, and mesh .* no texture coordinates"):
        scene_of(folder, text)


def test_a_shot_gives_a_measured_surface_to_its_object(folder):
    (folder / "square.obj").write_text(SQUARE)
    (folder / "shot.toml").write_text(SHOT % 'file = "felt.binary"')
    shot = read_shot(folder / "shot.toml")
    assert "felt.binary" in shot.named_files()
    (mesh,) = placed_meshes(shot)
    assert isinstance(mesh.material, MeasuredBRDF) and mesh.material.name == "felt"
    (folder / "shot.toml").write_text(SHOT % 'file = "none.binary"')
    with pytest.raises(InvalidShot, match=r"objects\.material: .*none\.binary: no such file"):
        placed_meshes(read_shot(folder / "shot.toml"))
