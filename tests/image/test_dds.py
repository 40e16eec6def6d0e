"""DDS textures of light: cubes and pictures of floats, halves, BC6H and packed floats, and what is no light."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np
import pytest

from relume.errors import FormatError, UnreadableFile
from relume.image import files
from relume.image.files.description import describe
from relume.image.files.read_options import ReadOptions
from relume.sphere.environment_files import read_environment


def dds(size: tuple[int, int], pixels: bytes, *, code: int | bytes, cube: bool = False, levels: int = 1) -> bytes:
    """By Microsoft's programming guide; a number is a DXGI_FORMAT in the second header, letters are the old code."""
    width, height = size
    letters = code if isinstance(code, bytes) else b"DX10"
    inner = struct.pack("<2I4s5I", 32, 4, letters, 0, 0, 0, 0, 0)
    head = struct.pack("<7I", 124, 0x21007, height, width, 0, 0, levels) + bytes(44) + inner
    head += struct.pack("<5I", 0x401008, 0xFE00 if cube else 0, 0, 0, 0)
    assert len(head) == 124
    second = b"" if isinstance(code, bytes) else struct.pack("<5I", code, 3, 4 if cube else 0, 1, 0)
    return b"DDS " + head + second + pixels


def written(path: Path, *given: object, **named: object) -> Path:
    path.write_bytes(dds(*given, **named))  # type: ignore[arg-type]
    return path


def test_a_cube_of_halves_is_a_strip_that_lights_its_axes(tmp_path):
    """Each face of one level alone; the levels behind it are passed over."""
    faces = b""
    for face in range(6):
        for side in (4, 2, 1):
            texels = np.ones((side, side, 4), "<f2")
            texels[..., :3] = face + 1 if side == 4 else 99
            faces += texels.tobytes()
    path = written(tmp_path / "a.dds", (4, 4), faces, code=struct.pack("<I", 113), cube=True, levels=3)
    light = read_environment(path)
    axes = np.array([[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]], np.float64)
    assert light.mapping.name == "strip" and light.lookup(axes)[:, 0].tolist() == [1, 2, 3, 4, 5, 6]
    assert describe(path)["subtype"] == "cube, half"


def test_rows_begin_at_the_top_and_columns_at_the_left(tmp_path):
    """On +Z the right is +X and down −Y, as OpenGL 4.6, table 8.19, and Direct3D have it."""
    cube = np.zeros((6, 8, 8, 3), "<f4")
    cube[4, 0, 7] = (5, 6, 7)
    light = read_environment(written(tmp_path / "a.dds", (8, 8), cube.tobytes(), code=6, cube=True))
    towards = np.array([0.875, 0.875, 1.0])
    np.testing.assert_array_equal(light.lookup(towards / np.linalg.norm(towards)), (5, 6, 7))


def test_blocks_of_bc6h(tmp_path):
    """A block of mode 11 whose ends are both 480 of 1023: ((480·2¹⁶ + 2¹⁵) / 2¹⁰) · 31 / 64 is the half 0x3A2F."""
    bits = 0b00011
    for end in range(6):
        bits |= 480 << (5 + 10 * end)
    block = bits.to_bytes(16, "little")
    # 6 × 5 pixels take 2 × 2 blocks.
    image = files.read_radiance(written(tmp_path / "a.dds", (6, 5), 4 * block, code=95))
    assert image.size == (6, 5)
    assert np.all(image.radiance == np.uint16(0x3A2F).view(np.float16))
    assert float(image.radiance[0, 0, 0]) == pytest.approx(0.77295, abs=1e-5)
    assert describe(tmp_path / "a.dds")["subtype"] == "BC6H"


def test_packed_floats(tmp_path):
    shared = 256 | 128 << 9 | 64 << 18 | 16 << 27  # mantissas 256, 128 and 64, exponent 16: times 2^-8
    image = files.read_radiance(written(tmp_path / "a.dds", (1, 1), struct.pack("<I", shared), code=67))
    assert image.radiance.tolist() == [[[1.0, 0.5, 0.25]]]
    small = 15 << 6 | (16 << 6) << 11 | (14 << 5) << 22  # exponents 15, 16 and 14: 1, 2 and a half
    image = files.read_radiance(written(tmp_path / "b.dds", (1, 1), struct.pack("<I", small), code=26))
    assert image.radiance.tolist() == [[[1.0, 2.0, 0.5]]]


def test_alpha_is_left_out_with_a_word(tmp_path):
    texels = np.ones((2, 2, 4), "<f4")
    texels[0, 0, 3] = 0
    with pytest.warns(UserWarning, match="alpha is left out, though 1 texels"):
        files.read_radiance(written(tmp_path / "a.dds", (2, 2), texels.tobytes(), code=2))


def test_galileo_s_tomb(shared):
    light = read_environment(shared / "data/probes/cubes_dds/galileo_cross.dds")
    assert light.size == 256
    assert (light.radiance.min(), light.radiance.max()) == (pytest.approx(0.0198, abs=1e-4), pytest.approx(1014, abs=1))


def test_codes_are_no_light_and_damage_is_one_line(tmp_path):
    good = dds((4, 4), np.ones((4, 4, 4), "<f2").tobytes(), code=10)
    with pytest.raises(UnreadableFile, match=r"a DDS texture of codes \(DXT5\), not of light; save it as BC6H"):
        files.read_radiance(written(tmp_path / "a.dds", (4, 4), bytes(16), code=b"DXT5"))
    with pytest.raises(UnreadableFile, match=r"codes \(DXGI 98\)"):
        files.read_radiance(written(tmp_path / "b.dds", (4, 4), bytes(16), code=98))
    with pytest.raises(UnreadableFile, match="without all six square faces"):
        files.read_radiance(written(tmp_path / "c.dds", (4, 2), bytes(6 * 64), code=10, cube=True))
    for length in (4, 40, 127, 130, 147, len(good) - 1):
        (tmp_path / "d.dds").write_bytes(good[:length])
        with pytest.raises(FormatError, match="DDS"):
            files.read_radiance(tmp_path / "d.dds")
    for place, value in ((4, 7), (76, 9), (12, 2**31), (28, 500)):
        (tmp_path / "e.dds").write_bytes(good[:place] + struct.pack("<I", value) + good[place + 4 :])
        with pytest.raises(UnreadableFile) as caught:
            files.read_radiance(tmp_path / "e.dds", ReadOptions(decoded=2**24))
        assert "\n" not in str(caught.value)
