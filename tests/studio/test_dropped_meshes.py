"""Meshes dropped with the files that they name: a glTF's buffer and picture, an OBJ's .mtl, layers of USD."""

from __future__ import annotations

import base64
import json
import os
import time
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

import relume as rl
from browsing import Tab, opened
from one_studio import OneStudio
from relume.studio.shots import bundles, studio
from relume.studio.shots.bundles import Bundle, Listed
from relume.studio.shots.folder import Folder
from relume.studio.shots.studio import _application
from serving import Server
from small_shot import TEXT, camera

for needed in ("uvicorn", "tomlkit"):
    pytest.importorskip(needed, reason="the extra studio is not installed")

CORNERS = np.array([[-0.04, 0, 0], [0.04, 0, 0], [0.04, 0.08, 0], [-0.04, 0.08, 0]], "<f4")
USDA = """#usda 1.0
(
    upAxis = "Y"
    metersPerUnit = 1
    subLayers = [@./parts/body.usda@]
)
"""
BODY = """#usda 1.0
(
    upAxis = "Y"
    metersPerUnit = 1
)
def Mesh "Body"
{
    uniform token subdivisionScheme = "none"
    int[] faceVertexCounts = [4]
    int[] faceVertexIndices = [0, 1, 2, 3]
    point3f[] points = [(-0.04, 0, 0), (0.04, 0, 0), (0.04, 0.08, 0), (-0.04, 0.08, 0)]
}
"""
OBJ = (
    b"mtllib body.mtl\nv -0.04 0 0\nv 0.04 0 0\nv 0.04 0.08 0\nv -0.04 0.08 0\n"
    b"vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nusemtl wood\nf 1/1 2/2 3/3 4/4\n"
)


@pytest.fixture(scope="module")
def small(looked_studio: OneStudio) -> Path:
    return looked_studio.folder


@pytest.fixture(scope="module")
def small_server(looked_studio: OneStudio) -> Server:
    return looked_studio.server


@pytest.fixture
def page(browser: Any, small: Path, small_server: Server) -> Iterator[Tab]:
    small_server.post("/shot/undo", {"by": 10_000})
    assert (small / "shot.toml").read_text(encoding="utf-8") == TEXT
    with opened(browser, small_server.address, refusals=True) as tab:
        tab.press("Alt+6")
        tab.until(lambda: tab.tab.locator("#overlay path").count() > 0, "the object")
        tab.tab.locator("#objects-look").uncheck()
        yield tab


def red_picture() -> bytes:
    return bytes(cv2.imencode(".png", np.full((4, 4, 3), (30, 40, 220), np.uint8))[1])


def chair() -> dict[str, bytes]:
    """A glTF whose picture is said to lie in a folder beside."""
    places = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], "<f4")
    faces = np.array([0, 1, 2, 0, 2, 3], "<u2")
    parts = [CORNERS.tobytes(), places.tobytes(), faces.tobytes()]
    starts = np.cumsum([0, *map(len, parts)])
    header = {
        "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0, "TEXCOORD_0": 1}, "indices": 2, "material": 0}]}],
        "materials": [{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}, "metallicFactor": 0}}],
        "textures": [{"source": 0}], "images": [{"uri": "textures/the%20wood.png"}],
        "buffers": [{"uri": "chair.bin", "byteLength": int(starts[-1])}],
        "bufferViews": [{"buffer": 0, "byteOffset": int(starts[i]), "byteLength": len(parts[i])} for i in range(3)],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3",
             "min": CORNERS.min(0).tolist(), "max": CORNERS.max(0).tolist()},
            {"bufferView": 1, "componentType": 5126, "count": 4, "type": "VEC2"},
            {"bufferView": 2, "componentType": 5123, "count": 6, "type": "SCALAR"},
        ],
    }  # fmt: skip
    return {"chair.gltf": json.dumps(header).encode(), "chair.bin": b"".join(parts), "the wood.png": red_picture()}


def body() -> dict[str, bytes]:
    return {"body.obj": OBJ, "body.mtl": b"newmtl wood\nKd 1 1 1\nmap_Kd maps\\red.png\n", "red.png": red_picture()}


def drop(page: Tab, files: dict[str, bytes], at: tuple[float, float]) -> None:
    """Let files fall on the picture."""
    x, y = page.point_at(*at)
    page.tab.evaluate(
        "([files, x, y]) => { const data = new DataTransfer();"
        "for (const [name, text] of files) data.items.add(new File([Uint8Array.from(atob(text), (c) =>"
        " c.charCodeAt(0))], name));"
        "document.getElementById('picture').dispatchEvent(new DragEvent('drop', { dataTransfer: data, clientX: x,"
        " clientY: y, bubbles: true, cancelable: true })); }",
        [[[name, base64.b64encode(content).decode()] for name, content in files.items()], x, y],
    )


