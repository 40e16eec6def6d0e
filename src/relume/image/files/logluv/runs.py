"""The rows of a LogLuv TIFF as words: found in the file, unpacked by several threads, and packed again.

A row of runs holds its words as byte streams, the highest byte first: 127 and below counts the bytes that follow,
128 and above says that the next byte stands n − 126 times (Larson 1998, "Run-length Compression"; as libtiff).
"""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from relume.errors import FormatError
from relume.image.files.logluv.blocks import FORMAT, Blocks, span
from relume.image.files.logluv.codes import CODES
from relume.image.files.read_options import OR_SALVAGE, ReadOptions

_WORDS = 2**16  # of a piece of work: 256 KiB, which stay in a core's own cache


@dataclass(frozen=True)
class Rows:
    """The rows of a picture, where they stand in the file.

    blocks : that they lie in
    data : (N,) uint8, the bytes of the file that hold them
    places : int64, where in `data` each row of each block begins; −1 where it is missing
    firsts : (blocks + 1,) int64, the place of each block's first row
    """

    blocks: Blocks
    data: np.ndarray
    places: np.ndarray
    firsts: np.ndarray

    def missing(self) -> np.ndarray:
        """(H, W) bool, True where the file ends before the pixel."""
        blocks = self.blocks
        result = np.zeros((blocks.height, blocks.width), bool)
        for first, count, top, left in self._pieces(blocks.block_height):
            missing = self.places[first : first + count, None] < 0
            result[top : top + count, left : left + blocks.block_width] |= missing
        return result

    def paint(self, picture: np.ndarray, work: Callable[[np.ndarray, np.ndarray], None]) -> int:
        """Call work(words, part of the picture) for all parts, on every core; how many words are no colour's.

        picture : (H, W, …)
        """
        from relume._kernel import in_threads
        from relume.image.files.logluv import kernels

        blocks = self.blocks
        pieces = list(self._pieces(max(1, _WORDS // blocks.block_width)))

        def piece(begin: int, _end: int) -> int:
            first, count, top, left = pieces[begin]
            words = np.empty((count, blocks.block_width), np.uint32)
            places = self.places[first : first + count]
            strange = 0
            if blocks.bits == 24:
                strange = kernels.unpack_24(self.data, places, CODES, words)
            else:
                kernels.unpack_runs(self.data, places, blocks.streams, words)
            work(words, picture[top : top + count, left : left + blocks.block_width])
            return strange

        return sum(in_threads(piece, len(pieces), chunk=1))

    def _pieces(self, most: int) -> list[tuple[int, int, int, int]]:
        """(place of the first row, rows, top, left) of pieces of at most `most` rows."""
        blocks = self.blocks
        if blocks.across == 1:  # rows of strips follow one another
            return [(y, min(most, blocks.height - y), y, 0) for y in range(0, blocks.height, most)]
        pieces = []
        for block, (top, rows) in enumerate(zip(blocks.top.tolist(), blocks.rows.tolist(), strict=True)):
            left = block % blocks.across * blocks.block_width
            for row in range(0, rows, most):
                pieces.append((int(self.firsts[block]) + row, min(most, rows - row), top + row, left))
        return pieces


def find(path: str | os.PathLike[str], blocks: Blocks, options: ReadOptions) -> Rows:
    """Find every row of the blocks; raises FormatError for a row that is cut short or longer than the picture.

    With options.salvage such a row, and those behind it in its block, are missing.
    """
    begin, end = span(blocks)
    with open(path, "rb") as file:
        file.seek(begin)
        data = np.frombuffer(file.read(end - begin), np.uint8)
    begins = np.clip(blocks.begins - begin, 0, len(data))
    ends = np.minimum(begins + blocks.lengths, len(data))
    firsts = np.concatenate([[0], np.cumsum(blocks.rows)])
    places = np.full(firsts[-1], -1, np.int64)
    if blocks.bits == 24:
        block = np.repeat(np.arange(len(begins)), blocks.rows)
        starts = begins[block] + (np.arange(firsts[-1]) - firsts[block]) * blocks.shortest_row
        whole = starts + blocks.shortest_row <= ends[block]
        places[whole] = starts[whole]
        return Rows(blocks, data, places, firsts)
    from relume.image.files.logluv import kernels

    failures = np.full((len(begins), 3), -1, np.int64)
    kernels.find_rows(data, begins, ends, firsts, blocks.block_width, blocks.streams, places, failures)
    for block in np.flatnonzero(failures[:, 0] >= 0):
        row, byte, filled = failures[block].tolist()
        where = f"row {blocks.top[block] + row}, byte {begin + byte}"
        expected = f"a stream of {blocks.block_width} pixels"
        if filled > blocks.block_width:
            raise FormatError(path, FORMAT, where, expected, f"a run that makes them {filled}")
        if not options.salvage:
            raise FormatError(path, FORMAT, where, expected, f"{filled} until the end of its block", OR_SALVAGE)
    return Rows(blocks, data, places, firsts)


def packed(words: np.ndarray, bits: int, rows: int) -> list[memoryview]:
    """The strips of `rows` rows each that hold (H, W) uint32 words."""
    from relume._kernel import in_threads
    from relume.image.files.logluv import kernels

    width = words.shape[1]

    def strip(begin: int, end: int) -> memoryview:
        if bits == 24:
            stored = np.empty(((end - begin) * width, 3), np.uint8)
            kernels.pack_24(words[begin:end].reshape(-1), stored)
            return stored.reshape(-1).data
        streams = bits // 8
        room = np.empty((end - begin) * streams * (width + -(-width // 127)), np.uint8)
        length = kernels.pack_runs(words[begin:end], streams, room)
        return room[:length].copy().data

    return in_threads(strip, len(words), chunk=rows)
