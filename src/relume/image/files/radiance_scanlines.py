"""The three ways in which Radiance pictures store scan lines of RGBE pixels: flat, old runs and new runs.

New runs (since 1991) hold the four components apart and are known by the bytes 2, 2, length. In old ones the pixel
(1, 1, 1, n) repeats the one before it n times, and where several follow each other they count in powers of 256.
"""

from __future__ import annotations

import os

import numpy as np

from relume.errors import UnreadableFile


def scanlines(path: str | os.PathLike[str], data: bytes, start: int, lines: int, length: int) -> np.ndarray:
    """(lines, length, 4) uint8 RGBE from `data[start:]`; raises UnreadableFile naming the line where it is damaged."""
    marker = bytes((2, 2, length >> 8, length & 255)) if 8 <= length <= 32767 else None
    rows, place = [], start
    for line in range(lines):
        where = f"scan line {line + 1} of {lines}, byte {place}; copy it again from where it came"
        try:
            if data[place : place + 4] == marker:
                row, place = _new_runs(data, place + 4, length)
                rows.append(np.frombuffer(row, np.uint8).reshape(4, length).T)
            else:
                row, place = _flat_or_old_runs(data, place, length)
                rows.append(np.frombuffer(row, np.uint8).reshape(length, 4))
        except IndexError:
            raise UnreadableFile(f"{path}: ends early, in {where}") from None
        except ValueError:
            raise UnreadableFile(f"{path}: damaged in {where}") from None
    return np.stack(rows)


def _new_runs(data: bytes, place: int, length: int) -> tuple[bytes | bytearray, int]:
    row = bytearray()
    for end in range(length, 4 * length + 1, length):
        while len(row) < end:
            code = data[place]
            if code > 128:
                row += data[place + 1 : place + 2] * (code - 128)
                place += 2
            elif code:
                row += data[place + 1 : place + 1 + code]
                place += 1 + code
            else:
                raise ValueError("a run of no bytes")
        if len(row) > end:
            raise ValueError("a run beyond the line")
    return row, place


def _flat_or_old_runs(data: bytes, place: int, length: int) -> tuple[bytes | bytearray, int]:
    flat = data[place : place + 4 * length]
    if len(flat) == 4 * length and b"\1\1\1" not in flat:
        return flat, place + 4 * length
    row, shift = bytearray(), 0
    while len(row) < 4 * length:
        red, green, blue, last = (data[place + i] for i in range(4))
        if red == green == blue == 1:
            count = last << shift
            # The bound comes before the repeat: the count may have any number of digits.
            if not row or count > length - len(row) // 4:
                raise ValueError("a run beyond the line")
            row += row[-4:] * count
            shift += 8
        else:
            row += data[place : place + 4]
            shift = 0
        place += 4
    return row, place
