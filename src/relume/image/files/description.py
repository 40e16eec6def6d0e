"""What a file holds, told in plain values: the content of `relume info FILE`."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import asdict

import numpy as np

from relume.image import files
from relume.image.files import exr
from relume.image.files.exr_parts import read_parts
from relume.image.files.signatures import kind_of
from relume.image.radiance import RadianceMap


def describe(path: str | os.PathLike[str]) -> dict[str, object]:
    """What a file holds, in plain values that JSON can hold: kind, size, unit, exposure, range, attributes, parts.

    minimum, maximum, mean : of the finite values; None where none is
    focal_length : in pixels
    channels, dtype : as stored in the first part, while `read` always gives three channels

    Raises UnreadableFile.
    """
    kind = kind_of(path)
    parts: list[dict[str, object]] = []
    if kind == "EXR":
        stored = read_parts(path)
        image = exr.radiance_map(path, stored)
        parts = [_part(part.name, part.channels) for part in stored]
    else:
        image = files.read(path)
    pixels = image.radiance if isinstance(image, RadianceMap) else image.pixels
    finite = pixels[np.isfinite(pixels)]
    facts: dict[str, object] = {"file": str(path), "format": kind, "size": list(image.size)}
    if isinstance(image, RadianceMap):
        facts |= {"kind": "radiance map", "unit": image.unit, "attributes": dict(image.attributes)}
    else:
        exposure = asdict(image.exposure) if image.exposure else None
        facts |= {"kind": "photograph", "unit": "encoded", "exposure": exposure, "camera": image.camera}
        facts |= {"focal_length": image.focal_length, "attributes": {}}
    return facts | {
        "channels": parts[0]["channels"] if parts else ["R", "G", "B"],
        "dtype": parts[0]["dtype"] if parts else str(pixels.dtype),
        "minimum": float(finite.min()) if finite.size else None,
        "maximum": float(finite.max()) if finite.size else None,
        "mean": float(finite.mean(dtype=np.float64)) if finite.size else None,
        "nan": int(np.count_nonzero(np.isnan(pixels))),
        "infinite": int(np.count_nonzero(np.isinf(pixels))),
        "parts": parts,
    }


def _part(name: str, channels: Mapping[str, np.ndarray]) -> dict[str, object]:
    return {
        "name": name,
        "channels": list(channels),
        "dtype": "/".join(sorted({str(plane.dtype) for plane in channels.values()})),
    }