def objects(folder: Path) -> list[dict[str, Any]]:
    return tomllib.loads((folder / "shot.toml").read_text(encoding="utf-8"))["objects"]


def together(server: Server, files: list[tuple[str, bytes]]) -> tuple[int, Any]:
    line = json.dumps([[name, len(content)] for name, content in files]).encode() + b"\n"
    return server.post("/uploads/together", line + b"".join(content for _, content in files))


def colour_of(mesh: rl.Mesh) -> np.ndarray:
    assert isinstance(mesh.material, rl.Material)
    return np.asarray(mesh.material.base_color).reshape(-1, 3).mean(0)


def left_in(folder: Path) -> list[str]:
    return sorted(each.relative_to(folder).as_posix() for each in (folder / "objects").rglob("*") if each.is_file())


def test_a_gltf_is_dropped_with_its_buffer_and_picture_and_stands_where_it_fell(page: Tab, small: Path):
    fell = camera().project(np.array([0.2, 0.0, 0.1]))
    drop(page, {**chair(), "licence.txt": b"free"}, (float(fell[0]), float(fell[1])))
    page.until(lambda: len(objects(small)) == 2, "the chair")
    assert objects(small)[1] == {"mesh": "objects/chair/chair.gltf", "stand": pytest.approx([0.2, 0.1], abs=2e-3)}
    page.until(lambda: "left out, as no part of a mesh: licence.txt" in page.text("#message"), "what was left out")
    (mesh,) = rl.read_meshes(small / "objects/chair/chair.gltf")
    assert np.ptp(mesh.vertices, axis=0) == pytest.approx([0.08, 0.08, 0], abs=1e-6)
    assert colour_of(mesh) == pytest.approx([0.716, 0.0212, 0.0130], rel=0.02)  # sRGB 220, 40, 30
    page.settle()
    page.until(lambda: page.tab.evaluate("() => document.querySelectorAll('.things button').length") == 2, "the list")
    # What it names and was not dropped is said, and nothing of it is kept.
    before = left_in(small)
    drop(page, {key: value for key, value in chair().items() if key != "chair.bin"}, (96, 64))
    page.until(
        lambda: "chair.gltf names chair.bin, which was not dropped with it" in page.text("#message"), "the refusal"
    )
    assert left_in(small) == before and len(objects(small)) == 2


def test_an_obj_and_usd_files_are_chosen_with_what_they_name(page: Tab, small: Path, tmp_path: Path):
    utilities = pytest.importorskip("pxr.UsdUtils", reason="usd-core is not installed")
    for name, content in body().items():
        (tmp_path / name).write_bytes(content)
    chooser = page.tab.locator('input[type="file"]')
    chooser.set_input_files([str(tmp_path / name) for name in body()])
    page.until(lambda: len(objects(small)) == 2, "the body")
    assert objects(small)[1]["mesh"] == "objects/body/body.obj"
    (mesh,) = rl.read_meshes(small / "objects/body/body.obj")
    assert colour_of(mesh) == pytest.approx([0.716, 0.0212, 0.0130], rel=0.02)  # sRGB 220, 40, 30
    # A layer of USD comes with the one that it stands on, wherever that lay; a .usdz by itself.
    page.settle()
    drop(page, {"thing.usda": USDA.encode(), "body.usda": BODY.encode()}, (96, 64))
    page.until(lambda: len(objects(small)) == 3, "the thing")
    assert objects(small)[2]["mesh"] == "objects/thing/thing.usda"
    (mesh,) = rl.read_meshes(small / "objects/thing/thing.usda")
    assert np.ptp(mesh.vertices, axis=0) == pytest.approx([0.08, 0.08, 0], abs=1e-6)
    (tmp_path / "whole.usda").write_text(BODY, encoding="utf-8")
    assert utilities.CreateNewUsdzPackage(str(tmp_path / "whole.usda"), str(tmp_path / "whole.usdz"))
    page.settle()
    chooser.set_input_files(str(tmp_path / "whole.usdz"))
    page.until(lambda: len(objects(small)) == 4, "the whole")
    assert objects(small)[3]["mesh"] == "objects/whole.usdz"
    page.until(lambda: page.tab.evaluate("() => document.querySelectorAll('.things button').length") == 4, "the list")
    assert page.tab.locator("#pane .doubt").count() == 0


