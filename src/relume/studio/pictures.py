"""Pictures as the page shows them: named layers of linear pixels, their pyramids, and tiles of them as bytes."""

from __future__ import annotations

import hashlib
import warnings
from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

import relume as rl
from relume.studio.words import in_the_page

TILE = 512
"""Pixels along a tile: 2 MB in halves, small enough to arrive at once, large enough that few are asked for."""
LARGEST_HALF = 32768.0
"""To which a layer's brightest pixel is scaled at most where its tiles are half floats."""
BAND = 32
"""Rows that are halved at once: they stay in a core's own cache."""
RENDERED = "with"
"""The layer of `layers.exr` whose variance stands beside it: the rendered scene with its objects."""
RELATIVE_ERROR = "relative error"
"""The layer that is made of a picture's variance; the page draws it over the picture."""
STOPS_OF_HALVES = 26
"""Stops that halves keep to a tenth of a per cent and better: 29 above their smallest normal number, less the room
between it and the darkest pixel."""


@dataclass(frozen=True, eq=False)
class Layer:
    """Pixels of one kind: radiance, its error, a matte.

    name : as its file calls it
    pixels : (H, W, 3) float32, linear
    marks : (H, W) uint8, what no photograph measured, in the codes of `RadianceMap`; None where unknown
    """

    name: str
    pixels: np.ndarray
    marks: np.ndarray | None = None

    @cached_property
    def digest(self) -> str:
        """Names the content: alike for the same pixels, whichever file they came from."""
        seen = hashlib.sha256(repr(self.pixels.shape).encode())  # of all hashes the one that processors have in them
        for array in (self.pixels, self.marks):
            seen.update(b"" if array is None else np.ascontiguousarray(array).data)
        return seen.hexdigest()[:24]

    @cached_property
    def extent(self) -> tuple[float, float, int]:
        """Smallest value above 0 at the 0.1th percentile, largest finite one, and how many values are not finite."""
        values, odd = self.pixels.ravel(), 0
        with np.errstate(over="ignore", invalid="ignore"):
            # A finite sum is one of finite values: they are looked at one by one only where it is not.
            if not np.isfinite(values.sum()):
                finite = np.isfinite(values)
                odd = int(values.size - np.count_nonzero(finite))
                values = values[finite] if odd else values
        largest = float(values.max(initial=0))
        lit = values[:: max(1, values.size // 2_000_000)]
        lit = lit[lit > 0]
        return (float(np.quantile(lit, 0.001)) if lit.size else 0.0), largest, odd

    @cached_property
    def median(self) -> float:
        """Of the luminance, from every so many pixels; 0 where none is finite."""
        rows = self.pixels.reshape(-1, 3)
        some = rows[:: max(1, len(rows) // 500_000)] @ np.array([0.2126, 0.7152, 0.0722])
        some = some[np.isfinite(some)]
        return float(np.median(some)) if some.size else 0.0

    @cached_property
    def scale(self) -> float:
        """What tiles are multiplied by on the page: a power of two, so that half floats lose nothing by it."""
        largest = self.extent[1]
        if not self.halves or largest <= 0:
            return 1.0
        return float(2.0 ** np.ceil(np.log2(largest / LARGEST_HALF)))

    @cached_property
    def halves(self) -> bool:
        """Whether half floats hold the layer; a sun beside a dark room needs whole ones."""
        smallest, largest, _ = self.extent
        return smallest == 0 or largest / smallest < 2.0**STOPS_OF_HALVES

    @cached_property
    def levels(self) -> list[np.ndarray]:
        """The pixels, and ever smaller pictures of them down to one tile: (h, w, 3), each the mean of 2 × 2."""
        found = [self.pixels]
        while max(found[-1].shape[:2]) > TILE:
            found.append(halved(found[-1]))
        return found

    def tile(self, level: int, column: int, row: int) -> bytes:
        """Rows of RGBA, little-endian halves or floats; A is the mark. Raises LookupError where there is none."""
        if not 0 <= level < len(self.levels) or column < 0 or row < 0:
            raise LookupError
        part = self.levels[level][row * TILE : (row + 1) * TILE, column * TILE : (column + 1) * TILE]
        if part.size == 0:
            raise LookupError
        result = np.zeros((*part.shape[:2], 4), "<f2" if self.halves else "<f4")
        with np.errstate(over="ignore", invalid="ignore"):
            result[..., :3] = part / np.float32(self.scale)
        if self.marks is not None:
            # Of a smaller picture each pixel has the mark of the first one in it.
            step = 2**level
            y, x = row * TILE * step, column * TILE * step
            marks = self.marks[y : y + part.shape[0] * step : step, x : x + part.shape[1] * step : step]
            result[: marks.shape[0], : marks.shape[1], 3] = marks
        return result.tobytes()


@dataclass(frozen=True, eq=False)
class OpenPicture:
    """A file as it was when it was opened.

    kind : "radiance map" or "photograph", whose values were decoded as sRGB's
    unit : of the layers, "cd/m²" or "relative"; "of white" for a photograph
    mapping : of an environment map; None for a picture
    layers : the picture first
    codes : (H, W, 3), what the file itself holds; None for a radiance map
    variance : (H, W, 3) of the radiance, squared unit; None where unknown
    notes : what reading it warned of
    focal_length : of a photograph, pixels; None where unknown
    noise : of a render that is not done, the relative error to be expected where objects change anything; None unknown
    """

    name: str
    kind: str
    unit: str
    mapping: rl.mappings.Mapping | None
    layers: tuple[Layer, ...]
    codes: np.ndarray | None = None
    variance: np.ndarray | None = None
    notes: tuple[str, ...] = ()
    focal_length: float | None = None
    noise: float | None = None

    @property
    def size(self) -> tuple[int, int]:
        """(width, height) of its first layer."""
        return self.layers[0].pixels.shape[1], self.layers[0].pixels.shape[0]

    def facts(self) -> dict[str, Any]:
        """What the page has to know of it, for JSON."""
        return {
            "name": self.name,
            "kind": self.kind,
            "unit": self.unit,
            "mapping": None if self.mapping is None else self.mapping.name,
            "size": self.size,
            "layers": [_facts_of(layer) for layer in self.layers],
            "notes": self.notes,
            "noise": self.noise,
        }


def _facts_of(layer: Layer) -> dict[str, Any]:
    # Each goes over all pixels by itself, and lets the others work meanwhile.
    with ThreadPoolExecutor(3) as pool:
        list(pool.map(lambda name: getattr(layer, name), ("digest", "levels", "extent")))
    smallest, largest, odd = layer.extent
    return {
        "name": layer.name,
        "digest": layer.digest,
        "half": layer.halves,
        "scale": layer.scale,
        "sizes": [[level.shape[1], level.shape[0]] for level in layer.levels],
        "smallest": smallest,
        "largest": largest,
        "median": layer.median,
        "odd": odd,
        "marked": layer.marks is not None and bool(layer.marks.any()),
    }


def halved(pixels: np.ndarray) -> np.ndarray:
    """The picture (H, W, C) at half its size, each pixel the mean of 2 × 2; an odd last row or column counts twice."""
    height, width = pixels.shape[:2]
    if height % 2 or width % 2:
        pixels = np.pad(pixels, ((0, height % 2), (0, width % 2), (0, 0)), mode="edge")
    result = np.empty((pixels.shape[0] // 2, pixels.shape[1] // 2, pixels.shape[2]), pixels.dtype)
    for start in range(0, len(result), BAND):
        band = slice(start, start + BAND)
        rows = pixels[0::2][band] + pixels[1::2][band]
        rows *= np.float32(0.25)
        for channel in range(rows.shape[2]):  # one at a time: loops over lines, not over three values
            np.add(rows[:, 0::2, channel], rows[:, 1::2, channel], out=result[band, :, channel])
    return result


def open_picture(path: Path) -> OpenPicture:
    """The picture in any file that relume reads as pixels, with all its layers.

    Raises UnreadableFile.
    """
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        if rl.light.number_in_store(path) is not None:
            image, parts = rl.as_radiance_map(rl.read_environment(path)), dict[str, np.ndarray]()
        else:
            image = rl.read_radiance(path) if rl.files.has_radiance(path) else rl.read(path)
            parts = rl.files.read_layers(path) if _has_parts(path) else {}
    # That parts are left out is said of what reads one picture; here all of them are layers.
    said = [str(each.message) for each in caught]
    notes = tuple(in_the_page(line) for line in said if ": left out: the parts " not in line)
    if isinstance(image, rl.Photograph):
        white = np.float32(np.iinfo(image.pixels.dtype).max)
        linear = _from_srgb(image.pixels.astype(np.float32) / white)
        layers = (Layer("picture", linear),)
        return OpenPicture(
            path.name, "photograph", "of white", None, layers, image.pixels, notes=notes,
            focal_length=image.focal_length,
        )  # fmt: skip
    name, others = _named(parts, image.radiance)
    layers = [Layer(name or "radiance", image.radiance, image.clipped)]
    variance = image.variance
    if variance is None and name == RENDERED and (found := parts.get("variance")) is not None:
        variance = found if found.shape == image.radiance.shape else None
    if variance is not None:
        error = np.sqrt(variance) / np.maximum(np.abs(image.radiance), np.float32(1e-12))
        layers.append(Layer(RELATIVE_ERROR, error.astype(np.float32)))
    return OpenPicture(
        path.name, "radiance map", image.unit, _mapping_of(image), (*layers, *others), None, variance, notes,
        noise=_noise_of(image),
    )  # fmt: skip


def _has_parts(path: Path) -> bool:
    """Whether a file has several pictures, or may have one by a name: a large one is not read twice for nothing."""
    return rl.files.kind_of(path) == "EXR" and " parts" in rl.files.subtype(path)


def _named(parts: Mapping[str, np.ndarray], first: np.ndarray) -> tuple[str, list[Layer]]:
    """The name of the part that was read as the picture, and the others; variance and marks belong to the picture."""
    name, found = "", []
    for each, values in parts.items():
        pixels = np.ascontiguousarray(
            values if values.ndim == 3 else np.repeat(values[..., None], 3, axis=2), np.float32
        )
        if not name and pixels.shape == first.shape and np.array_equal(pixels, first, equal_nan=True):
            name = each
        elif each not in ("variance", "clipped"):
            found.append(Layer(each or "picture", pixels))
    return name, found


def _noise_of(image: rl.RadianceMap) -> float | None:
    """What a preview of `insert` says of itself; None of another program's word."""
    try:
        found = float(image.attributes.get("noise", "nan"))
    except ValueError:
        return None
    return found if 0 <= found < np.inf else None


def _mapping_of(image: rl.RadianceMap) -> rl.mappings.Mapping | None:
    """The mapping that a map's file names, or lat-long where it is twice as wide as high; None for a picture."""
    width, height = image.size
    name = image.attributes.get("mapping") or ("latlong" if width == 2 * height else None)
    if name is None or "orientation" in image.attributes or "mirror" in image.attributes:
        return None
    try:
        mapping = rl.mappings.mapping_named(name)
        return mapping if mapping.shape(height) == (height, width) else None
    except ValueError:  # a mapping of another program
        return None


def _from_srgb(codes: np.ndarray) -> np.ndarray:
    """sRGB's values, 0 to 1, in linear light (IEC 61966-2-1)."""
    return np.where(codes <= 0.04045, codes / np.float32(12.92), ((codes + 0.055) / 1.055) ** 2.4).astype(np.float32)
