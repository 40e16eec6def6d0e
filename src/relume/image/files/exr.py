"""Radiance maps and layers as OpenEXR: always float32, ZIP, Rec. 709, with unit and attributes in the header.

A radiance map is one part `radiance` (R, G, B), followed by `variance` (R, G, B) and `clipped` (Y) where it has them.
The unit is the standard attribute `whiteLuminance`, the luminance of RGB (1, 1, 1) in cd/m²: a calibrated map is stored
as it is, with whiteLuminance 1. Attributes are strings under the prefix "relume:".
"""

from __future__ import annotations

import os
import warnings
from collections.abc import Mapping

import numpy as np

from relume.errors import UnreadableFile
from relume.image.files.exr_parts import Part, placed, read_parts, write_parts
from relume.image.radiance import RadianceMap

_REC709 = (0.64, 0.33, 0.30, 0.60, 0.15, 0.06, 0.3127, 0.3290)  # x, y of red, green, blue and white
_PREFIX = "relume:"


def read(path: str | os.PathLike[str]) -> RadianceMap:
    """The radiance map in an EXR file: its part `radiance`, else its first part with R, G, B, else a lone Y as grey.

    Half and float files are read alike, to float32. Warns when the primaries are not Rec. 709 (the numbers are kept)
    and when alpha is left out that is not 1 (the pixels, premultiplied, are as over black). Raises UnreadableFile.
    """
    return radiance_map(path, read_parts(path))


def radiance_map(path: str | os.PathLike[str], parts: list[Part]) -> RadianceMap:
    """The radiance map that parts of a file hold; `path` is for messages."""
    part = _picture(path, parts)
    others = {other.name: other for other in parts} if part.name == "radiance" else {}
    radiance = _pixels(path, part)
    variance = _pixels(path, others["variance"]) if "variance" in others else None
    clipped = _pixels(path, others["clipped"])[..., 0].astype(np.uint8) if "clipped" in others else None
    _warn_of_other_primaries(path, part.header)
    _warn_of_alpha(path, part)
    scale = part.header.get("whiteLuminance")
    if scale is None:
        unit = "relative"
    elif isinstance(scale, float) and np.isfinite(scale) and scale > 0:
        unit = "cd/m²"
        radiance = radiance * np.float32(scale)
        variance = None if variance is None else variance * np.float32(scale**2)
    else:
        raise UnreadableFile(f"{path}: whiteLuminance is {scale}; remove the attribute or give RGB 1 in cd/m²")
    return RadianceMap(radiance, variance, clipped, unit, attributes_of(part.header))


def write(path: str | os.PathLike[str], image: RadianceMap) -> None:
    """Write a radiance map with all that it knows; NaN and infinity are stored as they are. Raises OutputNotWritten."""
    layers = {"radiance": image.radiance, "variance": image.variance, "clipped": image.clipped}
    present = {name: layer for name, layer in layers.items() if layer is not None}
    write_layers(path, present, unit=image.unit, attributes=image.attributes)


def write_layers(
    path: str | os.PathLike[str],
    layers: Mapping[str, np.ndarray],
    *,
    unit: str = "relative",
    attributes: Mapping[str, str] | None = None,
) -> None:
    """Write named layers of one size as the parts of one file.

    layers : name → (H, W, 3), stored as R, G, B, or (H, W), stored as Y; float32 whatever they were
    unit : of the three-channel layers, "relative" or "cd/m²"
    attributes : strings stored with every layer under "relume:"

    Raises ValueError for no layer, another shape, sizes that differ, or values beyond float32; OutputNotWritten.
    """
    sizes = {np.shape(layer)[:2] for layer in layers.values()}
    if len(sizes) != 1:
        raise ValueError(f"layers have the sizes {sorted(sizes)}; a file holds layers of one size: write several files")
    if unit not in ("relative", "cd/m²"):
        raise ValueError(f'unit is "{unit}"; expected "relative" or "cd/m²"')
    texts = {_PREFIX + key: str(value) for key, value in (attributes or {}).items()}
    # OpenEXR wants the same primaries in every part; they say nothing of a part without R, G, B.
    header = {"chromaticities": _REC709, **texts}
    lit = {"whiteLuminance": 1.0, **header} if unit == "cd/m²" else header
    parts = []
    for name, layer in layers.items():
        planes = _planes(name, layer)
        parts.append(Part(name, planes, dict(header if "Y" in planes else lit)))
    write_parts(path, parts)


