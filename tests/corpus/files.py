"""What a corpus is made of: good files that say what they hold, bad ones that say what is wrong with them."""

from __future__ import annotations

import struct
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

import numpy as np

WIDTH, HEIGHT = 16, 8
"""The size of most good pictures: not square, and wide enough for the run lengths of Radiance."""

READ = "relume.image.files:read"
READ_PHOTOGRAPH = "relume.image.files:read_photograph"
READ_RADIANCE = "relume.image.files:read_radiance"
READ_FACTS = "relume.image.files:read_facts"
READ_RAW = "relume.image.files:read_raw"
READ_CUBE = "relume.image.files.textures.ktx2:read_cube"
READ_LAYERS = "relume.image.files:read_layers"
DESCRIBE = "relume.image.files.description:describe"
SALVAGE = "corpus.doors:salvaged"
"""The ways into the package, as module and function."""


@dataclass(frozen=True)
class Good:
    """A file that its format allows.

    pixels : (H, W, 3) what it holds, or (H, W) its luminance; None where only that it opens is known
    tolerance : of each value, relative to the largest of the picture
    """

    name: str
    data: bytes
    suffix: str
    pixels: np.ndarray | None = None
    tolerance: float = 0.0


@dataclass(frozen=True)
class Bad:
    """A file that breaks its format, or claims what no reader should believe.

    refused : nothing in it can be used, so that reading it must fail; else a reader may also mend or leave out what is
        wrong
    """

    name: str
    data: bytes
    suffix: str
    refused: bool = True


@dataclass(frozen=True)
class Corpus:
    """The files of one format.

    doors : the functions it is read through, the most important first
    repaired : makes checksums right again after damage, so that what is behind them is reached; None without any
    """

    name: str
    good: Sequence[Good]
    bad: Sequence[Bad]
    doors: Sequence[str] = (READ, DESCRIBE, SALVAGE)
    repaired: Callable[[bytes], bytes] | None = None


def picture(seed: int, height: int = HEIGHT, width: int = WIDTH) -> np.ndarray:
    """(H, W, 3) float32 positive values over three decades, which halves hold exactly."""
    random = np.random.default_rng(seed)
    return np.exp2(random.uniform(-5, 5, (height, width, 3))).astype(np.float16).astype(np.float32)


def patched(data: bytes, place: int, new: bytes) -> bytes:
    """`data` with `new` in place of as many bytes at `place`."""
    assert 0 <= place and place + len(new) <= len(data)
    return data[:place] + new + data[place + len(new) :]


def replaced(data: bytes, old: bytes, new: bytes) -> bytes:
    """`data` with the first `old` replaced, which must be there."""
    assert old in data, old
    return data.replace(old, new, 1)


def integer(value: int, letter: str, order: str = "<") -> bytes:
    """A number as `struct` packs it, modulo its size."""
    size = struct.calcsize(order + letter)
    return (value % 2 ** (8 * size)).to_bytes(size, "little" if order == "<" else "big")


def cut(name: str, data: bytes, suffix: str, places: Iterable[int], *, refused: bool = True) -> list[Bad]:
    """The file ending early at each of `places` (from its end where negative)."""
    return [Bad(f"{name}, ends at byte {at % len(data)} of {len(data)}", data[:at], suffix, refused) for at in places]
