"""A baked place as .glb and .usda: read again, its radiance is what was baked, far above what 8 bits hold."""

import json
import struct
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import relume as rl
import virtual_place as place
from relume.report.shots import place_files


@pytest.fixture(scope="module")
def baked():
    return rl.renderers.bake(place.meshes(), place.photographs(), texel=0.1)


@pytest.mark.parametrize("suffix", ["glb", "usda"])
def test_a_place_comes_back_with_its_radiance(baked, tmp_path, suffix):
    if suffix == "usda":
        pytest.importorskip("pxr")
    written = rl.report.write_place(tmp_path / f"hall.{suffix}", baked)
    assert written.holes == baked.holes and len(written.textures) == len(written.masks) == 3
    read: dict[str, Any] = {mesh.name.split("/")[-1]: mesh for mesh in rl.read_meshes(written.main)}
    for part in baked.parts:
        mesh = read[part.mesh.name]
        assert part.mesh.uv is not None
        assert np.array_equal(mesh.material.emission, part.radiance)
        assert np.allclose(mesh.vertices[mesh.faces], part.mesh.vertices[part.mesh.faces], atol=1e-6)
        assert np.allclose(mesh.uv[mesh.faces], part.mesh.uv[part.mesh.faces], atol=1e-6)
    assert max(part.radiance.max() for part in baked.parts) > 30


def test_what_lies_beside_a_place_is_known(baked, tmp_path):
    written = rl.report.write_place(tmp_path / "hall.glb", baked)
    assert set(rl.scene.files_beside_mesh(written.main)) == {path.name for path in written.textures}
    assert "hall_room_emissiveColor.exr" in [path.name for path in written.textures]
    written.textures[0].unlink()
    with pytest.warns(UserWarning, match=r"its radiance in hall_room_emissiveColor\.exr, which is missing"):
        room: Any = next(mesh for mesh in rl.read_meshes(written.main) if mesh.name == "room")
    assert room.material.emission.max() < 5  # what the picture of 8 bits holds


def test_any_viewer_finds_an_emissive_texture(baked, tmp_path):
    written = rl.report.write_place(tmp_path / "hall.glb", baked)
    data = written.main.read_bytes()
    header = json.loads(data[20 : 20 + struct.unpack_from("<I", data, 12)[0]])
    material = header["materials"][0]
    assert material["extras"] == {"relume_radiance": "hall_room_emissiveColor.exr"}
    assert "emissiveTexture" in material and material["pbrMetallicRoughness"]["baseColorFactor"][:3] == [0, 0, 0]


def test_holes_are_drawn(baked, tmp_path):
    written = rl.report.write_place(tmp_path / "hall.glb", baked)
    mask = rl.read_photograph(written.masks[1]).pixels
    part = baked.parts[1]
    assert np.array_equal(mask[..., 0] > 0, part.used & ~part.seen) and mask.any()


def test_names_differ_by_more_than_their_case(baked):
    parts = [replace(baked.parts[0], mesh=replace(baked.parts[0].mesh, name=name)) for name in ("Wall", "wall", "WALL")]
    names = place_files._names(replace(baked, parts=tuple(parts)))
    assert names == ["Wall", "wall_1", "WALL_2"]
    parts = [replace(parts[0], mesh=replace(parts[0].mesh, name=name)) for name in ("a_2", "A", "a")]
    assert place_files._names(replace(baked, parts=tuple(parts))) == ["a_2", "A", "a_3"]


def test_other_files_are_refused(baked, tmp_path):
    with pytest.raises(ValueError, match=r"as \.glb or \.usda"):
        rl.report.write_place(tmp_path / "hall.obj", baked)
    with pytest.raises(rl.errors.OutputNotWritten):
        rl.report.write_place(tmp_path / "nowhere" / "hall.glb", baked)
