"""PNGs are deflated in pieces on every core, and are one stream that every decoder reads."""

import io
import zlib

import numpy as np
import pytest
from PIL import Image

from relume.image import files
from relume.image.files.photographs import png
from relume.image.photograph import Photograph


def content(data: bytes) -> bytes:
    """What its one IDAT holds."""
    begin = data.index(b"IDAT")
    return data[begin + 4 : begin + 4 + int.from_bytes(data[begin - 4 : begin])]


@pytest.mark.parametrize("strategy", [zlib.Z_DEFAULT_STRATEGY, zlib.Z_RLE])
@pytest.mark.parametrize("channels, kind", [(3, np.uint8), (4, np.uint8), (3, np.uint16)])
def test_pieces_make_one_stream_whose_checksum_is_right(strategy, channels, kind):
    pixels = np.random.default_rng(1).integers(0, 9, (700, 1001, channels)).astype(kind)
    data = png.encode(pixels, b"", strategy=strategy)
    engine = zlib.decompressobj()
    rows = engine.decompress(content(data))
    assert engine.eof and not engine.unused_data  # zlib compares Adler-32 with the rows
    assert len(rows) == 700 * (1 + 1001 * channels * np.dtype(kind).itemsize) > 2 * png._BAND
    if kind == np.uint8:
        assert np.array_equal(np.asarray(Image.open(io.BytesIO(data))), pixels)


@pytest.mark.parametrize("kind", [np.uint8, np.uint16])
@pytest.mark.parametrize("shape", [(1, 1), (3, 60_000), (1300, 400)])
def test_pixels_come_back(tmp_path, kind, shape):
    pixels = np.random.default_rng(2).integers(0, np.iinfo(kind).max + 1, (*shape, 3)).astype(kind)
    files.write(tmp_path / "a.png", Photograph(pixels))
    assert np.array_equal(files.read_photograph(tmp_path / "a.png").pixels, pixels)


def test_drawings_are_packed_by_their_patterns():
    pattern = np.random.default_rng(3).integers(0, 255, (1, 100, 3)).astype(np.uint8)
    tiled = np.tile(pattern, (300, 6, 1))
    assert len(png.encode(tiled, b"")) < len(png.encode(tiled, b"", strategy=zlib.Z_RLE)) / 20
