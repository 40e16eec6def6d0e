"""Small EXR files, written byte by byte from the specification ("OpenEXR File Layout"): uncompressed scan lines."""

from __future__ import annotations

import struct
from collections.abc import Sequence

import numpy as np

UINT, HALF, FLOAT = 0, 1, 2
_KINDS = {"uint32": UINT, "float16": HALF, "float32": FLOAT}

Channel = tuple[str, np.ndarray, int]
"""Name, samples (H, W), and every how many pixels there is a sample in x and y."""


def attribute(name: str, kind: str, data: bytes) -> bytes:
    return name.encode() + b"\0" + kind.encode() + b"\0" + struct.pack("<i", len(data)) + data


def window(name: str, width: int, height: int) -> bytes:
    return attribute(name, "box2i", struct.pack("<4i", 0, 0, width - 1, height - 1))


def channel_list(channels: Sequence[tuple[str, int, int]]) -> bytes:
    """Name, kind and sampling of each, in the order of their names."""
    entries = [
        name.encode() + b"\0" + struct.pack("<iB3xii", kind, 0, step, step) for name, kind, step in sorted(channels)
    ]
    return attribute("channels", "chlist", b"".join(entries) + b"\0")


def header(
    width: int, height: int, channels: Sequence[tuple[str, int, int]], *attributes: bytes, compression: int = 0
) -> bytes:
    """Magic number, version and header of a file of one part in scan lines; its last byte is the header's end."""
    return b"".join(
        [
            b"\x76\x2f\x31\x01\x02\0\0\0",
            channel_list(channels),
            attribute("compression", "compression", bytes([compression])),
            window("dataWindow", width, height),
            window("displayWindow", width, height),
            attribute("lineOrder", "lineOrder", b"\0"),
            attribute("pixelAspectRatio", "float", struct.pack("<f", 1)),
            attribute("screenWindowCenter", "v2f", struct.pack("<2f", 0, 0)),
            attribute("screenWindowWidth", "float", struct.pack("<f", 1)),
            *attributes,
            b"\0",
        ]
    )


def scan_lines(width: int, height: int, channels: Sequence[Channel], *attributes: bytes) -> bytes:
    """A whole file."""
    listed = [(name, _KINDS[samples.dtype.name], step) for name, samples, step in channels]
    data, table = header(width, height, listed, *attributes), b""
    lines = []
    place = len(data) + 8 * height
    for y in range(height):
        row = b"".join(
            samples[y // step].tobytes() for _, samples, step in sorted(channels, key=_name) if y % step == 0
        )
        lines.append(struct.pack("<2i", y, len(row)) + row)
        table += struct.pack("<Q", place)
        place += len(lines[-1])
    return data + table + b"".join(lines)


def _name(channel: Channel) -> str:
    return channel[0]
