"""What a file holds, in plain values: the content of `relume info FILE`."""

from __future__ import annotations

import os
from dataclasses import asdict
from typing import Any

import numpy as np

from relume.image import files
from relume.image.colour_space import name_of
from relume.image.files.photographs import header
from relume.image.files.read_options import ReadOptions
from relume.image.files.signatures import MAPS, kind_of
from relume.image.photograph import Exposure, Photograph, RawPhotograph, Settings
from relume.image.radiance import BLACK, OUTSIDE, SATURATED, RadianceMap
from relume.image.statistics import Spot, Statistics, code_percentiles, code_values, statistics

_NUMBERS_OF_EXR = {"half": "float16", "float": "float32", "uint": "uint32"}
_NUMBERS_OF_KTX2 = {97: "half", 109: "float"}  # Vulkan's names for R16G16B16A16_SFLOAT and R32G32B32A32_SFLOAT

_ROWS = 64


def describe(path: str | os.PathLike[str], options: ReadOptions = ReadOptions()) -> dict[str, object]:
    """What a file holds, in plain values that JSON can hold; None where there is nothing.

    Of every file: file, format, subtype (from its header), size [width, height], megapixels and kind.

    kind "radiance map" : unit; primaries of the pixels and primaries_of_file; attributes; channels and dtype as stored
        in the first part of an EXR, as read of other formats; parts of an EXR; minimum, maximum, mean of finite
        values; luminance of lit pixels; dynamic_range in stops and as a ratio, of all of them and robust; brightest
        spot and a lone brighter pixel; how many values are nan, infinite, negative, how many pixels at_maximum, and
        clipped as the planes of the map say (see `relume.image.statistics`)
    kind "photograph" : colour_space by its profile; exposure, camera, settings; focal_length in pixels; minimum,
        maximum, mean and percentiles of codes, and the share of pixels at_black and at_white in each channel; gain_map
        as its header describes it, and light, the radiance map that it makes of the photograph
    kind "camera raw" : the same, with pattern, black, white, as_shot and daylight balance
    kind "cube" : levels, their sides in pixels; values, luminance and range of the largest

    options : limits, and how what a file leaves open is understood
    Raises UnreadableFile.
    """
    kind = kind_of(path)
    if kind == "RAW":
        return _of_raw(path, files.read_raw(path, options))
    if kind == "KTX2":
        return _of_cube(path, options)
    if kind in MAPS:
        return _of_map(path, kind, files.read_radiance(path, options), options)
    from relume.image.files.photographs import photographs

    return _of_photograph(path, kind, photographs.read(path, options), options)


def _of_map(path: str | os.PathLike[str], kind: str, image: RadianceMap, options: ReadOptions) -> dict[str, object]:
    parts = _parts(path, options) if kind == "EXR" else []
    found = statistics(image.radiance)
    marks = None
    if image.clipped is not None:
        codes = {"saturated": SATURATED, "black": BLACK, "outside": OUTSIDE}
        marks = {name: int(np.count_nonzero(image.clipped == code)) for name, code in codes.items()}
    return {
        **_file(path, kind, files.subtype(path, options), image.size),
        "kind": "radiance map",
        "unit": image.unit,
        "primaries": "Rec. 709",
        "primaries_of_file": image.attributes.get("primaries"),
        "attributes": dict(image.attributes),
        "channels": parts[0]["channels"] if parts else ["R", "G", "B"],
        "dtype": parts[0]["dtype"] if parts else str(image.radiance.dtype),
        **_values(found),
        "brightest": _place(found.spot),
        "lone": _place(found.lone),
        "clipped": marks,
        "has_variance": image.variance is not None,
        "parts": parts,
    }


def _of_photograph(
    path: str | os.PathLike[str], kind: str, image: Photograph, options: ReadOptions
) -> dict[str, object]:
    found = code_values(image)
    # Of such a JPEG the library's own word on its variety is that of the gain map.
    lit = kind == "JPEG" and files.has_radiance(path)
    gain_map = files.subtype(path, options) if lit else "of a kind that is not read" if image.gain_map else None
    return {
        **_file(path, kind, header.form_of(path, kind, options).text, image.size),
        "kind": "photograph",
        "unit": "encoded",
        "colour_space": name_of(image),
        **_capture(image.exposure, image.camera, image.focal_length, image.settings),
        "attributes": {},
        "channels": ["R", "G", "B"],
        "dtype": str(image.pixels.dtype),
        "minimum": found.minimum,
        "maximum": found.maximum,
        "mean": found.mean,
        "percentiles": {f"{percent:g}": code for percent, code in found.percentiles.items()},
        "at_black": list(found.black),
        "at_white": list(found.white),
        "transparent": 0 if image.outside is None else int(np.count_nonzero(image.outside)),
        "nan": 0,
        "infinite": 0,
        "gain_map": gain_map,
        "light": None if not lit else _of_map(path, kind, files.read_radiance(path, options), options),
        "parts": [],
    }


