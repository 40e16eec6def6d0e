"""XMP packets, which carry metadata: ours under "relume:", and what others put there.

A packet is RDF in XML (ISO 16684-1, part 1). It comes from strangers: no document type, so no entity to expand, no
nesting deeper than any writer's, and no more bytes than allowed.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from xml.parsers import expat

from relume.image.files.read_options import ReadOptions

NAMESPACE = "urn:relume:attributes#"
_RDF = "http://www.w3.org/1999/02/22-rdf-syntax-ns#"
_DEEPEST = 16  # elements in one another; those of a gain map's container are 8

# What XML 1.0 cannot hold at all, and what its names may not: written as _xHHHH_ (ISO 9075-14), as is that itself;
# _x_ stands for no name.
_NOT_IN_XML = r"[\x00-\x08\x0b\x0c\x0e-\x1f\ud800-\udfff\ufffe\uffff]"
_VALUE = re.compile(rf"_(?=x)|{_NOT_IN_XML}")
_NAME = re.compile(r"_(?=x)|^[^A-Za-z_]|[^A-Za-z0-9_.-]")
_ESCAPED = re.compile(r"_x([0-9A-F]*)_")
_BREAKS = {"\n": "&#10;", "\r": "&#13;", "\t": "&#9;"}  # else XML reads them as spaces


def packet(attributes: Mapping[str, str]) -> bytes:
    """An XMP packet that holds `attributes` under "relume:", every name and value as it is."""
    from xml.sax.saxutils import quoteattr  # brings http.client

    ours = "".join(
        f"\n   relume:{_escaped(_NAME, name) or '_x_'}={quoteattr(_escaped(_VALUE, value), _BREAKS)}"
        for name, value in attributes.items()
    )
    declared = f' xmlns:relume="{NAMESPACE}"' if attributes else ""
    return (
        '<?xpacket begin="\ufeff" id="W5M0MpCehiHzreSzNTczkc9d"?>\n'  # ISO 16684-1, 7.3.2
        '<x:xmpmeta xmlns:x="adobe:ns:meta/">\n'
        f' <rdf:RDF xmlns:rdf="{_RDF}">\n'
        f'  <rdf:Description rdf:about=""{declared}{ours}/>\n'
        " </rdf:RDF>\n"
        "</x:xmpmeta>\n"
        '<?xpacket end="w"?>'
    ).encode()


def attributes(packet: bytes, options: ReadOptions = ReadOptions()) -> dict[str, str]:
    """The texts that a packet holds under "relume:"; raises ValueError as `properties` does."""
    ours = {
        name.removeprefix(NAMESPACE): values[0]
        for name, values in properties(packet, options).items()
        if name.startswith(NAMESPACE) and values
    }
    return {_unescaped(name): _unescaped(value) for name, value in ours.items()}


def properties(packet: bytes, options: ReadOptions = ReadOptions()) -> dict[str, tuple[str, ...]]:
    """All properties of a packet: namespace and name, put together → its values, one or as many as its list has.

    Those of structures within others (a container's items) are left out. Raises ValueError, whose text says why, for
    damaged XML, a document type, elements nested too deep, and more than `options.metadata` bytes.
    """
    if len(packet) > options.metadata:
        raise ValueError(f"its XMP packet has {len(packet)} bytes; {options.metadata} are read")
    found = _Properties()
    parser = expat.ParserCreate(namespace_separator="}")
    parser.buffer_text = True
    parser.StartDoctypeDeclHandler = _refuse_document_type
    parser.StartElementHandler = found.start
    parser.EndElementHandler = found.end
    parser.CharacterDataHandler = found.text.append
    try:
        parser.Parse(packet.strip(b"\0 \t\r\n"), True)
    except (expat.ExpatError, UnicodeError, LookupError) as error:
        raise ValueError(f"its XMP packet is damaged ({error})") from None
    return {name: tuple(values) for name, values in found.values.items()}


class _Properties:
    """What stands directly in an rdf:Description: attributes, elements with text, and lists of texts."""

    def __init__(self) -> None:
        self.values: dict[str, list[str]] = {}
        self.text: list[str] = []
        self.inside: list[str] = []

    def start(self, name: str, attributes: Mapping[str, str]) -> None:
        self.inside.append(_joined(name))
        if len(self.inside) > _DEEPEST:
            raise ValueError(f"its XMP packet nests more than {_DEEPEST} elements; no writer does")
        if self._described(len(self.inside)):
            for key, value in attributes.items():
                if not _joined(key).startswith(_RDF):
                    self.values.setdefault(_joined(key), []).append(value)
        self.text.clear()

    def end(self, name: str) -> None:
        text = "".join(self.text)
        self.text.clear()
        if self._described(len(self.inside) - 1) and not self.inside[-1].startswith(_RDF):
            self.values.setdefault(self.inside[-1], [text] if text.strip() else [])
        elif self.inside[-1] == _RDF + "li" and self._described(len(self.inside) - 3):
            self.values.setdefault(self.inside[-3], []).append(text)
        self.inside.pop()

    def _described(self, depth: int) -> bool:
        """Whether the element at `depth` is a description that stands in none other."""
        descriptions = [index for index, name in enumerate(self.inside) if name == _RDF + "Description"]
        return bool(descriptions) and descriptions[0] == depth - 1


def _refuse_document_type(*_: object) -> None:
    raise ValueError("its XMP packet declares a document type, which none needs")


def _joined(name: str) -> str:
    return name.replace("}", "", 1)


def _escaped(pattern: re.Pattern[str], text: str) -> str:
    return pattern.sub(lambda match: f"_x{ord(match[0]):04X}_", text)


def _unescaped(text: str) -> str:
    return _ESCAPED.sub(lambda match: chr(min(int(match[1], 16), 0x10FFFF)) if match[1] else "", text)
