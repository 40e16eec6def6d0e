"""A photograph without its pixels, from its header: enough to sort a folder into brackets."""

from __future__ import annotations

import os
from dataclasses import dataclass

from relume.errors import UnreadableFile
from relume.image.files.read_options import ReadOptions
from relume.image.files.signatures import MAPS, kind_of
from relume.image.photograph import Exposure, Settings


@dataclass(frozen=True)
class Facts:
    """A photograph but for its pixels.

    name : the file
    size : (width, height) in pixels, upright
    exposure : shutter, aperture, ISO; None where the file has none
    camera : make and model, "" where unknown
    settings : what else the file stores
    shutter_speed : −log₂ of the exposure time in seconds as the camera wrote it beside (APEX), None where it did not
    """

    name: str
    size: tuple[int, int]
    exposure: Exposure | None = None
    camera: str = ""
    settings: Settings = Settings()
    shutter_speed: float | None = None


def read(path: str | os.PathLike[str], options: ReadOptions = ReadOptions()) -> Facts:
    """The facts of a JPEG, PNG, TIFF or camera raw; raises UnreadableFile for anything else.

    The size of a camera raw is that of its sensor's lit part, as it lies in the camera.
    """
    # Pillow and LibRaw are loaded here and not above: most who import this module's parent read no photograph.
    from relume.image.files.metadata import exif
    from relume.image.files.photographs.header import form_of

    kind = kind_of(path)
    if kind in MAPS:
        raise UnreadableFile(f"{path}: a radiance map where a photograph is needed; give a JPEG, PNG or TIFF")
    if kind == "RAW":
        return _of_raw(path)
    if kind not in ("JPEG", "PNG", "TIFF"):
        raise UnreadableFile(f"{path}: a {kind} file where a photograph is needed; give a JPEG, PNG or TIFF")
    form = form_of(path, kind, options)
    tags = exif.tags(path, kind)
    lying = exif.orientation_of(tags) >= 5
    return Facts(
        name=str(path),
        size=(form.height, form.width) if lying else (form.width, form.height),
        exposure=exif.exposure_of(tags),
        camera=exif.camera_of(tags),
        settings=exif.settings_of(tags),
        shutter_speed=exif.shutter_speed_of(tags),
    )


def _of_raw(path: str | os.PathLike[str]) -> Facts:
    import rawpy

    from relume.image.files import camera_raw
    from relume.image.files.metadata import exif

    try:
        with rawpy.imread(os.fspath(path)) as raw:  # the header alone: pixels are unpacked when they are asked for
            sizes, tags = raw.sizes, camera_raw.tags_of(path)
            exposure, settings = camera_raw.exposure_of(raw, tags)
            size = (sizes.width, sizes.height)
    except (rawpy.LibRawError, OSError, ValueError, AttributeError, TypeError) as error:
        raise camera_raw.refusal(path, error) from error
    known = tags or {}
    return Facts(str(path), size, exposure, exif.camera_of(known), settings, exif.shutter_speed_of(known))
