"""Small DNG files, written tag by tag from the specification (DNG 1.4, TIFF 6, EXIF 2.32), and a virtual sensor."""

from __future__ import annotations

import struct
from collections.abc import Sequence
from fractions import Fraction
from pathlib import Path

import numpy as np

RGGB = ((0, 1), (1, 2))
SIZES = {1: 1, 2: 1, 3: 2, 4: 4, 5: 8, 7: 1, 10: 8}
# Camera ← XYZ of a virtual camera whose filters overlap as real ones do.
COLOUR_MATRIX = ((0.8, -0.2, -0.1), (-0.4, 1.2, 0.2), (-0.05, 0.2, 0.6))

Tag = tuple[int, int, bytes]


def shorts(tag: int, *values: int) -> Tag:
    return tag, 3, struct.pack(f"<{len(values)}H", *values)


def longs(tag: int, *values: int) -> Tag:
    return tag, 4, struct.pack(f"<{len(values)}I", *values)


def rationals(tag: int, *values: float, signed: bool = False) -> Tag:
    fractions = [Fraction(value).limit_denominator(1_000_000) for value in values]
    pairs = [part for fraction in fractions for part in (fraction.numerator, fraction.denominator)]
    return tag, 10 if signed else 5, struct.pack(f"<{len(pairs)}{'i' if signed else 'I'}", *pairs)


def text(tag: int, value: str) -> Tag:
    return tag, 2, value.encode("ascii") + b"\0"


def octets(tag: int, *values: int) -> Tag:
    return tag, 1, bytes(values)


def folder(tags: Sequence[Tag], offset: int) -> bytes:
    """A TIFF directory at `offset`, its long values behind it."""
    tags = sorted(tags)
    entries, values = b"", b""
    behind = offset + 2 + 12 * len(tags) + 4
    for tag, kind, data in tags:
        entries += struct.pack("<HHI", tag, kind, len(data) // SIZES[kind])
        if len(data) <= 4:
            entries += data.ljust(4, b"\0")
        else:
            entries += struct.pack("<I", behind + len(values))
            values += data + b"\0" * (len(data) % 2)
    return struct.pack("<H", len(tags)) + entries + struct.pack("<I", 0) + values


def write_dng(
    path: Path,
    mosaic: np.ndarray,
    *,
    pattern: Sequence[Sequence[int]] = RGGB,
    black: Sequence[int] = (512, 512, 512, 512),
    white: int = 16383,
    seconds: float | None = 1 / 60,
    f_number: float | None = 4.0,
    iso: int | None = 100,
    orientation: int = 1,
    margins: tuple[int, int] = (0, 0),
    as_shot: Sequence[float] = (0.5, 1.0, 0.6),
    linear: bool = False,
) -> Path:
    """An uncompressed 16-bit DNG of a mosaic (H, W), or with `linear` of three values a pixel.

    pattern, black : of the sites of a 2 × 2 block, counted from the active area, which begins at `margins`
    """
    height, width = mosaic.shape[:2]
    exposure: list[Tag] = [rationals(0x920A, 35.0), shorts(0xA405, 35), text(0x9003, "2026:01:02 03:04:05")]
    exposure += [rationals(0x829A, seconds)] if seconds is not None else []
    exposure += [rationals(0x829D, f_number)] if f_number is not None else []
    exposure += [shorts(0x8827, iso)] if iso is not None else []
    samples = 3 if linear else 1
    tags: list[Tag] = [
        longs(254, 0),
        longs(256, width),
        longs(257, height),
        shorts(258, *[16] * samples),
        shorts(259, 1),
        shorts(262, 34892 if linear else 32803),
        text(271, "Virtual"),
        text(272, "Virtual One"),
        longs(273, 8),
        shorts(274, orientation),
        shorts(277, samples),
        longs(278, height),
        longs(279, mosaic.nbytes),
        shorts(284, 1),
        octets(50706, 1, 4, 0, 0),
        octets(50707, 1, 1, 0, 0),
        text(50708, "Virtual One"),
        longs(50717, *[white] * samples),
        rationals(50721, *np.ravel(COLOUR_MATRIX).tolist(), signed=True),
        rationals(50728, *as_shot),
        shorts(50778, 21),  # D65
    ]
    if not linear:
        tags += [shorts(33421, 2, 2), octets(33422, *np.ravel(pattern).tolist())]
        tags += [shorts(50713, 2, 2), shorts(50714, *black)]
        tags += [longs(50829, margins[0], margins[1], height, width)]
    data = np.ascontiguousarray(mosaic, "<u2").tobytes()
    first = 8 + len(data) + len(data) % 2
    # The EXIF folder lies behind the main one, whose length its place does not change.
    second = first + len(folder([*tags, longs(0x8769, 0)], first))
    with open(path, "wb") as file:
        file.write(b"II*\0" + struct.pack("<I", first) + data + b"\0" * (len(data) % 2))
        file.write(folder([*tags, longs(0x8769, second)], first) + folder(exposure, second))
    return path


def sensed(
    radiance: np.ndarray,
    factor: float,
    *,
    electrons: float = 20_000.0,
    read_noise: float = 3.0,
    black: float = 512.0,
    white: int = 16383,
    seed: int = 0,
) -> np.ndarray:
    """(H, W) uint16: what a sensor reads of radiance (H, W), 1 being white at factor 1.

    electrons : caught at white
    read_noise : standard deviation, electrons
    """
    generator = np.random.default_rng(seed)
    caught = generator.poisson(radiance * factor * electrons) + generator.normal(0, read_noise, radiance.shape)
    return np.rint(np.clip(black + caught / electrons * (white - black), 0, white)).astype(np.uint16)
