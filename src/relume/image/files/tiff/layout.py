"""How the pixels of a TIFF lie in their file: its size, its samples, and its strips or tiles; judged, not decoded.

Format: TIFF 6.0, sections 3 to 15, and Adobe Photoshop TIFF technical note 3 for the floating-point predictor. The
eight orientations are those of EXIF 2.32 too.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from relume.errors import FormatError, UnreadableFile
from relume.image.files.read_options import ReadOptions, refuse_absurd_amount, refuse_absurd_size
from relume.image.files.tiff.directories import Folder

SUBFILE, _SMALLER, _MASK = 254, 1, 4
WIDTH, HEIGHT, BITS, COMPRESSION, PHOTOMETRIC, ORIENTATION = 256, 257, 258, 259, 262, 274
STRIP_PLACES, SAMPLES, STRIP_ROWS, STRIP_LENGTHS, PLANAR, PREDICTOR = 273, 277, 278, 279, 284, 317
TILE_WIDTH, TILE_HEIGHT, TILE_PLACES, TILE_LENGTHS, EXTRA, SAMPLE_FORMAT = 322, 323, 324, 325, 338, 339

NONE, LZW, ZIP, PACKBITS, OLD_ZIP = 1, 5, 8, 32773, 32946
COMPRESSIONS = {
    NONE: "uncompressed",
    2: "CCITT",
    3: "CCITT G3",
    4: "CCITT G4",
    LZW: "LZW",
    6: "old JPEG",
    7: "JPEG",
    ZIP: "ZIP",
    PACKBITS: "PackBits",
    34676: "SGILOG",
    34677: "SGILOG24",
    34712: "JPEG 2000",
    34887: "LERC",
    34925: "LZMA",
    OLD_ZIP: "ZIP",
    50000: "ZSTD",
    50001: "WebP",
}
UNSIGNED, SIGNED, FLOAT = 1, 2, 3  # sample formats
# The most that a byte of file can become: DEFLATE copies 258 bytes by two bits, the code of LZW stands for fewer than
# 4096 bytes in nine bits or more; and what is not packed is what it is.
_MOST = {NONE: 1, LZW: 4096, ZIP: 1032, OLD_ZIP: 1032, PACKBITS: 64}
_FRAME = "its first folder"
# By the value of ORIENTATION: rows, columns and axes as stored → as seen.
_UPRIGHT: Mapping[int, Callable[[np.ndarray], np.ndarray]] = {
    1: lambda p: p,
    2: lambda p: p[:, ::-1],
    3: lambda p: p[::-1, ::-1],
    4: lambda p: p[::-1],
    5: lambda p: p.swapaxes(0, 1),
    6: lambda p: p.swapaxes(0, 1)[:, ::-1],
    7: lambda p: p[::-1, ::-1].swapaxes(0, 1),
    8: lambda p: p.swapaxes(0, 1)[::-1],
}


@dataclass(frozen=True)
class Layout:
    """How the pixels of one page lie in a TIFF.

    width, height : of the picture as stored
    samples, extra : of each pixel in all, and how many of those are no colours (alpha)
    bits, sample_format : of each sample; 1 unsigned, 2 signed, 3 float
    compression, predictor, photometric : as the tags say
    planar : whether each sample has strips of its own, one plane after the other
    block : (width, height) of a strip or tile
    tiled : whether these are tiles
    places, lengths : of the strips or tiles, bytes
    """

    width: int
    height: int
    samples: int
    extra: int
    bits: int
    sample_format: int
    compression: int
    predictor: int
    photometric: int
    planar: bool
    block: tuple[int, int]
    tiled: bool
    places: tuple[int, ...]
    lengths: tuple[int, ...]

    @property
    def across(self) -> int:
        """How many blocks stand beside one another."""
        return -(-self.width // self.block[0])

    @property
    def down(self) -> int:
        """How many blocks stand below one another."""
        return -(-self.height // self.block[1])

    @property
    def decoded(self) -> int:
        """Bytes of all samples in memory."""
        return self.width * self.height * self.samples * -(-self.bits // 8)

    @property
    def packing(self) -> str:
        """The name of the compression, or its number."""
        return COMPRESSIONS.get(self.compression, f"compression {self.compression}")

    def rows_within(self, size: int) -> int:
        """How many rows from the top a file of `size` bytes holds; of a packed strip or tile all of them or none."""
        plane, deep = self.across * self.down, self.block[1]
        row = self.block[0] * (1 if self.planar else self.samples) * self.bits // 8
        rows = self.height
        for index, (place, length) in enumerate(zip(self.places, self.lengths, strict=True)):
            if place + length > size:
                top = index % plane // self.across * deep
                there = max(size - place, 0) // row if self.compression == NONE and row else 0
                rows = min(rows, top + min(there, deep))
        return rows


def layout_of(path: str | os.PathLike[str], folder: Folder, size: int, options: ReadOptions) -> Layout:
    """The layout of the page whose folder that is, in a file of `size` bytes.

    Raises UnreadableFile where it is larger than `options` allows, FormatError where the tags break the format or
    claim more pixels than their bytes can hold. A file that ends early is left to `Layout.rows_within`.
    """
    width, height = (_count(path, folder, tag, name) for tag, name in ((WIDTH, "width"), (HEIGHT, "height")))
    refuse_absurd_size(path, width, height, options)
    samples = _count(path, folder, SAMPLES, "samples", 1)
    if samples > options.channels:
        raise UnreadableFile(f"{path}: its header claims {samples} channels; relume reads {options.channels}")
    bits = _alike(path, folder, BITS, "bits", 1)
    kind = _alike(path, folder, SAMPLE_FORMAT, "sample format", UNSIGNED)
    tiled = TILE_WIDTH in folder.values
    tags = (TILE_PLACES, TILE_LENGTHS) if tiled else (STRIP_PLACES, STRIP_LENGTHS)
    places, lengths = (folder.integers(tag) for tag in tags)
    if tiled:
        block = _count(path, folder, TILE_WIDTH, "tile width"), _count(path, folder, TILE_HEIGHT, "tile height")
        refuse_absurd_size(path, *block, options, where="the tag of its tiles")
    else:
        block = (width, min(_count(path, folder, STRIP_ROWS, "rows of a strip", height), height))
    layout = Layout(
        width,
        height,
        samples,
        len(folder.integers(EXTRA)),
        bits,
        kind,
        _count(path, folder, COMPRESSION, "compression", NONE),
        _count(path, folder, PREDICTOR, "predictor", 1),
        int(_finite(folder, PHOTOMETRIC, -1)),
        samples > 1 and _finite(folder, PLANAR, 1) == 2,
        block,
        tiled,
        places,
        lengths if lengths or tiled or len(places) != 1 else (max(size - places[0], 0),),
    )
    _refuse_senseless(path, layout, size, options)
    return layout


def upright(picture: np.ndarray, orientation: float) -> np.ndarray:
    """A stored picture (H, W, …) as it is seen; as it is where the orientation is none of the eight."""
    return np.ascontiguousarray(_UPRIGHT.get(int(orientation), _UPRIGHT[1])(picture))


def orientation_of(folder: Folder) -> float:
    """The value of ORIENTATION, 1 where it is missing."""
    return _finite(folder, ORIENTATION, 1)


def pages_of(folders: Sequence[Folder]) -> int:
    """How many pictures a TIFF holds, the first and all that are neither its smaller copies nor its masks."""
    return 1 + sum(not int(_finite(folder, SUBFILE, 0)) & (_SMALLER | _MASK) for folder in folders[1:])


def _refuse_senseless(path: str | os.PathLike[str], layout: Layout, size: int, options: ReadOptions) -> None:
    kind = "tiles" if layout.tiled else "strips"
    wanted = layout.across * layout.down * (layout.samples if layout.planar else 1)
    for name, found in (("offsets", layout.places), ("byte counts", layout.lengths)):
        if len(found) != wanted:
            expected = f"{wanted} {name} of {kind}"
            raise FormatError(path, "TIFF", _FRAME, expected, str(len(found)))
    refuse_absurd_amount(path, layout.decoded, size, options)
    block = layout.block[0] * layout.block[1] * (1 if layout.planar else layout.samples) * layout.bits // 8
    refuse_absurd_amount(path, block, size, options)
    most = _MOST.get(layout.compression, 0)
    stored = sum(layout.lengths)
    least = layout.width * layout.height * layout.samples * layout.bits // 8
    if most and stored * most < least:
        expected = f"{kind} that hold {least} bytes of pixels"
        raise FormatError(path, "TIFF", _FRAME, expected, f"{stored} bytes, {layout.packing}")


def _finite(folder: Folder, tag: int, default: float) -> float:
    values = folder.integers(tag)
    return values[0] if values else default


def _count(path: str | os.PathLike[str], folder: Folder, tag: int, name: str, default: int | None = None) -> int:
    """A tag that has to be a whole number above 0."""
    if tag not in folder.values and default is not None:
        return default
    values = folder.integers(tag)
    if not values or values[0] < 1:
        raise FormatError(path, "TIFF", f"tag {tag} ({name})", "a number above 0", str(values[:1] or "none"))
    return values[0]


def _alike(path: str | os.PathLike[str], folder: Folder, tag: int, name: str, default: int) -> int:
    """A tag that holds one number a sample, all of them alike."""
    values = set(folder.integers(tag)) if tag in folder.values else {default}
    if len(values) != 1 or not 1 <= min(values) <= 64:
        found = ", ".join(map(str, sorted(values))) or "none"
        raise FormatError(path, "TIFF", f"tag {tag} ({name})", "the same of every sample, 1 to 64", found)
    return values.pop()
