"""What a file is, told by its content and never by its suffix, and how large a picture relume will decode.

The size limits stand between a header and the allocation it asks for: a file of fifty bytes may claim any size.
"""

from __future__ import annotations

import os
import re
import struct
from pathlib import Path
from typing import BinaryIO

from relume.errors import UnreadableFile

MAXIMUM_SIDE = 2**16
MAXIMUM_PIXELS = 2**28
MAXIMUM_SAMPLES = 2**31  # all channels of all parts of a file: 8 GiB of float32

_MAGIC = {
    b"\xff\xd8\xff": "JPEG",
    b"\x89PNG\r\n\x1a\n": "PNG",
    b"II*\x00": "TIFF",
    b"MM\x00*": "TIFF",
    b"II+\x00": "TIFF",
    b"MM\x00+": "TIFF",
    b"\x76\x2f\x31\x01": "EXR",
    b"#?": "HDR",
    b"FUJIFILMCCD-RAW": "RAW",
    b"IIU\x00": "RAW",  # Panasonic
    b"IIRO": "RAW",  # Olympus, three ways
    b"IIRS": "RAW",
    b"MMOR": "RAW",
    b"FOVb": "RAW",  # Sigma
}
_CANON_CR3 = b"ftypcrx "
# Most raw files are TIFFs; these of their tags and values no developed picture has (TIFF/EP, DNG 1.7).
_PHOTOMETRIC, _SUB_FOLDERS, _DNG_VERSION = 262, 330, 50706
_RAW_PHOTOMETRICS = (32803, 34892)  # colour filter array, linear raw
# Files from before 1991, and Radiance's own tools, leave out "#?RADIANCE" or FORMAT, but none the resolution line.
_RADIANCE_HEADER = re.compile(rb"(FORMAT=32-bit_rle_|\n\r?\n[-+][XY] *\d+ [-+][XY] *\d+\r?\n)")


def kind_of(path: str | os.PathLike[str]) -> str:
    """ "JPEG", "PNG", "TIFF", "EXR", "HDR" (Radiance) or "RAW" by content; raises UnreadableFile for anything else."""
    path = Path(path)
    if path.is_dir():
        raise UnreadableFile(f"{path}: a folder, not a file; name one picture in it")
    try:
        with open(path, "rb") as file:
            head = file.read(16384)
            raw = head[4:12] == _CANON_CR3 or (_MAGIC.get(head[:4]) == "TIFF" and _is_raw_tiff(file))
    except FileNotFoundError:
        raise UnreadableFile(f"{path}: no such file; check the path") from None
    except (OSError, ValueError) as error:
        raise UnreadableFile(f"{path}: cannot be opened: {one_line(error)}; check its permissions") from None
    if not head:
        raise UnreadableFile(f"{path}: an empty file; copy it again from where it came")
    if raw:
        return "RAW"
    for magic, kind in _MAGIC.items():
        if head.startswith(magic):
            return kind
    if _RADIANCE_HEADER.search(head):
        return "HDR"
    raise UnreadableFile(
        f"{path}: no picture relume reads; convert it to JPEG, PNG or TIFF, or to EXR or Radiance .hdr"
    )


def _is_raw_tiff(file: BinaryIO) -> bool:
    """Whether a TIFF's folders of tags tell of a sensor's own values; a damaged one is told by its decoder."""
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


def refuse_absurd_size(path: str | os.PathLike[str], width: int, height: int) -> None:
    """Raise UnreadableFile when a header claims no pixels, a side over 65,536 or more than 2²⁸ pixels."""
    if width < 1 or height < 1:
        raise UnreadableFile(f"{path}: its header claims {width} x {height} pixels; the file is damaged")
    if max(width, height) > MAXIMUM_SIDE or width * height > MAXIMUM_PIXELS:
        raise UnreadableFile(
            f"{path}: its header claims {width} x {height} pixels; relume reads sides up to {MAXIMUM_SIDE}"
            f" and {MAXIMUM_PIXELS} pixels in all: scale it down, or copy it again if that is not its size"
        )


def one_line(error: object) -> str:
    """A library's message without line breaks, at most 200 characters."""
    return " ".join(str(error).split())[:200]
