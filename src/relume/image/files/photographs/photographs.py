"""JPEG, PNG and TIFF photographs: pixels through OpenImageIO or our own, EXIF through Pillow, upright, three channels.

OpenImageIO decodes JPEG and TIFF, because Pillow rounds 16-bit colour to 8 bits without a word and takes any JPEG with
a hole in its data for whole. OpenImageIO returns the pixels of a damaged JPEG too, with a complaint: every complaint is
an error here, but for stray bytes among the headers, which lose no pixel. (A JPEG has no checksum: a few bytes altered
in the middle may still decode without one.) It does not turn pictures by their EXIF orientation; we do. The header is
judged by our own readers first, because a decoder allocates what a header claims.
"""

from __future__ import annotations

import io
import os
import re
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from relume.errors import FormatError, UnreadableFile, warn
from relume.image.bands import in_threads
from relume.image.files.atomic import replacing
from relume.image.files.gain_map.gain_map import has_any as has_any_gain_map
from relume.image.files.metadata import exif, exif_attributes, icc_profile
from relume.image.files.photographs import heif, pixmaps, png
from relume.image.files.photographs.form import Form
from relume.image.files.photographs.header import form_of
from relume.image.files.photographs.jpeg_coding import coding_of
from relume.image.files.photographs.jpeg_decoding import decoded
from relume.image.files.photographs.jpeg_segments import APP1, APP2, ICC, header_at, length_of, segment
from relume.image.files.photographs.salvage import PROFILE, embedded_profile, opened, salvaged
from relume.image.files.read_options import ReadOptions
from relume.image.files.signatures import kind_of, one_line
from relume.image.files.tiff.layout import EXTRA, ZIP, upright
from relume.image.files.tiff.writing import picture_tags
from relume.image.files.tiff.writing import write_tiff as write_folders
from relume.image.photograph import Photograph

if TYPE_CHECKING:
    import OpenImageIO as oiio

# OpenImageIO and Pillow are loaded where they are used: whoever writes a photograph needs neither.

# Only before markers that come ahead of the pixels: APP, COM, DQT, DRI, SOF. Elsewhere such bytes are lost pixels.
_HARMLESS = re.compile(r"extraneous bytes before marker 0x(e[0-9a-f]|fe|db|dd|c[012])")
_STRIP = 2**18  # bytes before compression
_LEVEL = 6  # of libdeflate
_RGB, _UNDEFINED = 2, 7  # TIFF 6.0: photometric interpretation, section 6; a type, section 2
_MOST_EXIF = 65533  # bytes behind the length of a JPEG's segment
_PIECE = 65533 - 14  # bytes of a numbered piece of a profile (ICC.1:2022, B.4)
_MOST_PROFILE = 255 * _PIECE
_LONG_TEXT = 1024  # letters; five of these fit


def read(path: str | os.PathLike[str], options: ReadOptions = ReadOptions()) -> Photograph:
    """The photograph in a JPEG, PNG, TIFF, HEIF, BMP or PPM, with exposure, settings, camera, focal length of its EXIF.

    Grey becomes three equal channels. Where alpha is 0 the picture is `outside`. Of a file with a gain map it is the
    base picture; of a TIFF the first page, of a HEIF the main picture. Its profile is the embedded one, else that of
    the colour space that its EXIF names. Warns of other pages, where alpha is dropped that was neither 0 nor opaque,
    where a profile is not understood (it is kept), and where a PNG says that its values are encoded otherwise. With
    `options.salvage` the rows that a file lacks are 0 and `outside`. Raises UnreadableFile for damaged files, those
    beyond the limits of `options`, and camera raw.
    """
    kind = kind_of(path)
    if kind == "HEIF":
        picture = heif.opened(path, options)
        stored, profile = heif.decoded(path, picture)
        # libheif has turned the pixels already.
        tags = {**exif.tags_in(path, picture.exif), exif.ORIENTATION: 1}
        return _photograph(path, stored, profile, tags, gain_map=picture.gain_map)
    form = form_of(path, kind, options)
    if kind in ("BMP", "PNM"):
        return _photograph(path, pixmaps.decoded(path, kind), None, {}, gain_map=False)
    if kind == "PNG":
        png.warn_of_other_encoding(path, png.header(path))
    if form.pages > 1:
        warn(f"{path}: only the first of its {form.pages} pages is read")
    gain_map = kind == "JPEG" and has_any_gain_map(path)
    found = salvaged(path, kind, form, options) if options.salvage else None
    if found is None:
        stored, profile = _decoded(path, kind, form, options)
        photograph = _photograph(path, stored, profile, exif.tags(path, kind), gain_map=gain_map)
        return replace(photograph, jpeg=coding_of(path)) if kind == "JPEG" else photograph
    missing = found.height - len(found.pixels)
    warn(f"{path}: ends early; {missing} of {found.height} rows are missing", missing / found.height)
    return _photograph(path, found.pixels, found.profile, exif.tags(path, kind), missing, gain_map=gain_map)


