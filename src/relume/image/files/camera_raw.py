"""Camera raw files: the sensor's values through LibRaw (rawpy), exposure and settings from their own EXIF.

LibRaw unpacks and nothing else: black is not subtracted, nothing is scaled, balanced or interpolated. Where the file is
a TIFF inside, as most are, EXIF is read by Pillow, because LibRaw hands an exposure time of 0 over as one second and
keeps 32 bits of a rational; it is asked for the other kinds only. Orientation follows LibRaw's bits: 4 exchanges rows
and columns, 2 turns rows over, 1 turns columns over.
"""

from __future__ import annotations

import os

import numpy as np
import rawpy

from relume.errors import FormatError, UnreadableFile
from relume.image.files.exr.parts import gathered_messages
from relume.image.files.metadata import exif
from relume.image.files.read_options import ReadOptions, refuse_absurd_amount, refuse_absurd_size
from relume.image.files.signatures import one_line
from relume.image.photograph import Exposure, RawPhotograph, Settings, is_bayer
from relume.image.primaries import REC709


def read(path: str | os.PathLike[str], options: ReadOptions = ReadOptions()) -> RawPhotograph:
    """The sensor's values in a camera raw file with a Bayer pattern; raises UnreadableFile for any other."""
    tags = tags_of(path)
    try:
        with gathered_messages() as messages, rawpy.imread(os.fspath(path)) as raw:
            photograph = _photograph(path, raw, tags, options)
    # Where damage is only met on the way, LibRaw's errors are followed by AttributeError and ValueError of the wrapper.
    except (rawpy.LibRawError, OSError, ValueError, AttributeError, TypeError) as error:
        raise refusal(path, error) from error
    if messages:  # of damage that LibRaw only prints
        raise refusal(path, messages[0])
    return photograph


def _photograph(
    path: str | os.PathLike[str], raw: rawpy.RawPy, tags: dict[int, object] | None, options: ReadOptions
) -> RawPhotograph:
    sizes = raw.sizes
    refuse_absurd_size(path, sizes.raw_width, sizes.raw_height, options)
    refuse_absurd_amount(path, 2 * sizes.raw_width * sizes.raw_height, os.path.getsize(path), options)
    if raw.raw_type != rawpy.RawType.Flat or raw.num_colors != 3:
        raise UnreadableFile(
            f"{path}: three values a pixel, no sensor's mosaic (linear raw); develop it to 16-bit TIFF"
        )
    stored = raw.raw_image_visible
    # LibRaw's colour of each photosite from the corner of the lit part: in eight rows X-Trans differs from Bayer.
    index = np.array([[raw.raw_color(sizes.top_margin + y, sizes.left_margin + x) for x in range(8)] for y in range(8)])
    names = raw.color_desc.decode("ascii")
    pattern = np.array([["RGB".find(names[i]) for i in row] for row in index])
    if not np.array_equal(index, np.tile(index[:2, :2], (4, 4))) or not is_bayer(pattern[:2, :2]):
        raise UnreadableFile(f"{path}: its colour filters are no Bayer pattern (X-Trans?); develop it to a 16-bit TIFF")
    black = np.asarray(raw.black_level_per_channel, np.float64)[index]
    white = float(min([raw.white_level, *(w for w in raw.camera_white_level_per_channel or () if w > 0)]))
    if not black[:2, :2].max() < white:
        raise FormatError(path, "camera raw", "its black level", f"one below its white, {white:g}", f"{black.max():g}")
    if stored.size == 0 or not stored.any():
        what = f"a camera raw without pixels: all of its {sizes.width} x {sizes.height} values are 0"
        raise UnreadableFile(f"{path}: {what}; copy it again from where it came")
    matrix, daylight = _colour(path, raw, exif.camera_of(tags or {}))
    as_shot = np.asarray(raw.camera_whitebalance[:3], np.float64)
    mosaic = np.ascontiguousarray(_upright(stored, sizes.flip))
    if np.shares_memory(mosaic, stored):  # LibRaw's own memory, gone when the file is closed
        mosaic = mosaic.copy()
    height, width = mosaic.shape
    # The corner of the turned mosaic: a patch whose sides are as even or odd as the sensor's turns like it.
    corner = (slice(0, 2 + sizes.height % 2), slice(0, 2 + sizes.width % 2))
    exposure, settings = exposure_of(raw, tags)
    return RawPhotograph(
        mosaic,
        _upright(pattern[corner], sizes.flip)[:2, :2].copy(),
        _upright(black[corner], sizes.flip)[:2, :2].copy(),
        white,
        matrix,
        daylight,
        as_shot / as_shot.min() if np.all(as_shot > 0) else None,
        name=str(path),
        exposure=exposure,
        camera=exif.camera_of(tags or {}),
        focal_length=exif.focal_length_of(tags or {}, width, height),
        settings=settings,
    )


