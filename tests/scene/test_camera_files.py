"""Cameras of other programs: the same camera written as glTF, USD and by Blender's script comes back from each."""

import json
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from gltf_files import as_glb
from relume.errors import UnreadableFile
from relume.scene.cameras.blender import FORMAT, blender_camera_script
from relume.scene.cameras.camera import Camera
from relume.scene.cameras.files import read_camera
from relume.scene.cameras.grid import fit_grid
from relume.sphere.directions import rotation_about

CAMERA = Camera.looking_at(
    np.array([1.0, 0.8, 1.4]), np.array([0.1, 0.2, 0.1]), width=360, height=240, focal_length=350
)
Z_UP = np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])
"""Blender's frame from ours."""


def placed(camera=CAMERA, world=np.eye(3), unit=1.0):
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = world @ camera.rotation, world @ camera.position / unit
    return matrix


def written(folder, data, name):
    path = folder / name
    path.write_bytes(data if isinstance(data, bytes) else data.encode())
    return path


def same(found, expected=CAMERA):
    np.testing.assert_allclose(found.position, expected.position, atol=1e-12)
    np.testing.assert_allclose(found.rotation, expected.rotation, atol=1e-12)
    assert found.focal_length == pytest.approx(expected.focal_length, rel=1e-12)
    assert (found.width, found.height) == (expected.width, expected.height)
    return True


# --- glTF -----------------------------------------------------------------------------------------------------------


def gltf(nodes, cameras=None, scenes=({"nodes": [0]},)):
    lens = {"yfov": 2 * np.arctan(120 / 350), "aspectRatio": 1.5, "znear": 0.1}
    return {
        "asset": {"version": "2.0"}, "scene": 0, "scenes": list(scenes), "nodes": nodes,
        "cameras": cameras or [{"type": "perspective", "name": "lens", "perspective": lens}],
    }  # fmt: skip


def quaternion(rotation):
    """(x, y, z, w) by the eigenvector of eigenvalue 1 and the trace."""
    values, vectors = np.linalg.eig(rotation)
    axis = np.real(vectors[:, np.argmin(np.abs(values - 1))])
    angle = np.arccos((np.trace(rotation) - 1) / 2)
    sign = 1 if np.allclose(rotation_about(axis, angle), rotation) else -1
    return [*(sign * np.sin(angle / 2) * axis), np.cos(angle / 2)]


def test_a_gltf_camera_is_where_its_node_is(tmp_path):
    path = written(tmp_path, as_glb(gltf([{"camera": 0, "matrix": placed().T.ravel().tolist()}])), "a.glb")
    assert same(read_camera(path, 360, 240))


def test_a_gltf_camera_moves_with_the_nodes_above_it(tmp_path):
    nodes = [
        {"children": [1], "translation": [1.0, 2, 3], "scale": [2.0, 2, 2]},
        {"children": [2], "rotation": quaternion(rotation_about([1, 2, 3], 0.7))},
        {"camera": 0, "translation": [0.1, 0.2, 0.3], "rotation": quaternion(rotation_about([0, 1, 0], -0.4))},
    ]
    camera = read_camera(written(tmp_path, json.dumps(gltf(nodes)), "a.gltf"), 360, 240)
    turn = rotation_about([1, 2, 3], 0.7)
    position = np.array([1.0, 2, 3]) + 2 * turn @ [0.1, 0.2, 0.3]
    assert same(camera, Camera(360, 240, 350.0, position, turn @ rotation_about([0, 1, 0], -0.4)))


def test_of_several_gltf_cameras_one_is_named(tmp_path):
    nodes = [
        {"children": [1, 2], "name": "stage"},
        {"camera": 0, "name": "left", "translation": [-1.0, 0, 0]},
        {"camera": 0, "name": "right", "translation": [1.0, 0, 0]},
    ]
    path = written(tmp_path, json.dumps(gltf(nodes)), "a.gltf")
    assert read_camera(path, 360, 240, name="right").position.tolist() == [1, 0, 0]
    with pytest.raises(UnreadableFile, match="holds 'left', 'right'; give the name of one"):
        read_camera(path, 360, 240)
    with pytest.raises(UnreadableFile, match="0 of its cameras are named 'middle'; it holds 'left', 'right'"):
        read_camera(path, 360, 240, name="middle")