def _photograph(
    path: str | os.PathLike[str],
    stored: np.ndarray,
    profile: bytes | None,
    tags: dict[int, object],
    missing: int | None = None,
    *,
    gain_map: bool,
) -> Photograph:
    """The photograph of stored pixels (H, W, 1 to 4), a profile and tags.

    missing : rows that a salvaged file lacks at its end; None for a whole one
    """
    outside = _transparent(path, stored[..., -1]) if stored.shape[2] in (2, 4) else None
    pixels = stored[..., :3] if stored.shape[2] >= 3 else np.repeat(stored[..., :1], 3, axis=2)
    if missing is not None:
        # What is missing is 0 and outside.
        outside = np.zeros(pixels.shape[:2], bool) if outside is None else outside
        outside = np.pad(outside, ((0, missing), (0, 0)), constant_values=True)
        pixels = np.pad(pixels, ((0, missing), (0, 0), (0, 0)))
    if profile is not None:
        _warn_of_profile(path, profile)
    elif exif.is_adobe_rgb(tags):
        profile = icc_profile.adobe_rgb()
    height, width = pixels.shape[:2]
    orientation = exif.orientation_of(tags)
    uncropped = exif.uncropped_of(tags, width, height)
    return Photograph(
        pixels=upright(pixels, orientation),
        name=str(path),
        exposure=exif.exposure_of(tags),
        camera=exif.camera_of(tags),
        focal_length=exif.focal_length_of(tags, width, height),
        outside=None if outside is None else upright(outside, orientation),
        settings=exif.settings_of(tags),
        profile=profile if profile is not None and _is_of_rgb(profile) else None,
        uncropped=uncropped if uncropped is None or orientation < 5 else (uncropped[1], uncropped[0]),
        gain_map=gain_map,
    )


def read_png(path: str | os.PathLike[str]) -> np.ndarray:
    """The values of a PNG as stored, (H, W, 1 to 4) uint8 or uint16, alpha included; raises UnreadableFile."""
    form_of(path, "PNG", ReadOptions())  # checks the header before anything it claims is allocated
    return png.decoded(path, png.chunks(path))


def subtype(path: str | os.PathLike[str], options: ReadOptions = ReadOptions()) -> str:
    """What kind of JPEG, PNG, TIFF or HEIF a file is, from its header alone: "8 bits, YCbCr 4:2:0"."""
    return form_of(path, kind_of(path), options).text


def write_jpeg(path: str | os.PathLike[str], photograph: Photograph) -> None:
    """Write a JPEG of quality 95 with full colour resolution, EXIF and profile; raises ValueError for 16-bit pixels.

    Warns of pixels that are `outside`, which a JPEG cannot mark, and of texts that are too long for its EXIF.
    """
    import imagecodecs

    if photograph.pixels.dtype != np.uint8:
        raise ValueError(f"pixels are {photograph.pixels.dtype}; a JPEG holds uint8: write .png")
    if max(photograph.size) > 65500:
        raise ValueError(f"the photograph is {photograph.size} pixels; a JPEG's side is at most 65500: write .png")
    block, lost = _within_segment(photograph)
    profile = _profile_to_write(path, photograph)
    if profile is not None and len(profile) > _MOST_PROFILE:
        lost.append(f"its profile of {len(profile)} bytes")
        profile = None
    encoded = memoryview(imagecodecs.jpeg8_encode(photograph.pixels, level=95, subsampling="444"))
    pieces = [] if profile is None else [profile[at : at + _PIECE] for at in range(0, len(profile), _PIECE)]
    own = [segment(APP1, block)] if block else []
    own += [segment(APP2, ICC + bytes((at, len(pieces))) + piece) for at, piece in enumerate(pieces, 1)]
    # JFIF's segment is the first, and says how the colours are stored.
    first = 4 + int.from_bytes(encoded[4:6])
    with replacing(path) as temporary, open(temporary, "wb") as file:
        for part in (encoded[:first], *own, encoded[first:]):
            file.write(part)
    if photograph.outside is not None and (count := int(np.count_nonzero(photograph.outside))):
        lost.append(f"which {count} of its pixels are outside the picture")
    if lost:
        warn(f"{path}: does not keep {'; '.join(lost)}; .png keeps everything")


