"""A .mtl's words arrive as a material."""

import numpy as np
import pytest
from PIL import Image

from relume.errors import UnreadableFile
from relume.scene.materials.materials import Material
from relume.scene.shapes.meshes import GREY, read_meshes

TRIANGLE = "mtllib paint.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nusemtl tin\nf 1/1 2/2 3/3\n"


@pytest.fixture
def read(tmp_path):
    def read(words):
        (tmp_path / "thing.obj").write_text(TRIANGLE)
        if words is not None:
            (tmp_path / "paint.mtl").write_text(f"newmtl tin\n{words}\n")
        (mesh,) = read_meshes(tmp_path / "thing.obj")
        assert isinstance(mesh.material, Material)
        return mesh.material

    return read


def test_numbers_are_read(read):
    material = read("Kd 0.5 0.25 0\nKe 2 1 0\nNi 1.25\nd 0.75\nPr 0.5\nPm 1 # metal")
    assert (material.base_color, material.emission) == ((0.5, 0.25, 0), (2, 1, 0))
    assert (material.ior, material.alpha, material.roughness, material.metallic) == (1.25, 0.75, 0.5, 1)
    assert (material.name, material.specular) == ("tin", 1)


@pytest.mark.parametrize(
    ("words", "name", "expected"),
    [
        # √(2/(98 + 2)) = 0.1414214 = α = roughness².
        ("Ns 98\nKs 1 1 1", "roughness", pytest.approx(0.1414214**0.5)),
        ("Kd 1 1 1", "roughness", 1),
        ("Ks 0 0 0", "specular", 0),
        ("Tr 0.25", "alpha", 0.75),
    ],
)
def test_gloss_and_transparency_become_gltfs(read, words, name, expected):
    assert getattr(read(words), name) == expected


def test_a_picture_is_decoded_and_multiplied(read, tmp_path):
    Image.fromarray(np.full((2, 2, 3), 128, np.uint8)).save(tmp_path / "wood.png")
    material = read("Kd 1 0.5 0\nmap_Kd wood.png")
    np.testing.assert_allclose(material.base_color[0, 0], [0.2158605, 0.1079303, 0], atol=1e-6)


def test_a_missing_picture_is_reported_with_its_material(read):
    with pytest.raises(
        UnreadableFile, match=r"paint\.mtl: the map_Kd of its material 'tin', gone\.png, cannot be read"
    ):
        read("map_Kd gone.png")


def test_numbers_that_cannot_be_are_reported_with_their_material(read):
    with pytest.raises(UnreadableFile, match=r"paint\.mtl: the material 'tin' cannot be read \(.*base_color"):
        read("Kd 5 0 0")


def test_a_missing_library_leaves_grey_and_says_so(read):
    with pytest.warns(UserWarning, match=r"not rendered of its materials, whose files are missing: paint\.mtl"):
        assert read(None) == GREY or read(None).base_color == GREY.base_color