def read_layers(path: str | os.PathLike[str]) -> dict[str, np.ndarray]:
    """Every part of an EXR file by its name, as stored: (H, W, 3) float32 for R, G, B, (H, W) for one channel.

    A part without a name, as in a single-part file of another program, is called "part 0". Raises UnreadableFile.
    """
    layers = {}
    for index, part in enumerate(read_parts(path)):
        lone = len(part.channels) == 1
        pixels = next(iter(placed(path, part).values())).astype(np.float32) if lone else _pixels(path, part)
        layers[part.name or f"part {index}"] = pixels
    return layers


def attributes_of(header: Mapping[str, object]) -> dict[str, str]:
    """The texts in a header, ours without their prefix, and the OpenEXR `envmap` kind where there is one."""
    texts = {key: value for key, value in header.items() if isinstance(value, str) and key not in ("name", "type")}
    if "envmap" in header:
        texts["envmap"] = str(header["envmap"]).rpartition(".")[2].removeprefix("ENVMAP_").lower()
    ours = {key.removeprefix(_PREFIX): value for key, value in texts.items() if key.startswith(_PREFIX)}
    return {key: value for key, value in texts.items() if not key.startswith(_PREFIX)} | ours


def _picture(path: str | os.PathLike[str], parts: list[Part]) -> Part:
    for wanted in ({"R", "G", "B"}, {"Y"}):
        for part in parts:
            if wanted <= part.channels.keys():
                return part
    held = ", ".join(sorted({name for part in parts for name in part.channels}))
    raise UnreadableFile(f"{path}: holds the channels {held}; relume needs R, G, B or Y: save that layer on its own")


def _pixels(path: str | os.PathLike[str], part: Part) -> np.ndarray:
    """(H, W, 3) float32 of R, G, B, or of Y in all three."""
    names = "RGB" if "R" in part.channels else "YYY"
    missing = sorted(set(names) - part.channels.keys())
    if missing:
        lacking = f'its part "{part.name}" has no channel {", ".join(missing)}'
        raise UnreadableFile(f"{path}: {lacking}; save it as R, G, B or Y")
    channels = placed(path, part)
    planes = [channels[name] for name in names]
    if any(plane.dtype == np.uint32 for plane in planes):
        raise UnreadableFile(f"{path}: its colours are integers (uint); save it as half or float")
    return np.stack(planes, axis=-1, dtype=np.float32, casting="same_kind")


def _planes(name: str, layer: np.ndarray) -> dict[str, np.ndarray]:
    layer = np.asarray(layer)
    if layer.ndim != 2 and (layer.ndim != 3 or layer.shape[2] != 3):
        raise ValueError(f'layer "{name}" is {layer.shape}; expected (H, W, 3) or (H, W)')
    with np.errstate(over="ignore"):
        stored = layer.astype(np.float32, copy=False)  # a picture of 45 megapixels is half a gigabyte
    beyond = 0 if stored is layer else np.count_nonzero(np.isinf(stored)) - np.count_nonzero(np.isinf(layer))
    if beyond:
        raise ValueError(f'layer "{name}" has {beyond} values beyond float32, 3.4e38; scale it down first')
    return {"Y": stored} if layer.ndim == 2 else {"R": stored[..., 0], "G": stored[..., 1], "B": stored[..., 2]}


def _warn_of_other_primaries(path: str | os.PathLike[str], header: Mapping[str, object]) -> None:
    primaries = header.get("chromaticities")
    if isinstance(primaries, tuple) and not np.allclose(primaries, _REC709, rtol=0, atol=2e-3):
        named = ", ".join(f"{value:.4g}" for value in primaries)
        warnings.warn(
            f"{path}: its primaries are {named} (x, y of R, G, B, white), not Rec. 709; not converted", stacklevel=5
        )


def _warn_of_alpha(path: str | os.PathLike[str], part: Part) -> None:
    seen_through = np.count_nonzero(part.channels["A"] != 1) if "A" in part.channels else 0
    if seen_through:
        warnings.warn(f"{path}: alpha is left out, though {seen_through} pixels are not opaque", stacklevel=5)
