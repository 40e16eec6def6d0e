"""Where a LogLuv TIFF keeps its pixels, held against the size of the file, and its rows as words, unpacked and packed.

Strips and tiles are both blocks of rows. A row of runs holds its words as byte streams, the highest byte first: 127 and
below counts the bytes that follow, 128 and above says that the next byte stands n − 126 times (Larson 1998, "Run-length
Compression"; as libtiff). So every row takes at least two bytes for 129 pixels of each stream, and a header that claims
more is refused before anything is allocated for it.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from relume.errors import FormatError, UnreadableFile
from relume.image.bands import in_threads
from relume.image.files.logluv.codes import CODES
from relume.image.files.read_options import OR_SALVAGE, ReadOptions, refuse_absurd_amount
from relume.image.files.tiff.directories import Folder
from relume.image.files.tiff.layout import COMPRESSION, PHOTOMETRIC, PLANAR, SAMPLES, TILE_WIDTH, Layout, layout_of

FORMAT = "LogLuv TIFF"
LOG_L, LOG_LUV = 32844, 32845  # PhotometricInterpretation
RUNS, PACKED_24 = 34676, 34677  # Compression: SGILOG and SGILOG24
_FILL_ORDER = 266
_LONGEST = 129  # pixels of a run, in two bytes
_WORDS = 2**16  # of a piece of work: 256 KiB, which stay in a core's own cache


@dataclass(frozen=True)
class Blocks:
    """The strips or tiles of a LogLuv TIFF, those of the upper rows first.

    layout : of the picture as stored; the last blocks may reach beyond it
    bits : 16, 24 or 32
    begins, lengths : (blocks,) int64, bytes in the file
    """

    layout: Layout
    bits: int
    begins: np.ndarray
    lengths: np.ndarray

    @property
    def streams(self) -> int:
        """Byte streams of runs in a row; 0 where there are none."""
        return {16: 2, 24: 0, 32: 4}[self.bits]

    @property
    def shortest_row(self) -> int:
        """Bytes that a row of a block takes at least."""
        return self.streams * 2 * -(-self.layout.block[0] // _LONGEST) or 3 * self.layout.block[0]

    @property
    def top(self) -> np.ndarray:
        """The picture row of each block's first."""
        return np.arange(len(self.begins)) // self.layout.across * self.layout.block[1]

    @property
    def rows(self) -> np.ndarray:
        """How many rows of each block lie in the picture."""
        return np.minimum(self.layout.block[1], self.layout.height - self.top)


def bits_of(path: str | os.PathLike[str], folder: Folder) -> int:
    """16, 24 or 32, the kind of LogLuv; raises UnreadableFile for one that is compressed as LogLuv never is."""
    photometric, compression = folder.number(PHOTOMETRIC), folder.number(COMPRESSION)
    if photometric not in (LOG_L, LOG_LUV) or compression not in (RUNS, PACKED_24):
        raise UnreadableFile(
            f"{path}: photometric {photometric} with compression {compression} is no LogLuv (32844 or 32845 with 34676 "
            "or 34677); convert it with the program that made it"
        )
    if photometric == LOG_L:  # libtiff reads runs whichever of the two is named
        return 16
    return 24 if compression == PACKED_24 else 32


def blocks_of(path: str | os.PathLike[str], folder: Folder, size: int, options: ReadOptions) -> Blocks:
    """The blocks that a folder lists, as far as they lie in a file of `size` bytes.

    Raises UnreadableFile for what is beyond `options`, FormatError for what breaks the format, such as blocks beyond
    the end of the file; with options.salvage these are cut short.
    """
    bits = bits_of(path, folder)
    layout = layout_of(path, folder, size, options)
    _refuse_strange(path, folder, layout, bits)
    begins, lengths = (np.minimum(places, 2**62).astype(np.int64) for places in (layout.places, layout.lengths))
    blocks = Blocks(layout, bits, np.maximum(begins, 0), lengths)
    within = np.clip(size - blocks.begins, 0, np.maximum(lengths, 0))
    if not options.salvage:
        least = blocks.rows * blocks.shortest_row
        for wrong, expected, found in (
            (within < lengths, lengths, f"the end of the file at {size}"),
            (lengths < least, least, "fewer"),
        ):
            for block in np.flatnonzero(wrong)[:1]:
                where = f"row {blocks.top[block]}, block {block} at byte {blocks.begins[block]}"
                raise FormatError(path, FORMAT, where, f"{expected[block]} bytes or more", found)
    # Blocks that lie over one another would have few bytes decoded again and again.
    if (total := sum(within.tolist())) > size:
        raise FormatError(path, FORMAT, "its blocks", f"{size} bytes, those of the file, or fewer", str(total))
    result = replace(blocks, lengths=within)
    begin, end = span(result)
    refuse_absurd_amount(path, 12 * layout.width * layout.height + end - begin, size, options)
    return result


