"""The parameters of a gain map in both their forms, and what is refused of them."""

import struct

import pytest

from relume.image.files.gain_map import metadata as gain_map_metadata
from relume.image.files.gain_map.metadata import GainMapMetadata
from relume.image.files.metadata import xmp
from relume.image.files.read_options import ReadOptions

# Of a file that libultrahdr 2.0.2 wrote: one channel, 0 to 5.6224 stops, no offsets, in the base's primaries.
FOREIGN = bytes.fromhex(
    "00000000 40 00000000 00000001 0059f541 00100000"
    "00000000 00000001 0059f541 00100000 00000001 00000001 00000000 00000001 00000000 00000001"
)
THREE = GainMapMetadata(
    low=(-0.5, -0.25, -1.0),
    high=(1.5, 2.0, 17.25),
    gamma=(0.5, 1.0, 2.0),
    base_offset=(1 / 64, 2.0**-20, 0.0),
    bright_offset=(1 / 64, 2.0**-20, 0.125),
    bright_headroom=17.25,
)
ADOBE = """<x:xmpmeta xmlns:x="adobe:ns:meta/"><rdf:RDF xmlns:rdf="http://www.w3.org/1999/02/22-rdf-syntax-ns#">
<rdf:Description rdf:about="" xmlns:hdrgm="http://ns.adobe.com/hdr-gain-map/1.0/" hdrgm:Version="1.0"
 hdrgm:BaseRenditionIsHDR="{bright}" hdrgm:OffsetSDR="0.03125" hdrgm:HDRCapacityMin="0" hdrgm:HDRCapacityMax="1.3">
<hdrgm:GainMapMin><rdf:Seq><rdf:li>-0.25</rdf:li><rdf:li>-0.5</rdf:li><rdf:li>-0.75</rdf:li></rdf:Seq></hdrgm:GainMapMin>
{maximum}</rdf:Description></rdf:RDF></x:xmpmeta>"""
MAXIMUM = "<hdrgm:GainMapMax>1.25</hdrgm:GainMapMax>"


def from_xmp(packet: bytes) -> GainMapMetadata:
    return gain_map_metadata.metadata_in(xmp.properties(packet, ReadOptions()))


def test_a_block_of_libultrahdr_is_read() -> None:
    said = gain_map_metadata.from_iso(FOREIGN)
    assert said.low == (0, 0, 0)
    assert said.high == pytest.approx((5.6223764,) * 3, abs=1e-6)
    assert said.gamma == (1, 1, 1)
    assert said.base_offset == said.bright_offset == (0, 0, 0)
    assert said.bright_headroom == said.high[0]
    assert said.in_base_primaries
    assert not said.base_is_bright


def test_a_common_denominator_is_read_as_libultrahdr_1_2_writes_it() -> None:
    block = struct.pack(">HHBIIIiiIii", 0, 0, 0x08, 64, 0, 128, -32, 128, 64, 1, 2)
    said = gain_map_metadata.from_iso(block)
    assert (said.low[0], said.high[2], said.gamma[1]) == (-0.5, 2.0, 1.0)
    assert (said.base_offset[0], said.bright_offset[0]) == (1 / 64, 1 / 32)
    assert not said.in_base_primaries


def test_the_block_is_written_byte_for_byte() -> None:
    block = gain_map_metadata.to_iso(THREE)
    assert len(block) == 141
    assert block[:21].hex() == "00000000c000000000400000000114000000100000"
    # Red: low −½, high 1½, gamma ½, both offsets 1/64.
    offset = "0100000040000000"
    assert block[21:61].hex() == "e000000040000000" + "0018000000100000" + "2000000040000000" + offset + offset
    assert gain_map_metadata.from_iso(block) == THREE


def test_both_forms_say_the_same() -> None:
    packet = gain_map_metadata.with_description(xmp.packet({}), gain_map_metadata.description(THREE))
    assert from_xmp(packet) == gain_map_metadata.from_iso(gain_map_metadata.to_iso(THREE))
    assert b"<hdrgm:OffsetSDR><rdf:Seq><rdf:li>0.015625</rdf:li><rdf:li>0.00000095367431640625</rdf:li>" in packet


