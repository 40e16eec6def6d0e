"""XMP packets: every text comes back, and those of strangers do no harm."""

import io
import xml.etree.ElementTree as ElementTree

import numpy as np
import pytest
from PIL import Image

from relume.image.files.metadata import xmp
from relume.image.files.read_options import ReadOptions

STRANGE = {
    "mapping": "latlong",
    "": "no name",
    "two words": 'a "quoted" <tag> & more',
    "1st": "it's",
    "a:b/ü": "ß 光 😀",
    "lines": " one\n two\r\n\tthree  ",
    "_x0041_": "_x0041_",
    "control": "\0\x1b\ud800\uffff",
    "empty": "",
    "exposure-time.s": "1/60",
}


def test_a_packet_is_written_byte_for_byte():
    assert xmp.packet({"a b": 'x"\n<'}).decode() == (
        '<?xpacket begin="\ufeff" id="W5M0MpCehiHzreSzNTczkc9d"?>\n'
        '<x:xmpmeta xmlns:x="adobe:ns:meta/">\n'
        ' <rdf:RDF xmlns:rdf="http://www.w3.org/1999/02/22-rdf-syntax-ns#">\n'
        '  <rdf:Description rdf:about="" xmlns:relume="urn:relume:attributes#"\n'
        "   relume:a_x0020_b='x\"&#10;&lt;'/>\n"
        " </rdf:RDF>\n</x:xmpmeta>\n"
        '<?xpacket end="w"?>'
    )


def test_every_name_and_text_comes_back():
    packed = xmp.packet(STRANGE)
    assert xmp.attributes(packed) == STRANGE
    ElementTree.fromstring(packed.decode())  # another parser takes it for XML
    assert xmp.attributes(xmp.packet({})) == {}
    assert xmp.attributes(packed + bytes(9)) == STRANGE  # padded, as in some files


def test_random_texts_come_back():
    random = np.random.default_rng(3)
    alphabet = [chr(code) for code in (0, 9, 10, 13, 32, 34, 38, 39, 60, 62, 65, 95, 120, 48, 0x133, 0xD800, 0x1F600)]
    texts = ["".join(random.choice(alphabet, random.integers(0, 12))) for _ in range(400)]
    given = dict(zip(texts, reversed(texts), strict=True))
    assert xmp.attributes(xmp.packet(given)) == given


def described(content, attributes=""):
    rdf = "http://www.w3.org/1999/02/22-rdf-syntax-ns#"
    return f"""<x:xmpmeta xmlns:x="adobe:ns:meta/"><rdf:RDF xmlns:rdf="{rdf}">
    <rdf:Description rdf:about="" xmlns:r="{xmp.NAMESPACE}" xmlns:g="http://g/" {attributes}>{content}
    </rdf:Description></rdf:RDF></x:xmpmeta>""".encode()


def test_properties_are_read_as_attributes_elements_and_lists():
    packed = described(
        "<r:mapping>angular</r:mapping><g:Min><rdf:Seq><rdf:li>1</rdf:li>\n<rdf:li>2</rdf:li></rdf:Seq></g:Min>"
        '<g:Items><rdf:Seq><rdf:li rdf:parseType="Resource"><g:Item g:Mime="image/jpeg"/></rdf:li></rdf:Seq></g:Items>'
        "<g:Inner><rdf:Description><g:Min>9</g:Min></rdf:Description></g:Inner>",
        'g:Max="3" r:name="n"',
    )
    assert xmp.attributes(packed) == {"mapping": "angular", "name": "n"}
    found = xmp.properties(packed)
    assert (found["http://g/Max"], found["http://g/Min"]) == (("3",), ("1", "2"))
    assert "http://g/Mime" not in found


@pytest.mark.parametrize(
    ("packed", "said"),
    [
        (b'<!DOCTYPE a [<!ENTITY e "x">]><a>&e;</a>', "document type"),
        ('<!DOCTYPE a [<!ENTITY e "x">]><a>&e;</a>'.encode("utf-16"), "document type"),
        (b"<a" * 1, "damaged"),
        (b"", "damaged"),
        (b"\xff\xfe\xff", "damaged"),
        (b'<?xml version="1.0" encoding="klingon"?><a/>', "damaged"),
        (b"<a>" * 100_000, "nests more than 16"),
        (described("&undeclared;"), "damaged"),
        (bytes(2000), "2000 bytes; 1000 are read"),
    ],
)
def test_hostile_packets_are_refused_with_the_reason(packed, said):
    with pytest.raises(ValueError, match=said) as raised:
        xmp.attributes(packed, ReadOptions(metadata=1000 if len(packed) == 2000 else 2**24))
    assert "\n" not in str(raised.value)


def test_mutants_of_a_packet_are_read_or_refused():
    random = np.random.default_rng(5)
    sound = xmp.packet(STRANGE)
    for _ in range(500):
        data = bytearray(sound)
        for place in random.integers(0, len(data), 3):
            data[place] = random.integers(0, 256)
        try:
            xmp.attributes(bytes(data))
        except ValueError as error:
            assert "XMP packet" in str(error)


def test_another_program_finds_the_properties(tmp_path):
    Image.new("RGB", (2, 2)).save(tmp_path / "a.jpg", xmp=xmp.packet({"mapping": "latlong"}))
    data = io.BytesIO((tmp_path / "a.jpg").read_bytes())
    with Image.open(data) as image:
        packed = image.info["xmp"]
    assert xmp.attributes(packed) == {"mapping": "latlong"}
