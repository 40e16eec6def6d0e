"""TIFFs of floats, of LogLuv pixels and of photographs.

Formats: TIFF 6.0; Larson, "LogLuv Encoding for Full Gamut, High Dynamic Range Images" (1998), and its layout in TIFF.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from corpus.files import (
    DESCRIBE,
    HEIGHT,
    READ,
    READ_FACTS,
    READ_PHOTOGRAPH,
    SALVAGE,
    WIDTH,
    Bad,
    Corpus,
    Good,
    cut,
    picture,
)
from corpus.tiff_building import (
    BITS,
    COMPRESSION,
    COUNTS,
    HEIGHT_TAG,
    OFFSETS,
    PHOTOMETRIC,
    PLANAR,
    PREDICTOR,
    ROWS,
    SAMPLE_FORMAT,
    SAMPLES,
    WIDTH_TAG,
    Entry,
    Tiff,
    frame_faults,
    long,
    short,
    text,
    value_faults,
)

_SUFFIX = ".tif"
_STONITS = 37439
_TILE_WIDTH, _TILE_HEIGHT, _TILE_OFFSETS, _TILE_COUNTS = 322, 323, 324, 325
_DEFLATE, _PACKBITS, _SGILOG, _SGILOG24 = 8, 32773, 34676, 34677
_LOGL, _LOGLUV = 32844, 32845


def floats() -> Corpus:
    """The good and bad files of float TIFF."""
    good = _float(picture(4))
    packed = _float(picture(4), deflate=True)
    half = (HEIGHT // 2) * WIDTH * 12
    bad = frame_faults(good) + value_faults(good)
    bad += _strip_faults(packed)
    bad += [
        Bad("strips of which one is missing", good.but({OFFSETS: long(8), COUNTS: long(half)}).data(), _SUFFIX),
        Bad("a strip that is too short", good.but({COUNTS: long(half, half - 4)}).data(), _SUFFIX),
        Bad("floats of 128 bits", good.but({BITS: short(128, 128, 128)}).data(), _SUFFIX),
        Bad("one colour of other bits", good.but({BITS: short(32, 16, 32)}).data(), _SUFFIX),
        Bad("integers and floats at once", good.but({SAMPLE_FORMAT: short(3, 1, 3)}).data(), _SUFFIX, False),
        Bad("not a number", _float(np.full((8, 16, 3), np.nan, np.float32)).data(), _SUFFIX, False),
        Bad("infinity", _float(np.full((8, 16, 3), np.inf, np.float32)).data(), _SUFFIX, False),
    ]
    return Corpus("float TIFF", _good_floats(), bad)


def logluv() -> Corpus:
    """The good and bad files of LogLuv TIFF."""
    files, tiffs = _good_logluv()
    whole = tiffs["32 bits"]
    start = 8
    bad = frame_faults(whole) + value_faults(whole)
    row = len(whole.strips[0]) // HEIGHT
    runs: list[tuple[str, bytes, bool]] = [
        ("a run beyond its line", b"\xff\x01", True),
        ("a stretch beyond its line", b"\x7f" + bytes(127), True),
        ("a stretch of nothing", b"\x00", False),
        ("nothing but stretches of nothing", bytes(500), True),
        ("no bytes", b"", True),
        ("a run without its byte", b"\x8e", True),
    ]
    for name, stored, must in runs:
        for at in (0, 3 * row):
            strip = whole.strips[0][:at] + stored
            strip += whole.strips[0][at + len(stored) :] if not must else b""
            bad.append(Bad(f"{name}, at byte {at} of the strip", replace(whole, strips=(strip,)).data(), _SUFFIX, must))
    raw = tiffs["24 bits"]
    bad += [
        Bad("24 bits, a byte short", replace(raw, strips=(raw.strips[0][:-1],)).data(), _SUFFIX),
        Bad("24 bits, indices outside the gamut", replace(raw, strips=(b"\xff\xff\xff" * 128,)).data(), _SUFFIX, False),
        Bad("24 bits, as run lengths", raw.but({COMPRESSION: short(_SGILOG)}).data(), _SUFFIX, False),
        Bad("32 bits, as 24", whole.but({COMPRESSION: short(_SGILOG24)}).data(), _SUFFIX, False),
        Bad("uncompressed", whole.but({COMPRESSION: short(1)}).data(), _SUFFIX),
        Bad("a luminance of colours", whole.but({PHOTOMETRIC: short(_LOGL)}).data(), _SUFFIX, False),
        Bad("colours of a luminance", tiffs["16 bits"].but({PHOTOMETRIC: short(_LOGLUV)}).data(), _SUFFIX, False),
        Bad("24 bits of a luminance", tiffs["16 bits"].but({COMPRESSION: short(_SGILOG24)}).data(), _SUFFIX, False),
    ]
    for value in (0.0, -1.0, float("nan"), float("inf"), 1e300):
        wrong = whole.but({_STONITS: Entry(12, (value,))})
        bad.append(Bad(f"STONITS of {value}", wrong.data(), _SUFFIX, False))
    bad += cut("24 bits", raw.data(), _SUFFIX, (start + 5, -3))
    return Corpus("LogLuv TIFF", files, bad)


def photographs() -> Corpus:
    """The good and bad files of TIFF photographs."""
    pixels = _photograph_pixels(np.uint8)
    good = _photograph(pixels)
    bad = frame_faults(good) + value_faults(good) + _strip_faults(_photograph(pixels, compression=_DEFLATE))
    packed = _photograph(pixels, compression=_PACKBITS)
    bad += [
        Bad("packed bytes beyond their strip", replace(packed, strips=(b"\x7f" + bytes(9),)).data(), _SUFFIX, False),
        Bad("a packed run without its byte", replace(packed, strips=(b"\x81",)).data(), _SUFFIX, False),
        Bad("nothing but packed nothing", replace(packed, strips=(b"\x80" * 400,)).data(), _SUFFIX, False),
        Bad("an EXIF folder in the pixels", good.but({0x8769: long(9)}).data(), _SUFFIX, False),
        Bad("an EXIF folder beyond the file", good.but({0x8769: long(2**31)}).data(), _SUFFIX, False),
        Bad("an EXIF folder that is this folder", good.but({0x8769: long(good.folder_at())}).data(), _SUFFIX, False),
        Bad("sub-folders in a circle", good.but({330: long(*[good.folder_at()] * 9)}).data(), _SUFFIX, False),
        Bad("a colour profile beyond the file", good.but({34675: Entry(7, (0,), 2**20, 2**20)}).data(), _SUFFIX, False),
        Bad("a text of a gibibyte", good.but({270: Entry(2, (65,), 2**30, 8)}).data(), _SUFFIX, False),
        Bad("an orientation of 99", good.but({274: short(99)}).data(), _SUFFIX, False),
    ]
    return Corpus("TIFF", _good_photographs(), bad, (READ_PHOTOGRAPH, READ, DESCRIBE, READ_FACTS, SALVAGE))


def _strip_faults(deflated: Tiff) -> list[Bad]:
    strip = deflated.strips[0]
    cases = {
        "a deflated strip cut short": strip[: len(strip) // 2],
        "a deflated strip of zeros": bytes(len(strip)),
        "a deflated strip with a wrong checksum": strip[:-1] + bytes([strip[-1] ^ 255]),
        "a deflated strip of too few bytes": zlib.compress(b"few"),
        "a deflated strip damaged within": strip[:20] + b"\xff" * 9 + strip[29:],
        "a deflated bomb": zlib.compress(bytes(2**24)) * 3,
    }
    may = ("a deflated bomb", "a deflated strip with a wrong checksum", "a deflated strip damaged within")
    return [
        Bad(name, replace(deflated, strips=(stored, *deflated.strips[1:])).data(), _SUFFIX, name not in may)
        for name, stored in cases.items()
    ]


def _tags(height: int, width: int, samples: int, bits: int, **others: Entry) -> dict[int, Entry]:
    tags = {
        WIDTH_TAG: short(width),
        HEIGHT_TAG: short(height),
        BITS: short(*[bits] * samples),
        COMPRESSION: short(1),
        PHOTOMETRIC: short(2 if samples == 3 else 1),
        SAMPLES: short(samples),
        ROWS: short(height),
        PLANAR: short(1),
    }
    names = {"sample_format": SAMPLE_FORMAT, "compression": COMPRESSION, "photometric": PHOTOMETRIC, "rows": ROWS}
    return tags | {names[name]: entry for name, entry in others.items()}


def _float(values: np.ndarray, order: str = "<", *, bits: int = 32, big: bool = False, deflate: bool = False) -> Tiff:
    """In two strips, as any writer of large pictures has them."""
    height, width = values.shape[:2]
    samples = 3 if values.ndim == 3 else 1
    rows = np.ascontiguousarray(values, f"{order}f{bits // 8}").reshape(2, -1)
    strips = tuple(zlib.compress(strip.tobytes()) if deflate else strip.tobytes() for strip in rows)
    tags = _tags(height, width, samples, bits, sample_format=short(*[3] * samples), rows=short(height // 2))
    return Tiff(tags | ({COMPRESSION: short(_DEFLATE)} if deflate else {}), strips, order, big)


def _predicted(values: np.ndarray) -> Tiff:
    """The floating-point predictor (TIFF technical note 3): bytes by weight, highest first, then differences."""
    height, width = values.shape[:2]
    planes = np.ascontiguousarray(values, ">f4").view(np.uint8).reshape(height, width * 3, 4).transpose(0, 2, 1)
    line = planes.reshape(height, -1)
    differences = line.copy()
    differences[:, 3:] -= line[:, :-3]
    tags = _tags(height, width, 3, 32, sample_format=short(3, 3, 3), compression=short(_DEFLATE))
    return Tiff(tags | {PREDICTOR: short(3)}, (zlib.compress(differences.tobytes()),))


def _good_floats() -> list[Good]:
    colour = picture(4)
    grey = colour[..., 0]
    planes = np.ascontiguousarray(colour.transpose(2, 0, 1), "<f4")
    apart = Tiff(
        _tags(HEIGHT, WIDTH, 3, 32, sample_format=short(3, 3, 3)) | {PLANAR: short(2)},
        tuple(plane.tobytes() for plane in planes),
    )
    return [
        Good("little-endian", _float(colour).data(), _SUFFIX, colour),
        Good("big-endian", _float(colour, ">").data(), _SUFFIX, colour),
        Good("BigTIFF", _float(colour, big=True).data(), _SUFFIX, colour),
        Good("16 bits", _float(colour, bits=16).data(), _SUFFIX, colour),
        Good("64 bits", _float(colour, bits=64).data(), _SUFFIX, colour),
        Good("grey", _float(grey).data(), _SUFFIX, np.repeat(grey[..., None], 3, 2)),
        Good("deflated", _float(colour, deflate=True).data(), _SUFFIX, colour),
        Good("deflated with its predictor", _predicted(colour).data(), _SUFFIX, colour),
        Good("colours apart", apart.data(), _SUFFIX, colour),
    ]


def _runs(codes: np.ndarray, planes: int) -> bytes:
    """Each line's bytes by weight, highest first, in runs (126 + n, byte) and stretches (n, bytes)."""
    out = bytearray()
    for line in codes:
        for plane in reversed(range(planes)):
            octets = [int(code) >> 8 * plane & 255 for code in line]
            place = 0
            while place < len(octets):
                end = place
                while end < len(octets) and octets[end] == octets[place] and end - place < 129:
                    end += 1
                if end - place < 4:
                    end = min(len(octets), place + 3)
                    out += bytes([end - place, *octets[place:end]])
                else:
                    out += bytes([126 + end - place, octets[place]])
                place = end
    return bytes(out)