def _upright(stored: np.ndarray, flip: int) -> np.ndarray:
    turned = stored[::-1] if flip & 2 else stored
    turned = turned[:, ::-1] if flip & 1 else turned
    return turned.T if flip & 4 else turned


def _colour(path: str | os.PathLike[str], raw: rawpy.RawPy, camera_name: str) -> tuple[np.ndarray, np.ndarray]:
    """Balanced camera colours → Rec. 709, and the balance for daylight.

    Camera ← XYZ is known by LibRaw or written in a DNG. Its product with XYZ ← Rec. 709 is what the camera sees of
    white; divided by that, its inverse keeps white white.
    """
    camera_from_xyz = np.asarray(raw.rgb_xyz_matrix, np.float64)[:3]
    if camera_from_xyz.any():
        camera = camera_from_xyz @ REC709.to_xyz()
        seen = camera.sum(1)
        if np.all(seen > 0) and np.linalg.cond(camera) < 1e4:
            daylight = 1 / seen
            return np.linalg.inv(camera / seen[:, None]), daylight / daylight.min()
    matrix = np.asarray(raw.color_matrix, np.float64)[:, :3]
    daylight = np.asarray(raw.daylight_whitebalance[:3], np.float64)
    if not (np.allclose(matrix.sum(1), 1, atol=1e-3) and np.all(daylight > 0)):
        named = repr(camera_name[:80]) if camera_name else "which its tags 271 and 272 do not name"
        raise UnreadableFile(f"{path}: no colour matrix is known for its camera, {named}; convert it to DNG")
    return matrix / matrix.sum(1, keepdims=True), daylight / daylight.min()


def tags_of(path: str | os.PathLike[str]) -> dict[int, object] | None:
    """EXIF of a file that is a TIFF inside, None of any other; warns where it is damaged."""
    with open(path, "rb") as file:
        is_tiff = file.read(4) in (b"II*\0", b"MM\0*")
    return exif.tags(path, "RAW") if is_tiff else None


def exposure_of(raw: rawpy.RawPy, tags: dict[int, object] | None) -> tuple[Exposure | None, Settings]:
    """The exposure and the settings: by the EXIF tags, else by what LibRaw reads of the file."""
    if tags is not None:
        return exif.exposure_of(tags), exif.settings_of(tags)
    other = raw.other
    if not (other.shutter_speed > 0 and other.iso_speed > 0):
        return None, Settings()
    taken = other.timestamp if other.timestamp.year > 1970 else None
    focal_length = other.focal_length if other.focal_length > 0 else None
    f_number = other.aperture if other.aperture > 0 else None
    exposure = Exposure(_rounded(other.shutter_speed), f_number and _rounded(f_number), other.iso_speed, "EXIF")
    return exposure, Settings(taken=taken, lens=raw.lens.model or None, focal_length=focal_length)


def _rounded(value: float) -> float:
    """The nearest number of seven digits to a 32-bit float: 5.6 of 5.599999904."""
    return float(f"{value:.7g}")


def refusal(path: str | os.PathLike[str], error: object) -> FormatError:
    """That LibRaw cannot read a file: what is wrong; it never says where."""
    detail = error.args[0] if isinstance(error, Exception) and error.args else error
    found = one_line(detail.decode("utf-8", "replace") if isinstance(detail, bytes) else detail)
    where = f"LibRaw's reading of its {os.path.getsize(path)} bytes"
    remedy = "copy it again from where it came, or convert it to DNG"
    return FormatError(path, "camera raw", where, "a sound file of a camera that it knows", found, remedy)
