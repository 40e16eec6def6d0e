"""A file in another format: crop, expose, write, and measure what of it the new file holds."""

from __future__ import annotations

import os
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from relume.errors import UnreadableFile, warn
from relume.image import files
from relume.image.arithmetic import multiplied
from relume.image.files.encodings import SUFFIXES, Encoding, suffix_of
from relume.image.files.read_options import ReadOptions
from relume.image.photograph import Photograph
from relume.image.radiance import RadianceMap
from relume.light.editing.edits import Crop
from relume.sphere.environment_files import as_environment, require_light

PHOTOGRAPHS = (".png", ".tif", ".tiff", ".jpg", ".jpeg")


@dataclass(frozen=True)
class FormatChange:
    """How a file is written in another format.

    encoding : of radiance; as the suffix says unless given
    floats : write radiance, also where the suffix is one of photographs too
    crop : left, top, width and height in pixels
    stops : to brighten radiance by
    clamp : set negative pixels to 0
    """

    encoding: Encoding | None = None
    floats: bool = False
    crop: tuple[int, int, int, int] | None = None
    stops: float = 0.0
    clamp: bool = False


def change_format(
    path: str | os.PathLike[str],
    out: str | os.PathLike[str],
    change: FormatChange = FormatChange(),
    options: ReadOptions = ReadOptions(),
    *,
    dry_run: bool = False,
) -> dict[str, object]:
    """Write what a file holds in the format that `out` names, read it back, and measure how much of it was kept.

    path : the file
    out : the file to be written; its suffix names the format
    change : encoding, crop, exposure, clamping; nothing unless given
    options : for reading
    dry_run : check only

    Raises ValueError for a format that does not hold what the file holds, UnreadableFile for a file that is damaged,
    or a photograph where radiance is needed.
    """
    path = Path(path)
    out = Path(out)
    # What is wanted, and whether the format holds it.
    suffix = suffix_of(out)
    if suffix not in PHOTOGRAPHS:
        require_radiance(path)
    # A JPEG with a gain map is both; to a format of both goes its base, unless floats are asked for.
    as_photograph = suffix in PHOTOGRAPHS and change.encoding is None and not change.floats
    wants_light = files.has_radiance(path) and not (files.kind_of(path) == "JPEG" and as_photograph)
    if wants_light and suffix not in SUFFIXES:
        raise ValueError(f"{path}: radiance, which {suffix} does not hold; make a picture of it with relume develop")
    if not wants_light and (change.stops or change.clamp or change.encoding is not None or change.floats):
        raise ValueError(f"{path}: a photograph; --exposure, --clamp, --float and formats of radiance are not for it")
    if dry_run:
        return {"would write": [str(out)]}

    # Photographs.
    image = files.read_radiance(path, options) if wants_light else files.read(path, options)
    image = image if change.crop is None else _cropped(image, change.crop)
    if not isinstance(image, RadianceMap):
        files.write(out, image)
        if held := _blocks_of_others(path):
            warn(f"{out}: does not keep the {' and '.join(held)} of {path.name}")
        facts = {"written": [str(out)], "size": list(image.size), "bits": 8 * image.pixels.itemsize}
        return {**facts, "kept": kept_codes(image, files.read_photograph(out, options))}

    # Radiance.
    image = exposed(require_light(path, image, clamp=True) if change.clamp else image, change.stops)
    files.write(out, image, change.encoding)
    again = replace(options, float_size=image.size, float_order=None)
    back = files.read_radiance(out, again)
    facts = {"written": [str(out)], "format": files.subtype(out, again), "size": list(image.size), "unit": image.unit}
    near = kept(image, back)
    return {**facts, **({} if near["exact"] else _audited(image, back)), "kept": near}


def require_radiance(path: str | os.PathLike[str]) -> None:
    """Refuse a photograph where radiance is needed, with what can be done about it.

    path : of the picture
    Raises UnreadableFile, also where the file is damaged.
    """
    path = Path(path)
    if not files.has_radiance(path):
        files.subtype(path)  # a damaged file is reported as that
        raise UnreadableFile(
            f"{path}: a photograph or painting, whose values are no light yet; merge a bracket, or say for which "
            "display it was painted, like --gamma 2.2 or --gamma srgb"
        )