def _good_logluv() -> tuple[list[Good], dict[str, Tiff]]:
    random = np.random.default_rng(6)
    log = random.integers(14000, 18000, (HEIGHT, WIDTH))
    log[2, 3:12] = 16384
    u, v = random.integers(70, 90, (2, HEIGHT, WIDTH)) + np.array([0, 112])[:, None, None]
    luminance = np.exp2((log + 0.5) / 256 - 64)
    tag = dict(photometric=short(_LOGLUV), compression=short(_SGILOG))
    colour = {**_tags(HEIGHT, WIDTH, 3, 16, sample_format=short(2, 2, 2), **tag), _STONITS: Entry(12, (1.0,))}
    grey = _tags(HEIGHT, WIDTH, 1, 16, photometric=short(_LOGL), compression=short(_SGILOG), sample_format=short(2))
    # 24 bits: ten of luminance, fourteen of a place in the gamut; index 9000 lies among the pale colours.
    small = random.integers(400, 1000, (HEIGHT, WIDTH))
    codes = small << 14 | (9000 + random.integers(0, 20, (HEIGHT, WIDTH)))
    octets = np.stack([codes >> 16 & 255, codes >> 8 & 255, codes & 255], -1).astype(np.uint8)
    tiffs = {
        "32 bits": Tiff(colour, (_runs(log << 16 | u << 8 | v, 4),)),
        "32 bits, big-endian": Tiff(colour, (_runs(log << 16 | u << 8 | v, 4),), ">"),
        "16 bits": Tiff(grey, (_runs(log, 2),)),
        "24 bits": Tiff(colour | {COMPRESSION: short(_SGILOG24)}, (octets.tobytes(),)),
    }
    values = {"24 bits": np.exp2((small + 0.5) / 64 - 12)}
    files = [Good(name, tiff.data(), _SUFFIX, values.get(name, luminance), 1e-3) for name, tiff in tiffs.items()]
    return files, tiffs