def _of_raw(path: str | os.PathLike[str], image: RawPhotograph) -> dict[str, object]:
    # Some rows at a time: NumPy counts 64-bit integers only, and copies what it is given.
    bands = np.array_split(image.mosaic, max(1, image.size[1] // _ROWS))
    counts = np.sum([np.bincount(band.ravel(), minlength=2**16) for band in bands], axis=0)
    used = np.flatnonzero(counts)
    channels = [image.pattern == channel for channel in range(3)]
    planes = [[image.mosaic[y::2, x::2] for y in (0, 1) for x in (0, 1) if here[y, x]] for here in channels]
    white = [
        sum(np.count_nonzero(plane >= image.white) for plane in group) / sum(p.size for p in group) for group in planes
    ]
    return {
        **_file(path, "RAW", f"Bayer {_letters(image)}", image.size),
        "kind": "camera raw",
        "unit": "linear",
        **_capture(image.exposure, image.camera, image.focal_length, image.settings),
        "attributes": {},
        "channels": ["R", "G", "B"],
        "dtype": str(image.mosaic.dtype),
        "pattern": _letters(image),
        "black": [float(level) for level in image.black.ravel()],
        "white": image.white,
        "as_shot": None if image.as_shot is None else [float(gain) for gain in image.as_shot],
        "daylight": [float(gain) for gain in image.daylight],
        "minimum": int(used[0]),
        "maximum": int(used[-1]),
        "mean": float(image.mosaic.mean(dtype=np.float64)),
        "percentiles": {f"{percent:g}": code for percent, code in code_percentiles(counts).items()},
        "at_white": white,
        "parts": [],
    }


def _of_cube(path: str | os.PathLike[str], options: ReadOptions) -> dict[str, object]:
    from relume.image.files.textures import ktx2

    levels = ktx2.read_cube(path, options)
    with open(path, "rb") as file:
        number = _NUMBERS_OF_KTX2[int.from_bytes(file.read(16)[12:], "little")]
    side = levels[0].shape[1]
    return {
        **_file(path, "KTX2", number, (side, side)),
        "kind": "cube",
        "unit": "relative",
        "attributes": {},
        "channels": ["R", "G", "B", "A"],
        "dtype": "float16" if number == "half" else "float32",
        "levels": [level.shape[1] for level in levels],
        **_values(statistics(levels[0].reshape(6 * side, side, 3))),
        "parts": [],
    }


def _file(path: str | os.PathLike[str], kind: str, subtype: str, size: tuple[int, int]) -> dict[str, object]:
    width, height = size
    megapixels = round(width * height / 1e6, 3)
    return {"file": str(path), "format": kind, "subtype": subtype, "size": [width, height], "megapixels": megapixels}


def _values(found: Statistics) -> dict[str, object]:
    low, high = found.robust or (None, None)
    return {
        "minimum": found.minimum,
        "maximum": found.maximum,
        "mean": found.mean,
        "luminance": {
            "lit": found.lit,
            "minimum": found.darkest,
            "maximum": found.brightest,
            "mean": found.mean_luminance,
            "robust_minimum": low,
            "robust_maximum": high,
            "percentiles": {f"{percent:g}": value for percent, value in found.percentiles.items()},
        },
        "dynamic_range": {
            "stops": found.stops,
            "ratio": None if found.stops is None else 2.0**found.stops,
            "robust_stops": found.robust_stops,
            "robust_ratio": None if found.robust_stops is None else 2.0**found.robust_stops,
        },
        "nan": found.nan,
        "infinite": found.infinite,
        "negative": found.negative,
        "at_maximum": found.at_maximum,
    }


def _place(spot: Spot | None) -> dict[str, Any] | None:
    return None if spot is None else {**asdict(spot), "radiance": list(spot.radiance)}


def _capture(exposure: Exposure | None, camera: str, focal_length: float | None, settings: Settings) -> dict[str, Any]:
    taken = settings.taken
    return {
        "exposure": None if exposure is None else asdict(exposure),
        "camera": camera,
        "focal_length": focal_length,
        "settings": asdict(settings) | {"taken": None if taken is None else taken.isoformat()},
    }


def _letters(image: RawPhotograph) -> str:
    return "".join("RGB"[channel] for channel in image.pattern.ravel())


def _parts(path: str | os.PathLike[str], options: ReadOptions) -> list[dict[str, object]]:
    """The parts of an EXR by its headers: their names, channels, the numbers these are stored in, their windows."""
    from relume.image.files.exr.header import read_headers

    return [
        {
            "name": part.name,
            "channels": [channel.name for channel in part.channels],
            "dtype": "/".join(sorted({_NUMBERS_OF_EXR[channel.kind] for channel in part.channels})),
            "size": list(part.size),
        }
        for part in read_headers(path, options).parts
    ]
