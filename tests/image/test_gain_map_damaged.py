"""Gain-map JPEGs that are damaged, or made to do harm: each is refused in one line, at once and without memory."""

import io
import struct
import tracemalloc
import warnings
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from relume.errors import FormatError, UnreadableFile
from relume.image.colour import encode_srgb
from relume.image.files.gain_map import encoding as gain_map_encoding
from relume.image.files.gain_map import gain_map
from relume.image.files.gain_map import layout as gain_map_layout
from relume.image.files.metadata import xmp
from relume.image.files.photographs import jpeg_segments, photographs
from relume.image.files.read_options import ReadOptions
from relume.image.radiance import RadianceMap

pytestmark = pytest.mark.filterwarnings("ignore:.*made for displays")


@pytest.fixture(scope="module")
def whole() -> bytes:
    y, x = np.mgrid[:48, :64].astype(np.float32)
    pixels = np.stack([2 ** (x / 16), 2 ** (y / 12), 1 + 0 * x], -1)
    noise = np.random.default_rng(1).uniform(-0.1, 0.1, pixels.shape)
    base = np.rint(255 * encode_srgb(np.clip(pixels / 16 + noise, 0, 1))).astype(np.uint8)
    return gain_map_encoding.encoded_rendition("a.jpg", pixels, base, 95)[0]


def map_at(data: bytes) -> int:
    return data.index(b"\xff\xd8\xff", 2)


def refused(path: Path, data: bytes, options: ReadOptions = ReadOptions()) -> str:
    """The one line that refuses it."""
    path.write_bytes(data)
    with pytest.raises(UnreadableFile) as caught:
        gain_map.read(path, options)
    line = str(caught.value)
    assert line.startswith(f"{path}: ")
    assert "\n" not in line
    assert isinstance(gain_map.is_present(path), bool)
    return line.removeprefix(f"{path}: ")


def test_a_file_that_ends_early_is_refused_wherever_it_ends(tmp_path: Path, whole: bytes) -> None:
    for end in (*range(0, 64, 7), *range(64, len(whole), 523), len(whole) - 2, len(whole) - 1):
        assert "damaged" in refused(tmp_path / "a.jpg", whole[:end]), end


def test_holes_in_the_data_of_either_picture_are_found(tmp_path: Path, whole: bytes) -> None:
    second = map_at(whole)
    hole = whole[: second - 600] + whole[second - 100 :]
    assert "base picture at byte 0: expected whole data" in refused(tmp_path / "a.jpg", hole)
    hole = whole[:-600] + whole[-100:]
    assert f"gain map at byte {second}: expected whole data" in refused(tmp_path / "a.jpg", hole)


def test_a_claimed_gain_map_that_is_not_there_is_reported(tmp_path: Path, whole: bytes) -> None:
    line = refused(tmp_path / "a.jpg", whole[: map_at(whole)])
    assert "behind its base picture: expected a JPEG with gain-map parameters, found none" in line
    second = map_at(whole)
    plain = io.BytesIO()
    Image.new("RGB", (8, 8)).save(plain, "JPEG")
    assert "expected a JPEG with gain-map parameters" in refused(tmp_path / "a.jpg", whole[:second] + plain.getvalue())
    assert gain_map.is_present(tmp_path / "a.jpg")


def test_wild_places_in_the_index_lead_nowhere(tmp_path: Path, whole: bytes) -> None:
    """The second picture's entry points before, into and behind the file; the directory still says it."""
    wanted_path = tmp_path / "whole.jpg"
    wanted_path.write_bytes(whole)
    wanted = gain_map.read(wanted_path).radiance
    start = whole.index(b"MPF\0") + 4
    entry = start + 50 + 16
    for place in (0, 1, 2**31, 2**32 - 1, len(whole) - start, 40):
        for length in (0, 2**32 - 1):
            data = whole[: entry + 4] + struct.pack(">II", length, place) + whole[entry + 12 :]
            (tmp_path / "a.jpg").write_bytes(data)
            assert np.array_equal(gain_map.read(tmp_path / "a.jpg").radiance, wanted)
    for offset, value in ((4, 2**32 - 1), (8, 2**32 - 1), (46, 7)):
        data = whole[: start + offset] + struct.pack(">I", value) + whole[start + offset + 4 :]
        (tmp_path / "a.jpg").write_bytes(data)
        assert np.array_equal(gain_map.read(tmp_path / "a.jpg").radiance, wanted)


