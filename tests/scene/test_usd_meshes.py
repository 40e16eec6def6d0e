"""USD files as objects: place, units, polygons, materials, textures and colours; what is lost is named."""

from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from relume.errors import UnreadableFile
from relume.image.colour import decode_srgb
from relume.scene.materials.materials import Material
from relume.scene.shapes.meshes import read_meshes
from relume.scene.shapes.shapes import Mesh

pytest.importorskip("pxr", reason="USD files are read by OpenUSD, the extra `usd`")
SHARED = Path(__file__).resolve().parents[3] / "shared" / "data" / "meshes" / "usd"
needs_shared = pytest.mark.skipif(not SHARED.is_dir(), reason=f"the sample meshes are not in {SHARED}")
HEAD = '#usda 1.0\n(\n    upAxis = "{up}"\n    metersPerUnit = {unit}\n)\n'
# A square and a triangle beside it, in the plane z = 0, seen from +z.
POLYGONS = """
    uniform token subdivisionScheme = "none"
    point3f[] points = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (2, 0, 0)]
    int[] faceVertexCounts = [4, 3]
    int[] faceVertexIndices = [0, 1, 2, 3, 1, 4, 2]
"""
PREVIEW = """
def Material "{name}"
{{
    token outputs:surface.connect = </{name}/Shader.outputs:surface>
    def Shader "Shader"
    {{
        uniform token info:id = "UsdPreviewSurface"
        token outputs:surface
        {inputs}
    }}
{more}
}}
"""


def written(folder: Path, text: str, *, up: str = "Y", unit: float = 1, name: str = "a.usda") -> Path:
    (folder / name).write_text(HEAD.format(up=up, unit=unit) + text)
    return folder / name


def square(more: str = "", name: str = "Square", above: str = "") -> str:
    return f'def Mesh "{name}"{above}\n{{{POLYGONS}{more}\n}}\n'


def bound(material: str, more: str = "") -> str:
    applied = '(\n    prepend apiSchemas = ["MaterialBindingAPI"]\n)'
    return square(f"    rel material:binding = </{material}>\n{more}", above=applied)


def lone(path: Path) -> tuple[Mesh, Material]:
    (mesh,) = read_meshes(path)
    assert isinstance(mesh.material, Material)
    return mesh, mesh.material


def face_normals(mesh: Mesh) -> np.ndarray:
    a, b, c = (mesh.vertices[mesh.faces[:, corner]] for corner in range(3))
    across = np.cross(b - a, c - a)
    return across / np.linalg.norm(across, axis=1, keepdims=True)


def test_polygons_become_triangles_in_metres_with_y_up(tmp_path):
    text = 'def Xform "Top"\n{\n    double3 xformOp:translate = (0, 0, 300)\n'
    text += '    uniform token[] xformOpOrder = ["xformOp:translate"]\n' + square() + "}\n"
    mesh, material = lone(written(tmp_path, text, up="Z", unit=0.01))
    assert mesh.faces.shape == (3, 3) and mesh.vertices.shape == (5, 3) and mesh.name == "Square"
    # Z up and centimetres: (x, y, z) is (x, z, −y) / 100.
    np.testing.assert_allclose(mesh.vertices[mesh.faces[0]], [[0, 3, 0], [0.01, 3, 0], [0.01, 3, -0.01]], atol=1e-7)
    np.testing.assert_allclose(face_normals(mesh), np.tile([0, 1, 0], (3, 1)), atol=1e-6)
    assert mesh.normals is None and material.base_color == (0.5, 0.5, 0.5)


def test_faces_point_outward_however_they_are_wound_or_mirrored(tmp_path):
    left = square('    uniform token orientation = "leftHanded"\n')
    flipped = square('    float3 xformOp:scale = (-1, 1, 1)\n    uniform token[] xformOpOrder = ["xformOp:scale"]\n')
    np.testing.assert_allclose(face_normals(lone(written(tmp_path, left))[0])[:, 2], -1)
    np.testing.assert_allclose(face_normals(lone(written(tmp_path, flipped))[0])[:, 2], 1)


