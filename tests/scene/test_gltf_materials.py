"""glTF's materials arrive with every number and picture that the extensions name, where they lie on the mesh."""

import numpy as np
import pytest
from PIL import Image

import gltf_files
from relume.errors import UnreadableFile
from relume.scene.materials.materials import Material
from relume.scene.shapes.meshes import read_meshes

HALF = np.full((2, 2, 4), 128, np.uint8)
"""128/255 is 0.5019608 as stored and 0.2158605 by the sRGB curve."""


@pytest.fixture
def read(tmp_path):
    def read(material, pictures=(), sampler=None, texture_points=gltf_files.TEXTURE_POINTS):
        names = []
        for index, pixels in enumerate(pictures):
            names.append({"uri": f"picture_{index}.png"})
            Image.fromarray(pixels).save(tmp_path / f"picture_{index}.png")
        top = {
            "images": names,
            "textures": [{"source": index, "sampler": 0} for index in range(len(names))],
            "samplers": [sampler or {}],
        }
        path = tmp_path / "thing.glb"
        path.write_bytes(
            gltf_files.square_glb(
                material={"name": "tin"} | material, top=top if names else None, texture_points=texture_points
            )
        )
        meshes = read_meshes(path)
        assert all(isinstance(mesh.material, Material) for mesh in meshes)
        return meshes

    return read


def material_of(meshes) -> Material:
    (mesh,) = meshes
    assert isinstance(mesh.material, Material)
    return mesh.material


EXTENDED = {
    "emissiveFactor": [0.5, 0.25, 1],
    "extensions": {
        "KHR_materials_emissive_strength": {"emissiveStrength": 4},
        "KHR_materials_clearcoat": {"clearcoatFactor": 0.75, "clearcoatRoughnessFactor": 0.125},
        "KHR_materials_sheen": {"sheenColorFactor": [0.5, 0.25, 0], "sheenRoughnessFactor": 0.375},
        "KHR_materials_anisotropy": {"anisotropyStrength": 0.5, "anisotropyRotation": 1.25},
        "KHR_materials_specular": {"specularFactor": 0.5, "specularColorFactor": [2, 1, 0]},
        "KHR_materials_transmission": {"transmissionFactor": 0.5},
        "KHR_materials_volume": {
            "thicknessFactor": 0.01,
            "attenuationColor": [0.25, 0.5, 1],
            "attenuationDistance": 0.02,
        },
        "KHR_materials_dispersion": {"dispersion": 0.5},
        "KHR_materials_ior": {"ior": 1.75},
    },
}


def test_every_number_of_the_extensions_is_read(read):
    material = material_of(read(EXTENDED))
    found = {
        name: getattr(material, name)
        for name in (
            "emission", "clearcoat", "clearcoat_roughness", "sheen_color", "sheen_roughness", "anisotropy",
            "anisotropy_rotation", "specular", "specular_color", "transmission", "thin", "attenuation_color",
            "attenuation_distance", "dispersion", "ior",
        )
    }  # fmt: skip
    assert found == {
        "emission": (2, 1, 4), "clearcoat": 0.75, "clearcoat_roughness": 0.125, "sheen_color": (0.5, 0.25, 0),
        "sheen_roughness": 0.375, "anisotropy": 0.5, "anisotropy_rotation": 1.25, "specular": 0.5,
        "specular_color": (2, 1, 0), "transmission": 0.5, "thin": False, "attenuation_color": (0.25, 0.5, 1),
        "attenuation_distance": 0.02, "dispersion": 0.5, "ior": 1.75,
    }  # fmt: skip


@pytest.mark.parametrize(
    ("extensions", "thin"),
    [({}, False), ({"KHR_materials_volume": {}}, True), ({"KHR_materials_volume": {"thicknessFactor": 0.1}}, False)],
)
def test_glass_is_solid_unless_its_volume_has_no_thickness(read, extensions, thin):
    clear = {"KHR_materials_transmission": {"transmissionFactor": 1}}
    assert material_of(read({"extensions": clear | extensions})).thin is thin


