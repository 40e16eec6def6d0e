"""Radiance pictures (.hdr, .pic): shared-exponent RGBE, read and written without a library.

A pixel is three mantissas m and one exponent e; its value is m·2^(e−136), 0 where e = 0 (Ward, "Real Pixels", Graphics
Gems II, 1991). No ½ is added to the mantissas on reading, because writing rounds to nearest, so that a file read and
written again keeps its bytes. EXPOSURE and COLORCORR lines tell what the pixels were multiplied by; all of them are
divided out. Written files are flat (not run-length coded), which every reader knows: use EXR where size matters.
"""

from __future__ import annotations

import os
import re
import warnings
from pathlib import Path

import numpy as np

from relume.errors import UnreadableFile
from relume.image.files.atomic import replacing
from relume.image.files.radiance_scanlines import scanlines
from relume.image.files.reading import refuse_absurd_size
from relume.image.radiance import RadianceMap

_RESOLUTION = re.compile(rb"([-+])([XY]) *(\d+) ([-+])([XY]) *(\d+)")
_VARIABLE = re.compile(r"([A-Za-z]\w*|relume:[^=]+)=(.*)")  # other lines are the commands that made the picture
_REC709 = (0.64, 0.33, 0.30, 0.60, 0.15, 0.06, 0.3127, 0.3290)  # x, y of red, green, blue and white
_PREFIX = "relume:"
_UNIT = "relume:unit"
_LARGEST = 255.5 * 2.0**119  # values from here on would round to a mantissa of 256 at the last exponent
_RATIO = 10_000  # a longer run of equal pixels than any photograph has, above 64 MiB


def read(path: str | os.PathLike[str]) -> RadianceMap:
    """The radiance map in a Radiance picture of any axis order; other header lines become its attributes.

    Warns when PRIMARIES are not Rec. 709; raises UnreadableFile for XYZE, damaged and truncated files.
    """
    data = Path(path).read_bytes()
    header, axes, (lines, length), start = _header(path, data)
    if lines * length * 4 > max(2**26, _RATIO * len(data)):
        raise UnreadableFile(f"{path}: {len(data)} bytes cannot hold its {lines * length} pixels; copy it again")
    rgbe = scanlines(path, data, start, lines, length)
    radiance = np.ldexp(rgbe[..., :3].astype(np.float32), rgbe[..., 3:].astype(np.int32) - 136)
    radiance[rgbe[..., 3] == 0] = 0
    attributes, scale = _understood(path, header)
    if np.any(scale != 1):
        radiance = (radiance / scale).astype(np.float32)
    unit = "cd/m²" if attributes.pop(_UNIT, "") == "cd/m2" else "relative"
    attributes = {key.removeprefix(_PREFIX): value for key, value in attributes.items()}
    return RadianceMap(np.ascontiguousarray(_upright(radiance, axes)), unit=unit, attributes=attributes)


def write(path: str | os.PathLike[str], image: RadianceMap) -> None:
    """Write a radiance map, each mantissa rounded to nearest: an error of at most 1/256 of the pixel's largest channel.

    Warns when the map has planes of variance or clipped pixels, which the format cannot hold. Raises ValueError for
    pixels that it cannot hold: negative, NaN, infinite or above 1.7e38; OutputNotWritten.
    """
    rgbe = encode(image.radiance)
    if image.variance is not None or image.clipped is not None:
        warnings.warn(f"{path}: a .hdr file keeps neither variance nor clipped pixels; write .exr", stacklevel=3)
    lines = [f"{_PREFIX}{key}={' '.join(value.split())}\n" for key, value in image.attributes.items()]
    lines += [f"{_UNIT}=cd/m2\n"] if image.unit == "cd/m²" else []
    width, height = image.size
    header = f"#?RADIANCE\n{''.join(lines)}FORMAT=32-bit_rle_rgbe\n\n-Y {height} +X {width}\n"
    with replacing(path) as temporary:
        temporary.write_bytes(header.encode("utf-8") + rgbe.tobytes())


