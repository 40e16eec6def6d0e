"""JPEG: baseline pictures of even 8 × 8 blocks, segment by segment from ITU-T T.81."""

from __future__ import annotations

import struct
from collections.abc import Sequence

import numpy as np

from corpus.files import DESCRIBE, HEIGHT, READ, READ_FACTS, READ_PHOTOGRAPH, WIDTH, Bad, Corpus, Good, cut, replaced

_SUFFIX = ".jpg"
SOI, EOI = b"\xff\xd8", b"\xff\xd9"


def corpus() -> Corpus:
    """The good and bad files of the format."""
    return Corpus("JPEG", _good(), _bad(), (READ_PHOTOGRAPH, READ, DESCRIBE, READ_FACTS))


def segment(marker: int, content: bytes, length: int | None = None) -> bytes:
    """One segment; `length` where it is not that of its content."""
    return struct.pack(">BBH", 0xFF, marker, (len(content) + 2 if length is None else length) & 0xFFFF) + content


def tables() -> bytes:
    """Quantisation by 8, so that a step of the mean is a step of the pixel; codes for means alone."""
    quantisation = segment(0xDB, b"\0" + b"\x08" * 64)
    means = segment(0xC4, b"\x00" + bytes([0, 0, 0, 12, *[0] * 12]) + bytes(range(12)))  # 12 codes of four bits
    details = segment(0xC4, b"\x10" + bytes([1, *[0] * 15]) + b"\0")  # the end of a block, one bit
    return quantisation + means + details


def frame(height: int, width: int, components: int, marker: int = 0xC0) -> bytes:
    """The frame header: every component whole, table 0."""
    listed = b"".join(bytes([number + 1, 0x11, 0]) for number in range(components))
    return segment(marker, struct.pack(">BHHB", 8, height & 0xFFFF, width & 0xFFFF, components) + listed)


def scan(blocks: np.ndarray) -> bytes:
    """The scan header and the means of (rows, columns, components) blocks, values 0 to 255."""
    components = blocks.shape[2]
    listed = b"".join(bytes([number + 1, 0]) for number in range(components))
    header = segment(0xDA, bytes([components]) + listed + b"\0\x3f\0")
    bits, last = "", [0] * components
    for block in blocks.reshape(-1, components).astype(int) - 128:
        for number, mean in enumerate(block):
            difference = int(mean) - last[number]
            last[number] = int(mean)
            size = abs(difference).bit_length()
            value = difference if difference > 0 else difference + 2**size - 1
            bits += f"{size:04b}" + (f"{value:0{size}b}" if size else "") + "0"
    bits += "1" * (-len(bits) % 8)
    coded = bytes(int(bits[at : at + 8], 2) for at in range(0, len(bits), 8))
    return header + coded.replace(b"\xff", b"\xff\0")


def picture_of(blocks: np.ndarray, segments: Sequence[bytes] = ()) -> bytes:
    """A whole file: `segments` behind the start, then the picture of 8 × 8 times the blocks."""
    height, width = 8 * blocks.shape[0], 8 * blocks.shape[1]
    head = SOI + b"".join(segments) + tables() + frame(height, width, blocks.shape[2])
    return head + scan(blocks) + EOI


def shown(blocks: np.ndarray) -> np.ndarray:
    """(H, W, 3) what a reader shows: YCbCr of JFIF (ITU-T T.871), or grey."""
    if blocks.shape[2] == 1:
        colours = np.repeat(blocks.astype(float), 3, 2)
    else:
        y, cb, cr = (blocks[..., number].astype(float) for number in range(3))
        cb, cr = cb - 128, cr - 128
        colours = np.stack([y + 1.402 * cr, y - 0.344136 * cb - 0.714136 * cr, y + 1.772 * cb], -1)
    return np.clip(np.rint(colours), 0, 255).repeat(8, 0).repeat(8, 1)


BLOCKS = np.array([[[100, 120, 140], [180, 135, 110]]], np.uint8)
"""One row of two: the means of luminance and of the two colour differences."""


def exif(order: str = "<", *, pointer: int | None = None, count: int = 1, kind: int = 5) -> bytes:
    """An EXIF segment with an exposure of 1/60 s, right or with a wrong pointer, count or type."""
    start = {"<": b"II", ">": b"MM"}[order] + struct.pack(order + "HI", 42, 8)
    folder = struct.pack(order + "HHHIII", 1, 0x8769, 4, 1, 26 if pointer is None else pointer, 0)
    said = struct.pack(order + "HHHIII", 1, 0x829A, kind, count, 44, 0) + struct.pack(order + "II", 1, 60)
    return segment(0xE1, b"Exif\0\0" + start + folder + said)