def test_a_gltf_camera_of_another_aspect_keeps_its_height_and_warns(tmp_path):
    path = written(tmp_path, json.dumps(gltf([{"camera": 0}])), "a.gltf")
    with pytest.warns(UserWarning, match=r"aspect is 1\.500, the picture's 2\.000; its vertical field of view is kept"):
        assert read_camera(path, 480, 240).focal_length == pytest.approx(350, rel=1e-12)


# --- USD ------------------------------------------------------------------------------------------------------------

USD = """#usda 1.0
(
    defaultPrim = "World"
    doc = \"\"\"two "lines"
of text\"\"\"
    {units}
    customLayerData = {{ string made = "here"; dictionary more = {{ int[] n = [1, 2] }} }}
)

class "_base"
{{
}}

def Xform "World" (
    prepend apiSchemas = ["A", "B"]
    variants = {{ string look = "a" }}
    prepend variantSets = "look"
)
{{
    {world}
    rel material:binding = </Materials/Red>
    custom string note
    # a comment with "quotes" {{
    def Camera "Main" (active = true)
    {{
        float2 clippingRange = (0.1, 100)
        float focalLength = 35
        float horizontalAperture = 36 (doc = "full frame")
        float verticalAperture = 24
        token projection = "perspective"
        {camera}
    }}
    variantSet "look" = {{
        "a" {{
            def Mesh "M" {{
            }}
        }}
        "b" {{
        }}
    }}
}}
"""


def usda(camera="", units="", world=""):
    return USD.format(camera=camera, units=units, world=world)


def usd_camera(attribute, name="A"):
    """The smallest layer with a camera."""
    return f'#usda 1.0\ndef Camera "{name}"\n{{\n{attribute}\n}}\n'


TWO_CAMERAS = usd_camera("") + 'def Camera "B"\n{\n}\n'


def transform(matrix):
    """USD's row vectors."""
    rows = ", ".join("(" + ", ".join(f"{v:.17g}" for v in row) + ")" for row in np.asarray(matrix).T)
    return f'matrix4d xformOp:transform = ( {rows} )\nuniform token[] xformOpOrder = ["xformOp:transform"]'


def test_a_usd_camera_is_where_its_matrix_is_in_the_files_units(tmp_path):
    # USD's own unit is the centimetre, and +Y up.
    path = written(tmp_path, usda(transform(placed(unit=0.01))), "a.usda")
    assert same(read_camera(path, 360, 240))
    metres = usda(transform(placed(world=Z_UP)), 'metersPerUnit = 1\nupAxis = "Z"')
    assert same(read_camera(written(tmp_path, metres, "b.usd"), 360, 240, name="Main"))
    assert same(read_camera(written(tmp_path, usda(transform(placed(world=Z_UP))), "c.usda"), 360, 240, up="z", unit=1))


def test_usd_operations_are_applied_from_the_last_to_the_first(tmp_path):
    steps = """
        double3 xformOp:translate = (1, 2, 3)
        float3 xformOp:rotateXYZ = (10, 20, 30)
        float xformOp:rotateZ:roll = 40
        quatd xformOp:orient = (0.8, 0.6, 0, 0)
        float3 xformOp:scale = (2, 2, 2)
        double3 xformOp:translate:pivot = (5, 6, 7)
        uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:rotateXYZ", "xformOp:rotateZ:roll",
            "xformOp:orient", "xformOp:scale", "xformOp:translate:pivot", "!invert!xformOp:scale"]"""
    above = 'double3 xformOp:translate = (0, 100, 0)\nuniform token[] xformOpOrder = ["xformOp:translate"]'
    camera = read_camera(written(tmp_path, usda(steps, "metersPerUnit = 1", above), "a.usda"), 360, 240)

    def about(axis, degrees):
        return rotation_about(np.eye(3)[axis], np.radians(degrees))

    xyz = about(2, 30) @ about(1, 20) @ about(0, 10)  # x first
    turn = xyz @ about(2, 40) @ rotation_about([1, 0, 0], 2 * np.arctan2(0.6, 0.8))
    position = np.array([1.0, 102, 3]) + turn @ (2 * np.array([5.0, 6, 7]))
    assert same(camera, Camera(360, 240, 350.0, position, turn))
    reset = steps.replace('["xformOp:translate"', '["!resetXformStack!", "xformOp:translate"')
    alone = read_camera(written(tmp_path, usda(reset, "metersPerUnit = 1", above), "b.usda"), 360, 240)
    np.testing.assert_allclose(alone.position, position - [0, 100, 0], atol=1e-12)