def encode(radiance: np.ndarray) -> np.ndarray:
    """(..., 4) uint8 RGBE of (..., 3) float32, rounded to nearest; raises ValueError for pixels it cannot hold."""
    unfit = ~np.all((radiance >= 0) & (radiance < _LARGEST), axis=-1)
    if np.any(unfit):
        raise ValueError(
            f"{np.count_nonzero(unfit)} of {unfit.size} pixels are negative, NaN, infinite or above 1.7e38;"
            " a .hdr file holds none of these: write .exr"
        )
    largest = radiance.max(axis=-1).astype(np.float64)
    exponent = np.frexp(largest)[1]
    # A mantissa that rounds up to 256 belongs to the next exponent.
    exponent += np.rint(np.ldexp(largest, 8 - exponent)) == 256
    mantissa = np.rint(np.ldexp(radiance.astype(np.float64), 8 - exponent[..., None]))
    rgbe = np.concatenate([mantissa, exponent[..., None] + 128], axis=-1)
    rgbe[(exponent < -127) | (largest == 0)] = 0
    return rgbe.astype(np.uint8)


def _header(path: str | os.PathLike[str], data: bytes) -> tuple[list[str], list[tuple[str, str]], tuple[int, int], int]:
    """Header lines, axes of scan lines and of pixels, their numbers, and where the pixels begin."""
    end = data.find(b"\n\n")
    if 0 <= data.find(b"\r\n\r\n") < (end if end >= 0 else len(data)):
        raise UnreadableFile(
            f"{path}: its line ends were converted to CR LF, which ruins the pixels; copy it again in binary mode"
        )
    stop = data.find(b"\n", end + 2)
    if end < 0 or stop < 0:
        raise UnreadableFile(f"{path}: its Radiance header does not end; copy it again from where it came")
    match = _RESOLUTION.fullmatch(data[end + 2 : min(stop, end + 100)].strip())
    if match is None or match[2] == match[5] or max(len(match[3]), len(match[6])) > 9:
        shown = data[end + 2 : min(stop, end + 42)].decode("latin-1")
        raise UnreadableFile(f'{path}: its resolution line is {shown!r}; expected one like "-Y 512 +X 1024"')
    axes = [(match[1].decode(), match[2].decode()), (match[4].decode(), match[5].decode())]
    counts = int(match[3]), int(match[6])
    refuse_absurd_size(path, *reversed(counts))
    return data[:end].decode("utf-8", "replace").splitlines(), axes, counts, stop + 1


def _understood(path: str | os.PathLike[str], header: list[str]) -> tuple[dict[str, str], np.ndarray]:
    """Attributes, and what the pixels were multiplied by in each channel."""
    attributes, scale = {}, np.ones(3)
    for key, value in (match.groups() for match in map(_VARIABLE.fullmatch, header) if match):
        if key == "FORMAT":
            if value.strip() != "32-bit_rle_rgbe":
                raise UnreadableFile(f"{path}: its pixels are {value.strip()}, not RGBE; convert it with ra_xyze -r")
        elif key in ("EXPOSURE", "COLORCORR"):
            scale *= _numbers(path, key, value, (1,) if key == "EXPOSURE" else (3,))
        else:
            attributes[key] = value.strip()
    if not (np.all(np.isfinite(scale)) and np.all(scale > 0)):
        raise UnreadableFile(f"{path}: its EXPOSURE lines multiply to {scale.tolist()}; expected positive numbers")
    if "PRIMARIES" in attributes:
        primaries = _numbers(path, "PRIMARIES", attributes["PRIMARIES"], (8,))
        # Photoshop writes eight zeros: it does not say.
        if primaries.any() and not np.allclose(primaries, _REC709, rtol=0, atol=2e-3):
            warnings.warn(
                f"{path}: its primaries are {attributes['PRIMARIES']} (x, y of R, G, B, white), not Rec. 709;"
                " not converted",
                stacklevel=4,
            )
    return attributes, scale


def _numbers(path: str | os.PathLike[str], key: str, value: str, shape: tuple[int]) -> np.ndarray:
    try:
        return np.array([float(word) for word in value.split()]).reshape(shape)
    except ValueError:
        what = f"{key}={value[:40]!r}; expected {shape[0]} number(s)"
        raise UnreadableFile(f"{path}: its header has {what}: mend the line or remove it") from None


def _upright(pixels: np.ndarray, axes: list[tuple[str, str]]) -> np.ndarray:
    """Pixels with y down in rows and x to the right in columns, from scan lines along the axes of the file."""
    (line_sign, line_axis), (pixel_sign, _) = axes
    if line_axis == "X":
        pixels, line_sign, pixel_sign = pixels.swapaxes(0, 1), pixel_sign, line_sign
    return pixels[:: 1 if line_sign == "-" else -1, :: 1 if pixel_sign == "+" else -1]
