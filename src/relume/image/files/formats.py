"""The only place where relume opens image files: one module a format behind `read` and `write`.

The content of a file decides what it is, never its suffix (but raw .float, which is nothing but pixels). A JPEG, PNG,
TIFF or HEIF of 8 to 16 bits is a `Photograph` (encoded values). An OpenEXR, Radiance picture, LogLuv or float TIFF, PFM
or raw float file is a `RadianceMap` (scene-linear). Nothing converts between the two unseen. A JPEG with a gain map is
both: `read_photograph` gives one, `read_radiance` the other. A camera raw is neither until it is merged: `read_raw`
gives its sensor's own values. Format libraries are imported at first use.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Mapping
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from relume.errors import UnreadableFile, warn
from relume.image.files import encodings
from relume.image.files.encodings import Encoding, suffix_of
from relume.image.files.photographs.remarks import warn_of_gain_maps
from relume.image.files.read_options import ReadOptions
from relume.image.files.signatures import MAPS, PHOTOGRAPHS, kind_of
from relume.image.photograph import Photograph, RawPhotograph
from relume.image.radiance import RadianceMap

_READERS = {
    "EXR": "exr.maps",
    "HDR": "hdr.radiance_hdr",
    "PFM": "pfm",
    "raw float": "raw_float",
    "float TIFF": "tiff.float_tiff",
    "LogLuv TIFF": "logluv.logluv_tiff",
    "DDS": "textures.dds",
    "JPEG": "photographs.photographs",
    "PNG": "photographs.photographs",
    "TIFF": "photographs.photographs",
    "HEIF": "photographs.photographs",
    "BMP": "photographs.photographs",
    "PNM": "photographs.photographs",
}
_WRITERS = {
    encodings.OpenEXR: "exr.maps",
    encodings.RadianceHDR: "hdr.radiance_hdr",
    encodings.PFM: "pfm",
    encodings.RawFloat: "raw_float",
    encodings.FloatTIFF: "tiff.float_tiff",
    encodings.LogLuv: "logluv.logluv_tiff",
}


def read(path: str | os.PathLike[str], options: ReadOptions = ReadOptions()) -> Photograph | RadianceMap:
    """The photograph or radiance map in a file; of a JPEG with a gain map the photograph, and a warning that says so.

    path : the file; its first bytes say what it is, and only of a .float its suffix
    options : limits, and how what a file leaves open is understood
    Raises UnreadableFile, in one line, for anything missing, damaged or beyond the limits.
    """
    kind = kind_of(path)
    image = _read(path, kind, options)
    if _has_gain_map(path, kind):
        warn(f"{path}: only its base picture is read, though it has a gain map too; read_radiance gives its light")
    elif isinstance(image, Photograph):
        warn_of_gain_maps([image])
    return image


def read_photograph(path: str | os.PathLike[str], options: ReadOptions = ReadOptions()) -> Photograph:
    """The photograph in a file.

    path : the file: JPEG, PNG, TIFF, HEIF and others
    options : limits, and how what a file leaves open is understood
    Warns of a gain map for HDR screens beside it, of which it shows nothing. Raises UnreadableFile, also where the file
    holds a radiance map.
    """
    return read_photographs([path], options)[0]


def read_photographs(paths: Iterable[str | os.PathLike[str]], options: ReadOptions = ReadOptions()) -> list[Photograph]:
    """As `read_photograph`, of several files, with one warning for all their gain maps."""
    images = []
    for path in paths:
        kind = kind_of(path)
        if kind in MAPS:
            raise UnreadableFile(f"{path}: a radiance map where a photograph is needed; give a JPEG, PNG or TIFF")
        image = _read(path, kind, options)
        assert isinstance(image, Photograph)
        images.append(image)
    warn_of_gain_maps(images)
    return images


def read_radiance(path: str | os.PathLike[str], options: ReadOptions = ReadOptions()) -> RadianceMap:
    """The radiance map in a file, also that of a JPEG with a gain map.

    path : the file: EXR, Radiance HDR, TIFF of floats, LogLuv, PFM and others
    options : limits, and how what a file leaves open is understood
    Raises UnreadableFile, also for a photograph, which holds no radiance.
    """
    kind = kind_of(path)
    if _has_gain_map(path, kind):
        return _decoded(path, "gain_map.gain_map", options)
    if kind in PHOTOGRAPHS:
        raise UnreadableFile(
            f"{path}: a photograph where a radiance map is needed; give an EXR or .hdr, or merge a bracket"
        )
    image = _read(path, kind, options)
    assert isinstance(image, RadianceMap)
    return image


def has_radiance(path: str | os.PathLike[str]) -> bool:
    """Whether `read_radiance` would find any in a file: not in a photograph without a gain map.

    path : the file
    Raises UnreadableFile.
    """
    kind = kind_of(path)
    return kind not in PHOTOGRAPHS or _has_gain_map(path, kind)


def _has_gain_map(path: str | os.PathLike[str], kind: str) -> bool:
    if kind != "JPEG":
        return False
    from relume.image.files.gain_map import gain_map

    return gain_map.is_present(path)


def _read(path: str | os.PathLike[str], kind: str, options: ReadOptions) -> Photograph | RadianceMap:
    if kind == "RAW":
        raise UnreadableFile(f"{path}: a camera raw file, not a photograph yet; give raw files to `relume merge`")
    if kind == "KTX2":
        raise UnreadableFile(f"{path}: a cube of an engine's texture levels, not one picture; give what it was made of")
    return _decoded(path, _READERS[kind], options)


def _decoded(path: str | os.PathLike[str], module: str, options: ReadOptions) -> Any:
    try:
        return import_module(f"relume.image.files.{module}").read(path, options)
    except MemoryError:
        raise UnreadableFile(f"{path}: larger than the memory there is; scale it down first") from None


def read_raw(path: str | os.PathLike[str], options: ReadOptions = ReadOptions()) -> RawPhotograph:
    """What the sensor read, from a camera raw file (DNG, NEF, CR2, CR3, ARW, …).

    path : a camera raw file
    options : limits
    Raises UnreadableFile for another kind of file, a damaged one, and a sensor without a Bayer pattern.
    """
    if (kind := kind_of(path)) != "RAW":
        raise UnreadableFile(f"{path}: a {kind} file where a camera raw is needed; give the camera's own raw file")
    from relume.image.files import camera_raw

    try:
        return camera_raw.read(path, options)
    except MemoryError:
        raise UnreadableFile(f"{path}: larger than the memory there is") from None


def write(path: str | os.PathLike[str], image: RadianceMap | Photograph, encoding: Encoding | None = None) -> None:
    """Write an image, whole or not at all, in the format that `encoding` or else its suffix names.

    path : the file; its suffix names the format
    image : the radiance map or the photograph
    encoding : a variety of the format, as of `rl.files`; the usual one of the suffix unless given

    A radiance map goes to .exr (float32, everything kept), .hdr or .pic (RGBE, an error of up to 1/256 of a pixel's
    largest channel), .tif (float32), .pfm, .float and .float.gz; `rl.files` has what else there is, such as `LogLuv`. A
    photograph goes to .png or .tif (8 or 16 bits) or .jpg (8 bits, quality 95, full colour resolution), with its EXIF.
    What the format does not keep is said in a warning.

    Raises ValueError for another suffix or pixels the format cannot hold, OutputNotWritten.
    """
    suffix = suffix_of(Path(path))
    if isinstance(image, RadianceMap):
        chosen = encoding or encodings.SUFFIXES.get(suffix)
        if chosen is None:
            raise ValueError(
                f'{path} ends in "{suffix}"; a radiance map goes to .exr, .hdr, .tif, .pfm or .float; develop it for a '
                "photograph, or for a JPEG with a gain map (relume develop --display gain-map)"
            )
        wanted = [ending for ending, known in encodings.SUFFIXES.items() if _home(known) == _home(chosen)]
        if suffix not in wanted:
            raise ValueError(f'{path} ends in "{suffix}"; {type(chosen).__name__} is written to {" or ".join(wanted)}')
        import_module(f"relume.image.files.{_WRITERS[type(chosen)]}").write(path, image, chosen)
        return
    if not isinstance(image, Photograph):
        raise ValueError(
            f"{path}: the image is of type {type(image).__name__}; give a RadianceMap or a Photograph "
            "(rl.as_radiance_map makes one of an environment map)"
        )
    if encoding is not None:
        raise ValueError(f"{type(encoding).__name__} holds radiance; a photograph goes to .png, .tif or .jpg as it is")
    from relume.image.files.photographs import photographs

    writers = {
        ".png": photographs.write_png,
        ".tif": photographs.write_tiff,
        ".tiff": photographs.write_tiff,
        ".jpg": photographs.write_jpeg,
        ".jpeg": photographs.write_jpeg,
    }
    if suffix not in writers:
        raise ValueError(
            f'{path} ends in "{suffix}"; a photograph goes to .png, .tif or .jpg: merge a bracket for .exr or .hdr'
        )
    writers[suffix](path, image)


def _home(encoding: Encoding) -> str:
    """What an encoding's files are called after: the two of TIFF share their endings."""
    return "tiff" if isinstance(encoding, encodings.LogLuv | encodings.FloatTIFF) else _WRITERS[type(encoding)]


