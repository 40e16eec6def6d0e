"""The files that a mesh names beside itself, of every kind that names any."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

import relume as rl
from relume.errors import UnreadableFile


def test_each_kind_names_what_is_read_of_it(tmp_path: Path):
    gltf = {
        "asset": {"version": "2.0"},
        "buffers": [{"uri": "a%20b.bin", "byteLength": 1}, {"uri": "data:;base64,AA==", "byteLength": 1}],
        "images": [{"uri": "maps\\wood.png"}, {"bufferView": 0}, {"uri": "a%20b.bin"}],
    }
    texts = {
        "chair.gltf": json.dumps(gltf),
        "body.obj": "mtllib my body.mtl\nv 0 0 0\n# mtllib other.mtl\n",
        "my body.mtl": "newmtl a\nmap_Kd -s 1 1 1 maps\\red.png # the paint\nmap_Bump bump.png\n",
        "points.ply": "ply\n",
    }
    for name, text in texts.items():
        (tmp_path / name).write_text(text, encoding="utf-8")
    found = {name: rl.scene.files_beside_mesh(tmp_path / name) for name in texts}
    assert found == {
        "chair.gltf": ("a b.bin", "maps/wood.png"), "body.obj": ("my body.mtl",), "my body.mtl": ("maps/red.png",),
        "points.ply": (),
    }  # fmt: skip


def test_a_usd_file_names_its_layers_and_pictures(tmp_path: Path):
    pytest.importorskip("pxr", reason="usd-core is not installed")
    layer = (
        '#usda 1.0\n( subLayers = [@./below.usda@] )\ndef "Thing" ( references = @parts/body.usdc@</A> )\n'
        "{\n asset picture = @maps/wood.<UDIM>.png@\n}\n"
    )
    (tmp_path / "thing.usda").write_text(layer, encoding="utf-8")
    found = rl.scene.files_beside_mesh(tmp_path / "thing.usda")
    assert sorted(found) == ["./below.usda", "maps/wood.<UDIM>.png", "parts/body.usdc"]


@pytest.mark.parametrize(
    ("name", "content"), [("a.gltf", b"{"), ("a.gltf", b"[]"), ("a.glb", b"glTF"), ("a.usda", b"none"), ("b.obj", None)]
)
def test_what_cannot_be_read_is_named_in_a_line(tmp_path: Path, name: str, content: bytes | None):
    if name.endswith(".usda"):
        pytest.importorskip("pxr", reason="usd-core is not installed")
    if content is not None:
        (tmp_path / name).write_bytes(content)
    with pytest.raises(UnreadableFile, match=name.replace(".", r"\.")) as raised:
        rl.scene.files_beside_mesh(tmp_path / name)
    assert "\n" not in str(raised.value)