def test_values_at_corners_part_what_points_share(tmp_path):
    more = """    texCoord2f[] primvars:st = [(0, 0), (1, 0), (1, 1), (0, 1)] ( interpolation = "faceVarying" )
    int[] primvars:st:indices = [0, 1, 2, 3, 0, 1, 2]
    normal3f[] normals = [(0, 0, 1), (0, 1, 0)] ( interpolation = "uniform" )
"""
    inputs = "color3f inputs:diffuseColor.connect = </Paint/Picture.outputs:rgb>"
    picture = """    def Shader "Picture"
    {
        uniform token info:id = "UsdUVTexture"
        asset inputs:file = @paint.png@
        float4 inputs:scale = (0.5, 1, 1, 1)
        float2 inputs:st.connect = </Paint/Reader.outputs:result>
        float3 outputs:rgb
    }
    def Shader "Reader"
    {
        uniform token info:id = "UsdPrimvarReader_float2"
        string inputs:varname = "st"
        float2 outputs:result
    }"""
    pixels = np.random.default_rng(0).integers(0, 255, (3, 5, 3), np.uint8)
    Image.fromarray(pixels).save(tmp_path / "paint.png")
    mesh, material = lone(
        written(tmp_path, bound("Paint", more) + PREVIEW.format(name="Paint", inputs=inputs, more=picture))
    )
    assert mesh.uv is not None and mesh.normals is not None and len(mesh.vertices) == 7
    # v goes upwards, as here: the triangle's three corners are places 0, 1 and 2 of the list.
    np.testing.assert_allclose(mesh.uv[mesh.faces[2]], [[0, 0], [1, 0], [1, 1]])
    np.testing.assert_allclose(mesh.normals[mesh.faces[2]], np.tile([0, 1, 0], (3, 1)), atol=1e-6)
    np.testing.assert_allclose(material.base_color, decode_srgb(pixels / 255) * [0.5, 1, 1], atol=1e-5)
    assert (material.metallic, material.roughness, material.name) == (0.0, 0.5, "Paint")
    # A package holds the same.
    from pxr import UsdUtils

    package = UsdUtils.CreateNewUsdzPackage  # pyright: ignore[reportAttributeAccessIssue]
    assert package(str(tmp_path / "a.usda"), str(tmp_path / "a.usdz"))
    (tmp_path / "paint.png").unlink()
    _, packed = lone(tmp_path / "a.usdz")
    np.testing.assert_array_equal(np.asarray(packed.base_color), np.asarray(material.base_color))
    with pytest.raises(UnreadableFile, match=r"the picture of diffuseColor, paint\.png, cannot be read"):
        read_meshes(tmp_path / "a.usda")


def test_shares_come_from_one_channel_as_stored(tmp_path):
    inputs = """float inputs:roughness.connect = </Paint/Picture.outputs:g>
        float inputs:metallic = 1
        color3f inputs:diffuseColor = (1, 0.72, 0.32)
        color3f inputs:emissiveColor = (0, 0, 4)
        float inputs:clearcoat = 0.5"""
    picture = '    def Shader "Picture"\n    {\n        uniform token info:id = "UsdUVTexture"\n'
    picture += "        asset inputs:file = @paint.png@\n        float outputs:g\n    }"
    Image.fromarray(np.array([[[0, 51, 0], [0, 204, 0]]], np.uint8)).save(tmp_path / "paint.png")
    st = '    texCoord2f[] primvars:st = [(0, 0), (1, 0), (1, 1), (0, 1), (2, 0)] ( interpolation = "vertex" )\n'
    text = bound("Paint", st) + PREVIEW.format(name="Paint", inputs=inputs, more=picture)
    _, material = lone(written(tmp_path, text))
    np.testing.assert_allclose(material.roughness, [[0.2, 0.8]], atol=1e-6)
    assert (material.metallic, material.clearcoat, material.clearcoat_roughness) == (1.0, 0.5, pytest.approx(0.01))
    assert material.base_color == pytest.approx((1, 0.72, 0.32)) and material.emission == (0.0, 0.0, 4.0)


@pytest.mark.parametrize(
    "inputs, wanted",
    [
        ("float inputs:opacity = 0\n float inputs:ior = 1.33", {"transmission": 1.0, "alpha": 1.0, "ior": 1.33}),
        ("float inputs:opacity = 0.25", {"transmission": 0.75, "alpha": 1.0}),
        ('float inputs:opacity = 0.25\n token inputs:opacityMode = "presence"', {"transmission": 0.0, "alpha": 0.25}),
        ("float inputs:opacity = 0.25\n float inputs:opacityThreshold = 0.5", {"transmission": 0.0, "alpha": 0.0}),
    ],
)
def test_opacity_is_glass_or_presence(tmp_path, inputs, wanted):
    _, material = lone(written(tmp_path, bound("Glass") + PREVIEW.format(name="Glass", inputs=inputs, more="")))
    for field, value in wanted.items():
        assert getattr(material, field) == pytest.approx(value)


def test_faces_may_have_materials_of_their_own(tmp_path):
    subset = """    uniform token subsetFamily:materialBind:familyType = "nonOverlapping"
    def GeomSubset "Part" ( prepend apiSchemas = ["MaterialBindingAPI"] )
    {
        uniform token elementType = "face"
        uniform token familyName = "materialBind"
        int[] indices = [1]
        rel material:binding = </Two>
    }
"""
    text = bound("One", subset)
    for name, red in (("One", 0.25), ("Two", 0.75)):
        text += PREVIEW.format(name=name, inputs=f"color3f inputs:diffuseColor = ({red}, 0, 0)", more="")
    meshes = read_meshes(written(tmp_path, text))
    found = {(len(m.faces), m.material.base_color) for m in meshes if isinstance(m.material, Material)}
    assert found == {(1, (0.75, 0.0, 0.0)), (2, (0.25, 0.0, 0.0))}


