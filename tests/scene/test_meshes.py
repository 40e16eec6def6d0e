"""Meshes: what a file says of shape, place and material arrives; what cannot be read is refused in one line."""

from pathlib import Path

import DracoPy
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


SQUARE = gltf_files.CORNERS.astype(np.float32)


def draco_of(corners, **attributes):
    return DracoPy.encode(corners, gltf_files.TRIANGLES.reshape(-1, 3), preserve_order=True, **attributes)


def draco_square(data, **attributes):
    """The square of gltf_files as KHR_draco_mesh_compression stores it: accessors without a buffer view.

    attributes : their numbers in the compressed data; POSITION's is 0 unless given
    """
    header, _ = gltf_files.parts_of(gltf_files.square_glb())
    primitive = header["meshes"][0]["primitives"][0]
    if "TEXCOORD_0" not in attributes:
        del primitive["attributes"]["TEXCOORD_0"]
    compressed = {"bufferView": 0, "attributes": {"POSITION": 0} | attributes}
    primitive["extensions"] = {"KHR_draco_mesh_compression": compressed}
    header["accessors"][1] |= {"componentType": 5123, "normalized": True}
    for accessor in header["accessors"]:
        del accessor["bufferView"]
    header["bufferViews"] = [{"buffer": 0, "byteLength": len(data)}]
    header["buffers"] = [{"byteLength": len(data)}]
    header["extensionsRequired"] = ["KHR_draco_mesh_compression"]
    return gltf_files.as_glb(header, data + bytes(-len(data) % 4))


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
        (draco_square(b"DRACO and then nothing"), "thing.glb", "its Draco data is damaged"),
        (draco_square(draco_of(SQUARE)[:-9]), "thing.glb", "its Draco data is damaged"),
        (draco_square(draco_of(SQUARE), TEXCOORD_0=7), "thing.glb", "TEXCOORD_0 is not of the mesh that Draco"),
        (requiring("EXT_meshopt_compression"), "thing.glb", "it requires EXT_meshopt_compression, which is not read"),
    ],
    ids=[
        "another kind", "another kind of that name", "no triangles", "no buffer", "NaN", "infinite", "no extent",
        "scaled to nothing", "scaled to a line", "draco", "draco cut short", "an attribute missing", "meshopt",
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


@pytest.mark.parametrize("kind", [np.int16, np.uint16, np.int8, np.uint8])
def test_quantised_places_and_coordinates_are_shares_of_the_largest_whole_number(written, kind):
    """KHR_mesh_quantization: normalised numbers, which the node's scale brings to their size."""
    top = np.iinfo(kind).max
    data = gltf_files.square_glb(
        corners=((gltf_files.CORNERS > 0) * top).astype(kind),
        texture_points=(gltf_files.TEXTURE_POINTS * top).astype(kind),
        node={"scale": [0.3, 0.4, 0.5]},
        top={"extensionsRequired": ["KHR_mesh_quantization"]},
    )
    (mesh,) = read_meshes(written(data, "thing.glb"))
    assert mesh.uv is not None
    np.testing.assert_allclose(mesh.vertices, (gltf_files.CORNERS > 0) * [0.3, 0.4, 0.5], atol=1e-7)
    np.testing.assert_allclose(mesh.uv, gltf_files.TEXTURE_POINTS * [1, -1] + [0, 1], atol=1e-7)


def test_whole_numbers_that_are_not_normalised_are_the_places_themselves(written):
    """Quantised without a range: the largest is then not 1 but itself, here 200 of them in 0.2 m."""
    plain = gltf_files.square_glb(
        corners=(np.sign(gltf_files.CORNERS) * 100).astype(np.int16), node={"scale": [1e-3] * 3}
    )
    header, blob = gltf_files.parts_of(plain)
    header["accessors"][0]["normalized"] = False
    (mesh,) = read_meshes(written(gltf_files.as_glb(header, blob), "thing.glb"))
    np.testing.assert_allclose(mesh.vertices, np.sign(gltf_files.CORNERS) * 0.1, atol=1e-7)


def test_a_mesh_compressed_by_draco_is_the_mesh(written):
    mesh, material = lone_mesh(written(draco_square(draco_of(SQUARE)), "thing.glb"))
    corners = mesh.vertices[mesh.faces].reshape(-1, 3)
    np.testing.assert_allclose(corners, SQUARE[gltf_files.TRIANGLES].reshape(-1, 3), atol=1e-4)
    assert material.name == "paint"


def test_whole_numbers_that_draco_compressed_are_shares_where_they_are_normalised(written):
    points = (gltf_files.TEXTURE_POINTS * 65535).astype(np.uint16)
    data = draco_of(SQUARE, generic_attributes={7: points})
    (mesh,) = read_meshes(written(draco_square(data, POSITION=8, TEXCOORD_0=7), "thing.glb"))
    assert mesh.uv is not None
    place, turned = mesh.vertices / 2 + 0.5, mesh.uv
    np.testing.assert_allclose(turned, place[:, :2], atol=1e-4)


@needs_shared
@pytest.mark.parametrize(
    ("name", "triangles", "size"),
    [
        ("Box", [12], [1, 1, 1]),
        ("BoxTextured", [12], [1, 1, 1]),
        ("suzi", [14842], [1.860, 1.338, 1.121]),
        ("bunny", [5648], [1.831, 1.831, 1.395]),
        ("ShaderBall", [17456, 70808], [2.144, 2.088, 2.081]),
    ],
)
def test_the_compressed_sample_files_are_read_whole(name, triangles, size):
    meshes = read_meshes(SHARED / "gltf" / f"{name}.glb")
    assert [len(mesh.faces) for mesh in meshes] == triangles
    vertices = np.concatenate([mesh.vertices for mesh in meshes])
    np.testing.assert_allclose(np.ptp(vertices, axis=0), size, atol=2e-3)
