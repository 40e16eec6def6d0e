"""The part of `relume convert` that changes a file's format and nothing else: crop, expose, write, and look back."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from cyclopts import Group, Parameter

if TYPE_CHECKING:
    from relume.image.files import Encoding, ReadOptions
    from relume.image.photograph import Photograph
    from relume.image.radiance import RadianceMap

FORMAT = Group("The format of the output", sort_key=1)
PHOTOGRAPHS = (".png", ".tif", ".tiff", ".jpg", ".jpeg")
FLOATS = (".exr", ".tif", ".tiff", ".pfm", ".float", ".float.gz")


@Parameter(name="*")
@dataclass(frozen=True)
class FormatOptions:
    """What of the output its name does not tell."""

    half: Annotated[
        bool, Parameter(group=FORMAT, negative="", help="16 bits a value in an .exr; float where halves would not do.")
    ] = False
    float_: Annotated[
        bool,
        Parameter(
            name="--float",
            group=FORMAT,
            negative="",
            help="32 bits a value, which is what is written unless asked otherwise.",
        ),
    ] = False
    as_: Annotated[
        Literal["xyze", "logluv32", "logluv24", "logl16", "grey"] | None,
        Parameter(
            name="--as",
            group=FORMAT,
            help="xyze: a .hdr in CIE XYZ. logluv32, logluv24, logl16: a .tif of log luminance. grey: a .pfm of one "
            "channel.",
        ),
    ] = None
    roi: Annotated[
        str | None, Parameter(group=FORMAT, help="Keep the rectangle X,Y,WIDTH,HEIGHT of the input, in pixels.")
    ] = None

    def encoding(self, out: Path) -> Encoding | None:
        """How the output is written; None as its name says. Raises ValueError for options that do not fit it."""
        from relume.image.files.encodings import PFM, LogLuv, OpenEXR, RadianceHDR, suffix_of

        radiance, tiff = (".hdr", ".pic", ".rgbe", ".xyze"), (".tif", ".tiff")
        choices: dict[str, tuple[bool, Callable[[], Encoding | None], tuple[str, ...]]] = {
            "--half": (self.half, lambda: OpenEXR(half=True), (".exr",)),
            "--float": (self.float_, lambda: None, FLOATS),
            "--as xyze": (self.as_ == "xyze", lambda: RadianceHDR(xyz=True), radiance),
            "--as logluv32": (self.as_ == "logluv32", lambda: LogLuv(32), tiff),
            "--as logluv24": (self.as_ == "logluv24", lambda: LogLuv(24), tiff),
            "--as logl16": (self.as_ == "logl16", lambda: LogLuv(16), tiff),
            "--as grey": (self.as_ == "grey", lambda: PFM(grey=True), (".pfm",)),
        }
        asked = {option: choice for option, choice in choices.items() if choice[0]}
        if len(asked) > 1:
            raise ValueError(f"{' and '.join(asked)} contradict each other; keep one")
        for option, (_, encoding, fits) in asked.items():
            if suffix_of(out) not in fits:
                raise ValueError(f"{option} is for {', '.join(fits)}; {out.name} is none")
            return encoding()
        return None

    def rectangle(self) -> tuple[int, int, int, int] | None:
        """Left, top, width and height of --roi."""
        from relume.cli.arguments import numbers, whole

        if self.roi is None:
            return None
        left, top, width, height = whole(numbers(self.roi, "--roi", 4), "--roi")
        return left, top, width, height


def change_format(
    path: Path,
    out: Path,
    form: FormatOptions,
    reading: ReadOptions,
    *,
    stops: float = 0.0,
    clamp: bool = False,
    dry_run: bool = False,
) -> dict[str, object]:
    """Write what a file holds in the format that `out` names, read it back, and tell how much of it was kept."""
    from relume.cli.arguments import refuse_input, require_files, require_suffix
    from relume.cli.convert_input import refuse_paintings
    from relume.image import files
    from relume.image.files.encodings import SUFFIXES, suffix_of
    from relume.image.radiance import RadianceMap
    from relume.sphere.environment_files import require_light

    suffix = suffix_of(out)
    require_suffix(out, *dict.fromkeys([*SUFFIXES, *PHOTOGRAPHS]))
    require_files([path])
    refuse_input(out, [path])
    encoding, rectangle = form.encoding(out), form.rectangle()
    if suffix not in PHOTOGRAPHS:
        refuse_paintings(path)
    # A JPEG with a gain map is both; to a format of both goes its base, unless floats are asked for.
    as_photograph = suffix in PHOTOGRAPHS and encoding is None and not form.float_
    wants_light = files.has_radiance(path) and not (files.kind_of(path) == "JPEG" and as_photograph)
    if wants_light and suffix not in SUFFIXES:
        raise ValueError(f"{path}: radiance, which {suffix} does not hold; make a picture of it with relume develop")
    if not wants_light and (stops or clamp or encoding is not None or form.float_):
        raise ValueError(f"{path}: a photograph; --exposure, --clamp, --float and formats of radiance are not for it")
    if dry_run:
        return {"would write": [str(out)]}
    image = files.read_radiance(path, reading) if wants_light else files.read(path, reading)
    image = cut(image, rectangle)
    if not isinstance(image, RadianceMap):
        files.write(out, image)
        if held := _blocks_of_others(path):
            warnings.warn(f"{out}: does not keep the {' and '.join(held)} of {path.name}", stacklevel=2)
        told = {"written": [str(out)], "size": list(image.size), "bits": 8 * image.pixels.itemsize}
        return {**told, "kept": kept_codes(image, files.read_photograph(out, reading))}
    image = exposed(require_light(path, image, clamp=True) if clamp else image, stops)
    files.write(out, image, encoding)
    again = replace(reading, float_size=image.size, float_order=None)
    back = files.read_radiance(out, again)
    told = {"written": [str(out)], "format": files.subtype(out, again), "size": list(image.size), "unit": image.unit}
    near = kept(image, back)
    return {**told, **({} if near["exact"] else _audited(image, back)), "kept": near}


def _blocks_of_others(path: Path) -> list[str]:
    """Blocks of metadata in a photograph that relume does not carry over, by their marks near its beginning."""
    with open(path, "rb") as file:
        head = file.read(2**20)
    marks = {"XMP": (b"http://ns.adobe.com/xap/1.0/", b"<x:xmpmeta"), "IPTC": (b"Photoshop 3.0\0", b"8BIM\x04\x04")}
    return [name for name, known in marks.items() if any(mark in head for mark in known)]


def _audited(before: RadianceMap, after: RadianceMap) -> dict[str, object]:
    """The energy of a light map as it was and as it is written; nothing for any other picture."""
    from relume.sphere.environment_files import as_environment

    try:
        return {"before": as_environment(before).audit().facts(), "after": as_environment(after).audit().facts()}
    except ValueError:
        return {}


def cut(image: RadianceMap | Photograph, rectangle: tuple[int, int, int, int] | None) -> RadianceMap | Photograph:
    """The rectangle of an image; a part of a light map no longer tells where it looks."""
    import relume as rl
    from relume.image.radiance import RadianceMap

    if rectangle is None:
        return image
    if isinstance(image, RadianceMap):
        return rl.light.Crop(*rectangle)(image)
    left, top, width, height = rectangle
    across, down = image.size
    if not (0 <= left < left + width <= across and 0 <= top < top + height <= down):
        raise ValueError(f"--roi {left},{top},{width},{height} is not in a picture of {across}×{down}")
    part = (slice(top, top + height), slice(left, left + width))
    outside = None if image.outside is None else image.outside[part].copy()
    return replace(image, pixels=image.pixels[part].copy(), outside=outside)


def exposed(picture: RadianceMap, stops: float) -> RadianceMap:
    """The map brightened; what was calibrated no longer is, and a warning says so."""
    from relume.image.arithmetic import multiplied

    if not abs(stops) <= 100:
        raise ValueError(f"--exposure: {stops:g}; expected −100 to 100 stops")
    if not stops:
        return picture
    if picture.unit != "relative":
        warnings.warn(f"brightened by {stops:g} stops it is no longer {picture.unit}, but relative", stacklevel=2)
    return replace(multiplied(picture, 2.0**stops), unit="relative")


def kept(before: RadianceMap, after: RadianceMap) -> dict[str, object]:
    """How far the file, read back, is from what was to be written.

    exact : whether every value is the same, bit for bit; nothing more is told then
    mean change : of each channel's mean, in percent of the greatest of the means
    error % of the largest channel : of each pixel, in half of those that are not black, in 99 of 100 and the largest
    black becomes : the largest value of what was black, where it is above 0
    no longer finite : pixels that were, and infinities and NaN that came out as numbers
    """
    import numpy as np

    first, second = before.radiance, after.radiance
    if first.shape == second.shape and np.array_equal(first.view(np.uint32), second.view(np.uint32)):
        return {"exact": True}
    was, still = np.isfinite(first).all(-1), np.isfinite(second).all(-1)
    told: dict[str, object] = {"exact": False}
    if changed := int(np.count_nonzero(was != still)):
        told["no longer finite"] = changed
    a, b = first[was & still], second[was & still]
    size = np.abs(a).max(-1, initial=0)
    lit = size > 0
    if lit.any():
        means = a.mean(0, dtype=np.float64), b.mean(0, dtype=np.float64)
        told["mean change %"] = [_short(100 * v) for v in (means[1] - means[0]) / np.abs(means[0]).max()]
        errors = np.abs(b[lit] - a[lit]).max(-1) / size[lit]
        half, most, largest = np.quantile(errors, [0.5, 0.99, 1.0])
        told["error % of the largest channel"] = {
            "half": _short(100 * half),
            "99 of 100": _short(100 * most),
            "largest": _short(100 * largest),
        }
    if (dark := float(np.abs(b[~lit]).max(initial=0))) > 0:
        told["black becomes"] = _short(dark)
    return told


def kept_codes(before: Photograph, after: Photograph) -> dict[str, object]:
    """The same of a photograph's code values: their mean change and their largest."""
    import numpy as np

    change = after.pixels.astype(np.int32) - before.pixels
    if not change.any():
        return {"exact": True}
    return {"exact": False, "mean change": _short(change.mean()), "largest change": int(np.abs(change).max())}


def _short(value: float) -> float:
    return float(f"{value:.3g}")
