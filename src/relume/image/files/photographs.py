"""JPEG, PNG and TIFF photographs: pixels through OpenImageIO, EXIF through Pillow, upright, three channels.

OpenImageIO decodes, because Pillow rounds 16-bit colour to 8 bits without a word and takes any JPEG with a hole in its
data for whole. OpenImageIO returns the pixels of a damaged JPEG too, with a complaint: every complaint is an error
here, but for stray bytes among the headers, which lose no pixel. (A JPEG has no checksum: a few bytes altered in the
middle may still decode without one.) It does not turn pictures by their EXIF orientation; we do.
"""

from __future__ import annotations

import io
import os
import re
import warnings

import numpy as np
import OpenImageIO as oiio
from PIL import Image

from relume.errors import UnreadableFile
from relume.image.files import exif, png
from relume.image.files.atomic import replacing
from relume.image.files.reading import refuse_absurd_size
from relume.image.files.signatures import kind_of, one_line
from relume.image.photograph import Photograph

# Only before markers that come ahead of the pixels: APP, COM, DQT, DRI, SOF. Elsewhere such bytes are lost pixels.
_HARMLESS = re.compile(r"extraneous bytes before marker 0x(e[0-9a-f]|fe|db|dd|c[012])")
_LOGLUV = (32844, 32845)
# Rows, columns and axes as stored → as seen, EXIF 2.32, tag 0x0112.
_UPRIGHT = {
    1: lambda p: p,
    2: lambda p: p[:, ::-1],
    3: lambda p: p[::-1, ::-1],
    4: lambda p: p[::-1],
    5: lambda p: p.swapaxes(0, 1),
    6: lambda p: p.swapaxes(0, 1)[:, ::-1],
    7: lambda p: p[::-1, ::-1].swapaxes(0, 1),
    8: lambda p: p.swapaxes(0, 1)[::-1],
}


def read(path: str | os.PathLike[str]) -> Photograph:
    """The photograph in a JPEG, PNG or TIFF, with the exposure, settings, camera and focal length its EXIF tells.

    Grey becomes three equal channels. Where alpha is 0 the picture is `outside`. Warns where alpha is dropped that was
    neither 0 nor opaque, and where an embedded profile is not sRGB. Raises UnreadableFile for damaged files,
    floating-point or LogLuv TIFF, and camera raw.
    """
    kind = kind_of(path)
    if kind == "PNG":
        png.refuse_damaged(path)
    pixels, outside = _decoded(path, kind)
    tags = exif.tags(path, kind)
    height, width = pixels.shape[:2]
    upright = _UPRIGHT[exif.orientation_of(tags)]
    return Photograph(
        pixels=np.ascontiguousarray(upright(pixels)),
        name=str(path),
        exposure=exif.exposure_of(tags),
        camera=exif.camera_of(tags),
        focal_length=exif.focal_length_of(tags, width, height),
        outside=None if outside is None else np.ascontiguousarray(upright(outside)),
        settings=exif.settings_of(tags),
    )


def write_jpeg(path: str | os.PathLike[str], photograph: Photograph) -> None:
    """Write a JPEG of quality 95 with full colour resolution and EXIF; raises ValueError for 16-bit pixels."""
    if photograph.pixels.dtype != np.uint8:
        raise ValueError(f"pixels are {photograph.pixels.dtype}; a JPEG holds uint8: write .png")
    if max(photograph.size) > 65500:
        raise ValueError(f"the photograph is {photograph.size} pixels; a JPEG's side is at most 65500: write .png")
    # Not straight into the file: on a full disk Pillow takes a short write for a whole one.
    encoded = io.BytesIO()
    picture = Image.fromarray(photograph.pixels)
    picture.save(encoded, "JPEG", quality=95, subsampling=0, exif=exif.encoded(photograph))
    with replacing(path) as temporary:
        temporary.write_bytes(encoded.getvalue())


def write_png(path: str | os.PathLike[str], photograph: Photograph) -> None:
    """Write a PNG of 8 or 16 bits with EXIF."""
    encoded = png.encode(photograph.pixels, exif.encoded(photograph))
    with replacing(path) as temporary:
        temporary.write_bytes(encoded)


