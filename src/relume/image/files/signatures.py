"""What a file is, by its content and never by its suffix; but for raw floats, which have no content but pixels."""

from __future__ import annotations

import os
import re
import struct
from pathlib import Path
from typing import BinaryIO

from relume.errors import UnreadableFile
from relume.image.files.encodings import suffix_of
from relume.image.files.tiff.directories import folders_in

MAPS = ("EXR", "HDR", "PFM", "raw float", "float TIFF", "LogLuv TIFF", "DDS")
"""The kinds that hold radiance maps."""
PHOTOGRAPHS = ("JPEG", "PNG", "TIFF", "HEIF", "BMP", "PNM")
"""The kinds that hold photographs as cameras develop them."""

_MAGIC = {
    b"\xff\xd8\xff": "JPEG",
    b"\x89PNG\r\n\x1a\n": "PNG",
    b"II*\x00": "TIFF",
    b"MM\x00*": "TIFF",
    b"II+\x00": "TIFF",
    b"MM\x00+": "TIFF",
    b"\x76\x2f\x31\x01": "EXR",
    b"#?": "HDR",
    b"\xabKTX 20\xbb\r\n\x1a\n": "KTX2",
    b"DDS ": "DDS",
    b"FUJIFILMCCD-RAW": "RAW",
    b"IIU\x00": "RAW",  # Panasonic
    b"IIRO": "RAW",  # Olympus, three ways
    b"IIRS": "RAW",
    b"MMOR": "RAW",
    b"FOVb": "RAW",  # Sigma
}
_CANON_CR3 = b"ftypcrx "
_HEVC_BRANDS = {b"heic", b"heix", b"heim", b"heis", b"hevc", b"hevx", b"hevm", b"hevs"}
"""Of files whose pictures HEVC codes (ISO 23008-12, annex B)."""
# Most raw files are TIFFs; these of their tags and values no developed picture has (TIFF/EP, DNG 1.7).
_PHOTOMETRIC, _SUB_FOLDERS, _SAMPLE_FORMAT, _DNG_VERSION = 262, 330, 339, 50706
_RAW_PHOTOMETRICS = (32803, 34892)  # colour filter array, linear raw
_LOGLUV_PHOTOMETRICS = (32844, 32845)  # log luminance, with u′v′
# Files from before 1991, and Radiance's own tools, leave out "#?RADIANCE" or FORMAT, but none the resolution line.
_RADIANCE_HEADER = re.compile(rb"(FORMAT=32-bit_rle_|\n\r?\n[-+][XY] *\d+ [-+][XY] *\d+\r?\n)")

_PNM_HEADER = re.compile(rb"P[2356][\s#]")
_PFM_HEADER = re.compile(rb"P[Ff]\s")
_STRANGERS = (
    (4, b"ftypavif", "an AVIF picture"),
    (4, b"ftypmif1", "an HEIF picture of another codec than HEVC"),
    (0, b"\0\0\0\x0cJXL ", "a JPEG XL picture"),
    (0, b"\xff\x0a", "a JPEG XL picture"),
    (0, b"\0\0\0\x0cjP  ", "a JPEG 2000 picture"),
    (8, b"WEBP", "a WebP picture"),
    (0, b"GIF8", "a GIF picture"),
    (0, b"\xabKTX ", "a KTX texture"),
    (0, b"FORM", "an IFF picture (NewTek's Flexible Format is one)"),
    (0, b"%PDF", "a PDF document"),
)
_CONVERT = "convert it to JPEG, PNG or TIFF, or to EXR or Radiance .hdr"


