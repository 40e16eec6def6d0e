"""LogLuv TIFF between relume and others: libtiff, OpenCV and the pictures of the format's author."""

import ctypes
import warnings
from pathlib import Path

import numpy as np
import PIL
import pytest

import naive_logluv
from other_programs import by_opencv
from relume.image.files import read_radiance as read
from relume.image.files import write
from relume.image.files.encodings import LogLuv
from relume.image.files.logluv import codes as logluv_codes
from relume.image.files.tiff.directories import read_folders
from relume.image.primaries import REC709
from relume.image.radiance import RadianceMap

TO_XYZ = REC709.to_xyz()


def libtiff():
    """The libtiff that Pillow brings; the test is skipped where it brings none of its own."""
    folders = (Path(PIL.__path__[0]).parent / "pillow.libs", Path(PIL.__path__[0]) / ".dylibs")
    found = [path for folder in folders for path in sorted(folder.glob("libtiff*"))]
    if not found:
        pytest.skip("Pillow has no libtiff of its own here")
    library = ctypes.CDLL(str(found[0]))
    pointer = ctypes.c_void_p
    library.TIFFOpen.restype = pointer
    library.TIFFScanlineSize.restype = ctypes.c_ssize_t
    for name, types in (
        ("TIFFOpen", [ctypes.c_char_p, ctypes.c_char_p]),
        ("TIFFSetField", [pointer, ctypes.c_uint32]),
        ("TIFFScanlineSize", [pointer]),
        ("TIFFReadScanline", [pointer, pointer, ctypes.c_uint32, ctypes.c_uint16]),
        ("TIFFWriteScanline", [pointer, pointer, ctypes.c_uint32, ctypes.c_uint16]),
        ("TIFFClose", [pointer]),
    ):
        getattr(library, name).argtypes = types
    return library


_FLOATS = (65560, ctypes.c_int(0))  # SGILogDataFmt: libtiff's own tag for what it hands out, not in files


def by_libtiff(path, width, height, channels):
    library = libtiff()
    handle = library.TIFFOpen(str(path).encode(), b"r")
    assert handle
    library.TIFFSetField(handle, *_FLOATS)
    result = np.empty((height, width, channels), np.float32)
    assert library.TIFFScanlineSize(handle) == 4 * width * channels
    assert all(library.TIFFReadScanline(handle, result[y].ctypes.data, y, 0) == 1 for y in range(height))
    library.TIFFClose(handle)
    return result


def write_by_libtiff(path, xyz, bits):
    library = libtiff()
    handle = library.TIFFOpen(str(path).encode(), b"w")
    assert handle
    height, width, channels = xyz.shape
    fields = {256: width, 257: height, 277: channels, 258: 32, 339: 3, 284: 1, 278: 4}
    fields |= {262: 32844 if bits == 16 else 32845, 259: 34677 if bits == 24 else 34676}
    for tag, value in fields.items():
        assert library.TIFFSetField(handle, tag, ctypes.c_uint32(value)) == 1
    library.TIFFSetField(handle, *_FLOATS)
    library.TIFFSetField(handle, 65561, ctypes.c_int(0))  # SGILogEncode: else 24 bits are dithered
    for y, row in enumerate(np.ascontiguousarray(xyz, np.float32)):
        assert library.TIFFWriteScanline(handle, row.ctypes.data, y, 0) == 1
    library.TIFFClose(handle)


@pytest.mark.parametrize("bits", [16, 24, 32])
def test_libtiff_reads_and_writes_the_same(tmp_path, bits):
    image = naive_logluv.some_map()
    path = tmp_path / "a.tif"
    with warnings.catch_warnings():
        warnings.simplefilter("ignore" if bits == 16 else "error")
        write(path, image, LogLuv(bits))
    ours = read(path).radiance.astype(np.float64) @ TO_XYZ.T
    theirs = by_libtiff(path, 70, 40, 1 if bits == 16 else 3)
    np.testing.assert_allclose(theirs, ours[..., 1:2] if bits == 16 else ours, rtol=3e-6)
    xyz = image.radiance.astype(np.float64) @ TO_XYZ.T
    write_by_libtiff(tmp_path / "b.tif", xyz[..., 1:2] if bits == 16 else xyz, bits)
    np.testing.assert_array_equal(read(tmp_path / "b.tif").radiance, read(path).radiance)


def test_libtiff_has_the_same_cells(tmp_path):
    path = tmp_path / "a.tif"
    write(path, RadianceMap(np.ones((1, 2**14, 3), np.float32)), LogLuv(24))
    stored = b"".join((768 << 14 | code).to_bytes(3, "big") for code in range(2**14))
    path.write_bytes(path.read_bytes()[:8] + stored + path.read_bytes()[8 + len(stored) :])
    theirs = by_libtiff(path, 2**14, 1, 3)
    u, v = naive_logluv.chromaticity(theirs[0].astype(np.float64))
    np.testing.assert_allclose(np.stack([u, v], axis=-1), logluv_codes.chromaticities(24), rtol=0, atol=2e-7)


@pytest.mark.parametrize("bits", [24, 32])
def test_opencv_reads_the_same(tmp_path, bits):
    write(tmp_path / "a.tif", naive_logluv.some_map("cd/m²"), LogLuv(bits))
    (scale,) = read_folders(tmp_path / "a.tif")[0].values[37439]
    theirs = by_opencv(tmp_path / "a.tif") * scale
    ours = read(tmp_path / "a.tif").radiance
    # OpenCV's matrix has a D65 of .31271 .32902.
    assert np.all(np.abs(theirs - ours) <= 1e-3 * np.abs(ours).max(axis=-1, keepdims=True))


def test_pictures_of_others_are_read(shared):
    folder = shared / "data" / "formats" / "logluv_tiff"
    coarse, fine = read(folder / "off_luv24.tif"), read(folder / "off_luv32.tif")
    for image, least, most, mean in ((coarse, 0.0018, 20.9, 0.8435), (fine, 0.0009, 21.7, 0.8436)):
        assert (image.unit, image.size) == ("cd/m²", (333, 225))
        said = image.radiance / 179  # its STONITS, which the README's numbers are before
        assert said.min() == pytest.approx(least, abs=6e-5)
        assert said.max() == pytest.approx(most, abs=0.06)
        assert said.mean(dtype=np.float64) == pytest.approx(mean, abs=1e-4)
    a, b = (image.radiance @ TO_XYZ[1] / 179 for image in (coarse, fine))
    held = a < 15.9
    assert np.abs(np.log2(a / b))[held].max() < 0.5 / 64
    assert np.count_nonzero(~held) == 29
    assert b[~held].min() > 2 ** (4 - 1.5 / 64)  # the brightest code of 24 bits, or beyond them all
    assert read(folder / "logluv-3c-16b.tiff").radiance.tolist() == [[[0, 0, 0]]]