def _decoded(path: str | os.PathLike[str], kind: str) -> tuple[np.ndarray, np.ndarray | None]:
    """(H, W, 3) uint8 or uint16 as stored, and (H, W) bool where alpha is 0; None where it is nowhere."""
    wanted = oiio.ImageSpec()
    wanted.attribute("oiio:UnassociatedAlpha", 1)  # else colours come multiplied by alpha
    source = oiio.ImageInput.open(str(path), wanted)
    if source is None:
        raise UnreadableFile(f"{path}: damaged {kind}: {one_line(oiio.geterror())}; copy it again from where it came")
    try:
        spec = source.spec()
        refuse_absurd_size(path, spec.width, spec.height)
        _refuse_unusable(path, kind, spec)
        pixels = source.read_image(0, 0, 0, spec.nchannels, spec.format)
        complaint = one_line(source.geterror())
    finally:
        source.close()
    if pixels is None or (complaint and not _HARMLESS.search(complaint)):
        reason = complaint.replace(f' ("{path}")', "") or "it holds no pixels"
        raise UnreadableFile(f"{path}: damaged {kind}: {reason}; copy it again from where it came")
    if complaint:
        _refuse_truncated(path, kind)
        warnings.warn(f"{path}: has stray bytes among its headers; look whether the picture is whole", stacklevel=4)
    pixels = pixels.reshape(spec.height, spec.width, spec.nchannels)
    three = pixels[..., :3] if spec.nchannels >= 3 else np.repeat(pixels[..., :1], 3, axis=2)
    return three, _transparent(path, pixels[..., -1]) if spec.nchannels in (2, 4) else None


def _refuse_unusable(path: str | os.PathLike[str], kind: str, spec: oiio.ImageSpec) -> None:
    if int(spec.getattribute("tiff:subfiletype") or 0) & 1:
        raise UnreadableFile(f"{path}: a camera raw file (it begins with a preview); develop it to a 16-bit TIFF first")
    if spec.getattribute("tiff:PhotometricInterpretation") in _LOGLUV:
        raise UnreadableFile(f"{path}: a LogLuv TIFF, whose range no photograph holds; convert it to EXR")
    if spec.format not in (oiio.UINT8, oiio.UINT16):
        what = "a JPEG with a gain map (Ultra HDR)" if kind == "JPEG" else f"a {kind} of {spec.format} pixels"
        raise UnreadableFile(f"{path}: {what}, not 8 or 16 bits; convert it to EXR, or to a plain {kind}")
    if tuple(spec.channelnames[: spec.nchannels]) not in (("R", "G", "B"), ("R", "G", "B", "A"), ("Y",), ("Y", "A")):
        raise UnreadableFile(f"{path}: its channels are {', '.join(spec.channelnames)}; save it as RGB or grey")
    profile = spec.getattribute("ICCProfile:profile_description")
    if profile and "srgb" not in str(profile).lower():
        warnings.warn(f'{path}: its colour profile is "{profile}", not sRGB; not converted', stacklevel=5)


def _refuse_truncated(path: str | os.PathLike[str], kind: str) -> None:
    """Ask another decoder whether the data ends early: the first one tells only the first of its troubles."""
    try:
        with open(path, "rb") as file, Image.open(file, formats=[kind]) as image:
            image.load()
    except (OSError, SyntaxError, Image.DecompressionBombError) as error:
        raise UnreadableFile(f"{path}: damaged {kind}: {one_line(error)}; copy it again from where it came") from error


def _transparent(path: str | os.PathLike[str], alpha: np.ndarray) -> np.ndarray | None:
    transparent = alpha == 0
    if transparent.all():
        raise UnreadableFile(f"{path}: alpha is 0 everywhere, so there is nothing to see; save it without alpha")
    seen_through = np.count_nonzero(~transparent & (alpha != np.iinfo(alpha.dtype).max))
    if seen_through:
        warnings.warn(f"{path}: alpha is left out, though {seen_through} pixels are not opaque", stacklevel=5)
    return transparent if transparent.any() else None
