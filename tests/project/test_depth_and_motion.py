"""Depth and motion from EXRs as programs write them: two channels, layers in names, many in one part."""

import numpy as np
import pytest

from command_line import refused
from relume.errors import UnreadableFile
from relume.image import files
from relume.image.files.exr.parts import Part, write_parts
from relume.image.radiance import RadianceMap
from relume.project.developing.depth_and_motion import read_depth, read_motion

RIGHT, DOWN = np.full((6, 9), 3.5, np.float32), np.full((6, 9), -2.0, np.float32)
DEPTH = np.full((6, 9), 7.0, np.float32)


def colours() -> dict[str, np.ndarray]:
    return {name: np.ones((6, 9), np.float32) for name in "RGB"}


@pytest.mark.parametrize(
    "channels",
    [
        {"R": RIGHT, "G": DOWN},
        {"motion.R": RIGHT, "motion.G": DOWN},
        {**colours(), "motion.R": RIGHT, "motion.G": DOWN, "depth.Z": DEPTH},
        {"R": RIGHT.astype(np.float16), "G": DOWN.astype(np.float16), "B": DEPTH.astype(np.float16)},
    ],
    ids=["two", "named", "beside a picture", "half"],
)
def test_motion_is_right_in_r_and_down_in_g(tmp_path, channels):
    write_parts(tmp_path / "motion.exr", [Part("", channels, {})])
    motion = read_motion(tmp_path / "motion.exr")
    assert motion.dtype == np.float32 and motion.flags.c_contiguous
    np.testing.assert_array_equal(motion, np.stack([RIGHT, DOWN], axis=-1))


@pytest.mark.parametrize("name", ["Z", "depth.Z", "ViewLayer.Depth.Z"])
def test_depth_is_found_beside_a_picture(tmp_path, name):
    write_parts(tmp_path / "render.exr", [Part("", {**colours(), name: DEPTH}, {})])
    np.testing.assert_array_equal(read_depth(tmp_path / "render.exr", 100.0), DEPTH)


@pytest.mark.parametrize(
    "own", [("objects", "matte", "difference"), ("radiance", "matte", "normal")], ids=["insert", "render"]
)
def test_depth_of_our_own_layers_is_along_the_rays(tmp_path, own):
    files.write_layers(tmp_path / "layers.exr", {name: DEPTH for name in (*own, "depth")})
    depth = read_depth(tmp_path / "layers.exr", 4.0)
    assert depth[0, 0] == pytest.approx(7 / np.sqrt(1 + (4**2 + 2.5**2) / 4**2))
    np.testing.assert_array_equal(read_depth(tmp_path / "layers.exr", 4.0, "axis"), DEPTH)


def test_planes_that_lack_what_is_needed_are_refused(tmp_path):
    files.write_layers(tmp_path / "one.exr", {"motion": DEPTH})
    with pytest.raises(UnreadableFile, match=r"holds only Y; motion needs two, right in R and down in G"):
        read_motion(tmp_path / "one.exr")
    write_parts(tmp_path / "other.exr", [Part("", {**colours(), "albedo.R": DEPTH}, {})])
    with pytest.raises(UnreadableFile, match="no layer named motion but part 0, albedo; name it so"):
        read_motion(tmp_path / "other.exr")


def test_other_formats_are_reported_that_an_exr_is_needed_and_what_for(tmp_path, capsys):
    files.write(tmp_path / "a.hdr", RadianceMap(np.ones((6, 9, 3), np.float32)))
    words = ["develop", str(tmp_path / "a.hdr"), "-o", str(tmp_path / "a.png")]
    line = refused([*words, "--vectors", str(tmp_path / "a.hdr"), "--set", "motion.kind='vectors'"], capsys)
    assert "--vectors" in line and "a HDR file; expected an EXR with channels R and G of pixels right and down" in line
    line = refused(
        [*words, "--depth", str(tmp_path / "a.hdr"), "--focus", "2", "--aperture", "2", "--lens", "50"], capsys
    )
    assert "--depth" in line and "a HDR file; expected an EXR with a channel of metres" in line