def test_a_usd_lens_has_its_shift_and_its_depth_of_field(tmp_path):
    more = """float horizontalApertureOffset = 3.6
        float verticalApertureOffset = -1.2
        float fStop = 2.8
        float focusDistance = 250"""
    camera = read_camera(written(tmp_path, usda(more), "a.usda"), 360, 240)
    # The window moves right and down by a tenth and a twentieth: the axis meets the picture left of and above it.
    assert camera.centre == pytest.approx((180 - 36, 120 - 12))
    assert camera.aperture == pytest.approx(0.035 / 5.6) and camera.focus == pytest.approx(2.5)


def test_a_usd_camera_that_moves_is_taken_where_it_begins(tmp_path):
    steps = """double3 xformOp:translate.timeSamples = { 24: (7, 8, 9), 1: (100, 200, 300), }
        uniform token[] xformOpOrder = ["xformOp:translate"]"""
    with pytest.warns(UserWarning, match="camera 'Main' changes with time"):
        camera = read_camera(written(tmp_path, usda(steps), "a.usda"), 360, 240)
    assert camera.position.tolist() == [1, 2, 3]


def test_the_numbers_of_usds_own_camera_stand_in_for_what_is_left_out(tmp_path):
    path = written(tmp_path, '#usda 1.0\ndef Camera "A"\n{\n}\n', "a.usda")
    camera = read_camera(path, 20955, 15291)
    assert camera.focal_length == pytest.approx(50_000, rel=1e-6) and camera.aperture == 0 and camera.focus == np.inf


def openusd(*names) -> list[Any]:
    """Modules of OpenUSD, of any type: they get their names only as they are loaded."""
    return [pytest.importorskip(f"pxr.{name}", reason="needs the extra usd") for name in names]


def stage_with_a_camera(path):
    """A stage written by OpenUSD: the camera lies in a group that a variant places."""
    Gf, Usd, UsdGeom = openusd("Gf", "Usd", "UsdGeom")
    stage = Usd.Stage.CreateNew(str(path))
    UsdGeom.SetStageMetersPerUnit(stage, 1.0)
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.y)
    rig = UsdGeom.Xform.Define(stage, "/Rig")
    stage.SetDefaultPrim(rig.GetPrim())
    heights = rig.GetPrim().GetVariantSets().AddVariantSet("height")
    for name, height in (("low", 0.0), ("high", 5.0)):
        heights.AddVariant(name)
        heights.SetVariantSelection(name)
        with heights.GetVariantEditContext():
            UsdGeom.XformCommonAPI(rig).SetTranslate((0, height, 0))
    camera = UsdGeom.Camera.Define(stage, "/Rig/Main")
    camera.AddTransformOp().Set(Gf.Matrix4d(placed().T.tolist()))
    for attribute, value in ((camera.CreateFocalLengthAttr(), 35.0), (camera.CreateHorizontalApertureAttr(), 36.0)):
        attribute.Set(value)
    camera.CreateVerticalApertureAttr(24.0)
    stage.Save()
    return path


@pytest.mark.parametrize("suffix", [".usda", ".usdc", ".usd"])
def test_cameras_that_openusd_wrote_are_read_in_every_form(tmp_path, suffix):
    camera = read_camera(stage_with_a_camera(tmp_path / f"rig{suffix}"), 360, 240)
    assert same(camera, replace(CAMERA, position=CAMERA.position + np.array([0, 5, 0])))


def test_a_usd_package_references_and_variants_are_followed(tmp_path):
    rig = stage_with_a_camera(tmp_path / "rig.usdc")
    Sdf, Usd, UsdGeom, UsdUtils = openusd("Sdf", "Usd", "UsdGeom", "UsdUtils")
    room = Usd.Stage.CreateNew(str(tmp_path / "room.usda"))
    UsdGeom.SetStageMetersPerUnit(room, 1.0)
    there = room.DefinePrim("/Room")
    there.GetReferences().AddReference(rig.name)
    there.GetVariantSets().GetVariantSet("height").SetVariantSelection("low")
    room.Save()
    assert same(read_camera(tmp_path / "room.usda", 360, 240))
    assert UsdUtils.CreateNewUsdzPackage(Sdf.AssetPath(str(tmp_path / "room.usda")), str(tmp_path / "room.usdz"))
    assert same(read_camera(tmp_path / "room.usdz", 360, 240))


def test_a_usd_file_that_is_missing_beside_another_is_named(tmp_path, capfd):
    text = usd_camera("") + 'def "B" (prepend references = @./gone.usda@)\n{\n}\n'
    with pytest.warns(UserWarning, match="gone.usda"), pytest.warns(UserWarning, match="aspect"):
        read_camera(written(tmp_path, text, "a.usda"), 360, 240)
    assert capfd.readouterr().err == ""


