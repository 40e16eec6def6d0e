"""HEIF photographs of telephones and cameras (.heic, .heif, .hif): pixels, profile and EXIF by libheif (pillow-heif).

libheif turns and mirrors the picture as the file asks, so its EXIF orientation is past: ISO 23008-12, 6.5.10. Samples
of 10 and 12 bits are stretched so that white is 65535. Colours are those of the ICC profile, else of the code points
beside the pixels (ITU-T H.273), of which a profile is made, so that what is read and written again keeps them.
"""

from __future__ import annotations

import os
from dataclasses import dataclass
from types import ModuleType
from typing import Any

import numpy as np

from relume.errors import FormatError, UnreadableFile, warn
from relume.image.files.metadata.icc_profile import screen_profile
from relume.image.files.photographs.form import Form
from relume.image.files.read_options import ReadOptions, refuse_absurd_amount, refuse_absurd_size
from relume.image.files.signatures import one_line
from relume.image.primaries import BT2020, P3

_APPLE_GAIN_MAP = "hdrgainmap"
_TONE_MAPPED = b"tmap"  # the item that ISO 21496-1's gain maps are found by (ISO 23008-12, amendment 1)
_ITEMS = 2**16  # bytes at the beginning in which items are named
_PRIMARIES = {
    9: (BT2020, "BT.2020"),
    11: (P3, "Display P3"),
    12: (P3, "Display P3"),
}  # H.273, table 2; 11 has DCI's white
_VIDEO = (1, 6, 14, 15)  # H.273, table 3: the curve of BT.709, BT.601 and BT.2020, which pictures rarely mean
_UNPLAIN = {8: "linear", 16: "PQ", 18: "HLG"}  # H.273, table 3: curves far from sRGB's


@dataclass(frozen=True, eq=False)
class HeifPicture:
    """What stands in a file beside its pixels.

    form : width, height and bits of the picture as it is shown
    exif : the block of tags, b"" where there is none
    gain_map : whether there is one
    premultiplied : whether its colours are those times alpha, as over black
    source : libheif's picture
    """

    form: Form
    exif: bytes
    gain_map: bool
    premultiplied: bool
    source: Any


def opened(path: str | os.PathLike[str], options: ReadOptions) -> HeifPicture:
    """The main picture of a file by its header, within the limits of `options`; raises UnreadableFile."""
    library = _library(path)
    try:
        source = library.open_heif(os.fspath(path), convert_hdr_to_8bit=False, hdr_to_16bit=False)
        picture = source[source.primary_index]
        (width, height), mode, info = picture.size, str(picture.mode), dict(picture.info)
    except MemoryError:
        raise
    except Exception as error:  # ValueError, OSError, RuntimeError, EOFError: whatever libheif finds
        raise FormatError(path, "HEIF", "its boxes", "a main picture that can be decoded", one_line(error)) from None
    bits = int(info.get("bit_depth") or 8)
    plain = mode.partition(";")[0]
    letters = plain.replace("a", "A")
    refuse_absurd_size(path, width, height, options)
    size = os.path.getsize(path)
    refuse_absurd_amount(path, width * height * len(letters) * (1 if bits <= 8 else 2), size, options)
    with open(path, "rb") as file:
        items = file.read(_ITEMS)
    auxiliary = any(_APPLE_GAIN_MAP in str(kind).lower() for kind in info.get("aux") or ())
    gain_map = auxiliary or _TONE_MAPPED in items
    form = Form(width, height, len(letters), bits, letters, "HEIF")
    return HeifPicture(form, bytes(info.get("exif") or b""), gain_map, plain.endswith("a"), picture)


def decoded(path: str | os.PathLike[str], picture: HeifPicture) -> tuple[np.ndarray, bytes | None]:
    """(H, W, 1 to 4) uint8 or uint16, and the profile; raises FormatError where the pixels are damaged.

    Colours that were multiplied by alpha are divided by it again.
    """
    form = picture.form
    try:
        stored = np.asarray(picture.source)
    except MemoryError:
        raise
    except Exception as error:  # as in `opened`
        raise FormatError(path, "HEIF", "its pixels", "whole data", one_line(error)) from None
    stored = (stored[..., None] if stored.ndim == 2 else stored)[:, : form.width]
    if stored.shape != (form.height, form.width, form.channels) or stored.dtype not in (np.uint8, np.uint16):
        expected = f"{form.width} x {form.height} pixels of {form.channels} channels"
        raise FormatError(path, "HEIF", "its pixels", expected, f"{stored.shape} {stored.dtype}")
    if form.bits > 8:
        most = 2**form.bits - 1
        wide = np.minimum(stored.astype(np.uint32), most)
        stored = ((wide * 65535 + most // 2) // most).astype(np.uint16)
    return _straight(stored) if picture.premultiplied else stored, _profile(path, picture.source.info)


def _straight(stored: np.ndarray) -> np.ndarray:
    """Codes (H, W, C) whose last channel is alpha, the others no longer times it; black where nothing is."""
    white, alpha = np.iinfo(stored.dtype).max, stored[..., -1:].astype(np.uint32)
    colours = (stored[..., :-1].astype(np.uint32) * white + alpha // 2) // np.maximum(alpha, 1)
    return np.concatenate([np.minimum(colours, white).astype(stored.dtype) * (alpha > 0), stored[..., -1:]], axis=-1)


def _profile(path: str | os.PathLike[str], info: dict[str, Any]) -> bytes | None:
    """The ICC profile, or one of the primaries that the code points name; None for sRGB's and unknown ones."""
    if profile := info.get("icc_profile"):
        return bytes(profile)
    points = info.get("nclx_profile") or {}
    if curve := _UNPLAIN.get(int(points.get("transfer_characteristics", 2))):
        warn(
            f"{path}: its values are {curve}, not sRGB; not converted: export it for ordinary screens, or merge a "
            "bracket of such, whose curve is then found"
        )
    elif int(points.get("transfer_characteristics", 2)) in _VIDEO:
        warn(
            f"{path}: its code points name the curve of video (BT.709); it is read as sRGB's, as most programs do, and "
            "where video's was meant middle tones come out a fifth too dark: merge a bracket of such, whose curve is "
            "then found"
        )
    primaries = _PRIMARIES.get(int(points.get("color_primaries", 2)))
    return None if primaries is None else screen_profile(*primaries)


def _library(path: str | os.PathLike[str]) -> ModuleType:
    try:
        import pillow_heif
    except ImportError:
        raise UnreadableFile(
            f"{path}: an HEIF photograph, and no library here reads it; pip install 'relume[heif]', or save it as JPEG"
        ) from None
    return pillow_heif