def test_a_length_in_the_index_that_ends_within_the_header_is_not_believed(tmp_path: Path, whole: bytes) -> None:
    start = whole.index(b"MPF\0") + 4
    entry = start + 50 + 16
    assert struct.unpack(">II", whole[entry + 4 : entry + 12]) == (len(whole) - map_at(whole), map_at(whole) - start)
    (tmp_path / "a.jpg").write_bytes(whole[: entry + 4] + struct.pack(">I", 9) + whole[entry + 8 :])
    assert gain_map.read(tmp_path / "a.jpg").size == (64, 48)


def test_lengths_beyond_the_file_are_refused(tmp_path: Path, whole: bytes) -> None:
    at = whole.index(b"\xff\xe2")
    line = refused(tmp_path / "a.jpg", whole[: at + 2] + b"\xff\xff" + whole[at + 4 : at + 400])
    assert f"byte {at}: expected a segment within the" in line
    assert "length 1" in refused(tmp_path / "a.jpg", whole[: at + 2] + b"\x00\x01" + whole[at + 4 :])


def with_frame(data: bytes, begin: int, width: int, height: int) -> bytes:
    frame = data.index(b"\xff\xc0\x00\x11", begin)
    return data[: frame + 5] + struct.pack(">HH", height, width) + data[frame + 9 :]


@pytest.mark.parametrize("which", ["base picture", "gain map"])
def test_an_absurd_size_is_refused_before_memory(tmp_path: Path, whole: bytes, which: str) -> None:
    begin = 0 if which == "base picture" else map_at(whole)
    for width, height in ((65500, 65500), (16000, 16000), (0, 9)):
        tracemalloc.start()
        line = refused(tmp_path / "a.jpg", with_frame(whole, begin, width, height))
        peak = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        assert f"its {which} claims" in line or "its header claims" in line
        assert peak < 2**22
    line = refused(tmp_path / "a.jpg", whole, ReadOptions(pixels=1000))
    assert "its base picture claims 64 x 48 pixels; relume reads" in line


def test_a_size_that_is_not_that_of_the_data_is_refused(tmp_path: Path, whole: bytes) -> None:
    assert "damaged" in refused(tmp_path / "a.jpg", with_frame(whole, map_at(whole), 64, 200))


def packets(data: bytes, map_packet: bytes) -> bytes:
    """The file with another packet in the gain map, and without its ISO block."""
    second = map_at(data)
    header = jpeg_segments.header_at("a.jpg", io.BytesIO(data), second, ReadOptions())
    body = jpeg_segments.without_metadata(data[second:], header)
    said = [jpeg_segments.segment(jpeg_segments.APP1, jpeg_segments.XMP + map_packet)]
    return data[:second] + jpeg_segments.with_segments(body, said)


def test_xmp_bombs_are_refused(tmp_path: Path, whole: bytes) -> None:
    declared = b'<!DOCTYPE a [<!ENTITY b "hdr-gain-map"><!ENTITY c "&b;&b;&b;&b;&b;&b;&b;&b;">]><a>&c;</a>'
    nested = b"<hdr-gain-map>" * 4000 + b"</hdr-gain-map>" * 4000
    for packet, complaint in (
        (declared, "document type"),
        (nested[:60000], "nests more than 16"),
        (b"<hdr-gain-map", "is damaged"),
        (b"\xff\xfehdr-gain-map", "is damaged"),
        (b"<hdr-gain-map/>", "hdrgm:GainMapMax is missing"),
    ):
        line = refused(tmp_path / "a.jpg", packets(whole, packet))
        assert complaint in line
        assert f"gain map at byte {map_at(whole)}, XMP" in line


def test_xmp_of_the_base_that_is_damaged_loses_only_what_it_holds(tmp_path: Path, whole: bytes) -> None:
    (tmp_path / "a.jpg").write_bytes(whole.replace(b"<x:xmpmeta", b"<!:xmpmeta", 1))
    assert gain_map.read(tmp_path / "a.jpg").attributes == {"rendition": "display"}


@pytest.mark.parametrize("factor", ["nan", "0.0", "-1.", "1e99", "abc"])
def test_a_senseless_factor_of_ours_is_not_believed(tmp_path: Path, whole: bytes, factor: str) -> None:
    packet = xmp.packet({"gain_map_scale": factor, "unit": "cd/m²"})
    own = jpeg_segments.segment(jpeg_segments.APP1, jpeg_segments.XMP + packet)
    index = whole.index(b"\xff\xe2")  # the packet goes in front, so that the map moves, and its index with it
    (tmp_path / "a.jpg").write_bytes(whole[:2] + own + whole[index:])
    image = gain_map.read(tmp_path / "a.jpg")
    assert (image.unit, image.attributes) == ("relative", {"rendition": "display"})