def _blocks_of_others(path: Path) -> list[str]:
    """Blocks of metadata in a photograph that relume does not carry over, by their marks near its beginning."""
    with open(path, "rb") as file:
        head = file.read(2**20)
    marks = {"XMP": (b"http://ns.adobe.com/xap/1.0/", b"<x:xmpmeta"), "IPTC": (b"Photoshop 3.0\0", b"8BIM\x04\x04")}
    return [name for name, known in marks.items() if any(mark in head for mark in known)]


def _audited(before: RadianceMap, after: RadianceMap) -> dict[str, object]:
    """The energy of an environment map as it was and as it is written; nothing for any other picture."""
    width, height = before.size
    if 0 < abs(width - 2 * height) <= 2:  # read as a map it would be resampled, which a change of format does not
        return {}
    try:
        return {"before": as_environment(before).audit().facts(), "after": as_environment(after).audit().facts()}
    except ValueError:
        return {}


def _cropped(image: RadianceMap | Photograph, rectangle: tuple[int, int, int, int]) -> RadianceMap | Photograph:
    if isinstance(image, RadianceMap):
        return Crop(*rectangle)(image)
    left, top, width, height = rectangle
    across, down = image.size
    if not (0 <= left < left + width <= across and 0 <= top < top + height <= down):
        raise ValueError(f"the rectangle {left},{top},{width},{height} is not in a picture of {across}×{down}")
    part = (slice(top, top + height), slice(left, left + width))
    outside = None if image.outside is None else image.outside[part].copy()
    return replace(image, pixels=image.pixels[part].copy(), outside=outside)


def exposed(picture: RadianceMap, stops: float) -> RadianceMap:
    """The map brightened; what was calibrated no longer is, and a warning says so."""
    if not abs(stops) <= 100:
        raise ValueError(f"the exposure is {stops:g} stops; expected −100 to 100")
    if not stops:
        return picture
    if picture.unit != "relative":
        warn(f"brightened by {stops:g} stops it is no longer {picture.unit}, but relative")
    return replace(multiplied(picture, 2.0**stops), unit="relative")


def kept(before: RadianceMap, after: RadianceMap) -> dict[str, object]:
    """How far the file, read back, is from what was to be written.

    exact : whether every value is the same, bit for bit; nothing else is measured then
    mean change : of each channel's mean, in percent of the greatest of the means
    error % of the largest channel : of each pixel, in half of those that are not black, in 99 of 100 and the largest
    black becomes : the largest value of what was black, where it is above 0
    no longer finite : pixels that were, and infinities and NaN that came out as numbers
    """
    first, second = before.radiance, after.radiance
    if first.shape == second.shape and np.array_equal(first.view(np.uint32), second.view(np.uint32)):
        return {"exact": True}
    was, still = np.isfinite(first).all(-1), np.isfinite(second).all(-1)
    change: dict[str, object] = {"exact": False}
    if changed := int(np.count_nonzero(was != still)):
        change["no longer finite"] = changed
    a, b = first[was & still], second[was & still]
    size = np.abs(a).max(-1, initial=0)
    lit = size > 0
    if lit.any():
        means = a.mean(0, dtype=np.float64), b.mean(0, dtype=np.float64)
        change["mean change %"] = [_short(100 * v) for v in (means[1] - means[0]) / np.abs(means[0]).max()]
        errors = np.abs(b[lit] - a[lit]).max(-1) / size[lit]
        half, most, largest = np.quantile(errors, [0.5, 0.99, 1.0])
        change["error % of the largest channel"] = {
            "half": _short(100 * half),
            "99 of 100": _short(100 * most),
            "largest": _short(100 * largest),
        }
    if (dark := float(np.abs(b[~lit]).max(initial=0))) > 0:
        change["black becomes"] = _short(dark)
    return change


def kept_codes(before: Photograph, after: Photograph) -> dict[str, object]:
    """The same of a photograph's code values: their mean change and their largest."""
    change = after.pixels.astype(np.int32) - before.pixels
    if not change.any():
        return {"exact": True}
    return {"exact": False, "mean change": _short(change.mean()), "largest change": int(np.abs(change).max())}


def _short(value: float) -> float:
    return float(f"{value:.3g}")
