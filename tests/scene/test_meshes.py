"""Meshes: what a file says of shape, place and material arrives; what cannot be read is refused in one line."""

from pathlib import Path

import numpy as np
import pytest
import trimesh

import gltf_files
from relume.errors import UnreadableFile
from relume.scene.materials.materials import Material
from relume.scene.shapes.meshes import GREY, read_meshes

OBJECTS = Path(__file__).resolve().parents[2] / "examples" / "room" / "objects"
SHARED = Path(__file__).resolve().parents[3] / "shared" / "data" / "meshes"
needs_shared = pytest.mark.skipif(not SHARED.is_dir(), reason=f"the sample meshes are not in {SHARED}")


@pytest.fixture
def written(tmp_path):
    def write(data, name="square.glb"):
        path = tmp_path / name
        path.write_bytes(data if isinstance(data, bytes) else data.encode())
        return path

    return write


def refusal(path):
    with pytest.raises(UnreadableFile) as caught:
        read_meshes(path)
    message = str(caught.value)
    assert message.startswith(str(path))
    assert "\n" not in message
    return message


def lone_mesh(path):
    """The only mesh of a file, and its material, which is never a mere `Diffuse`."""
    (mesh,) = read_meshes(path)
    assert isinstance(mesh.material, Material)
    return mesh, mesh.material


# --- what is read ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("cube_gold", {"base_color": (1, 0.72, 0.32), "metallic": 1, "roughness": 0.25, "transmission": 0}),
        ("sphere_glass", {"base_color": (1, 1, 1), "metallic": 0, "roughness": 0, "transmission": 1, "ior": 1.5}),
        ("sphere_gray", {"base_color": (0.5, 0.5, 0.5), "metallic": 0, "roughness": 1, "transmission": 0}),
        ("sphere_mirror", {"base_color": (0.95, 0.95, 0.95), "metallic": 1, "roughness": 0, "transmission": 0}),
        ("suzanne_plastic", {"base_color": (0.05, 0.3, 0.08), "metallic": 0, "roughness": 0.15, "transmission": 0}),
    ],
)
def test_the_rooms_objects_are_made_of_what_their_files_say(name, expected):
    (mesh,) = read_meshes(OBJECTS / f"{name}.glb")
    for field, value in expected.items():
        np.testing.assert_allclose(getattr(mesh.material, field), value, atol=1e-6)


@pytest.mark.parametrize(
    ("name", "lowest", "highest"),
    [
        ("cube_gold", (0.165720, 0.0, 0.085720), (0.274280, 0.08, 0.194280)),
        ("sphere_glass", (-0.01, 0.0, 0.07), (0.09, 0.1, 0.17)),
        ("sphere_gray", (0.14, 0.0, -0.1), (0.26, 0.12, 0.02)),
    ],
)
def test_the_rooms_objects_stand_on_the_table_where_their_files_place_them(name, lowest, highest):
    (mesh,) = read_meshes(OBJECTS / f"{name}.glb")
    np.testing.assert_allclose(mesh.vertices.min(0), lowest, atol=1e-6)
    np.testing.assert_allclose(mesh.vertices.max(0), highest, atol=1e-6)


def test_a_smooth_sphere_keeps_its_normals_and_faces_outwards():
    (mesh,) = read_meshes(OBJECTS / "sphere_gray.glb")
    centre = np.array([0.2, 0.06, -0.04])
    outwards = (mesh.vertices - centre) / np.linalg.norm(mesh.vertices - centre, axis=1, keepdims=True)
    assert mesh.normals is not None
    assert np.sum(mesh.normals * outwards, axis=1).min() > 0.9999  # 0.8°: the exporter rounds normals
    a, b, c = (mesh.vertices[mesh.faces[:, i]] for i in range(3))
    facing = np.sum(np.cross(b - a, c - a) * ((a + b + c) / 3 - centre), axis=1)
    assert np.mean(facing > 0) > 0.999  # triangles at the poles have no area


def test_a_node_is_scaled_then_turned_then_moved(written):
    # A quarter turn about +Z: the upper right corner (1, 1) becomes (2, 3) by scale and (−3, 2) by the turn.
    half = float(np.sqrt(0.5))
    node = {"translation": [10, 20, 30], "rotation": [0, 0, half, half], "scale": [2, 3, 1]}
    (mesh,) = read_meshes(written(gltf_files.square_glb(node=node)))
    np.testing.assert_allclose(mesh.vertices[1], [7, 22, 30], atol=1e-6)