def test_files_with_folders_keep_them_and_no_name_leads_elsewhere(small_server: Server, small: Path):
    layers = [("layered/layered.usda", USDA.encode()), ("layered/parts/body.usda", BODY.encode())]
    pytest.importorskip("pxr", reason="usd-core is not installed")
    status, answer = together(small_server, layers)
    assert (status, answer["left_out"]) == (200, [])
    (mesh,) = answer["meshes"]
    place = small / Path(mesh).parent
    assert (place / "parts" / "body.usda").read_text(encoding="utf-8") == BODY
    before = left_in(small)
    chosen = chair()
    for name in ("../x.bin", "/x.bin", "a/../x.bin", "a\\x.bin", ".hidden.bin", "a//x.bin", "x.bin\u0000", "C:x.bin"):
        status, answer = together(small_server, [("chair.gltf", chosen["chair.gltf"]), (name, b"1")])
        assert status == 422 and "is no name for a file here" in answer["error"], name
    outside = chosen["chair.gltf"].replace(b"chair.bin", b"../shot.toml")
    status, answer = together(small_server, [("chair.gltf", outside), ("shot.bin", b"1")])
    assert status == 422 and "is not below it" in answer["error"]
    # Too few bytes, too many, a list that is none.
    listing = json.dumps([["chair.gltf", 10]]).encode() + b"\n"
    for content, said in (
        (listing + b"12345", "ended too early"), (listing + b"1" * 11, "more came than was listed"),
        (b"nothing\n", "in the first line"), (b"[]\n", "give 1 to"), (b'[["a.gltf", -1]]\n', "number of bytes"),
        (json.dumps([["a.txt", 1]]).encode() + b"\n1", "there is no mesh"),
        (json.dumps([["a.ply", 0], ["A.ply", 0]]).encode() + b"\n", "have one name"),
    ):  # fmt: skip
        status, answer = small_server.post("/uploads/together", content)
        assert status == 422 and said in answer["error"], content
    assert left_in(small) == before
    assert not [each for each in (small / "objects").iterdir() if each.name.startswith(".")]


def naming(picture: str) -> bytes:
    """A glTF that names its buffer and one picture."""
    return chair()["chair.gltf"].replace(b"textures/the%20wood.png", picture.encode())


def two_chairs() -> list[tuple[str, bytes]]:
    buffer = chair()["chair.bin"]
    return [
        ("old/chair.gltf", naming("wood.png")), ("old/chair.bin", buffer), ("new/chair.gltf", naming("wood.png")),
        ("new/chair.bin", buffer), ("new/wood.png", red_picture()),
    ]  # fmt: skip


def written(root: Path, files: list[tuple[str, bytes]]) -> Bundle:
    """A drop whose files are there, not yet settled."""
    bundle = Bundle(Folder(root), [Listed(name, len(content)) for name, content in files])
    (place,) = (root / "objects").glob(".dropped-*")
    for name, content in files:
        (place / name).parent.mkdir(parents=True, exist_ok=True)
        (place / name).write_bytes(content)
    return bundle


@pytest.mark.parametrize("order", [1, -1])
def test_what_one_mesh_finds_is_not_taken_from_it_for_another(tmp_path: Path, order: int):
    found = written(tmp_path, two_chairs()[::order]).settled()["meshes"]
    assert found == ["objects/chair/new/chair.gltf", "objects/chair/old/chair.gltf"]
    for name in found:
        assert colour_of(rl.read_meshes(tmp_path / name)[0]) == pytest.approx([0.716, 0.0212, 0.0130], rel=0.02)