# --- Blender --------------------------------------------------------------------------------------------------------


def blender_camera(**changes):
    return {
        "format": FORMAT, "matrix_world": placed(world=Z_UP).tolist(), "unit": 1.0, "lens": 35.0,
        "sensor_width": 36.0, "sensor_height": 24.0, "sensor_fit": "AUTO", "shift": [0.0, 0.0],
        "resolution": [1920, 1280], "pixel_aspect": [1.0, 1.0], "f_number": None, "focus": None,
    } | changes  # fmt: skip


def blender(folder, size=(360, 240), **changes):
    return read_camera(written(folder, json.dumps(blender_camera(**changes)), "camera.json"), *size)


def test_a_blender_camera_comes_back(tmp_path):
    assert same(blender(tmp_path))
    half = blender(tmp_path, unit=0.5, f_number=2.8, focus=3.0)
    np.testing.assert_allclose(half.position, CAMERA.position / 2, atol=1e-12)
    assert half.focus == 1.5 and half.aperture == pytest.approx(0.5 * 0.035 / 5.6)


@pytest.mark.parametrize(
    ("fit", "size", "focal_length", "centre"),
    [
        ("AUTO", (360, 240), 350.0, (180 - 36, 120 + 18)),
        ("AUTO", (240, 360), 350.0, (120 - 36, 180 + 18)),  # the width of the sensor lies along the longer side
        ("HORIZONTAL", (240, 360), 240 * 35 / 36, (120 - 24, 180 + 12)),
        ("VERTICAL", (360, 240), 350.0, (180 - 24, 120 + 12)),  # 24 mm along 240
        ("VERTICAL", (240, 360), 525.0, (120 - 36, 180 + 18)),
    ],
)
def test_blenders_sensor_fit_and_shift_are_obeyed(tmp_path, fit, size, focal_length, centre):
    camera = blender(tmp_path, size, sensor_fit=fit, shift=[0.1, 0.05], resolution=list(size))
    assert camera.focal_length == pytest.approx(focal_length) and camera.centre == pytest.approx(centre)


def test_the_script_is_python_that_writes_what_is_read(tmp_path, monkeypatch):
    """The script run with a stand-in for Blender, whose names are those of its Python interface."""
    import sys
    from types import ModuleType
    from types import SimpleNamespace as Names

    world = Names(__iter__=None)
    matrix = [tuple(row) for row in placed(world=Z_UP)]
    field = Names(use_dof=True, focus_distance=3.0, focus_object=None, aperture_fstop=2.8)
    lens = Names(
        type="PERSP", lens=35.0, sensor_width=36.0, sensor_height=24.0, sensor_fit="AUTO", shift_x=0.1, shift_y=0.0,
        dof=field,
    )  # fmt: skip
    camera = Names(data=lens, evaluated_get=lambda graph: Names(matrix_world=matrix))
    render = Names(resolution_x=1920, resolution_y=1280, pixel_aspect_x=1.0, pixel_aspect_y=1.0)
    bpy = ModuleType("bpy")
    bpy.context = Names(  # pyright: ignore[reportAttributeAccessIssue]
        scene=Names(
            camera=camera,
            render=render,
            unit_settings=Names(scale_length=1.0),
            frame_current=1,
            frame_start=1,
            frame_end=2,
            frame_set=lambda frame: None,
        ),
        evaluated_depsgraph_get=lambda: world,
    )
    bpy.data = Names(filepath=str(tmp_path / "scene.blend"))  # pyright: ignore[reportAttributeAccessIssue]
    monkeypatch.setitem(sys.modules, "bpy", bpy)
    exec(compile(blender_camera_script(), "script.py", "exec"), {})
    found = read_camera(tmp_path / "camera.json", 360, 240)
    assert same(found, replace(CAMERA, centre=(144.0, 120.0))) and found.centre == pytest.approx((144.0, 120.0))
    assert found.focus == 3.0 and found.aperture == pytest.approx(0.035 / 5.6)