def test_xmp_holds_scalars_lists_and_defaults() -> None:
    said = from_xmp(ADOBE.format(bright="False", maximum=MAXIMUM).encode())
    assert said.low == (-0.25, -0.5, -0.75)
    assert said.high == (1.25, 1.25, 1.25)
    assert said.gamma == (1, 1, 1)
    assert said.base_offset == (0.03125,) * 3
    assert said.bright_offset == (0.015625,) * 3
    assert (said.base_headroom, said.bright_headroom) == (0.0, 1.3)


def test_another_version_is_refused_and_a_missing_one_taken_for_the_first() -> None:
    said = ADOBE.format(bright="False", maximum=MAXIMUM)
    for version in ("99.0", "2.0", "", "10"):
        with pytest.raises(ValueError, match=f'hdrgm:Version is "{version}"; expected 1.0'):
            from_xmp(said.replace('Version="1.0"', f'Version="{version}"').encode())
    for missing in ('hdrgm:Version="1.1"', ""):
        assert from_xmp(said.replace('hdrgm:Version="1.0"', missing).encode()) == from_xmp(said.encode())


def test_a_bright_base_is_reported() -> None:
    assert from_xmp(ADOBE.format(bright="True", maximum=MAXIMUM).encode()).base_is_bright
    block = struct.pack(">HHBIIIIiIiIIIiIiI", 0, 0, 0x40, 3, 1, 0, 1, -3, 1, 0, 1, 1, 1, 0, 1, 0, 1)
    assert gain_map_metadata.from_iso(block).base_is_bright


@pytest.mark.parametrize(
    ("maximum", "complaint"),
    [
        ("", "hdrgm:GainMapMax is missing"),
        ("<hdrgm:GainMapMax>bright</hdrgm:GainMapMax>", 'hdrgm:GainMapMax is "bright"'),
        ("<hdrgm:GainMapMax>nan</hdrgm:GainMapMax>", "high is"),
        ("<hdrgm:GainMapMax>1e300</hdrgm:GainMapMax>", "high is"),
        ("<hdrgm:GainMapMax>-2</hdrgm:GainMapMax>", "no low above its high"),
        (MAXIMUM + "<hdrgm:Gamma>0</hdrgm:Gamma>", "gamma is"),
        (
            MAXIMUM + "<hdrgm:Gamma><rdf:Seq><rdf:li>1</rdf:li><rdf:li>2</rdf:li></rdf:Seq></hdrgm:Gamma>",
            "has 2 values",
        ),
    ],
)
def test_senseless_xmp_is_refused(maximum: str, complaint: str) -> None:
    with pytest.raises(ValueError, match=complaint):
        from_xmp(ADOBE.format(bright="False", maximum=maximum).encode())


@pytest.mark.parametrize(
    ("block", "complaint"),
    [
        (b"", "it ends after 0 bytes"),
        (FOREIGN[:-1], "it ends after 60 bytes"),
        (b"\x00\x01" + FOREIGN[2:], "for readers of version 1"),
        (FOREIGN[:4] + b"\xc0" + FOREIGN[5:], "it ends after 61 bytes"),
        (FOREIGN[:9] + bytes(4) + FOREIGN[13:], "a denominator is 0"),
        (FOREIGN[:37] + bytes(4) + FOREIGN[41:], "gamma is"),
        (FOREIGN[:29] + b"\x7f\xff\xff\xff\x00\x00\x00\x01" + FOREIGN[37:], "high is"),
    ],
)
def test_a_senseless_block_is_refused(block: bytes, complaint: str) -> None:
    with pytest.raises(ValueError, match=complaint):
        gain_map_metadata.from_iso(block)


def test_a_directory_says_lengths_and_padding() -> None:
    packet = gain_map_metadata.with_description(xmp.packet({"a": "b"}), gain_map_metadata.directory(4711))
    assert gain_map_metadata.lengths_in(packet) == [("GainMap", 4711)]
    padded = packet.replace(b'Item:Length="4711"', b'Item:Length="4711" Item:Padding="9"')
    assert gain_map_metadata.lengths_in(padded) == [("GainMap", 4720)]
    for nonsense in (b"-1", b"", b"1e3", b"9" * 30):
        assert gain_map_metadata.lengths_in(packet.replace(b"4711", nonsense)) == []
    assert gain_map_metadata.lengths_in(xmp.packet({})) == []