def extended(name, **numbers):
    return {"extensions": {f"KHR_materials_{name}": numbers}}


PICTURE = {"index": 0}
PAINT = {"pbrMetallicRoughness": {"baseColorTexture": PICTURE}}
ROUGH = {"pbrMetallicRoughness": {"metallicRoughnessTexture": PICTURE, "roughnessFactor": 0.5}}


@pytest.mark.parametrize(
    ("description", "name", "expected"),
    [
        (ROUGH, "roughness", 0.2509804),
        ({"emissiveTexture": PICTURE, "emissiveFactor": [1, 1, 1]}, "emission", 0.2158605),
        (extended("transmission", transmissionFactor=0.5, transmissionTexture=PICTURE), "transmission", 0.2509804),
        (extended("clearcoat", clearcoatFactor=1, clearcoatTexture=PICTURE), "clearcoat", 0.5019608),
        (extended("sheen", sheenColorFactor=[1, 1, 1], sheenColorTexture=PICTURE), "sheen_color", 0.2158605),
        (extended("specular", specularTexture=PICTURE), "specular", 0.5019608),
        ({"alphaMode": "BLEND"} | PAINT, "alpha", 0.5019608),
        ({"alphaMode": "MASK"} | PAINT, "alpha", 1.0),
        ({"alphaMode": "MASK", "alphaCutoff": 0.6} | PAINT, "alpha", 0.0),
    ],
)
def test_a_picture_is_multiplied_by_its_factor_in_its_own_encoding(read, description, name, expected):
    value = getattr(material_of(read(description, [HALF])), name)
    assert value.shape[:2] == (2, 2)
    np.testing.assert_allclose(value, expected, atol=1e-6)


