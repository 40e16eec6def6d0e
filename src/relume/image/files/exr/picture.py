"""What of an EXR file is its picture: which part, which channels, and where they lie in it.

Luminance and chroma, as OpenEXR stores them: Y of every pixel, and of every fourth how red and how blue it is, RY =
(R − Y) / Y and BY = (B − Y) / Y, where Y is the luminance of the file's own primaries. The chroma of the pixels between
is interpolated by the windowed sinc of 27 taps that OpenEXR reads with, so that both read the same picture ("Technical
Introduction to OpenEXR", "Luminance/Chroma Images"; weights: ImfRgbaYca, 27-pixel reconstruction filter).
"""

from __future__ import annotations

import os
from collections.abc import Collection

import numpy as np

from relume.errors import UnreadableFile, warn
from relume.image.files.exr.parts import Part, extent, meets, placed
from relume.image.primaries import Primaries

# Of the samples 1, 3, 5, … 13 pixels to either side; they sum to ½.
_WEIGHTS = (0.627123, -0.186077, 0.087929, -0.043159, 0.019597, -0.007540, 0.002128)


def picture(path: str | os.PathLike[str], parts: list[Part]) -> tuple[Part, str]:
    """The part that holds the picture and what its channels' names begin with: "", or a view and a dot.

    Parts that lie beside the display window wholly, whose picture nobody sees, are passed over for one that does not.
    """
    views = _all_views(parts)
    parts = [part for part in parts if meets(part.header)] or parts
    for prefix in ("", *(f"{view}." for view in views)):
        for wanted in (("R", "G", "B"), ("Y", "RY", "BY"), ("Y",)):
            for part in parts:
                if {prefix + name for name in wanted} <= part.channels.keys():
                    chosen = _view(part, prefix)
                    if len(views) > 1:
                        warn(f"{path}: holds the views {', '.join(views)}; {chosen or 'the first'} is read")
                    return part, prefix
    held = _listed(sorted({name for part in parts for name in part.channels}))
    raise UnreadableFile(f"{path}: holds the channels {held}; relume needs R, G and B, or Y: save that on its own")


def left_out(part: Part, prefix: str, parts: list[Part]) -> tuple[list[str], list[str]]:
    """Names of the parts, and of the channels of `part`, that are neither the picture nor known of beside it.

    Our own variance and marks are read, and the confidence of a probe is no light; alpha and other views have warnings
    of their own.
    """
    others = _all_views(parts).keys() - {_view(part, prefix)}
    ours = ("variance", "clipped", "confidence") if part.name == "radiance" else ()
    beside = [
        other.name
        for other in parts
        if other is not part and other.name not in ours and other.header.get("view") not in others
    ]
    read = {*colours(part, prefix), prefix + "A"}
    return beside, [name for name in part.channels if name not in read and others.isdisjoint(name.split(".")[:-1])]


def warn_of_left_out(path: str | os.PathLike[str], parts: Collection[str], channels: Collection[str]) -> None:
    """Say in one warning which parts and channels are not read."""
    kinds = (("part", parts), ("channel", channels))
    lists = [f"the {kind}{'s' * (len(names) > 1)} {_listed(names)}" for kind, names in kinds if names]
    if lists:
        warn(f"{path}: left out: {' and '.join(lists)}; save each on its own to read it")


def _listed(names: Collection[str]) -> str:
    """At most 16 names in one line; those of damaged files may hold anything."""
    shown = [name[:40] if name.isprintable() else ascii(name[:40]) for name in list(names)[:16]]
    return ", ".join(shown) + (f" and {len(names) - 16} more" if len(names) > 16 else "")


def _all_views(parts: list[Part]) -> dict[str, None]:
    """The names of all views, each once and in their order."""
    views = {part.header["view"]: None for part in parts if isinstance(part.header.get("view"), str)}
    for part in parts:
        views |= dict.fromkeys(_views(part))
    return views


def _view(part: Part, prefix: str) -> str:
    """The view that the channels of `part` which begin with `prefix` are of; "" where there are none."""
    return prefix[:-1] or part.header.get("view") or next(iter(_views(part)), "")


def _views(part: Part) -> list[str]:
    """The views in one part; channels of the first have plain names ("OpenEXR", "Multi-View")."""
    views = part.header.get("multiView", ())
    return [view for view in views if isinstance(view, str)] if isinstance(views, list | tuple) else []


def colours(part: Part, prefix: str) -> tuple[str, ...]:
    """The names of a part's R, G and B, of its Y, RY and BY, or of a lone Y."""
    for wanted in (("R", "G", "B"), ("Y", "RY", "BY")):
        if prefix + wanted[0] in part.channels and prefix + wanted[1] in part.channels:
            return tuple(prefix + name for name in wanted)
    return tuple(prefix + name for name in ("RGB" if prefix + "R" in part.channels else "Y"))


