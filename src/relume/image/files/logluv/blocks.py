"""Where a LogLuv TIFF keeps its pixels: what its tags claim, held against the size of the file.

Strips and tiles are both blocks of rows. Every row of runs takes at least two bytes for 129 pixels of each stream, so
that a header that claims more is refused before anything is allocated for it.
"""

from __future__ import annotations

import os
from dataclasses import dataclass, replace

import numpy as np

from relume.errors import FormatError, UnreadableFile
from relume.image.files.read_options import ReadOptions, refuse_absurd_amount
from relume.image.files.tiff.directories import Folder
from relume.image.files.tiff.layout import COMPRESSION, PHOTOMETRIC, PLANAR, SAMPLES, TILE_WIDTH, Layout, layout_of

FORMAT = "LogLuv TIFF"
LOG_L, LOG_LUV = 32844, 32845  # PhotometricInterpretation
RUNS, PACKED_24 = 34676, 34677  # Compression: SGILOG and SGILOG24
_FILL_ORDER = 266
_LONGEST = 129  # pixels of a run, in two bytes


@dataclass(frozen=True)
class Blocks:
    """The strips or tiles of a LogLuv TIFF, those of the upper rows first.

    width, height : of the picture as stored
    bits : 16, 24 or 32
    block_width, block_height : of a block; the last ones may reach beyond the picture
    across : blocks beside one another, 1 of strips
    tiled : whether they are tiles
    begins, lengths : (blocks,) int64, bytes in the file
    """

    width: int
    height: int
    bits: int
    block_width: int
    block_height: int
    across: int
    tiled: bool
    begins: np.ndarray
    lengths: np.ndarray

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
        """How many rows of each block lie in the picture."""
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


def blocks_of(path: str | os.PathLike[str], folder: Folder, size: int, options: ReadOptions) -> Blocks:
    """The blocks that a folder lists, as far as they lie in a file of `size` bytes.

    Raises UnreadableFile for what is beyond `options`, FormatError for what breaks the format, such as blocks beyond
    the end of the file; with options.salvage these are cut short.
    """
    bits = bits_of(path, folder)
    layout = layout_of(path, folder, size, options)
    _refuse_strange(path, folder, layout, bits)
    begins, lengths = (np.minimum(places, 2**62).astype(np.int64) for places in (layout.places, layout.lengths))
    blocks = Blocks(
        layout.width, layout.height, bits, *layout.block, layout.across, layout.tiled, np.maximum(begins, 0), lengths
    )
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
