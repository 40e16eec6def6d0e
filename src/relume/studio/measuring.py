"""What is measured in open pictures: one pixel with its error, a region's statistics, the difference of two."""

from __future__ import annotations

from typing import Any

import numpy as np

import relume as rl
from relume.studio.pictures import Layer, OpenPicture

LUMINANCE = np.array([0.2126, 0.7152, 0.0722])
MARKS = ("measured", "saturated in every photograph", "black in every photograph", "outside every photograph")
LARGEST_REGION = 4096
"""Values that `values` hands out at once: as many pixels as a screen shows enlarged far enough to print them."""

Box = tuple[int, int, int, int]


def value_at(picture: OpenPicture, layer: Layer, x: int, y: int) -> dict[str, Any]:
    """A pixel as its file has it: float32, with its standard deviation, its mark, its direction on a map.

    Raises LookupError outside the picture.
    """
    height, width = layer.pixels.shape[:2]
    if not (0 <= x < width and 0 <= y < height):
        raise LookupError
    rgb = layer.pixels[y, x]
    found: dict[str, Any] = {"x": x, "y": y, "rgb": _plain(rgb), "luminance": _number(float(rgb @ LUMINANCE))}
    if layer is picture.layers[0]:
        if picture.variance is not None:
            found["sigma"] = _plain(np.sqrt(picture.variance[y, x]))
        if picture.codes is not None:
            found["codes"] = [int(code) for code in picture.codes[y, x]]
    if layer.marks is not None:
        found["mark"] = MARKS[min(int(layer.marks[y, x]), len(MARKS) - 1)]
    if picture.mapping is not None and (height, width) == picture.mapping.shape(height):
        found |= _direction(picture.mapping, (x + 0.5) / width, (y + 0.5) / height, height)
    return found


def values(layer: Layer, box: Box) -> np.ndarray:
    """The (h, w, 3) float32 values of a box (x, y, width, height); raises LookupError for one too large or outside."""
    x, y, width, height = box
    if min(x, y, width - 1, height - 1) < 0 or width * height > LARGEST_REGION:
        raise LookupError
    part = layer.pixels[y : y + height, x : x + width]
    if part.shape[:2] != (height, width):
        raise LookupError
    return np.ascontiguousarray(part, "<f4")


def statistics(picture: OpenPicture, layer: Layer, box: Box | None) -> dict[str, Any]:
    """Mean, deviation, least, median and most of red, green, blue and luminance in a box, or the whole picture.

    Of an environment map the mean is also weighed by solid angle, and its solid angle and irradiance are given:
    ∫ L dω and ∫ L (n·ω)⁺ dω with n up. Values that are not finite count apart. Raises LookupError.
    """
    height, width = layer.pixels.shape[:2]
    x, y, w, h = box or (0, 0, width, height)
    part = layer.pixels[max(y, 0) : max(y + h, 0), max(x, 0) : max(x + w, 0)]
    if part.size == 0:
        raise LookupError
    rows = part.reshape(-1, 3)
    finite = np.isfinite(rows).all(axis=1)
    kept = rows if finite.all() else rows[finite]
    found: dict[str, Any] = {"pixels": len(rows), "not_finite": int(len(rows) - len(kept))}
    if len(kept):
        # One channel after the other: all of 24 megapixels in float64 at once would be a gigabyte.
        four = (*kept.T, kept @ LUMINANCE)
        found |= {
            "mean": [_number(float(each.mean(dtype=np.float64))) for each in four],
            "deviation": [_number(float(each.std(dtype=np.float64))) for each in four],
            "least": [_number(float(str(each.min()))) for each in four],
            "median": [_number(_median(each)) for each in four],
            "most": [_number(float(str(each.max()))) for each in four],
        }
    mapping = picture.mapping
    if mapping is not None and (height, width) == mapping.shape(height):
        areas = mapping.solid_angles(height)[max(y, 0) : max(y + h, 0), max(x, 0) : max(x + w, 0)].ravel()[finite]
        up = rl.mappings.pixel_directions(mapping, height)[max(y, 0) : y + h, max(x, 0) : x + w, 1].ravel()[finite]
        cosine = np.maximum(np.nan_to_num(up), 0)
        found |= {
            "solid_angle": _number(float(areas.sum())),
            "total": _plain(areas @ kept),
            "irradiance_from_above": _plain((areas * cosine) @ kept),
        }
    return found


def differences(one: Layer, other: Layer, box: Box | None, gain: float = 1.0) -> dict[str, Any]:
    """How far one picture is from another: root mean square, mean absolute and mean signed error, PSNR.

    The other is the reference, multiplied by `gain` first: shares are of its mean, PSNR's peak is its largest value.
    Raises ValueError where their sizes differ, LookupError for an empty box.
    """
    if one.pixels.shape != other.pixels.shape:
        sizes = " and ".join(f"{each.pixels.shape[1]}×{each.pixels.shape[0]}" for each in (one, other))
        raise ValueError(f"the pictures are {sizes} pixels; only pictures of one size are compared")
    height, width = one.pixels.shape[:2]
    x, y, w, h = box or (0, 0, width, height)
    rows = slice(max(y, 0), max(y + h, 0)), slice(max(x, 0), max(x + w, 0))
    a, b = one.pixels[rows].astype(np.float64), gain * other.pixels[rows].astype(np.float64)
    finite = np.isfinite(a).all(-1) & np.isfinite(b).all(-1)
    if not finite.any():
        raise LookupError
    a, b = a[finite], b[finite]
    square = float(np.mean((a - b) ** 2))
    mean, peak = float(np.abs(b).mean()), float(b.max())
    return {
        "pixels": len(a),
        "gain": gain,
        "rms": _number(float(np.sqrt(square))),
        "absolute": _number(float(np.abs(a - b).mean())),
        "signed": _number(float((a - b).mean())),
        "rms_share": _number(float(np.sqrt(square)) / mean) if mean > 0 else None,
        "bias_share": _number(float((a - b).mean()) / mean) if mean > 0 else None,
        "psnr": _number(10 * float(np.log10(peak**2 / square))) if square > 0 and peak > 0 else None,
    }


def _direction(mapping: rl.mappings.Mapping, u: float, v: float, rows: int) -> dict[str, Any]:
    """Where a map's pixel lies: unit vector towards its light, azimuth to the right of −Z and elevation, degrees."""
    direction = mapping.directions(np.array([u, v]))
    if not np.isfinite(direction).all():
        return {}
    x, y, z = direction
    area = mapping.solid_angles(rows)[min(int(v * rows), rows - 1), min(int(u * mapping.shape(rows)[1]), 10**9)]
    return {
        "direction": [round(float(each), 6) for each in direction],
        "azimuth": round(float(np.degrees(np.arctan2(x, -z))), 3),
        "elevation": round(float(np.degrees(np.arcsin(np.clip(y, -1, 1)))), 3),
        "solid_angle": float(area),
    }


def _median(values: np.ndarray) -> float:
    """As NumPy's of float64, of values as they are: of an even number the mean of the two in the middle."""
    low, high = (len(values) - 1) // 2, len(values) // 2
    sorted_there = np.partition(values, (low, high))
    if low == high:
        return float(str(sorted_there[low]))
    return (float(sorted_there[low]) + float(sorted_there[high])) / 2


def _number(value: float) -> float | str:
    """A number as JSON has it; the others by name."""
    return value if np.isfinite(value) else str(value)


def _plain(values: np.ndarray) -> list[float | str]:
    """Each as the shortest text of the float32 or float64 that it is, so that nothing is rounded on the way."""
    return [_number(float(str(each))) for each in values]