def kind_of(path: str | os.PathLike[str]) -> str:
    """The kind of a picture file, by its first bytes: "EXR", "HDR", "JPEG", "RAW" and so on.

    path : the file
    Raises UnreadableFile for anything that relume does not read.
    """
    path = Path(path)
    if path.is_dir():
        raise UnreadableFile(f"{path}: a folder, not a file; name one picture in it")
    try:
        with open(path, "rb") as file:
            head = file.read(16384)
            is_tiff = _MAGIC.get(head[:4]) == "TIFF"
            raw = head[4:12] == _CANON_CR3 or (is_tiff and _is_raw_tiff(file))
            if is_tiff and not raw:
                return _kind_of_tiff(path, file)
    except FileNotFoundError:
        raise UnreadableFile(f"{path}: no such file; check the path") from None
    except (OSError, ValueError) as error:
        raise UnreadableFile(f"{path}: cannot be opened: {one_line(error)}; check its permissions") from None
    if not head:
        raise UnreadableFile(f"{path}: an empty file; copy it again from where it came")
    if raw:
        return "RAW"
    if suffix_of(path) in (".float", ".float.gz"):  # its pixels may begin with any bytes
        return "raw float"
    for magic, kind in _MAGIC.items():
        if head.startswith(magic):
            return kind
    if _is_heif(head):
        return "HEIF"
    if _PNM_HEADER.match(head):
        return "PNM"
    if head.startswith(b"BM") and head[6:10] == b"\0\0\0\0":  # two numbers that are always 0
        return "BMP"
    if _PFM_HEADER.match(head):
        return "PFM"
    if _RADIANCE_HEADER.search(head):
        return "HDR"
    for place, magic, name in _STRANGERS:
        if head[place : place + len(magic)] == magic:
            raise UnreadableFile(f"{path}: {name}, which relume does not read; {_CONVERT}")
    raise UnreadableFile(f"{path}: no picture relume reads; {_CONVERT}")


def _is_heif(head: bytes) -> bool:
    """Whether a file's box of brands, its first (ISO 14496-12, 4.3), names HEVC pictures: most name it second."""
    length = int.from_bytes(head[:4])
    if head[4:8] != b"ftyp" or not 16 <= length <= 256:
        return False
    brands = {head[8:12], *(head[place : place + 4] for place in range(16, min(length, len(head) - 3), 4))}
    return not brands.isdisjoint(_HEVC_BRANDS)


def _kind_of_tiff(path: Path, file: BinaryIO) -> str:
    try:
        folder = folders_in(path, file)[0]
    except UnreadableFile:
        return "TIFF"  # its decoder will say what is wrong
    if folder.number(_PHOTOMETRIC) in _LOGLUV_PHOTOMETRICS:
        return "LogLuv TIFF"
    return "float TIFF" if folder.number(_SAMPLE_FORMAT) == 3 else "TIFF"


def _is_raw_tiff(file: BinaryIO) -> bool:
    """Whether a TIFF's folders of tags belong to a camera raw; a damaged one is left to its decoder."""
    file.seek(0)
    head = file.read(10)
    if len(head) < 10 or head[2:4] not in (b"*\x00", b"\x00*"):  # no camera writes BigTIFF
        return False
    if head[8:10] == b"CR":  # Canon CR2
        return True
    order = "<" if head[:2] == b"II" else ">"
    waiting, seen = [struct.unpack(order + "I", head[4:8])[0]], set()
    while waiting and len(seen) < 16:
        offset = waiting.pop(0)
        if offset in seen:
            continue
        seen.add(offset)
        file.seek(offset)
        count = int.from_bytes(file.read(2), "little" if order == "<" else "big")
        folder = file.read(12 * count + 4)
        for start in range(0, min(12 * count, len(folder) - 11), 12):
            tag, _, values, place = struct.unpack_from(order + "HHII", folder, start)
            if tag == _DNG_VERSION:
                return True
            if tag == _PHOTOMETRIC and struct.unpack_from(order + "H", folder, start + 8)[0] in _RAW_PHOTOMETRICS:
                return True
            if tag == _SUB_FOLDERS:
                file.seek(place)
                listed = file.read(4 * min(values, 16)) if values > 1 else folder[start + 8 : start + 12]
                waiting += struct.unpack(f"{order}{len(listed) // 4}I", listed[: len(listed) // 4 * 4])
        if len(folder) == 12 * count + 4 and (following := struct.unpack_from(order + "I", folder, 12 * count)[0]):
            waiting.append(following)
    return False


def one_line(error: object) -> str:
    """A library's message without line breaks, at most 200 characters."""
    return " ".join(str(error).split())[:200]
