"""What the header of a photograph says without its pixels: their form, and what sorts a folder into brackets."""

from __future__ import annotations

import os
import struct
from dataclasses import dataclass
from typing import BinaryIO

from relume.errors import FormatError, UnreadableFile
from relume.image.files.photographs import pixmaps, png
from relume.image.files.photographs.form import Form
from relume.image.files.photographs.jpeg_segments import APP1, APP2, ISO_GAIN_MAP
from relume.image.files.read_options import ReadOptions, refuse_absurd_amount, refuse_absurd_size
from relume.image.files.signatures import MAPS, PHOTOGRAPHS, kind_of
from relume.image.files.tiff.directories import read_folders
from relume.image.files.tiff.layout import layout_of, pages_of
from relume.image.photograph import Exposure, Settings

_FRAMES = frozenset(range(0xC0, 0xD0)) - {0xC4, 0xC8, 0xCC}  # ITU-T T.81, table B.1
_PROGRESSIVE = (0xC2, 0xC6, 0xCA, 0xCE)
_ALONE = (0x01, *range(0xD0, 0xD9))  # markers without a length
_MOST_STEPS = 2**13  # segments, and stray bytes between them; 16 MiB of metadata make 256 full segments
_SUBSAMPLED = {(1, 1): "4:4:4", (2, 1): "4:2:2", (2, 2): "4:2:0", (4, 1): "4:1:1", (1, 2): "4:4:0", (4, 2): "4:1:0"}
_PHOTOMETRICS = {0: "grey, black and white exchanged", 1: "grey", 2: "RGB", 3: "palette", 5: "CMYK", 6: "YCbCr"}
_UNREAD = (6, 34712, 34887, 34925, 50000, 50001)  # old JPEG, JPEG 2000, LERC, LZMA, ZSTD, WebP


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


def form_of(path: str | os.PathLike[str], kind: str, options: ReadOptions) -> Form:
    """The form of one of `PHOTOGRAPHS`; raises UnreadableFile where damaged, or beyond `options`."""
    size = os.path.getsize(path)
    if kind == "HEIF":
        from relume.image.files.photographs import heif

        return heif.opened(path, options).form
    if kind in ("BMP", "PNM"):
        form = pixmaps.form_of(path, kind)
        refuse_absurd_size(path, form.width, form.height, options)
        refuse_absurd_amount(path, form.width * form.height * 3 * -(-form.bits // 8), size, options)
        return form
    if kind == "TIFF":
        return _tiff(path, size, options)
    if kind == "PNG":
        found = png.header(path)
        packing = "interlaced" if found.interlaced else ""
        form = Form(found.width, found.height, found.channels, found.bits, found.colour, packing)
    else:
        with open(path, "rb") as file:
            form = _jpeg(path, file, size, options)
    refuse_absurd_size(path, form.width, form.height, options)
    if form.channels > options.channels:
        raise UnreadableFile(f"{path}: its header claims {form.channels} channels; relume reads {options.channels}")
    refuse_absurd_amount(path, form.width * form.height * max(form.channels, 3) * -(-form.bits // 8), size, options)
    return form


def read_facts(path: str | os.PathLike[str], options: ReadOptions = ReadOptions()) -> Facts:
    """The facts of a JPEG, PNG, TIFF, HEIF or camera raw, from its header alone.

    path : the file
    options : limits

    The size of a camera raw is that of its sensor's lit part, as it lies in the camera. Raises UnreadableFile for
    anything else.
    """
    # Pillow and LibRaw are loaded here and not above: most who import this module's parent read no photograph.
    from relume.image.files.metadata import exif

    kind = kind_of(path)
    if kind in MAPS:
        raise UnreadableFile(f"{path}: a radiance map where a photograph is needed; give a JPEG, PNG or TIFF")
    if kind == "RAW":
        return _of_raw(path)
    if kind not in PHOTOGRAPHS:
        raise UnreadableFile(f"{path}: a {kind} file where a photograph is needed; give a JPEG, PNG or TIFF")
    if kind == "HEIF":
        from relume.image.files.photographs import heif

        picture = heif.opened(path, options)
        form, tags, lying = picture.form, exif.tags_in(path, picture.exif), False
    else:
        form = form_of(path, kind, options)
        tags = {} if kind in ("BMP", "PNM") else exif.tags(path, kind)
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


def _tiff(path: str | os.PathLike[str], size: int, options: ReadOptions) -> Form:
    folders = read_folders(path, options)
    layout = layout_of(path, folders[0], size, options)
    if layout.compression in _UNREAD:
        raise UnreadableFile(f"{path}: packed by {layout.packing}, which relume does not read; save it with ZIP or LZW")
    kind = _PHOTOMETRICS.get(layout.photometric, f"photometric {layout.photometric}")
    packing = [layout.packing]
    if layout.tiled:
        packing.append(f"tiled {layout.block[0]} × {layout.block[1]}")
    pages = pages_of(folders)
    if pages > 1:
        packing.append(f"{pages} pages")
    alpha = " with alpha" if layout.extra else ""
    return Form(
        layout.width,
        layout.height,
        layout.samples,
        layout.bits,
        kind + alpha,
        ", ".join(packing),
        layout=layout,
        pages=pages,
    )


def _jpeg(path: str | os.PathLike[str], file: BinaryIO, size: int, options: ReadOptions) -> Form:
    """From the first frame; bytes between the segments are passed over, as decoders do."""
    place, gain_map = 2, False
    for _ in range(_MOST_STEPS):
        file.seek(place)
        head = file.read(4)
        if len(head) < 4 or place > options.metadata:
            break
        if head[0] != 0xFF or head[1] in (0x00, 0xFF):
            place += 1
            continue
        marker = head[1]
        if marker in _ALONE:
            place += 2
            continue
        if marker in _FRAMES:
            return _frame(path, place, marker, file.read(64), gain_map)
        if marker in (0xD9, 0xDA):
            raise FormatError(path, "JPEG", f"byte {place}", "a frame", f"the marker {marker:02x}")
        length = int.from_bytes(head[2:])
        if marker in (APP1, APP2) and not gain_map:
            payload = file.read(max(length - 2, 0))
            gain_map = b"hdrgm:Version" in payload if marker == APP1 else payload.startswith(ISO_GAIN_MAP)
        place += 2 + max(length, 2)
    raise FormatError(path, "JPEG", f"byte {min(place, size)}", "a frame", "none ahead of the pixels")


def _frame(path: str | os.PathLike[str], place: int, marker: int, payload: bytes, gain_map: bool) -> Form:
    if len(payload) < 6 or len(payload) < 6 + 3 * payload[5] or not payload[5]:
        raise FormatError(path, "JPEG", f"byte {place}", "a frame with its components", payload[:6].hex(" "))
    bits, height, width, channels = struct.unpack_from(">BHHB", payload)
    factors = [(byte >> 4, byte & 15) for byte in payload[7 : 6 + 3 * channels : 3]]
    across, down = (max(factor[axis] for factor in factors) for axis in (0, 1))
    names = {1: "grey", 3: "YCbCr", 4: "CMYK"}
    kind = names.get(channels, f"{channels} channels")
    if channels == 3:
        chroma = factors[1]
        if factors[1] == factors[2] and min(chroma) > 0:
            kind += " " + _SUBSAMPLED.get((across // chroma[0], down // chroma[1]), "")
    packing = "progressive" if marker in _PROGRESSIVE else ""
    return Form(width, height, channels, bits, kind.strip(), packing, gain_map)