def write_png(path: str | os.PathLike[str], photograph: Photograph) -> None:
    """Write a PNG of 8 or 16 bits with EXIF and profile, and an alpha channel where some of it is `outside`."""
    profile = _profile_to_write(path, photograph)
    block = exif_attributes.encoded(photograph)
    encoded = png.encode(_with_alpha(photograph), block, profile, drawing=False)
    with replacing(path) as temporary:
        temporary.write_bytes(encoded)


def write_tiff(path: str | os.PathLike[str], photograph: Photograph) -> None:
    """Write a TIFF of 8 or 16 bits with EXIF and profile, and an alpha channel where some of it is `outside`.

    Packed by ZIP with the horizontal predictor, which lose nothing.
    """
    import imagecodecs

    pixels = _with_alpha(photograph)
    pixels = pixels.astype(pixels.dtype.newbyteorder("<"), copy=False)
    height, width, channels = pixels.shape
    rows = max(1, _STRIP // (channels * width * pixels.itemsize))
    main, folder = exif_attributes.folders(photograph)
    profile = _profile_to_write(path, photograph)

    def strip(begin: int, end: int) -> bytes:
        differences = pixels[begin:end].copy()
        differences[:, 1:] -= pixels[begin:end, :-1]
        return bytes(imagecodecs.deflate_encode(differences.tobytes(), level=_LEVEL))

    bits = 8 * pixels.itemsize
    tags = {
        **picture_tags(photograph.size, channels, bits, rows=rows, compression=ZIP, photometric=_RGB, predictor=2),
        **({EXTRA: (3, [2])} if channels == 4 else {}),  # alpha that colours are not multiplied by
        **({PROFILE: (_UNDEFINED, profile)} if profile else {}),
        **main,
    }
    write_folders(path, tags, in_threads(strip, height, chunk=rows), folder)


def _within_segment(photograph: Photograph) -> tuple[bytes, list[str]]:
    """The EXIF of a JPEG, without the texts for which its one segment has no room, and those."""
    lost: list[str] = []
    block = exif_attributes.encoded(photograph)
    for name in ("comments", "copyright", "owner", "lens", "serial"):
        if len(block) + len(exif_attributes.HEAD) <= _MOST_EXIF:
            break
        text = getattr(photograph.settings, name) or ""
        if len(text) > _LONG_TEXT:
            lost.append(f"its {name} of {len(text)} letters")
            photograph = replace(photograph, settings=replace(photograph.settings, **{name: None}))
            block = exif_attributes.encoded(photograph)
    return exif_attributes.HEAD + block if block else b"", lost


def _with_alpha(photograph: Photograph) -> np.ndarray:
    """(H, W, 3) pixels as they are; (H, W, 4), alpha the last, where some are outside."""
    pixels, outside = photograph.pixels, photograph.outside
    if outside is None or not outside.any():
        return pixels
    alpha = np.where(outside, 0, np.iinfo(pixels.dtype).max).astype(pixels.dtype)
    return np.concatenate([pixels, alpha[..., None]], axis=2)


def _profile_to_write(path: str | os.PathLike[str], photograph: Photograph) -> bytes | None:
    if photograph.profile is None or _is_of_rgb(photograph.profile):
        return photograph.profile
    warn(f"{path}: does not keep its profile, which is not an ICC profile of RGB")
    return None


def _is_of_rgb(profile: bytes) -> bool:
    """Whether a profile is of three channels, as all pixels here are, from its header (ICC.1:2022, 7.2)."""
    return profile[16:20] == b"RGB " and profile[36:40] == b"acsp"


def _decoded(
    path: str | os.PathLike[str], kind: str, form: Form, options: ReadOptions
) -> tuple[np.ndarray, bytes | None]:
    """(H, W, 1 to 4) uint8 or uint16 as stored, and the profile."""
    if kind == "PNG":
        return _of_png(path, options)
    if form.gain_map:
        return _base_of_gain_map(path, options)
    import OpenImageIO as oiio

    source = opened(path, kind)
    try:
        spec = source.spec()
        if kind == "JPEG" and spec.format == oiio.HALF:  # its library found a gain map where we saw none
            source.close()
            return _base_of_gain_map(path, options)
        _refuse_unusable(path, kind, spec)
        if (spec.width, spec.height) != (form.width, form.height):
            expected = f"{form.width} x {form.height} pixels"
            raise FormatError(path, kind, "its header", expected, f"{spec.width} x {spec.height}")
        pixels = source.read_image(0, 0, 0, spec.nchannels, spec.format)
        complaint = one_line(source.geterror())
    finally:
        source.close()
    if pixels is None or (complaint and not _HARMLESS.search(complaint)):
        reason = complaint.replace(f' ("{path}")', "") or "none"
        raise FormatError(path, kind, "its pixels", "whole data", reason)
    if complaint:
        _refuse_truncated(path, kind)
        _warn_of_stray_bytes(path)
    return pixels.reshape(spec.height, spec.width, spec.nchannels), embedded_profile(spec)


def _of_png(path: str | os.PathLike[str], options: ReadOptions) -> tuple[np.ndarray, bytes | None]:
    chunks = png.chunks(path)
    return png.decoded(path, chunks), png.profile(chunks, options)


def _base_of_gain_map(path: str | os.PathLike[str], options: ReadOptions) -> tuple[np.ndarray, bytes | None]:
    """As `_decoded`, of the picture that every program shows; a library that knows gain maps decodes to light."""
    data = Path(path).read_bytes()
    header = header_at(path, io.BytesIO(data), 0, options)
    end = length_of(data, header.scan) or len(data)
    pixels = decoded(path, data[:end], header, "base picture")
    if header.stray:
        _warn_of_stray_bytes(path)
    return pixels, header.profile


def _warn_of_stray_bytes(path: str | os.PathLike[str]) -> None:
    warn(f"{path}: has stray bytes among its headers; look whether the picture is whole")


def _refuse_unusable(path: str | os.PathLike[str], kind: str, spec: oiio.ImageSpec) -> None:
    import OpenImageIO as oiio

    if int(spec.getattribute("tiff:subfiletype") or 0) & 1:
        raise UnreadableFile(f"{path}: a camera raw file (it begins with a preview); develop it to a 16-bit TIFF first")
    if spec.format not in (oiio.UINT8, oiio.UINT16):
        what = f"a {kind} of {spec.format} pixels"
        raise UnreadableFile(f"{path}: {what}, not 8 or 16 bits; convert it to EXR, or to a plain {kind}")
    if tuple(spec.channelnames[: spec.nchannels]) not in (("R", "G", "B"), ("R", "G", "B", "A"), ("Y",), ("Y", "A")):
        raise UnreadableFile(f"{path}: its channels are {', '.join(spec.channelnames)}; save it as RGB or grey")


def _warn_of_profile(path: str | os.PathLike[str], profile: bytes) -> None:
    """Say that a profile is not understood, unless it is sRGB by another way of writing: by tables."""
    if icc_profile.parsed(profile) is None and "srgb" not in (name := icc_profile.description(profile)).lower():
        warn(
            f'{path}: its colour profile is "{name}", not one of primaries and curves; it is taken for sRGB: save it '
            "in sRGB or Display P3 first"
        )


def _refuse_truncated(path: str | os.PathLike[str], kind: str) -> None:
    """Ask another decoder whether the data ends early: the first one reports only the first of its troubles."""
    from PIL import Image

    try:
        with exif.heard([]), open(path, "rb") as file, Image.open(file, formats=[kind]) as image:
            image.load()
    except (OSError, SyntaxError, Image.DecompressionBombError) as error:
        raise FormatError(path, kind, "its pixels", "whole data", one_line(error)) from error


def _transparent(path: str | os.PathLike[str], alpha: np.ndarray) -> np.ndarray | None:
    transparent = alpha == 0
    if transparent.all():
        raise UnreadableFile(f"{path}: alpha is 0 everywhere, so there is nothing to see; save it without alpha")
    seen_through = np.count_nonzero(~transparent & (alpha != np.iinfo(alpha.dtype).max))
    if seen_through:
        warn(f"{path}: alpha is left out, though {seen_through} pixels are not opaque")
    return transparent if transparent.any() else None
