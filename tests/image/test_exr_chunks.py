"""EXR files that end early: refused with the place, or salvaged as far as they go."""

import numpy as np
import OpenEXR
import OpenImageIO as oiio
import pytest

from exr_files import scan_lines
from relume.errors import FormatError, UnreadableFile
from relume.image.files import ReadOptions, read_layers, read_radiance, write
from relume.image.files.exr.header import COMPRESSIONS as KNOWN
from relume.image.files.exr.header import read_headers
from relume.image.radiance import OUTSIDE, RadianceMap

SALVAGE = ReadOptions(salvage=True)
COMPRESSIONS = ["NO", "RLE", "ZIPS", "ZIP", "PIZ", "PXR24", "B44", "B44A", "DWAA", "HTJ2K32", "ZSTD"]


@pytest.fixture(scope="module")
def noise() -> np.ndarray:
    return np.random.default_rng(1).random((150, 60, 3), np.float32)


def cut(path, share):
    data = path.read_bytes()
    path.write_bytes(data[: int(len(data) * share)])


def test_a_cut_file_names_the_first_row_that_is_missing(tmp_path, numbered):
    data = scan_lines(7, 5, [("Y", np.ascontiguousarray(numbered[..., 0]), 1)])
    path = tmp_path / "a.exr"
    path.write_bytes(data[:-1])
    with pytest.raises(
        FormatError, match=r"row 4: expected 5 chunks of pixels, found 4; .*or salvage what is there \(--salvage\)$"
    ):
        read_radiance(path)
    with pytest.warns(UserWarning, match="ends early; pixels of 1 of 5 rows are missing, and 0, marked as outside"):
        image = read_radiance(path, SALVAGE)
    np.testing.assert_array_equal(image.radiance[:4, :, 1], numbered[:4, :, 0])
    assert image.clipped is not None
    assert image.clipped.tolist() == [[0] * 7] * 4 + [[OUTSIDE] * 7]
    assert not image.radiance[4].any()


def test_a_whole_file_is_read_alike_with_salvage(tmp_path, numbered):
    write(tmp_path / "a.exr", RadianceMap(numbered))
    image = read_radiance(tmp_path / "a.exr", SALVAGE)
    np.testing.assert_array_equal(image.radiance, numbered)
    assert image.clipped is None


@pytest.mark.parametrize("kind", ["e", "f"])
@pytest.mark.parametrize("compression", COMPRESSIONS)
def test_every_compression_is_salvaged(tmp_path, noise, compression, kind):
    path = tmp_path / "a.exr"
    header = {"compression": getattr(OpenEXR, f"{compression}_COMPRESSION"), "type": OpenEXR.scanlineimage}
    OpenEXR.File([OpenEXR.Part(header, {"RGB": noise.astype(kind)}, "")]).write(str(path))
    whole = read_radiance(path).radiance
    cut(path, 0.7)
    with pytest.warns(UserWarning, match="ends early"):
        image = read_radiance(path, SALVAGE)
    assert image.clipped is not None
    lost = image.clipped == OUTSIDE
    assert 0.25 < lost.mean() < 0.65  # chunks have up to 32 of 150 rows
    np.testing.assert_array_equal(image.radiance[~lost], whole[~lost])
    assert not image.radiance[lost].any()


@pytest.mark.parametrize("levels", [False, True])
def test_tiles_are_salvaged_and_smaller_levels_not_missed(tmp_path, noise, levels):
    path = tmp_path / "a.exr"
    if levels:
        oiio.ImageBufAlgo.make_texture(oiio.MakeTxTexture, oiio.ImageBuf(noise), str(path))
    else:
        spec = oiio.ImageSpec(60, 150, 3, "float")
        spec.tile_width, spec.tile_height = 32, 16
        output = oiio.ImageOutput.create(str(path))
        assert output is not None
        output.open(str(path), spec)
        output.write_image(noise)
        output.close()
    whole = read_radiance(path).radiance
    cut(path, 0.99)
    with pytest.raises(FormatError, match="tile "):
        read_radiance(path)
    if levels:  # the largest is written first, and is whole
        image = read_radiance(path, SALVAGE)
        assert image.clipped is None
        np.testing.assert_array_equal(image.radiance, whole)
        return
    with pytest.warns(UserWarning, match="pixels of 6 of 150 rows are missing"):
        image = read_radiance(path, SALVAGE)
    assert image.clipped is not None
    assert np.argwhere(image.clipped == OUTSIDE).min(0).tolist() == [144, 32]  # of the last tile, 28 × 6
    assert np.count_nonzero(image.clipped) == 28 * 6
    np.testing.assert_array_equal(image.radiance[image.clipped == 0], whole[image.clipped == 0])


