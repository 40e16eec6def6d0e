"""Where a LogLuv TIFF keeps its pixels: what its tags claim, held against the size of the file.

Strips and tiles are both blocks of rows. Every row of runs takes at least two bytes for 129 pixels of each stream, so
that a header is refused before anything is allocated for it.
"""

from __future__ import annotations

import os
from dataclasses import dataclass

import numpy as np

from relume.errors import FormatError, UnreadableFile
from relume.image.files.reading import Reading, refuse_absurd_amount, refuse_absurd_size
from relume.image.files.tiff_folders import Folder

FORMAT = "LogLuv TIFF"
LOG_L, LOG_LUV = 32844, 32845  # PhotometricInterpretation
RUNS, PACKED_24 = 34676, 34677  # Compression: SGILOG and SGILOG24
WIDTH, HEIGHT, COMPRESSION, PHOTOMETRIC = 256, 257, 259, 262
FILL_ORDER, STRIP_OFFSETS, CHANNELS, ROWS_PER_STRIP, STRIP_COUNTS, PLANAR = 266, 273, 277, 278, 279, 284
TILE_WIDTH, TILE_HEIGHT, TILE_OFFSETS, TILE_COUNTS = 322, 323, 324, 325
_LONGEST = 129  # pixels of a run, in two bytes


@dataclass(frozen=True)
class Blocks:
    """The strips or tiles of a LogLuv TIFF.

    width, height : of the picture
    bits : 16, 24 or 32
    across : blocks beside one another, 1 of strips
    block_width, block_height : of a block; the last ones may reach beyond the picture
    begins, lengths : (blocks,) int64, bytes in the file, those of the upper rows first
    tiled : whether they are tiles
    """

    width: int
    height: int
    bits: int
    across: int
    block_width: int
    block_height: int
    begins: np.ndarray
    lengths: np.ndarray
    tiled: bool

    @property
    def streams(self) -> int:
        """Byte streams of runs in a row; 0 where there are none."""
        return {16: 2, 24: 0, 32: 4}[self.bits]

    @property
    def shortest_row(self) -> int:
        """Bytes that a row of a block takes at least."""
        return self.streams * 2 * -(-self.block_width // _LONGEST) or 3 * self.block_width

    @property
    def top(self) -> np.ndarray:
        """The picture row of each block's first."""
        return np.arange(len(self.begins)) // self.across * self.block_height

    @property
    def rows(self) -> np.ndarray:
        """The rows of each block that lie in the picture."""
        return np.minimum(self.block_height, self.height - self.top)


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


def blocks_of(path: str | os.PathLike[str], folder: Folder, size: int, reading: Reading) -> Blocks:
    """The blocks that a folder tells of, checked against `size`, the bytes of the file.

    Raises UnreadableFile for what is beyond `reading`, FormatError for what breaks the format; with reading.salvage
    blocks may reach beyond the file's end.
    """
    bits = bits_of(path, folder)
    width, height = int(folder.number(WIDTH, 0) or 0), int(folder.number(HEIGHT, 0) or 0)
    refuse_absurd_size(path, width, height, reading)
    refuse_absurd_amount(path, 12 * width * height, size, reading)
    channels = int(folder.number(CHANNELS, 1) or 1)
    if channels not in (1, 3) or (channels == 3 and bits == 16):
        raise FormatError(path, FORMAT, f"tag {CHANNELS}", "1 sample of LogL, 1 or 3 of LogLuv", str(channels))
    if channels == 3 and folder.number(PLANAR, 1) == 2:
        raise FormatError(path, FORMAT, f"tag {PLANAR}", "1, as LogLuv has no planes", "2")
    if folder.number(FILL_ORDER, 1) == 2:
        raise UnreadableFile(f"{path}: its bits are in reverse order (tag {FILL_ORDER}); convert it with libtiff")
    tiled = TILE_OFFSETS in folder.values or TILE_WIDTH in folder.values
    if tiled:
        block_width, block_height = (int(folder.number(tag, 0) or 0) for tag in (TILE_WIDTH, TILE_HEIGHT))
        for tag, side in ((TILE_WIDTH, block_width), (TILE_HEIGHT, block_height)):
            if side < 16 or side % 16 or side > reading.side:  # TIFF 6.0, section 15
                raise FormatError(path, FORMAT, f"tag {tag}", f"a multiple of 16 up to {reading.side}", str(side))
    else:
        block_width, block_height = width, min(int(folder.number(ROWS_PER_STRIP, height) or 0), height)
        if block_height < 1:
            raise FormatError(path, FORMAT, f"tag {ROWS_PER_STRIP}", "1 row a strip or more", str(block_height))
    across, down = -(-width // block_width), -(-height // block_height)
    places, counts = (TILE_OFFSETS, TILE_COUNTS) if tiled else (STRIP_OFFSETS, STRIP_COUNTS)
    begins, lengths = folder.integers(places), folder.integers(counts)
    for tag, values in ((places, begins), (counts, lengths)):
        if len(values) < across * down or any(not 0 <= value < 2**62 for value in values):
            found = f"{len(values)}" if len(values) < across * down else "one that no file has"
            raise FormatError(path, FORMAT, f"tag {tag}", f"{across * down} numbers, one a block", found)
    result = Blocks(
        width,
        height,
        bits,
        across,
        block_width,
        block_height,
        np.array(begins[: across * down], np.int64),
        np.array(lengths[: across * down], np.int64),
        tiled,
    )
    _refuse_impossible(path, result, size, reading)
    return result


def _refuse_impossible(path: str | os.PathLike[str], blocks: Blocks, size: int, reading: Reading) -> None:
    """Raise FormatError for blocks beyond the file, over one another, or too short for their rows."""
    # Overlapping blocks would have few bytes decoded again and again.
    total = sum(int(length) for length in blocks.lengths)
    if total > size and not reading.salvage:
        beyond = np.flatnonzero(blocks.begins + blocks.lengths > size)
        where = f"block {beyond[0] if len(beyond) else 0}, row {blocks.top[beyond[0]] if len(beyond) else 0}"
        raise FormatError(path, FORMAT, where, f"{total} bytes in {len(blocks.lengths)} blocks", f"{size} bytes of file")
    if reading.salvage:
        return
    beyond = np.flatnonzero(blocks.begins + blocks.lengths > size)
    if len(beyond):
        block = beyond[0]
        raise FormatError(
            path,
            FORMAT,
            f"row {blocks.top[block]}, block {block} at byte {blocks.begins[block]}",
            f"{blocks.lengths[block]} bytes",
            f"the end of the file at {size}",
        )
    short = np.flatnonzero(blocks.lengths < blocks.rows * blocks.shortest_row)
    if len(short):
        block = short[0]
        raise FormatError(
            path,
            FORMAT,
            f"row {blocks.top[block]}, block {block} at byte {blocks.begins[block]}",
            f"{blocks.rows[block] * blocks.shortest_row} bytes or more for {blocks.rows[block]} rows",
            f"{blocks.lengths[block]}",
        )