def _photograph_pixels(kind: type[np.unsignedinteger]) -> np.ndarray:
    largest = np.iinfo(kind).max
    return np.random.default_rng(7).integers(0, largest, (HEIGHT, WIDTH, 3), endpoint=True).astype(kind)


def _photograph(pixels: np.ndarray, order: str = "<", *, compression: int = 1) -> Tiff:
    stored = np.ascontiguousarray(pixels, f"{order}u{pixels.itemsize}").tobytes()
    if compression == _DEFLATE:
        stored = zlib.compress(stored)
    if compression == _PACKBITS:
        stored = b"".join(b"\x2f" + stored[at : at + 48] for at in range(0, len(stored), 48))  # 48 bytes as they are
    samples = 3 if pixels.ndim == 3 else 1
    tags = _tags(pixels.shape[0], pixels.shape[1], samples, 8 * pixels.itemsize, compression=short(compression))
    return Tiff(tags | {271: text("Maker"), 272: text("Maker One")}, (stored,), order)


def _tiled(pixels: np.ndarray) -> Tiff:
    tile = np.zeros((16, 16, 3), np.uint8)
    tile[: pixels.shape[0]] = pixels
    tags = _tags(HEIGHT, WIDTH, 3, 8)
    del tags[ROWS]
    tags |= {_TILE_WIDTH: short(16), _TILE_HEIGHT: short(16)}
    return Tiff(tags, (tile.tobytes(),), place_tag=_TILE_OFFSETS, length_tag=_TILE_COUNTS)