def write_layers(
    path: str | os.PathLike[str],
    layers: Mapping[str, np.ndarray],
    *,
    unit: str = "relative",
    attributes: Mapping[str, str] | None = None,
    between: Callable[[], None] | None = None,
) -> None:
    """Write named layers of one size as the parts of one EXR, always float32.

    path : the file, .exr
    layers : name → (H, W, 3), stored as R, G, B, or (H, W), stored as Y
    unit : of the three-channel layers, "relative" or "cd/m²"
    attributes : strings stored with every layer
    between : called again and again while layers are written, for what gives back the memory of those in files

    Raises ValueError for another suffix, shape or unit, or sizes that differ; OutputNotWritten.
    """
    from relume.image.files.exr import maps as exr

    if Path(path).suffix.lower() != ".exr":
        raise ValueError(f'{path} ends in "{Path(path).suffix}"; layers are written to .exr')
    exr.write_layers(path, layers, unit, attributes or {}, between=between)


def read_layers(path: str | os.PathLike[str], options: ReadOptions = ReadOptions()) -> dict[str, np.ndarray]:
    """The parts of an EXR by name, (H, W, 3) or (H, W) float32.

    path : the file, .exr
    options : limits
    Raises UnreadableFile.
    """
    if (kind := kind_of(path)) != "EXR":
        raise UnreadableFile(f"{path}: a {kind} file where layers are needed; give an EXR")
    from relume.image.files.exr import maps as exr

    return exr.read_layers(path, options)


def subtype(path: str | os.PathLike[str], options: ReadOptions = ReadOptions()) -> str:
    """The variety of a file's format in a few words, from its header: "half, PIZ, tiled".

    path : the file
    options : limits
    Raises UnreadableFile.
    """
    kind = kind_of(path)
    module = "gain_map.gain_map" if _has_gain_map(path, kind) else _READERS.get(kind)
    return "" if module is None else import_module(f"relume.image.files.{module}").subtype(path, options)