def test_what_is_not_rendered_is_left_out_or_named(tmp_path):
    hidden = square('    token visibility = "invisible"\n', "Hidden") + square(
        '    uniform token purpose = "guide"\n', "Guide"
    )
    cage = square(name="Cage").replace('uniform token subdivisionScheme = "none"', "")
    other = 'def Sphere "Ball"\n{\n}\n' + bound("Strange").replace("Square", "Odd")
    other += 'def Material "Strange"\n{\n}\n'
    with pytest.warns(UserWarning, match="not rendered") as caught:
        meshes = read_meshes(written(tmp_path, hidden + cage + other))
    assert sorted(mesh.name for mesh in meshes) == ["Cage", "Odd"]
    said = str(caught[0].message)
    for words in ("the subdivision of Cage", "Sphere Ball", 'of material "Strange": its shader'):
        assert words in said
    assert len(caught) == 1


@needs_shared
def test_colours_lie_as_the_file_says():
    """https://github.com/usd-wg/assets, PrimvarInterpolation: the same two squares, coloured in every way."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        meshes = {mesh.name: mesh for mesh in read_meshes(SHARED / "primvar_interpolation.usda")}
    constant = meshes["constant"].material
    assert isinstance(constant, Material) and constant.base_color == pytest.approx((1, 0.3, 0.3))
    for name, mesh in meshes.items():
        assert isinstance(mesh.material, Material)
        assert name == "constant" or np.asarray(mesh.material.base_color).shape[2] == 3
        assert mesh.vertices[:, 2] == pytest.approx(-0.1, abs=1e-6)
    # Point 0, (−1, 0, 0), is red; point 2, in the middle above, is white.
    vertex = meshes["vertex"]
    image, uv = np.asarray(vertex.material.base_color), vertex.uv  # type: ignore[union-attr]
    assert uv is not None
    low = vertex.vertices[:, :2].min(0)
    for place, wanted in ((low, (1, 0, 0)), (low + 0.01, (1, 1, 1))):
        corner = int(np.linalg.norm(vertex.vertices[:, :2] - place, axis=1).argmin())
        column, row = uv[corner] * [image.shape[1], -image.shape[0]] + [0, image.shape[0]]
        np.testing.assert_allclose(image[int(row), int(column)], wanted, atol=1e-5)


@needs_shared
def test_a_chess_pawn_stands_in_metres():
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        meshes = read_meshes(SHARED / "Pawn" / "Pawn.usd")
    assert "Pawn_mat.mtlx" in str(caught[0].message) and "the subdivision of" in str(caught[1].message)
    points = np.concatenate([mesh.vertices for mesh in meshes])
    # The box that OpenUSD itself finds from the extents that the file holds.
    from pxr import Usd, UsdGeom

    stage = Usd.Stage.Open(str(SHARED / "Pawn" / "Pawn.usd"))  # pyright: ignore[reportAttributeAccessIssue]
    now = Usd.TimeCode.EarliestTime()  # pyright: ignore[reportAttributeAccessIssue]
    cache = UsdGeom.BBoxCache(now, ["default", "render"])  # pyright: ignore[reportAttributeAccessIssue]
    box = cache.ComputeWorldBound(stage.GetPseudoRoot()).ComputeAlignedRange()
    np.testing.assert_allclose(points.min(0), box.GetMin(), atol=1e-4)
    np.testing.assert_allclose(points.max(0), box.GetMax(), atol=1e-4)
    assert 0.06 < np.ptp(points[:, 1]) < 0.07
    assert "\n" not in str(caught[-1].message)


def test_damaged_files_are_one_line(tmp_path, capfd):
    good = written(tmp_path, square()).read_text()
    wrong = [good[:60], good.replace("faceVertexCounts = [4, 3]", "faceVertexCounts = [4, 4]")]
    wrong += [good.replace("[0, 1, 2, 3, 1, 4, 2]", "[0, 1, 2, 3, 1, 9, 2]"), "#usda 1.0\n"]
    for text in wrong:
        (tmp_path / "b.usda").write_text(text)
        with pytest.raises(UnreadableFile) as caught:
            read_meshes(tmp_path / "b.usda")
        assert "\n" not in str(caught.value) and "b.usda" in str(caught.value)
    (tmp_path / "c.usdc").write_bytes(b"PXR-USDC" + bytes(200))
    with pytest.raises(UnreadableFile, match=r"c\.usdc"):
        read_meshes(tmp_path / "c.usdc")
    assert capfd.readouterr().err == ""


def test_a_picture_without_coordinates_becomes_its_mean(tmp_path):
    Image.fromarray(np.array([[[255, 0, 0], [0, 0, 255]]], np.uint8)).save(tmp_path / "paint.png")
    picture = """
    def Shader "Picture"
    {
        uniform token info:id = "UsdUVTexture"
        asset inputs:file = @paint.png@
        float3 outputs:rgb
    }"""
    inputs = "color3f inputs:diffuseColor.connect = </Paint/Picture.outputs:rgb>"
    path = written(tmp_path, bound("Paint") + PREVIEW.format(name="Paint", inputs=inputs, more=picture))
    with pytest.warns(UserWarning, match="textures without coordinates"):
        _, material = lone(path)
    assert material.base_color == pytest.approx((0.5, 0, 0.5))