def pixels(path: str | os.PathLike[str], part: Part, names: tuple[str, ...], primaries: Primaries) -> np.ndarray:
    """(H, W, 3) float32 of the channels `names`, which the part gives up."""
    lacking = sorted(set(names) - part.channels.keys())
    if lacking:
        problem = f'its part "{part.name}" has no channel {", ".join(lacking)}'
        raise UnreadableFile(f"{path}: {problem}; save it as R, G, B or Y")
    planes = [part.channels.pop(name) for name in names]
    if any(plane.dtype.kind != "f" for plane in planes):
        raise UnreadableFile(f"{path}: its colours are integers (uint); save it as half or float")
    width, height = extent(part.header["dataWindow"])
    if len(names) == 3 and names[0].endswith("Y"):
        try:
            planes = to_rgb(planes[0], planes[1], planes[2], primaries)
        except ValueError as error:
            raise UnreadableFile(f"{path}: {error}; save it as R, G, B") from None
    if any(plane.shape != (height, width) for plane in planes):
        raise UnreadableFile(f"{path}: channels {', '.join(names)} are subsampled; save it as RGB")
    window = part.header["displayWindow"]
    width, height = extent(window)
    in_place = all(np.array_equal(*corners) for corners in zip(window, part.header["dataWindow"], strict=True))
    if in_place and (mixed_by_library := _as_they_lie(planes, (height, width, 3))) is not None:
        return mixed_by_library
    mixed = np.empty((height, width, 3), np.float32)
    planes *= 3 // len(planes)
    for i in range(3):
        (mixed[..., i],) = placed(part.header, {"": planes.pop(0)}).values()
    return mixed


def plane(path: str | os.PathLike[str], part: Part, name: str) -> np.ndarray:
    """(H, W) of one channel, as stored."""
    width, height = extent(part.header["dataWindow"])
    if name not in part.channels:
        raise UnreadableFile(f'{path}: its part "{part.name}" has no channel {name}; save it as Y')
    if part.channels[name].shape != (height, width):
        raise UnreadableFile(f"{path}: channel {name} is subsampled; save it in full size")
    return placed(part.header, {name: part.channels[name]})[name]


def _as_they_lie(planes: list[np.ndarray], shape: tuple[int, int, int]) -> np.ndarray | None:
    """The array of `shape` whose last axis the planes are, as float32; None where there is none."""
    base = planes[0].base
    if len(planes) != 3 or not isinstance(base, np.ndarray) or base.shape != shape or base.dtype != planes[0].dtype:
        return None
    starts = [plane.ctypes.data - base.ctypes.data for plane in planes]
    if starts != [0, base.itemsize, 2 * base.itemsize] or any(p.strides != base.strides[:2] for p in planes):
        return None
    return base.astype(np.float32, copy=False)


def missing(part: Part) -> np.ndarray | None:
    """(H, W) bool over the display window: what a file that ends early has no pixels of."""
    return None if part.missing is None else placed(part.header, {"": part.missing})[""]


def warn_of_alpha(path: str | os.PathLike[str], part: Part, prefix: str) -> None:
    """Say how many pixels alpha makes see-through, which the part then gives up: it is not kept."""
    alpha = part.channels.pop(prefix + "A", None)
    if alpha is None:
        return
    seen_through = np.count_nonzero(alpha != 1)
    if part.missing is not None and part.missing.shape == alpha.shape:
        seen_through -= np.count_nonzero((alpha != 1) & part.missing)
    if seen_through:
        warn(f"{path}: alpha is left out, though {seen_through} pixels are not opaque")


def to_rgb(luminance: np.ndarray, red: np.ndarray, blue: np.ndarray, primaries: Primaries) -> list[np.ndarray]:
    """Planes R, G and B, (H, W) float32, in `primaries`.

    luminance : (H, W) Y, any float
    red, blue : RY and BY, (⌈H/2⌉, ⌈W/2⌉) or as large as `luminance`

    Raises ValueError for another size. Unlike OpenEXR, which makes saturated pixels paler and clips negative ones,
    nothing is changed after the interpolation.
    """
    of_red, _, of_blue = primaries.to_xyz()[1].tolist()
    light = luminance.astype(np.float32, copy=False)
    r = _upsampled(red, light.shape)
    b = _upsampled(blue, light.shape)
    for plane in (r, b):
        plane += 1
        plane *= light
    # Grey stays grey to the last bit: R = G = B = Y where both chromas are 0.
    green = light + (light - r) * np.float32(of_red / (1 - of_red - of_blue))
    green += (light - b) * np.float32(of_blue / (1 - of_red - of_blue))
    return [r, green, b]


def _upsampled(chroma: np.ndarray, shape: tuple[int, ...]) -> np.ndarray:
    """(H, W) float32 of a chroma of that size or of every second pixel in x and y."""
    if chroma.shape == shape:
        return chroma.astype(np.float32)
    if chroma.shape != tuple(-(-length // 2) for length in shape):
        raise ValueError(f"chroma is {chroma.shape}; expected {shape}, or half of that")
    tall = _doubled(chroma.astype(np.float32), shape[0])
    return _doubled(tall.T, shape[1]).T


def _doubled(samples: np.ndarray, length: int) -> np.ndarray:
    """(length, N) of every second row: those between are interpolated, the edges go on as they are."""
    rows = np.empty((length, samples.shape[1]), np.float32)
    rows[::2] = samples
    count, reach = length // 2, len(_WEIGHTS)
    padded = np.pad(samples, ((reach - 1, reach), (0, 0)), mode="edge")
    between = rows[1::2]
    between[...] = 0
    for i, weight in enumerate(_WEIGHTS):
        # Between samples k and k + 1 lies row 2k + 1; those 2i + 1 pixels away are samples k − i and k + 1 + i.
        between += np.float32(weight) * padded[reach - 1 - i : reach - 1 - i + count]
        between += np.float32(weight) * padded[reach + i : reach + i + count]
    return rows
