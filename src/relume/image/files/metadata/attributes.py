"""The metadata that every format may store, by one name each.

The attributes of a radiance map are texts. Those below have a place of their own in several formats; all others are
relume's (their mapping, their orientation, …) or of the format they came from, and are stored under "relume:".
"""

from __future__ import annotations

import os
from collections.abc import Collection, Mapping

import numpy as np

from relume.errors import UnreadableFile, warn
from relume.image.radiance import RadianceMap

PREFIX = "relume:"

# Our name → the standard attribute of OpenEXR 3.4 and its type.
EXR: Mapping[str, tuple[str, type]] = {
    "exposure_time": ("expTime", float),  # s
    "f_number": ("aperture", float),
    "iso": ("isoSpeed", float),
    "focal_length": ("nominalFocalLength", float),  # mm
    "pixel_aspect": ("pixelAspectRatio", float),  # a pixel's width by its height
    "latitude": ("latitude", float),  # degrees north
    "longitude": ("longitude", float),  # degrees east
    "camera": ("cameraModel", str),
    "camera_make": ("cameraMake", str),
    "serial": ("cameraSerialNumber", str),
    "lens": ("lensModel", str),
    "taken": ("capDate", str),  # YYYY:MM:DD hh:mm:ss
    "owner": ("owner", str),
    "comments": ("comments", str),
}

# Our name → the variable of a Radiance header. PIXASPECT there is a pixel's height by its width: its inverse; LATLONG
# is latitude and longitude in one.
RADIANCE: Mapping[str, str] = {
    "camera": "CAMERA",
    "taken": "CAPDATE",
    "software": "SOFTWARE",
    "owner": "OWNER",
    "view": "VIEW",
}

# Our name → the TIFF or EXIF tag. Latitude and longitude stand in a folder of their own: `gps`.
EXIF: Mapping[str, int] = {
    "exposure_time": 0x829A,
    "f_number": 0x829D,
    "iso": 0x8827,
    "focal_length": 0x920A,
    "camera": 0x0110,
    "camera_make": 0x010F,
    "serial": 0xA431,
    "lens": 0xA434,
    "taken": 0x9003,
    "owner": 0x013B,
    "copyright": 0x8298,
    "comments": 0x010E,
    "software": 0x0131,
}


def warn_of_losses(
    path: str | os.PathLike[str], image: RadianceMap, kept: Collection[str] | None, *, unit: bool = True
) -> None:
    """Say in one warning what of a radiance map a file will not hold: planes, unit, attributes.

    kept : the attributes that the format holds; None where it holds them all
    unit : whether it holds the unit
    """
    lost = [name for name in ("variance", "clipped") if getattr(image, name) is not None]
    lost = [{"variance": "the variance", "clipped": "the marks of clipped pixels"}[name] for name in lost]
    if not unit and image.unit != "relative":
        lost.append(f"the unit {image.unit}")
    dropped = [] if kept is None else sorted(image.attributes.keys() - set(kept))
    if dropped:
        lost.append(f"the attributes {', '.join(dropped)}")
    if lost:
        warn(f"{path}: does not keep {'; '.join(lost)}; .exr keeps everything")


def scale_by(path: str | os.PathLike[str], pixels: np.ndarray, luminance: float, name: str) -> None:
    """Multiply float32 pixels, in place, by the luminance of RGB (1, 1, 1) that a file names.

    Raises UnreadableFile where finite ones come to be beyond float32.
    """
    infinite = np.count_nonzero(np.isinf(pixels))
    with np.errstate(over="ignore"):
        pixels *= np.float32(luminance)
    if beyond := np.count_nonzero(np.isinf(pixels)) - infinite:
        raise UnreadableFile(
            f"{path}: times its {name} of {luminance:g}, {beyond} values are beyond float32; correct it"
        )