def test_what_is_found_twice_takes_no_room_twice_and_none_that_is_not_there(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    written(tmp_path, two_chairs()).settled()
    pictures = [tmp_path / "objects/chair" / name / "wood.png" for name in ("old", "new")]
    assert pictures[0].samefile(pictures[1])

    def no_links(*_: object) -> None:
        raise PermissionError(1, "Operation not permitted")

    monkeypatch.setattr(os, "link", no_links)
    written(tmp_path, two_chairs()).settled()
    pictures = [tmp_path / "objects/chair-2" / name / "wood.png" for name in ("old", "new")]
    assert pictures[0].read_bytes() == pictures[1].read_bytes() and not pictures[0].samefile(pictures[1])
    monkeypatch.setattr(Folder, "room", lambda _: 10)
    bundle = written(tmp_path, two_chairs())
    with pytest.raises(rl.errors.OutputNotWritten, match=r"^old/wood\.png: cannot be written \(No space left"):
        bundle.settled()


def test_of_several_files_that_may_be_meant_none_is_taken(small_server: Server, small: Path):
    whole = [("chair.gltf", naming("textures/wood.png")), ("chair.bin", chair()["chair.bin"])]
    before = left_in(small)
    both = [*whole, ("red/wood.png", red_picture()), ("blue/wood.png", red_picture())]
    status, answer = together(small_server, both)
    assert status == 422 and answer["error"] == (
        "chair.gltf names textures/wood.png, which may be any of red/wood.png, blue/wood.png; drop it where it is named"
    )
    # Names are compared as they are, and not as patterns.
    strange = [("chair.gltf", naming("wood[12].png")), whole[1], ("wood1.png", red_picture())]
    status, answer = together(small_server, strange)
    assert status == 422 and "chair.gltf names wood[12].png, which was not dropped with it" in answer["error"]
    assert left_in(small) == before


def test_layers_that_name_each_other_without_an_end_are_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    pytest.importorskip("pxr", reason="usd-core is not installed")
    monkeypatch.setattr(bundles, "MOST_FILES", 100)  # each of the 2000 takes four milliseconds
    layers = [
        (f"{name}.usda", USDA.replace("./parts/body.usda", f"./in/{other}.usda").encode())
        for name, other in (("one", "two"), ("two", "one"))
    ]
    bundle = written(tmp_path, layers)
    with pytest.raises(ValueError, match="without an end"):
        bundle.settled()


def test_tiles_of_a_picture_get_the_place_and_the_name_that_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    tiles = ["Wood.1001.png", "sub/wood.1002.png"]
    files = [("body.obj", OBJ), ("body.mtl", b"newmtl wood\n"), *((name, red_picture()) for name in tiles)]
    monkeypatch.setattr(
        rl.scene, "files_beside_mesh", lambda path: ("maps/wood.<UDIM>.png",) if path.suffix == ".obj" else ()
    )
    written(tmp_path, files).settled()
    assert {f"maps/wood.{n}.png" for n in (1001, 1002)} <= {
        each.relative_to(tmp_path / "objects/body").as_posix() for each in (tmp_path / "objects").rglob("*.png")
    }


def test_what_cannot_be_written_is_said_in_a_line(
    small_server: Server, small: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    before = left_in(small)
    status, answer = together(small_server, [("body.obj", OBJ), ("a.bin", b"1"), ("a.bin/b.bin", b"1")])
    assert status == 422 and answer["error"].startswith("a.bin/b.bin: cannot be written (")
    # Another drop was quicker with the name.
    bundle = written(tmp_path, [("body.obj", OBJ), ("body.mtl", b"newmtl wood\n")])
    (tmp_path / "objects/body/taken").mkdir(parents=True)
    monkeypatch.setattr(os.path, "lexists", lambda _: False)
    with pytest.raises(rl.errors.OutputNotWritten, match=r"^objects/body: cannot be written \("):
        bundle.settled()
    assert left_in(small) == before


def test_a_refusal_names_the_file_as_it_was_dropped(small_server: Server):
    status, answer = together(small_server, [("parts/broken.gltf", b"{"), ("body.obj", OBJ)])
    assert status == 422 and answer["error"].startswith("parts/broken.gltf: ")
    assert ".dropped-" not in answer["error"]


def test_what_a_killed_server_left_of_a_drop_goes_when_the_studio_starts(tmp_path: Path):
    old, coming = (tmp_path / "objects" / f".dropped-{name}" for name in ("old", "coming"))
    for each in (old, coming):
        each.mkdir(parents=True)
        (each / "half.bin").write_bytes(b"1")
    (tmp_path / "objects/kept").mkdir()
    two_hours_ago = time.time() - 7200
    os.utime(old, (two_hours_ago, two_hours_ago))
    with _application(tmp_path / "shot.toml", tmp_path / "out") as begun:
        begun()
        assert sorted(each.name for each in (tmp_path / "objects").iterdir()) == [".dropped-coming", "kept"]


def test_usd_is_loaded_before_there_are_threads_that_could_wait_for_each_other(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    pytest.importorskip("pxr", reason="usd-core is not installed")
    loaded: list[str] = []
    monkeypatch.setattr(studio, "import_module", loaded.append)
    monkeypatch.setattr(studio, "serve", lambda *_, **__: loaded.append("served"))
    rl.open_studio(tmp_path, open_browser=False)
    assert loaded == ["pxr.Tf", "served"]
