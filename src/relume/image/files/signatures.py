"""What a file is, told by its first bytes and never by its suffix, and how large a picture relume will decode.

The size limits stand between a header and the allocation it asks for: a file of fifty bytes may claim any size.
"""

from __future__ import annotations

import os
import re
from pathlib import Path

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
}
# Files from before 1991, and Radiance's own tools, leave out "#?RADIANCE" or FORMAT, but none the resolution line.
_RADIANCE_HEADER = re.compile(rb"(FORMAT=32-bit_rle_|\n\r?\n[-+][XY] *\d+ [-+][XY] *\d+\r?\n)")


def kind_of(path: str | os.PathLike[str]) -> str:
    """ "JPEG", "PNG", "TIFF", "EXR" or "HDR" (Radiance) by content; raises UnreadableFile for anything else."""
    path = Path(path)
    if path.is_dir():
        raise UnreadableFile(f"{path}: a folder, not a file; name one picture in it")
    try:
        with open(path, "rb") as file:
            head = file.read(16384)
    except FileNotFoundError:
        raise UnreadableFile(f"{path}: no such file; check the path") from None
    except (OSError, ValueError) as error:
        raise UnreadableFile(f"{path}: cannot be opened: {one_line(error)}; check its permissions") from None
    if not head:
        raise UnreadableFile(f"{path}: an empty file; copy it again from where it came")
    for magic, kind in _MAGIC.items():
        if head.startswith(magic):
            return kind
    if _RADIANCE_HEADER.search(head):
        return "HDR"
    raise UnreadableFile(
        f"{path}: no picture relume reads; convert it to JPEG, PNG or TIFF, or to EXR or Radiance .hdr"
    )


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
