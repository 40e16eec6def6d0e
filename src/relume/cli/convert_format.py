"""The part of `relume convert` that changes a file's format and nothing else: crop, expose, write, and look back."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from cyclopts import Group, Parameter

if TYPE_CHECKING:
    from relume.image.files import Encoding, Reading
    from relume.image.photograph import Photograph
    from relume.image.radiance import RadianceMap

FORMAT = Group("The format of the output", sort_key=1)
SUFFIXES = (".exr", ".hdr", ".pic", ".tif", ".tiff", ".pfm", ".float", ".gz", ".jpg", ".jpeg")
PHOTOGRAPHS = (".png", ".tif", ".tiff", ".jpg", ".jpeg")
_DIGITS = 1e-7
"""Differences below this share are the last digit of a float."""


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
    tolerance: Annotated[
        float | None,
        Parameter(
            group=FORMAT, help="Error of luminance, in percent, that a .jpg with a gain map may have; 5 unless given."
        ),
    ] = None

    def encoding(self, out: Path) -> Encoding | None:
        """How the output is written; None as its name says. Raises ValueError for options that do not fit it."""
        from relume.image.files.encodings import PFM, GainMap, LogLuv, OpenEXR, RadianceHDR, suffix_of

        suffix = suffix_of(out)
        if self.half and self.float_:
            raise ValueError("--half and --float contradict each other; leave one out")
        if self.float_ and suffix in (".hdr", ".pic", ".jpg", ".jpeg"):
            raise ValueError(f"--float: {suffix} holds no floats; write .exr, .tif or .pfm")
        chosen = {
            "--half": (self.half, OpenEXR(half=True), (".exr",)),
            "--as xyze": (self.as_ == "xyze", RadianceHDR(xyz=True), (".hdr", ".pic")),
            "--as logluv32": (self.as_ == "logluv32", LogLuv(32), (".tif", ".tiff")),
            "--as logluv24": (self.as_ == "logluv24", LogLuv(24), (".tif", ".tiff")),
            "--as logl16": (self.as_ == "logl16", LogLuv(16), (".tif", ".tiff")),
            "--as grey": (self.as_ == "grey", PFM(grey=True), (".pfm",)),
            "--tolerance": (
                self.tolerance is not None,
                GainMap(tolerance=(self.tolerance or 5.0) / 100),
                (".jpg", ".jpeg"),
            ),
        }
        asked = {option: (encoding, fits) for option, (given, encoding, fits) in chosen.items() if given}
        for option, (_, fits) in asked.items():
            if suffix not in fits:
                raise ValueError(f"{option} is for {' and '.join(fits)}; {out.name} is none")
        return next((encoding for encoding, _ in asked.values()), None)

    def rectangle(self) -> tuple[int, int, int, int] | None:
        """Left, top, width and height of --roi."""
        from relume.cli.merge_options import numbers, whole

        if self.roi is None:
            return None
        left, top, width, height = whole(numbers(self.roi, "--roi", 4), "--roi")
        return left, top, width, height


def change_format(
    path: Path,
    out: Path,
    form: FormatOptions,
    reading: Reading,
    *,
    stops: float = 0.0,
    clamp: bool = False,
    dry_run: bool = False,
) -> dict[str, object]:
    """Write what a file holds in the format that `out` names, read it back, and tell how much of it was kept."""
    from relume.cli.arguments import require_files, require_suffix
    from relume.cli.convert_input import refuse_paintings
    from relume.cli.light_input import light_only
    from relume.image import files
    from relume.image.radiance import RadianceMap

    require_suffix(out, *SUFFIXES, *PHOTOGRAPHS)
    require_files([path])
    encoding, rectangle = form.encoding(out), form.rectangle()
    if dry_run:
        files.kind_of(path)
        return {"would write": [str(out)]}
    if out.suffix.lower() not in PHOTOGRAPHS:
        refuse_paintings(path)
    # A JPEG with a gain map is both; to a format of both goes its base, unless floats are asked for.
    as_photograph = out.suffix.lower() in PHOTOGRAPHS and encoding is None and not form.float_
    wants_light = files.has_radiance(path) and not (files.kind_of(path) == "JPEG" and as_photograph)
    image = files.read_radiance(path, reading) if wants_light else files.read(path, reading)
    image = cut(image, rectangle)
    if not isinstance(image, RadianceMap):
        if stops or clamp or encoding is not None:
            raise ValueError(f"{path}: a photograph; --exposure, --clamp and formats of radiance are not for it")
        files.write(out, image)
        return {"written": [str(out)], "size": list(image.size), "bits": 8 * image.pixels.itemsize}
    image = exposed(light_only(path, image, True) if clamp else image, stops)
    files.write(out, image, encoding)
    again = replace(reading, float_size=image.size, float_order=None)
    back = files.read_radiance(out, again)
    told = {"written": [str(out)], "format": files.subtype(out, again), "size": list(image.size), "unit": image.unit}
    near = kept(image, back)
    return {**told, **({} if near["exact"] else _audited(image, back)), "kept": near}


def _audited(before: RadianceMap, after: RadianceMap) -> dict[str, object]:
    """The energy of a light map as it was and as it is written; nothing for any other picture."""
    from relume.sphere.audit import audit
    from relume.sphere.illumination import as_illumination

    try:
        return {"before": audit(as_illumination(before)).facts(), "after": audit(as_illumination(after)).facts()}
    except ValueError:
        return {}


def cut(image: RadianceMap | Photograph, rectangle: tuple[int, int, int, int] | None) -> RadianceMap | Photograph:
    """The rectangle of an image; a part of a light map no longer tells where it looks."""
    from relume.cli.edit_steps import crop
    from relume.image.radiance import RadianceMap

    if rectangle is None:
        return image
    if isinstance(image, RadianceMap):
        return crop(image, *rectangle)
    left, top, width, height = rectangle
    across, down = image.size
    if not (0 <= left < left + width <= across and 0 <= top < top + height <= down):
        raise ValueError(f"--roi {left},{top},{width},{height} is not in a picture of {across}×{down}")
    part = (slice(top, top + height), slice(left, left + width))
    outside = None if image.outside is None else image.outside[part].copy()
    return replace(image, pixels=image.pixels[part].copy(), outside=outside)


def exposed(picture: RadianceMap, stops: float) -> RadianceMap:
    """The map brightened; what was calibrated no longer is, and a warning says so."""
    import warnings

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

    mean : change of each channel's mean, in percent
    error : of each pixel's channels, as a share of its largest: in half of the pixels, in 99 of 100 and the largest,
        in percent
    exact : whether every value is the same, bit for bit
    """
    import numpy as np

    first, second = before.radiance, after.radiance
    exact = first.shape == second.shape and np.array_equal(first.view(np.uint32), second.view(np.uint32))
    if exact:
        return {"exact": True}
    finite = np.isfinite(first).all(-1) & np.isfinite(second).all(-1)
    a, b = first[finite], second[finite]
    means = a.mean(0, dtype=np.float64), b.mean(0, dtype=np.float64)
    size = np.abs(a).max(-1)
    lit = size > 0
    errors = np.abs(b - a).max(-1)[lit] / size[lit]
    change = 100 * (means[1] - means[0]) / np.maximum(np.abs(means[0]), 1e-30)
    half, most = np.quantile(errors, [0.5, 0.99]) if errors.size else (0.0, 0.0)
    return {
        "exact": False,
        "mean change %": [float(f"{value:.3g}") for value in change],
        "error %": {
            "half": float(f"{100 * half:.3g}"),
            "99 of 100": float(f"{100 * most:.3g}"),
            "largest": float(f"{100 * errors.max(initial=0):.3g}"),
        },
    }