def test_an_opaque_material_ignores_the_alpha_of_its_picture(read):
    assert material_of(read({"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}, [HALF])).alpha == 1


def test_a_normal_map_is_scaled_and_of_unit_length(read):
    # (204, 127.5, 230)/255·2 − 1 = (0.6, 0, 0.8): twice the 0.6 is (1.2, 0, 0.8) of length 1.4422205.
    picture = np.zeros((1, 1, 3), np.uint8)
    picture[...] = (204, 128, 230)
    material = material_of(read({"normalTexture": {"index": 0, "scale": 2}}, [picture]))
    assert material.normal is not None
    np.testing.assert_allclose(material.normal[0, 0], [0.8305, 0.0054, 0.5570], atol=1e-3)
    assert np.linalg.norm(material.normal[0, 0]) == pytest.approx(1, abs=1e-6)


def test_a_mirrored_part_has_its_own_normal_map_turned_over(read):
    picture = np.zeros((1, 1, 3), np.uint8)
    picture[...] = (128, 255, 128)
    points = gltf_files.TEXTURE_POINTS[[1, 0, 3, 2]]
    material = material_of(read({"normalTexture": {"index": 0}}, [picture], texture_points=points))
    assert material.normal is not None and material.normal[0, 0, 1] < -0.99
    # One triangle of two mirrored: they part.
    points = np.array([[0, 0], [1, 0], [1, 1], [2, 0]], np.float32)
    parts = read({"normalTexture": {"index": 0}}, [picture], texture_points=points)
    assert [len(part.faces) for part in parts] == [1, 1]
    assert [float(np.sign(part.material.normal[0, 0, 1])) for part in parts] == [1, -1]


CORNERS = np.array([[[255, 0, 0], [0, 255, 0]], [[0, 0, 255], [255, 255, 255]]], np.uint8)
"""Red and green above blue and white."""


@pytest.mark.parametrize(
    ("transform", "points"),
    [
        ({"offset": [0.25, 0.5]}, [[0.25, 0.5], [1.25, 0.5], [1.25, 1.5], [0.25, 1.5]]),
        ({"scale": [2, 3]}, [[0, 0], [2, 0], [2, 3], [0, 3]]),
        # A quarter turn counter-clockwise, v downwards: right (1, 0) goes up (0, −1).
        ({"rotation": np.pi / 2}, [[0, 0], [0, -1], [1, -1], [1, 0]]),
    ],
)
def test_a_texture_transform_moves_the_coordinates(read, transform, points):
    info = {"index": 0, "extensions": {"KHR_texture_transform": transform}}
    (mesh,) = read({"pbrMetallicRoughness": {"baseColorTexture": info}}, [CORNERS])
    expected = np.array(points) * [1, -1] + [0, 1]
    np.testing.assert_allclose(mesh.uv, expected, atol=1e-6)


@pytest.mark.parametrize(
    ("wrap", "upper_row"),
    [(33071, ["r", "g", "g", "g"]), (33648, ["r", "g", "g", "r"]), (10497, ["r", "g"])],
    ids=["clamp", "mirror", "repeat"],
)
def test_a_texture_goes_on_as_its_sampler_says(read, wrap, upper_row):
    points = gltf_files.TEXTURE_POINTS * [2, 1]
    (mesh,) = read(
        {"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}},
        [CORNERS],
        {"wrapS": wrap, "wrapT": wrap},
        points.astype(np.float32),
    )
    assert ["rgb"[int(np.argmax(pixel))] for pixel in mesh.material.base_color[0]] == upper_row
    # Two pictures wide, over the one image that shows both.
    assert mesh.uv[:, 0].max() == (2 if wrap == 10497 else 1)


def test_textures_that_lie_differently_are_brought_to_one_place(read):
    description = {
        "pbrMetallicRoughness": {"baseColorTexture": {"index": 0}},
        "emissiveFactor": [1, 1, 1],
        "emissiveTexture": {"index": 0, "extensions": {"KHR_texture_transform": {"offset": [0.5, 0]}}},
    }
    (mesh,) = read(description, [CORNERS])
    np.testing.assert_allclose(mesh.material.base_color, CORNERS / 255, atol=1e-6)
    # Half a picture to the right of each point: left and right change places.
    np.testing.assert_allclose(mesh.material.emission, CORNERS[:, ::-1] / 255, atol=1e-6)


def test_what_lies_on_another_set_of_coordinates_than_the_first_is_said(read):
    description = {
        "pbrMetallicRoughness": {"baseColorTexture": {"index": 0}},
        "normalTexture": {"index": 0, "texCoord": 1},
    }
    with pytest.warns(UserWarning, match='of material "tin": normalTexture .of another set'):
        assert material_of(read(description, [CORNERS])).normal is None


@pytest.mark.parametrize(
    ("uri", "message"),
    [
        ("gone.png", r"normalTexture of its material 'paint' cannot be read.*gone\.png"),
        ("../secret.png", "lies outside of the file's folder"),
    ],
)
def test_a_picture_that_is_missing_or_outside_of_the_files_folder_is_refused(tmp_path, uri, message):
    Image.fromarray(CORNERS).save(tmp_path / "secret.png")
    path = tmp_path / "within" / "thing.glb"
    path.parent.mkdir()
    description = {"name": "paint", "normalTexture": {"index": 0}}
    top = {"images": [{"uri": uri}], "textures": [{"source": 0}]}
    path.write_bytes(gltf_files.square_glb(material=description, top=top))
    with pytest.raises(UnreadableFile, match=message):
        read_meshes(path)


def test_sixteen_bits_of_grey_are_not_clipped_to_eight(read):
    description = {"pbrMetallicRoughness": {"metallicRoughnessTexture": {"index": 0}}}
    roughness = np.asarray(material_of(read(description, [np.full((2, 2), 32768, np.uint16)])).roughness)
    assert roughness[0, 0] == pytest.approx(32768 / 65535, abs=1e-6)


def test_the_helmet_arrives_with_all_its_pictures(shared):
    (mesh, *_) = read_meshes(shared / "data/meshes/gltf/DamagedHelmet/DamagedHelmet.gltf")
    material = mesh.material
    assert isinstance(material, Material)
    for name in ("base_color", "roughness", "metallic", "normal", "emission"):
        assert np.shape(getattr(material, name))[:2] == (2048, 2048)
    assert np.max(material.emission) == 1