def _good_photographs() -> list[Good]:
    eight, sixteen = _photograph_pixels(np.uint8), _photograph_pixels(np.uint16)
    named: Sequence[tuple[str, Tiff, np.ndarray]] = [
        ("8 bits", _photograph(eight), eight),
        ("16 bits", _photograph(sixteen), sixteen),
        ("16 bits, big-endian", _photograph(sixteen, ">"), sixteen),
        ("8 bits, deflated", _photograph(eight, compression=_DEFLATE), eight),
        ("8 bits, packed", _photograph(eight, compression=_PACKBITS), eight),
        ("grey", _photograph(eight[..., 0]), np.repeat(eight[..., :1], 3, 2)),
        ("in tiles", _tiled(eight), eight),
    ]
    return [Good(name, tiff.data(), _SUFFIX, pixels) for name, tiff, pixels in named]


def bomb() -> bytes:
    """A TIFF of 134 bytes that claims 65,535 × 65,535 pixels: a folder of nine entries, and four bytes of pixels."""
    tags = _tags(2**16 - 1, 2**16 - 1, 1, 8)
    del tags[PLANAR]
    data = Tiff(tags, (struct.pack("<I", 0),)).data()
    return data.ljust(134, b"\0")


def float_bomb() -> bytes:
    """A float TIFF that claims 16384 × 16384 pixels of three floats, 3 GiB, in one deflated strip of few bytes."""
    tags = _tags(2**14, 2**14, 3, 32, sample_format=short(3, 3, 3), compression=short(_DEFLATE))
    return Tiff(tags, (zlib.compress(bytes(2**16)),)).data()


def logluv_bomb() -> bytes:
    """A LogLuv TIFF that claims as much, in one strip of few bytes."""
    tags = _tags(2**14, 2**14, 3, 16, photometric=short(_LOGLUV), compression=short(_SGILOG))
    return Tiff(tags, (b"\xff\0" * 500,)).data()