def test_a_mirrored_node_still_faces_outwards(written):
    (mesh,) = read_meshes(written(gltf_files.square_glb(node={"scale": [-1, 1, 1]})))
    a, b, c = mesh.vertices[mesh.faces[0]]
    assert np.cross(b - a, c - a)[2] > 0


def test_a_texture_is_decoded_and_multiplied_by_its_factor(written):
    image = np.array([[[255, 0, 0], [0, 255, 0]], [[0, 0, 255], [128, 128, 128]]], np.uint8)
    material = {"pbrMetallicRoughness": {"metallicFactor": 0, "baseColorFactor": [0.5, 1, 1, 1]}}
    mesh, paint = lone_mesh(written(gltf_files.square_glb(image=image, material=material)))
    # 128/255 by the sRGB curve is 0.2158605 (IEC 61966-2-1).
    expected = [[[0.5, 0, 0], [0, 1, 0]], [[0, 0, 1], [0.10793, 0.2158605, 0.2158605]]]
    np.testing.assert_allclose(paint.base_color, expected, atol=1e-6)
    assert mesh.uv is not None
    # Ours has (0, 0) in the lower left corner; the first vertex is the upper left one.
    assert mesh.uv.tolist() == [[0, 1], [1, 1], [1, 0], [0, 0]]


def test_a_metal_by_default_is_what_gltf_says(written):
    _, material = lone_mesh(written(gltf_files.square_glb(material={"name": "plain"})))
    assert (material.metallic, material.roughness, material.name) == (1.0, 1.0, "plain")


def test_index_of_refraction_and_transmission_are_read(written):
    material = {
        "pbrMetallicRoughness": {"metallicFactor": 0, "roughnessFactor": 0.1},
        "extensions": {
            "KHR_materials_ior": {"ior": 1.33},
            "KHR_materials_transmission": {"transmissionFactor": 0.75},
        },
    }
    required = {"extensionsRequired": ["KHR_materials_ior", "KHR_materials_transmission"]}
    _, paint = lone_mesh(written(gltf_files.square_glb(material=material, top=required)))
    assert (paint.ior, paint.transmission) == (1.33, 0.75)


@pytest.mark.parametrize(
    ("extra", "said"),
    [
        ({"extensions": {"KHR_materials_unlit": {}}}, "KHR_materials_unlit"),
        ({"extensions": {"KHR_materials_iridescence": {}}}, "KHR_materials_iridescence"),
        ({"extensions": {"KHR_materials_clearcoat": {"clearcoatNormalTexture": {}}}}, "clearcoatNormalTexture"),
        ({"extensions": {"KHR_materials_anisotropy": {"anisotropyTexture": {}}}}, "anisotropyTexture"),
    ],
)
def test_what_is_not_rendered_is_warned_of_by_name(written, extra, said):
    data = gltf_files.square_glb(material={"name": "tin", "pbrMetallicRoughness": {}} | extra)
    with pytest.warns(UserWarning, match=f'not rendered of material "tin": {said}'):
        read_meshes(written(data))


@pytest.mark.parametrize("kind", ["obj", "ply", "stl"])
def test_shapes_without_materials_are_grey(tmp_path, kind):
    path = tmp_path / f"box.{kind}"
    trimesh.creation.box((1, 2, 3)).export(path)
    mesh, material = lone_mesh(path)
    np.testing.assert_allclose(np.ptp(mesh.vertices, axis=0), [1, 2, 3], atol=1e-6)
    assert material.base_color == GREY.base_color == (0.5, 0.5, 0.5)


@needs_shared
def test_a_file_of_many_parts_is_read_as_many_meshes():
    with pytest.warns(UserWarning, match="not rendered of material"):
        meshes = read_meshes(SHARED / "gltf" / "ClearcoatTest.glb")
    assert len(meshes) > 20
    # Its README counts 37 116 triangles.
    assert sum(len(mesh.faces) for mesh in meshes) == 37116


# --- what is refused -------------------------------------------------------------------------------------------------