def span(blocks: Blocks) -> tuple[int, int]:
    """The first byte of the blocks in the file, and the first behind them."""
    kept = blocks.lengths > 0
    if not np.any(kept):
        return 0, 0
    return int(blocks.begins[kept].min()), int((blocks.begins + blocks.lengths)[kept].max())


def _refuse_strange(path: str | os.PathLike[str], folder: Folder, layout: Layout, bits: int) -> None:
    if layout.samples not in ((1,) if bits == 16 else (1, 3)):
        raise FormatError(path, FORMAT, f"tag {SAMPLES}", "1 sample of LogL, 3 of LogLuv", str(layout.samples))
    if layout.planar:
        raise FormatError(path, FORMAT, f"tag {PLANAR}", "1, as LogLuv has no planes", "2")
    if folder.number(_FILL_ORDER, 1) == 2:
        raise UnreadableFile(f"{path}: its bits are in reverse order (tag {_FILL_ORDER}); convert it with libtiff")
    if layout.tiled and any(side % 16 for side in layout.block):  # TIFF 6.0, section 15
        found = f"{layout.block[0]} × {layout.block[1]}"
        raise FormatError(path, FORMAT, f"tag {TILE_WIDTH}", "tiles of a multiple of 16", found)


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
        result = np.zeros((blocks.layout.height, blocks.layout.width), bool)
        for first, count, top, left in self._pieces(blocks.layout.block[1]):
            missing = self.places[first : first + count, None] < 0
            result[top : top + count, left : left + blocks.layout.block[0]] |= missing
        return result

    def paint(self, picture: np.ndarray, work: Callable[[np.ndarray, np.ndarray], None]) -> int:
        """Call work(words, part of the picture) for all parts, on every core; how many words are no colour's.

        picture : (H, W, …)
        """
        from relume.image.files.logluv import kernels

        blocks = self.blocks
        pieces = list(self._pieces(max(1, _WORDS // blocks.layout.block[0])))

        def piece(begin: int, _end: int) -> int:
            first, count, top, left = pieces[begin]
            words = np.empty((count, blocks.layout.block[0]), np.uint32)
            places = self.places[first : first + count]
            strange = 0
            if blocks.bits == 24:
                strange = kernels.unpack_24(self.data, places, CODES, words)
            else:
                kernels.unpack_runs(self.data, places, blocks.streams, words)
            work(words, picture[top : top + count, left : left + blocks.layout.block[0]])
            return strange

        return sum(in_threads(piece, len(pieces), chunk=1))

    def _pieces(self, most: int) -> list[tuple[int, int, int, int]]:
        """(place of the first row, rows, top, left) of pieces of at most `most` rows."""
        blocks = self.blocks
        if blocks.layout.across == 1:  # rows of strips follow one another
            return [(y, min(most, blocks.layout.height - y), y, 0) for y in range(0, blocks.layout.height, most)]
        pieces = []
        for block, (top, rows) in enumerate(zip(blocks.top.tolist(), blocks.rows.tolist(), strict=True)):
            left = block % blocks.layout.across * blocks.layout.block[0]
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
    kernels.find_rows(data, begins, ends, firsts, blocks.layout.block[0], blocks.streams, places, failures)
    for block in np.flatnonzero(failures[:, 0] >= 0):
        row, byte, filled = failures[block].tolist()
        where = f"row {blocks.top[block] + row}, byte {begin + byte}"
        expected = f"a stream of {blocks.layout.block[0]} pixels"
        if filled > blocks.layout.block[0]:
            raise FormatError(path, FORMAT, where, expected, f"a run that makes them {filled}")
        if not options.salvage:
            raise FormatError(path, FORMAT, where, expected, f"{filled} until the end of its block", OR_SALVAGE)
    return Rows(blocks, data, places, firsts)


def packed(words: np.ndarray, bits: int, rows: int) -> list[memoryview]:
    """The strips of `rows` rows each that hold (H, W) uint32 words."""
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