def test_stray_bytes_among_the_headers_are_reported_and_do_no_harm(tmp_path: Path, whole: bytes) -> None:
    path = tmp_path / "a.jpg"
    path.write_bytes(whole)
    light, shown = gain_map.read(path).radiance, photographs.read(path).pixels
    at = whole.index(b"\xff\xdb")
    path.write_bytes(whole[:at] + b"stray\xff\0\xff\xd0" + whole[at:])
    assert gain_map.is_present(path)
    for reader, wanted in ((gain_map.read, light), (photographs.read, shown)):
        with pytest.warns(UserWarning, match=r"a\.jpg: has stray bytes among its headers"):
            image = reader(path)
        np.testing.assert_array_equal(image.radiance if isinstance(image, RadianceMap) else image.pixels, wanted)
    # Only a few: no file is searched to its end.
    assert f"byte {at + 8192}: expected a marker" in refused(path, whole[:at] + bytes(9000) + whole[at:])


def test_whether_there_is_a_gain_map_is_reported_of_anything(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def failing(*_: object) -> None:
        raise IndexError("of a fault")

    monkeypatch.setattr(gain_map_layout, "located", failing)
    (tmp_path / "a.jpg").write_bytes(b"\xff\xd8\xff")
    assert gain_map.is_present(tmp_path / "a.jpg") is False
    assert gain_map.is_present(tmp_path) is False


def test_too_many_segments_are_refused(tmp_path: Path, whole: bytes) -> None:
    many = whole[:2] + b"\xff\xfe\x00\x02" * 5000 + whole[2:]
    assert "expected at most 16777216 bytes in 4096 segments" in refused(tmp_path / "a.jpg", many)
    full = jpeg_segments.segment(jpeg_segments.APP1, bytes(65000)) * 3
    line = refused(tmp_path / "a.jpg", whole[:2] + full + whole[2:], ReadOptions(metadata=2**17))
    assert "expected at most 131072 bytes" in line


def test_what_would_take_long_to_read_is_given_up(tmp_path: Path, whole: bytes) -> None:
    """Fill bytes without end, in the header and among the data, and an index of many places."""
    endless = b"\xff" * 2**22
    assert f"byte {2 + 4096}: expected a segment" in refused(tmp_path / "a.jpg", whole[:2] + endless + whole[2:])
    second = map_at(whole)
    assert "found none" in refused(
        tmp_path / "a.jpg", whole[: second - 2] + endless + b"\0" + whole[second - 2 : second]
    )
    entries = b"".join(struct.pack(">IIIHH", 0, 9, place, 0, 0) for place in range(second, second + 64))
    tags = struct.pack(">HHIII", 0xB002, 7, len(entries), 26, 0)
    index = jpeg_segments.segment(jpeg_segments.APP2, b"MPF\0MM\0*" + struct.pack(">IH", 8, 1) + tags + entries)
    line = refused(tmp_path / "a.jpg", whole[:2] + index * 1000 + whole[2:second])
    assert "expected a JPEG with gain-map parameters" in line


def test_senseless_parameters_name_their_place(tmp_path: Path, whole: bytes) -> None:
    at = whole.rindex(jpeg_segments.ISO_GAIN_MAP) + len(jpeg_segments.ISO_GAIN_MAP)
    line = refused(tmp_path / "a.jpg", whole[:at] + b"\x00\x09" + whole[at + 2 :])
    assert "ISO 21496-1 block: expected parameters that make sense, found it is for readers of version 9" in line


def test_mutants_raise_nothing_else(tmp_path: Path, whole: bytes) -> None:
    """Bytes of the headers altered at random: every file is read or refused in one line."""
    random = np.random.default_rng(7)
    second = map_at(whole)
    places = np.concatenate([np.arange(2000), second + np.arange(2500)])
    outcomes = {"read": 0, "refused": 0}
    for _ in range(50):
        data = bytearray(whole)
        for place in random.choice(places, random.integers(1, 6)):
            data[place] = random.integers(256)
        (tmp_path / "a.jpg").write_bytes(data)
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                image = gain_map.read(tmp_path / "a.jpg")
            assert np.all(np.isfinite(image.radiance))
            outcomes["read"] += 1
        except UnreadableFile as error:
            assert "\n" not in str(error)
            outcomes["refused"] += 1
    assert min(outcomes.values()) > 3


def test_errors_say_where() -> None:
    with pytest.raises(FormatError) as caught:
        jpeg_segments.header_at("a.jpg", io.BytesIO(b"\xff\xd8\xff\xe1\x00"), 0, ReadOptions())
    assert (caught.value.where, caught.value.format) == ("byte 2", "JPEG")
