"""Radiance maps and layers as OpenEXR: ZIP, Rec. 709, float32 unless half is asked for, with unit and attributes.

A radiance map is one part `radiance` (R, G, B), followed by `variance` (R, G, B) and `clipped` (Y) where it has them.
The unit is the standard attribute `whiteLuminance`, the luminance of RGB (1, 1, 1) in cd/m²: a calibrated map is stored
as it is, with whiteLuminance 1. Attributes: see `exr.attributes`.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Collection, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from relume.errors import UnreadableFile, warn
from relume.image import mapped_arrays
from relume.image.bands import in_bands
from relume.image.files.encodings import OpenEXR
from relume.image.files.exr import half as exr_half
from relume.image.files.exr import picture as exr_picture
from relume.image.files.exr.attributes import attributes_of, header_of, storable
from relume.image.files.exr.header import read_headers
from relume.image.files.exr.parts import Part, outside, read_parts, warn_of_overscan, write_parts
from relume.image.files.metadata.attributes import scale_by
from relume.image.files.read_options import ReadOptions
from relume.image.mapped_arrays import Mapped
from relume.image.primaries import EQUAL_ENERGY, REC709, Primaries, adaptation, converted
from relume.image.radiance import OUTSIDE, RadianceMap

__all__ = ["attributes_of", "read", "read_layers", "subtype", "write", "write_layers"]

_XYZ = Primaries((1.0, 0.0), (0.0, 1.0), (0.0, 0.0), EQUAL_ENERGY)


def read(path: str | os.PathLike[str], options: ReadOptions = ReadOptions()) -> RadianceMap:
    """The radiance map in an EXR file: its first part with R, G, B, else with Y.

    Half and float files are read alike, to float32; luminance and chroma (Y, RY, BY) become colours, a lone Y grey; of
    several views the first is read. Other primaries than Rec. 709 are converted. The picture is the display window;
    what of it the data window does not cover is 0 and marked OUTSIDE. Warns of both, of parts and channels that are
    left out, of alpha that is left out and not 1 (the pixels, premultiplied, are as over black), and of rows missing in
    a file read with `options.salvage`. Raises FormatError, UnreadableFile.
    """
    return _radiance_map(path, read_parts(path, options))


def subtype(path: str | os.PathLike[str], options: ReadOptions = ReadOptions()) -> str:
    """How pixels are stored, from the header alone, such as "half, PIZ, tiled 64 × 64, 2 parts"."""
    headers = read_headers(path, options).parts
    first = headers[0]
    kinds = sorted({channel.kind for header in headers for channel in header.channels})
    words = [" and ".join(kinds), " and ".join(dict.fromkeys(header.compression.name for header in headers))]
    if any(header.deep for header in headers):
        words.append("deep")
    if {"Y", "RY", "BY"} <= {channel.name for channel in first.channels}:
        words.append("luminance/chroma")
    if first.tiling is not None:
        words.append(f"tiled {first.tiling.width} × {first.tiling.height}")
        words += [["", "MIP-mapped", "RIP-mapped"][first.tiling.mode]] if first.tiling.mode else []
    if len(headers) > 1:
        words.append(f"{len(headers)} parts")
    return ", ".join(words)


def write(path: str | os.PathLike[str], image: RadianceMap, encoding: OpenEXR = OpenEXR()) -> None:
    """Write a radiance map with all that it knows; NaN and infinity are stored as they are.

    encoding : where it asks for half, layers of which halves hold 99 of 100 values to 1/2048 are stored so, and others
        as float; a warning counts the values that are lost, or would be. The marks of clipped pixels are exact in both

    Raises OutputNotWritten.
    """
    layers = {"radiance": image.radiance, "variance": image.variance, "clipped": image.clipped}
    present = {name: layer for name, layer in layers.items() if layer is not None}
    halves = {name for name, layer in present.items() if encoding.half and exr_half.holds(path, name, layer)}
    write_layers(path, present, image.unit, image.attributes, halves)


def write_layers(
    path: str | os.PathLike[str],
    layers: Mapping[str, np.ndarray],
    unit: str,
    attributes: Mapping[str, str],
    halves: Collection[str] = (),
    between: Callable[[], None] | None = None,
) -> None:
    """As `formats.write_layers`; those named in `halves` are stored as half, all others as float32.

    Raises ValueError for no layer, another shape, sizes that differ, or values beyond float32; OutputNotWritten.
    """
    sizes = {np.shape(layer)[:2] for layer in layers.values()}
    if len(sizes) != 1:
        raise ValueError(f"layers have the sizes {sorted(sizes)}; a file holds layers of one size: write several files")
    if unit not in ("relative", "cd/m²"):
        raise ValueError(f'unit is "{unit}"; expected "relative" or "cd/m²"')
    # OpenEXR wants the same primaries in every part; they say nothing of a part without R, G, B.
    header = {"chromaticities": REC709.values, **header_of(storable(path, attributes))}
    lit = {"whiteLuminance": 1.0, **header} if unit == "cd/m²" else header
    parts, mapped = [], Mapped()

    def release() -> None:
        mapped.release()
        # Layers that lie as they are stored are written from where the caller has them.
        if between is not None:
            between()

    for name, layer in layers.items():
        pixels = _pixels(name, layer, np.float16 if name in halves else np.float32, Path(path).parent, mapped)
        parts.append(Part(name, pixels, dict(header if "Y" in pixels else lit)))
        release()
    write_parts(path, parts, release if mapped.maps or between is not None else None)


def read_layers(path: str | os.PathLike[str], options: ReadOptions = ReadOptions()) -> dict[str, np.ndarray]:
    """Every part of an EXR file by its name, as stored: (H, W, 3) float32 for R, G, B, (H, W) for one channel.

    A part without a name, as in a single-part file of another program, is called "part 0". What the data window does
    not cover is 0. Warns of that, and of channels left out. Raises UnreadableFile.
    """
    layers = {}
    for index, part in enumerate(read_parts(path, options)):
        lone = next(iter(part.channels)) if len(part.channels) == 1 else ""
        if lone:
            pixels = exr_picture.plane(path, part, lone).astype(np.float32)
        else:
            pixels = exr_picture.pixels(path, part, exr_picture.colours(part, ""), _primaries(path, part))
            exr_picture.warn_of_alpha(path, part, "")
            exr_picture.warn_of_left_out(path, {}, part.channels)
        _padding(path, part, "0")
        warn_of_overscan(path, part.header)
        _warn_of_missing(path, exr_picture.missing(part))
        layers[part.name or f"part {index}"] = pixels
    return layers


def _radiance_map(path: str | os.PathLike[str], parts: list[Part]) -> RadianceMap:
    """The radiance map in `parts`, whose planes are given up one by one: a picture may fill half the memory."""
    part, view = exr_picture.picture(path, parts)
    left_out = exr_picture.left_out(part, view, parts)
    others = {other.name: other for other in parts} if part.name == "radiance" else {}
    parts.clear()
    padding = _padding(path, part, "0 and marked as outside")
    if padding is not None and padding.all():
        raise UnreadableFile(f"{path}: no pixel of its data window lies in its display window; correct one of them")
    warn_of_overscan(path, part.header)
    exr_picture.warn_of_left_out(path, *left_out)
    missing = exr_picture.missing(part)
    primaries = _primaries(path, part)
    exr_picture.warn_of_alpha(path, part, view)
    radiance = exr_picture.pixels(path, part, exr_picture.colours(part, view), primaries)
    variance = clipped = None
    if "variance" in others and _whole(path, others["variance"]):
        variance = exr_picture.pixels(path, others["variance"], exr_picture.colours(others["variance"], ""), primaries)
        # Where its own window has none nothing is known of the light's, which is not the same as certain.
        if (unknown := outside(others["variance"].header)) is not None:
            variance[unknown] = np.inf
    if "clipped" in others and _whole(path, others["clipped"]):
        marks = exr_picture.plane(path, others["clipped"], "Y")
        clipped = np.clip(np.nan_to_num(marks), 0, OUTSIDE).astype(np.uint8)
    _warn_of_missing(path, missing)
    for unknown in (padding, missing):
        if unknown is not None:
            clipped = np.zeros(unknown.shape, np.uint8) if clipped is None else clipped
            clipped[unknown] = OUTSIDE
    unit, scale = _unit(path, part)
    if scale != 1:
        # The variance by the scale twice, as its square may be beyond float32 where the product is not.
        for plane in (radiance, variance, variance):
            if plane is not None:
                scale_by(path, plane, scale, "whiteLuminance")
    image = RadianceMap(radiance, variance, clipped, unit, attributes_of(part.header))
    if primaries.is_close(REC709):
        return image
    named = ", ".join(f"{value:.4g}" for value in primaries.values)
    warn(f"{path}: its primaries are {named} (x, y of R, G, B, white); converted to Rec. 709", 0.0)
    return _in_rec709(image, primaries, part.header)


def _in_rec709(image: RadianceMap, given: Primaries, header: Mapping[str, Any]) -> RadianceMap:
    """The map in Rec. 709.

    What is neutral in the file stays neutral: its `adoptedNeutral`, else its white. CIE XYZ itself has no white, and is
    converted as it is (OpenEXR "Standard Attributes"; in its sample pair Rec709_YC and XYZ_YC the colours then agree
    to 0.9 %, where taking R = G = B for neutral makes them differ by 18 %).
    """
    neutral = _neutral(header.get("adoptedNeutral"))
    if neutral is None and given.is_close(_XYZ):
        adapted = np.eye(3)
    else:
        adapted = adaptation(given.white if neutral is None else neutral, REC709.white)
    matrix = np.linalg.inv(REC709.to_xyz()) @ adapted @ given.to_xyz()
    return converted(image, matrix, given)


def _pixels(name: str, layer: np.ndarray, kind: type, folder: Path, mapped: Mapped) -> dict[str, np.ndarray]:
    """A layer as it is stored, itself where it lies so; a large copy is in a nameless file of that folder."""
    layer = np.asarray(layer)
    if layer.ndim != 2 and (layer.ndim != 3 or layer.shape[2] != 3):
        raise ValueError(f'layer "{name}" is {layer.shape}; expected (H, W, 3) or (H, W)')
    channels = "Y" if layer.ndim == 2 else "RGB"
    if layer.dtype == kind and layer.flags.c_contiguous:
        return {channels: layer}
    if layer.size * np.dtype(kind).itemsize >= mapped_arrays.LARGE:
        (stored,) = mapped.zeros(folder, [layer.shape], kind)
    else:
        stored = np.empty(layer.shape, kind)

    def fill(rows: slice) -> int:
        with np.errstate(over="ignore"):
            stored[rows] = layer[rows]
        return 0 if kind is np.float16 else int(np.count_nonzero(np.isinf(stored[rows]) & np.isfinite(layer[rows])))

    beyond = sum(in_bands(layer.shape[0], layer.shape[1], fill))
    mapped.release()
    if beyond:
        raise ValueError(f'layer "{name}" has {beyond} values beyond float32, 3.4e38; scale it down first')
    return {channels: stored}


def _primaries(path: str | os.PathLike[str], part: Part) -> Primaries:
    values = part.header.get("chromaticities")
    if values is None:
        return REC709
    try:
        return Primaries.of(values)
    except (ValueError, TypeError) as error:
        warn(f"{path}: its chromaticities are of no use and not applied: {error}")
        return REC709


def _unit(path: str | os.PathLike[str], part: Part) -> tuple[str, float]:
    """The unit, and what the numbers are multiplied by to have it."""
    scale = part.header.get("whiteLuminance")
    if scale is None:
        return "relative", 1.0
    if isinstance(scale, float) and np.isfinite(scale) and scale > 0:
        return "cd/m²", scale
    raise UnreadableFile(f"{path}: whiteLuminance is {scale}; remove the attribute or give RGB 1 in cd/m²")


def _padding(path: str | os.PathLike[str], part: Part, shown: str) -> np.ndarray | None:
    """What of the display window has no pixels, with a warning that they are `shown`; None where all has."""
    padding = outside(part.header)
    if padding is not None:
        count = np.count_nonzero(padding)
        warn(f"{path}: {count} of its {padding.size} pixels lie outside its data window; they are {shown}")
    return padding


def _neutral(value: object) -> tuple[float, float] | None:
    """The x, y of an attribute; None where it is missing or no colour."""
    if not isinstance(value, np.ndarray) or value.shape != (2,) or not np.all(np.isfinite(value)) or value[1] <= 0:
        return None
    return float(value[0]), float(value[1])


def _whole(path: str | os.PathLike[str], part: Part) -> bool:
    if part.missing is not None:
        warn(f"{path}: its part {part.name} is incomplete and left out")
    return part.missing is None


def _warn_of_missing(path: str | os.PathLike[str], missing: np.ndarray | None) -> None:
    if missing is not None:
        rows = np.count_nonzero(missing.any(1))
        warn(
            f"{path}: ends early; pixels of {rows} of {len(missing)} rows are missing, and 0, marked as outside",
            float(missing.mean()),
        )