def test_blenders_own_camera_of_the_room_is_the_one_its_grid_says(tmp_path, shared):
    from relume.image.files import read_photograph

    room = shared / "shoots" / "room"
    truth = json.loads((room / "truth" / "shoot.json").read_text())["plate_camera"]
    lens = 18 / np.tan(np.radians(truth["hfov_deg"]) / 2)
    camera = blender(
        tmp_path, (768, 512), matrix_world=truth["matrix_world"], lens=lens, resolution=[768, 512], sensor_height=99.0
    )
    fit = fit_grid(read_photograph(room / "plate_grid.jpg"), squares=(9, 6), square=0.03)
    # The printed board lies about 1 mm above the table, whose frame the truth is in.
    assert np.linalg.norm(fit.camera.position - camera.position) < 0.003
    assert fit.camera.focal_length == pytest.approx(camera.focal_length, rel=1e-4)
    assert np.abs(fit.camera.project(np.zeros(3)) - camera.project(np.array([0, 0.001, 0]))).max() < 1


# --- what cannot be used ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "data", "message"),
    [
        ("a.blend", b"BLENDER", r"no camera is read from files of kind \.blend; use \.glb"),
        ("camera", b"", "no camera is read from files without a suffix"),
        ("a.glb", b"glTF\x02", "not a readable glTF file"),
        ("a.gltf", json.dumps(gltf([{"name": "empty"}])), "holds no camera that a node places"),
        ("a.gltf", json.dumps(gltf([{"camera": 3}])), "its nodes cannot be followed"),
        ("a.gltf", json.dumps(gltf([{"children": [0]}])), "a node lies within itself"),
        ("a.gltf", json.dumps(gltf([{"camera": 0, "scale": [1, 2, 1]}])), "scaled unevenly"),
        ("a.gltf", json.dumps(gltf([{"camera": 0, "scale": [0, 0, 0]}])), "no extent"),
        ("a.gltf", json.dumps(gltf([{"camera": 0}], [{"type": "orthographic"}])), "no perspective field of view"),
        ("a.usdc", b"PXR-USDC\x00\x08", "not a readable USD file"),
        ("a.usdz", b"PK\x03\x04", "not a readable USD file"),
        ("a.usd", b"\xff\xfe\x00", "not a readable USD file"),
        ("a.usda", "def Camera", "not a readable USD file"),
        ("a.usda", '#usda 1.0\ndef Camera "A" {', "not a readable USD file .*Expected }"),
        ("a.usda", "#usda 1.0\n" + 'def "A" {' * 3000, "not a readable USD file"),
        ("a.usda", '#usda 1.0\ndef Mesh "A"\n{\n}', "holds no camera"),
        ("a.usda", TWO_CAMERAS, "holds 'A', 'B'; give the name of one"),
        ("a.usda", usd_camera('token projection = "orthographic"'), "not perspective"),
        ("a.usda", usd_camera("float focalLength = 0"), "a lens of 0.0 on a sensor"),
        ("a.usda", usd_camera('float focalLength = "x"'), "not a readable USD file .*Failed to parse value"),
        (
            "a.usda",
            usd_camera('float3 xformOp:scale = (0, 0, 0)\nuniform token[] xformOpOrder = ["xformOp:scale"]'),
            "no extent",
        ),
        ("a.json", "{}", "not a camera; expected what fSpy exports, or what relume's script writes"),
        ("a.json", "{", "not valid JSON"),
        ("a.json", json.dumps(blender_camera(lens=0)), "a lens of 0"),
        ("a.json", json.dumps(blender_camera(resolution=[100, 100])), "made for a picture of 100×100, not 360×240"),
        ("a.json", json.dumps(blender_camera(pixel_aspect=[2, 1])), "pixels are not square"),
        ("a.json", json.dumps(blender_camera(focus=-1.0)), "focus -1.0"),
        ("a.json", json.dumps({"format": FORMAT}), "its camera lacks something"),
    ],
)
@pytest.mark.filterwarnings("ignore:.*aspect is")
def test_a_file_that_cannot_be_used_says_so_in_one_line(tmp_path, name, data, message):
    path = written(tmp_path, data, name)
    with pytest.raises(UnreadableFile, match=message) as caught:
        read_camera(path, 360, 240)
    assert str(path) in str(caught.value) and "\n" not in str(caught.value)


def test_files_that_are_missing_and_names_that_are_not_needed(tmp_path):
    for name in ("a.glb", "a.usda", "a.json", "a.fspy"):
        with pytest.raises(UnreadableFile, match=r"cannot be read \(No such file"):
            read_camera(tmp_path / name, 360, 240)
    with pytest.raises(UnreadableFile, match="holds one camera only; leave the name 'x' out"):
        read_camera(tmp_path / "a.json", 360, 240, name="x")