@pytest.mark.parametrize("number", range(len(KNOWN)))
def test_the_rows_of_a_chunk_are_those_that_the_library_writes(tmp_path, number):
    path = tmp_path / "a.exr"
    header = {"compression": OpenEXR.Compression(number), "type": OpenEXR.scanlineimage}
    OpenEXR.File([OpenEXR.Part(header, {"Y": np.zeros((1000, 3), np.float32)}, "")]).write(str(path))
    headers = read_headers(path)
    (first,) = np.frombuffer(path.read_bytes(), "<u8", count=1, offset=headers.end)
    assert first == headers.end + 8 * -(-1000 // KNOWN[number].rows)


def test_luminance_and_chroma_are_salvaged(tmp_path):
    """Rows of odd number have no chroma, so that their chunks are smaller."""
    light, chroma = np.ones((8, 6), np.float32), np.full((4, 3), 0.5, np.float32)
    data = scan_lines(6, 8, [("Y", light, 1), ("RY", chroma, 2), ("BY", chroma, 2)])
    path = tmp_path / "a.exr"
    path.write_bytes(data[:-120])
    with pytest.warns(UserWarning, match="pixels of 3 of 8 rows are missing"):
        image = read_radiance(path, SALVAGE)
    np.testing.assert_allclose(image.radiance[0], [[1.5, 0.8009, 1.5]] * 6, atol=1e-4)
    np.testing.assert_array_equal(image.radiance[5:], 0)


def test_a_table_that_was_never_written_is_made_good_from_the_chunks(tmp_path, noise):
    data = bytearray(
        scan_lines(60, 150, [(name, np.ascontiguousarray(noise[..., i]), 1) for i, name in enumerate("RGB")])
    )
    row = 8 + 60 * 12
    table = len(data) - 150 * (row + 8)
    data[table : table + 150 * 8] = bytes(150 * 8)
    path = tmp_path / "a.exr"
    path.write_bytes(data)
    np.testing.assert_array_equal(read_radiance(path).radiance, noise)
    path.write_bytes(data[: table + 150 * 8 + 100 * row + 5])
    with pytest.warns(UserWarning, match="pixels of 50 of 150 rows are missing"):
        image = read_radiance(path, SALVAGE)
    np.testing.assert_array_equal(image.radiance[:100], noise[:100])


def test_of_parts_only_what_is_whole_is_kept(tmp_path, noise):
    path = tmp_path / "a.exr"
    clipped = np.ones(noise.shape[:2], np.uint8)
    write(path, RadianceMap(noise, noise, clipped))
    cut(path, 0.8)
    with pytest.warns(UserWarning) as said:
        image = read_radiance(path, SALVAGE)
    assert [str(warning.message).removeprefix(f"{path}: ") for warning in said] == [
        "its part variance is incomplete and left out",
        "its part clipped is incomplete and left out",
    ]
    np.testing.assert_array_equal(image.radiance, noise)
    assert image.variance is None and image.clipped is None
    with pytest.warns(UserWarning, match="ends early"):
        layers = read_layers(path, SALVAGE)
    np.testing.assert_array_equal(layers["radiance"], noise)
    assert not layers["clipped"].any()


def test_a_file_without_a_single_chunk_is_refused_even_then(tmp_path):
    data = scan_lines(4, 3, [("Y", np.ones((3, 4), np.float32), 1)])
    path = tmp_path / "a.exr"
    path.write_bytes(data[: len(data) - 3 * 24 + 10])
    with pytest.raises(
        FormatError, match=r"row 0: expected 3 chunks of pixels, found 0; copy it again from where it came$"
    ):
        read_radiance(path, SALVAGE)


def test_the_file_that_its_program_left_half_written_is_read_as_another_reads_it(shared):
    path = shared / "data/malformed/oiio/incomplete.exr"
    with pytest.raises(FormatError, match="row 125: expected 480 chunks of pixels, found 125"):
        read_radiance(path)
    with pytest.warns(UserWarning, match="pixels of 355 of 480 rows|alpha is left out, though 79749 pixels"):
        image = read_radiance(path, SALVAGE)
    file = oiio.ImageInput.open(str(path))
    assert file is not None
    for y in range(125):
        row = file.read_scanline(y, 0, oiio.FLOAT)
        assert row is not None
        np.testing.assert_array_equal(image.radiance[y], row[:, :3])
    assert image.clipped is not None
    assert np.count_nonzero(image.clipped[:125]) == 0 and (image.clipped[125:] == OUTSIDE).all()


def test_damage_within_a_chunk_is_refused_even_with_salvage(tmp_path, noise):
    path = tmp_path / "a.exr"
    write(path, RadianceMap(np.round(noise * 8)))  # even enough to be compressed at all
    data = bytearray(path.read_bytes())
    data[-400:-300] = bytes(100)
    path.write_bytes(data)
    with pytest.raises(UnreadableFile, match=r"damaged EXR, bytes \d+ to \d+, pixels"):
        read_radiance(path, SALVAGE)