def test_a_missing_file_is_refused(tmp_path):
    assert "no such mesh file; check the path" in refusal(tmp_path / "nowhere.glb")


@pytest.mark.parametrize("name", ["empty.glb", "empty.gltf", "empty.obj", "empty.ply", "empty.stl"])
def test_an_empty_file_is_refused(written, name):
    assert "export" in refusal(written(b"", name))


EMPTY = {"asset": {"version": "2.0"}, "scenes": [{"nodes": [0]}], "scene": 0, "nodes": [{"name": "lamp"}]}
WITHOUT_BUFFER = (
    '{"asset": {"version": "2.0"}, "buffers": [{"uri": "gone.bin", "byteLength": 36}],'
    ' "bufferViews": [{"buffer": 0, "byteLength": 36}], "scene": 0, "scenes": [{"nodes": [0]}],'
    ' "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"}],'
    ' "nodes": [{"mesh": 0}], "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}]}'
)


def with_a_corner_at(value):
    corners = gltf_files.CORNERS.copy()
    corners[2, 1] = value
    return gltf_files.square_glb(corners=corners)


def requiring(extension):
    return gltf_files.square_glb(top={"extensionsRequired": [extension]})


@pytest.mark.parametrize(
    ("data", "name", "words"),
    [
        (b"Kaydara FBX", "thing.fbx", "files of kind .fbx are not read; use .glb"),
        (b"\x89PNG\r\n\x1a\n" + bytes(100), "thing.glb", "no glTF header"),
        (gltf_files.as_glb(EMPTY), "thing.glb", ""),
        (WITHOUT_BUFFER, "thing.gltf", ""),
        (with_a_corner_at(np.nan), "thing.glb", ""),
        (with_a_corner_at(np.inf), "thing.glb", ""),
        (gltf_files.square_glb(corners=np.zeros_like(gltf_files.CORNERS)), "thing.glb", "has no extent"),
        (gltf_files.square_glb(node={"scale": [0, 0, 0]}), "thing.glb", "has no extent"),
        (gltf_files.square_glb(node={"scale": [1, 0, 1]}), "thing.glb", "has no extent"),
        (requiring("KHR_draco_mesh_compression"), "thing.glb", "it requires KHR_draco_mesh_compression, which is not"),
        (requiring("EXT_meshopt_compression"), "thing.glb", "it requires EXT_meshopt_compression, which is not read"),
        (requiring("KHR_mesh_quantization"), "thing.glb", "it requires KHR_mesh_quantization, which is not read"),
        (
            gltf_files.square_glb(texture_points=(gltf_files.TEXTURE_POINTS * 65535).astype(np.uint16)),
            "thing.glb",
            "TEXCOORD_0 is quantised",
        ),
    ],
    ids=[
        "another kind", "another kind of that name", "no triangles", "no buffer", "NaN", "infinite", "no extent",
        "scaled to nothing", "scaled to a line", "draco", "meshopt", "quantised", "quantised coordinates",
    ],
)  # fmt: skip
def test_what_cannot_be_read_is_refused_by_what_is_wrong(written, data, name, words):
    assert words in refusal(written(data, name))


@pytest.mark.parametrize("share", [0.05, 0.3, 0.5, 0.9, 0.99])
def test_a_damaged_file_is_refused(written, share):
    whole = (OBJECTS / "cube_gold.glb").read_bytes()
    refusal(written(whole[: int(len(whole) * share)]))


def test_points_without_faces_are_refused(tmp_path):
    path = tmp_path / "cloud.ply"
    trimesh.PointCloud(np.eye(3)).export(path)
    assert "holds no triangles" in refusal(path)


@needs_shared
@pytest.mark.parametrize(
    ("name", "extension"),
    [
        ("Box", "KHR_draco_mesh_compression"),
        ("BoxTextured", "KHR_draco_mesh_compression"),
        ("suzi", "KHR_draco_mesh_compression"),
        ("bunny", "KHR_draco_mesh_compression"),
        ("ShaderBall", "KHR_mesh_quantization"),
    ],
)
def test_the_compressed_sample_files_are_refused_by_what_they_require(name, extension):
    assert extension in refusal(SHARED / "gltf" / f"{name}.glb")
