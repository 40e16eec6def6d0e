"""The only place where relume opens image files: one module a format behind `read` and `write`.

Files are told by their content, never by their suffix. A JPEG, PNG or TIFF of 8 or 16 bits is a `Photograph` (encoded
values), an OpenEXR or Radiance .hdr file a `RadianceMap` (scene-linear): what a file is decides what it becomes, and
nothing converts between the two unseen. A camera raw is neither until it is merged: `read_raw` gives its sensor's own
values. Format libraries are imported at first use.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from relume.errors import UnreadableFile
from relume.image.files.atomic import replacing, write_text
from relume.image.files.facts import Facts
from relume.image.files.signatures import kind_of
from relume.image.photograph import Photograph
from relume.image.radiance import RadianceMap
from relume.image.raw import RawPhotograph

__all__ = [
    "Facts",
    "describe",
    "read",
    "read_facts",
    "read_layers",
    "read_photograph",
    "read_radiance",
    "read_raw",
    "replacing",
    "write",
    "write_layers",
    "write_text",
]


def read(path: str | os.PathLike[str]) -> Photograph | RadianceMap:
    """The photograph or radiance map in a file; raises UnreadableFile, in one line, for anything missing or damaged."""
    kind = kind_of(path)
    if kind == "RAW":
        raise UnreadableFile(f"{path}: a camera raw file, not a photograph yet; give raw files to `relume merge`")
    try:
        if kind == "EXR":
            from relume.image.files import exr

            return exr.read(path)
        if kind == "HDR":
            from relume.image.files import radiance_hdr

            return radiance_hdr.read(path)
        from relume.image.files import photographs

        return photographs.read(path)
    except MemoryError:
        raise UnreadableFile(f"{path}: larger than the memory there is; scale it down first") from None


def read_photograph(path: str | os.PathLike[str]) -> Photograph:
    """The photograph in a file; raises UnreadableFile where the file holds a radiance map."""
    image = read(path)
    if isinstance(image, RadianceMap):
        raise UnreadableFile(f"{path}: a radiance map where a photograph is needed; give a JPEG, PNG or TIFF")
    return image


def read_radiance(path: str | os.PathLike[str]) -> RadianceMap:
    """The radiance map in a file; raises UnreadableFile where the file holds a photograph."""
    image = read(path)
    if isinstance(image, Photograph):
        raise UnreadableFile(
            f"{path}: a photograph where a radiance map is needed; give an EXR or .hdr, or merge a bracket"
        )
    return image


def read_facts(path: str | os.PathLike[str]) -> Facts:
    """What the header of a photograph tells, without its pixels; raises UnreadableFile for what is no photograph."""
    from relume.image.files import facts

    return facts.read(path)


def read_raw(path: str | os.PathLike[str]) -> RawPhotograph:
    """What the sensor read, from a camera raw file (DNG, NEF, CR2, CR3, ARW, …); see `RawPhotograph`.

    Raises UnreadableFile for another kind of file, a damaged one, and a sensor without a Bayer pattern.
    """
    if (kind := kind_of(path)) != "RAW":
        raise UnreadableFile(f"{path}: a {kind} file where a camera raw is needed; give the camera's own raw file")
    from relume.image.files import camera_raw

    try:
        return camera_raw.read(path)
    except MemoryError:
        raise UnreadableFile(f"{path}: larger than the memory there is") from None


def write(path: str | os.PathLike[str], image: RadianceMap | Photograph) -> None:
    """Write an image, whole or not at all, in the format its suffix names.

    A radiance map goes to .exr (float32, everything kept) or .hdr (RGBE, an error of up to 1/256 of a pixel's largest
    channel); a photograph to .png (8 or 16 bits) or .jpg (8 bits, quality 95, full colour resolution), with its EXIF.

    Raises ValueError for another suffix or pixels the format cannot hold, OutputNotWritten.
    """
    suffix = Path(path).suffix.lower()
    if isinstance(image, RadianceMap) and suffix == ".exr":
        from relume.image.files import exr

        exr.write(path, image)
    elif isinstance(image, RadianceMap) and suffix == ".hdr":
        from relume.image.files import radiance_hdr

        radiance_hdr.write(path, image)
    elif isinstance(image, Photograph) and suffix == ".png":
        from relume.image.files import photographs

        photographs.write_png(path, image)
    elif isinstance(image, Photograph) and suffix in (".jpg", ".jpeg"):
        from relume.image.files import photographs

        photographs.write_jpeg(path, image)
    elif isinstance(image, RadianceMap):
        raise ValueError(f'{path} ends in "{suffix}"; a radiance map goes to .exr or .hdr: develop it for a photograph')
    else:
        raise ValueError(
            f'{path} ends in "{suffix}"; a photograph goes to .png or .jpg: merge a bracket for .exr or .hdr'
        )


def write_layers(
    path: str | os.PathLike[str],
    layers: Mapping[str, np.ndarray],
    *,
    unit: str = "relative",
    attributes: Mapping[str, str] | None = None,
) -> None:
    """Write named layers of one size as the parts of one EXR, always float32.

    layers : name → (H, W, 3), stored as R, G, B, or (H, W), stored as Y
    unit : of the three-channel layers, "relative" or "cd/m²"
    attributes : strings stored with every layer

    Raises ValueError for another suffix, shape or unit, or sizes that differ; OutputNotWritten.
    """
    from relume.image.files import exr

    if Path(path).suffix.lower() != ".exr":
        raise ValueError(f'{path} ends in "{Path(path).suffix}"; layers are written to .exr')
    exr.write_layers(path, layers, unit=unit, attributes=attributes)


def read_layers(path: str | os.PathLike[str]) -> dict[str, np.ndarray]:
    """The parts of an EXR by name, (H, W, 3) or (H, W) float32; raises UnreadableFile."""
    if (kind := kind_of(path)) != "EXR":
        raise UnreadableFile(f"{path}: a {kind} file where layers are needed; give an EXR")
    from relume.image.files import exr

    return exr.read_layers(path)


def describe(path: str | os.PathLike[str]) -> dict[str, object]:
    """What a file holds, in plain values that JSON can hold: see `relume.image.files.description.describe`."""
    from relume.image.files import description

    return description.describe(path)
