"""Seeded damage to good files: the kinds that OpenEXR's fuzz test does, and those that real files suffer.

Each mutant is reported by its format and number alone, so that one found today is made again tomorrow.
"""

from __future__ import annotations

import zlib
from collections.abc import Callable, Iterator

import numpy as np

from corpus.files import Bad, Corpus, Good, integer

_TELLING = (0, 1, 2, -1, -2, 2**15, 2**16 - 1, 2**16, 2**24, 2**31 - 1, -(2**31), 0x7F800000, 0x7FC00000, 0x3F800000)
_HEAD = 2048  # bytes; OpenEXR's fuzz test damages these apart, because headers stand there
_SHARE = 0.1  # of the bytes at most, as there


def mutants(corpus: Corpus, count: int) -> Iterator[tuple[Bad, str]]:
    """`count` damaged files, each with the door to read it through."""
    for number in range(count):
        random = np.random.default_rng([zlib.crc32(corpus.name.encode()), number])
        good = corpus.good[number % len(corpus.good)]
        kind, damage = _KINDS[int(random.integers(len(_KINDS)))]
        data = damage(good, random)
        # Half with their checksums made right again, so that decoders are reached too.
        if corpus.repaired is not None and random.random() < 0.5:
            data = corpus.repaired(data)
        # Every fifth takes another way than the most important one.
        door = corpus.doors[number // 5 % len(corpus.doors)] if number % 5 == 0 else corpus.doors[0]
        yield Bad(f"{corpus.name} mutant {number}: {good.name}, {kind}", data, good.suffix, refused=False), door


def _noise(random: np.random.Generator, length: int) -> bytes:
    style = int(random.integers(4))
    return bytes(length) if style == 0 else b"\xff" * length if style == 1 else random.bytes(length)


def _ranges(good: Good, random: np.random.Generator, end: int | None = None) -> tuple[int, int]:
    """Place and length of up to a tenth of the file, or of its bytes before `end`."""
    size = min(len(good.data), end or len(good.data))
    length = int(random.integers(1, max(2, int(size * _SHARE) + 1)))
    return int(random.integers(0, max(1, size - length + 1))), length


def _window(good: Good, random: np.random.Generator) -> bytes:
    place, length = _ranges(good, random)
    return good.data[:place] + _noise(random, length) + good.data[place + length :]


def _scattered(good: Good, random: np.random.Generator) -> bytes:
    data = bytearray(good.data)
    size = min(_HEAD, len(data))
    for _ in range(int(random.integers(1, max(2, int(size * _SHARE))))):
        data[int(random.integers(size))] = int(random.integers(256))
    return bytes(data)


def _head(good: Good, random: np.random.Generator) -> bytes:
    place, length = _ranges(good, random, end=min(_HEAD, 256))
    return good.data[:place] + _noise(random, length) + good.data[place + length :]


def _truncated(good: Good, random: np.random.Generator) -> bytes:
    return good.data[: int(random.integers(1, len(good.data)))]


def _number(good: Good, random: np.random.Generator) -> bytes:
    data = bytearray(good.data)
    for _ in range(int(random.integers(1, 3))):
        place = int(random.integers(0, max(1, len(data) - 3)))
        place -= place % 4 if random.random() < 0.5 else 0
        data[place : place + 4] = integer(_TELLING[int(random.integers(len(_TELLING)))], "I", "<>"[random.integers(2)])
    return bytes(data)


def _bit(good: Good, random: np.random.Generator) -> bytes:
    data = bytearray(good.data)
    for _ in range(int(random.integers(1, 4))):
        data[int(random.integers(len(data)))] ^= 1 << int(random.integers(8))
    return bytes(data)


def _swapped(good: Good, random: np.random.Generator) -> bytes:
    data = bytearray(good.data)
    first, length = _ranges(good, random)
    second = int(random.integers(0, max(1, len(data) - length + 1)))
    held = data[first : first + length]
    data[first : first + length] = data[second : second + length]
    data[second : second + length] = held
    return bytes(data)


def _duplicated(good: Good, random: np.random.Generator) -> bytes:
    place, length = _ranges(good, random)
    return good.data[: place + length] + good.data[place:]


def _removed(good: Good, random: np.random.Generator) -> bytes:
    place, length = _ranges(good, random)
    return good.data[:place] + good.data[place + length :] or b"\0"


_KINDS: tuple[tuple[str, Callable[[Good, np.random.Generator], bytes]], ...] = (
    ("a window of damage", _window),
    ("a window of damage", _window),
    ("scattered damage to its head", _scattered),
    ("a window in its header", _head),
    ("cut short", _truncated),
    ("a number overwritten", _number),
    ("a number overwritten", _number),
    ("a few bits flipped", _bit),
    ("two ranges exchanged", _swapped),
    ("a range doubled", _duplicated),
    ("a range lost", _removed),
)