def _good() -> list[Good]:
    grey = np.array([[[60], [200]]], np.uint8)
    many = np.random.default_rng(13).integers(90, 160, (2, 3, 3)).astype(np.uint8)
    jfif = segment(0xE0, b"JFIF\0\1\1\0\0\1\0\1\0\0")
    files = [
        ("colour", BLOCKS, (jfif,)),
        ("grey", grey, (jfif,)),
        ("EXIF", BLOCKS, (exif(),)),
        ("EXIF, big-endian", BLOCKS, (exif(">"),)),
        ("six blocks", many, (jfif, segment(0xFE, b"made by hand"))),
    ]
    # Decoders may round colours by one step.
    return [Good(name, picture_of(blocks, parts), _SUFFIX, shown(blocks), 1.5 / 160) for name, blocks, parts in files]


def _bad() -> list[Bad]:
    good = picture_of(BLOCKS)
    head, coded = SOI + tables(), scan(BLOCKS)
    bad: list[tuple[str, bytes]] = []
    lenient: list[tuple[str, bytes]] = []
    for height, width in ((8, 0), (0, 16), (65535, 65535), (65500, 65500)):
        bad.append((f"{width} × {height} pixels", head + frame(height, width, 3) + coded + EOI))
    for components in (0, 2, 5, 255):
        listed = segment(0xC0, struct.pack(">BHHB", 8, 8, 16, components) + b"\1\x11\0" * min(components, 5))
        bad.append((f"{components} components", head + listed + coded + EOI))
    for bits in (0, 7, 12, 16, 255):
        bad.append(
            (
                f"{bits} bits",
                head
                + replaced(frame(8, 16, 3), b"\x08\x00\x08\x00\x10", bytes([bits]) + b"\0\x08\0\x10")
                + coded
                + EOI,
            )
        )
    for sampling in (0x00, 0x01, 0x10, 0x51, 0xFF):
        wrong = replaced(frame(8, 16, 3), b"\x01\x11\x00", bytes([1, sampling, 0]))
        bad.append((f"a sampling of {sampling:#04x}", head + wrong + coded + EOI))
    for marker in (0xC3, 0xC5, 0xC7, 0xCB, 0xCF):
        bad.append((f"a frame of the kind {marker:#x}", head + frame(8, 16, 3, marker) + coded + EOI))
    for length in (0, 1, 2, 3, 16, 18, 65535):
        content = frame(8, 16, 3)[4:]
        bad.append((f"a frame header of {length} bytes", head + segment(0xC0, content, length) + coded + EOI))
    bad += [
        ("its first three bytes alone", b"\xff\xd8\xff"),
        ("a start and an end", SOI + EOI),
        ("no frame", SOI + tables() + coded + EOI),
        ("no scan", SOI + tables() + frame(8, 16, 3) + EOI),
        ("no code tables", SOI + segment(0xDB, b"\0" + b"\x08" * 64) + frame(8, 16, 3) + coded + EOI),
        ("no quantisation", SOI + tables()[69:] + frame(8, 16, 3) + coded + EOI),
        (
            "a quantisation of no number",
            SOI + segment(0xDB, b"\x0f" + b"\x08" * 64) + tables()[69:] + good[len(head) :],
        ),
        ("a quantisation cut short", SOI + segment(0xDB, b"\0" + b"\x08" * 20) + tables()[69:] + good[len(head) :]),
        ("a code table of 400 codes", SOI + segment(0xC4, b"\0" + b"\x19" * 16 + bytes(400)) + good[2:]),
        ("a code table of a class that is none", SOI + segment(0xC4, b"\x50" + bytes(16)) + good[2:]),
        ("a code table with more codes than bits", head + segment(0xC4, b"\0\x05" + bytes(20)) + good[len(head) :]),
        ("a scan of a component that is none", replaced(good, b"\xff\xda\0\x0c\3\1", b"\xff\xda\0\x0c\3\x09")),
        ("a scan of four components", replaced(good, b"\xff\xda\0\x0c\3", b"\xff\xda\0\x0c\4")),
        ("a scan of no components", replaced(good, b"\xff\xda\0\x0c\3", b"\xff\xda\0\x0c\0")),
        ("a scan with a table that is none", replaced(good, b"\xff\xda\0\x0c\3\1\0", b"\xff\xda\0\x0c\3\1\x33")),
        ("two frames", head + frame(8, 16, 3) * 2 + coded + EOI),
        ("no pixels behind the scan header", head + frame(8, 16, 3) + coded[:14] + EOI),
        ("pixels cut short", head + frame(8, 16, 3) + coded[:-4]),
        ("pixels cut short, with an end", head + frame(800, 1600, 3) + coded + EOI),
        ("no end", good[:-2]),
    ]
    segments = {
        "EXIF in a circle": exif(pointer=8),
        "EXIF beyond the segment": exif(pointer=2**31),
        "EXIF with 2^32 − 1 values": exif(count=2**32 - 1),
        "EXIF of a type that is none": exif(kind=99),
        "EXIF of text": exif(kind=2),
        "EXIF of doubles": exif(kind=12),
        "EXIF of no bytes": segment(0xE1, b"Exif\0\0"),
        "EXIF of noise": segment(0xE1, b"Exif\0\0" + b"\x55" * 200),
        "EXIF of an order that is none": segment(0xE1, b"Exif\0\0XX*\0" + bytes(20)),
        "EXIF, 1 s by 0": exif()[:-4] + bytes(4),
        "a JFIF segment of two bytes": segment(0xE0, b"JF"),
        "XMP of noise": segment(0xE1, b"http://ns.adobe.com/xap/1.0/\0" + b"<\x00\xff&" * 50),
        "XMP nested 5000 deep": segment(0xE1, b"http://ns.adobe.com/xap/1.0/\0" + b"<a>" * 5000),
        "XMP with entities": segment(0xE1, b"http://ns.adobe.com/xap/1.0/\0" + _entities()),
        "a colour profile of part 9 of 2": segment(0xE2, b"ICC_PROFILE\0\x09\x02" + bytes(50)),
        "a colour profile of no parts": segment(0xE2, b"ICC_PROFILE\0\0\0"),
        "a colour profile of noise": segment(0xE2, b"ICC_PROFILE\0\1\1" + b"\x55" * 200),
        "MPF of noise": segment(0xE2, b"MPF\0" + b"\x55" * 90),
        "MPF in a circle": segment(0xE2, b"MPF\0II*\0" + struct.pack("<IHHHIII", 8, 1, 0xB002, 7, 16, 8, 8)),
        "an Adobe segment of a transform that is none": segment(0xEE, b"Adobe\0\x64\0\0\0\0\x09"),
        "restarts that are not there": segment(0xDD, b"\0\1"),
        "restarts of three bytes": segment(0xDD, b"\0\1\0"),
        "a reserved marker": b"\xff\x02",
        "fill bytes": b"\xff" * 3000,
        "zeros between segments": bytes(3000),
        "a segment of 65533 bytes": segment(0xEF, bytes(65533)),
        "a segment beyond the file": segment(0xEF, b"", 65535),
        "a thousand comments": segment(0xFE, b"x") * 1000,
        "an arithmetic table": segment(0xCC, b"\0\x10"),
        "a number of lines": segment(0xDC, b"\0\x08"),
    }
    lenient += [(name, SOI + part + good[2:]) for name, part in segments.items()]
    lenient += [
        ("a frame of arithmetic codes", head + frame(8, 16, 3, 0xC9) + coded + EOI),
        ("bytes behind", good + bytes(500)),
        ("another picture behind", good + good),
        ("lines stated as 0, and behind the scan", head + frame(0, 16, 3) + coded + segment(0xDC, b"\0\x08") + EOI),
        ("more details than a block has", good[:-8] + b"\xfe" * 6 + EOI),
    ]
    files = [Bad(name, data, _SUFFIX) for name, data in bad]
    files += [Bad(name, data, _SUFFIX, refused=False) for name, data in lenient]
    return files + cut("colour", good, _SUFFIX, (4, 20, 72, 100, 130, -1))


def _entities() -> bytes:
    """The "billion laughs": entities that each hold ten of the one before."""
    lines = b"".join(b'<!ENTITY l%d "%s">' % (n, b"&l%d;" % (n - 1) * 10) for n in range(1, 10))
    return b'<?xml version="1.0"?><!DOCTYPE x [<!ENTITY l0 "ha">' + lines + b"]><x>&l9;</x>"


def bomb(marker: int = 0xC0) -> bytes:
    """A JPEG of 735 bytes that claims 65,500 × 65,500 pixels."""
    start = SOI + tables() + frame(65_500, 65_500, 3, marker) + scan(BLOCKS)
    return start + bytes(735 - len(start) - 2) + EOI


assert 8 * BLOCKS.shape[0] == HEIGHT and 8 * BLOCKS.shape[1] == WIDTH
