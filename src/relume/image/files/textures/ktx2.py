"""Cube maps as KTX 2.0, uncompressed half or float, written and read without a library; and as strips of .hdr.

A file is a header, an index of its levels, a data format descriptor, keys with values and the levels, the smallest
first; numbers are little-endian. Formats: Khronos KTX 2.0 revision 4, and Khronos Data Format 1.4, section 5. A level
is (6, S, S, 3), the faces +X, −X, +Y, −Y, +Z, −Z with row 0 on top, as in `relume.sphere.mip_cube`.
"""

from __future__ import annotations

import os
import struct
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from relume.errors import FormatError, UnreadableFile, warn
from relume.image.files.atomic import replacing
from relume.image.files.hdr import radiance_hdr
from relume.image.files.read_options import ReadOptions, refuse_absurd_size
from relume.image.files.signatures import one_line
from relume.image.radiance import RadianceMap

_IDENTIFIER = b"\xabKTX 20\xbb\r\n\x1a\n"
_HEADER = struct.Struct("<12s9I4I2Q")
_LEVEL = struct.Struct("<3Q")  # offset, bytes, bytes before supercompression
_FORMATS = {97: "VK_FORMAT_R16G16B16A16_SFLOAT", 109: "VK_FORMAT_R32G32B32A32_SFLOAT"}
_NUMBERS = {97: np.dtype("<f2"), 109: np.dtype("<f4")}
_LARGEST_HALF = 65504.0
_FULL_HALF = 2.0**-14  # below, halves lose one bit after another, and all of them at 2⁻²⁵


def write_cube(path: str | os.PathLike[str], levels: Sequence[np.ndarray]) -> str:
    """Write levels [(6, S, S, 3), (6, S/2, S/2, 3), …] of scene-linear Rec. 709 light as a KTX 2.0 cube, alpha 1.

    Returns the Vulkan format used: VK_FORMAT_R16G16B16A16_SFLOAT (an error of at most 1/2048 of a value, or of 3e-8),
    because every engine filters halves; VK_FORMAT_R32G32B32A32_SFLOAT where a value is above 65504, the largest half,
    or the largest of all is below 6e-5, where halves would lose the picture. Nothing is clipped.

    Raises ValueError for other shapes, NaN, infinity or values beyond float32; OutputNotWritten.
    """
    planes = _checked(levels)
    largest = max(float(np.abs(plane).max()) for plane in planes)
    vk_format = 97 if largest == 0 or _FULL_HALF <= largest <= _LARGEST_HALF else 109
    number = _NUMBERS[vk_format]
    images = [np.ones((*plane.shape[:3], 4), number) for plane in planes]
    for image, plane in zip(images, planes, strict=True):
        image[..., :3] = plane

    descriptor, keys = _descriptor(number.itemsize), _keys({"KTXorientation": "rd", "KTXwriter": "relume"})
    descriptor_at = _HEADER.size + len(images) * _LEVEL.size
    keys_at = descriptor_at + len(descriptor)
    texel = 4 * number.itemsize
    end = keys_at + len(keys)
    padding = -end % texel  # whole texels follow, so that all levels are aligned when the first one is
    index, place = [], end + padding
    for image in reversed(images):
        index.append(_LEVEL.pack(place, image.nbytes, image.nbytes))
        place += image.nbytes
    size = planes[0].shape[1]
    counts = (vk_format, number.itemsize, size, size, 0, 0, 6, len(images), 0)
    header = _HEADER.pack(_IDENTIFIER, *counts, descriptor_at, len(descriptor), keys_at, len(keys), 0, 0)
    with replacing(path) as temporary, open(temporary, "wb") as file:
        file.write(header + b"".join(reversed(index)) + descriptor + keys + bytes(padding))
        for image in reversed(images):
            file.write(image.tobytes())
    return _FORMATS[vk_format]


def read_cube(path: str | os.PathLike[str], options: ReadOptions = ReadOptions()) -> list[np.ndarray]:
    """The levels of a KTX 2.0 cube of half or float R, G, B, A, largest first: (6, S, S, 3) float32 each.

    Warns when alpha is left out that is not 1. Raises UnreadableFile, in one line, for anything else and for damage.
    """
    try:
        data = Path(path).read_bytes()
    except OSError as error:
        raise UnreadableFile(f"{path}: cannot be opened: {one_line(error.strerror or error)}; check the path") from None
    if not data.startswith(_IDENTIFIER):
        raise UnreadableFile(f"{path}: no KTX 2.0 file; give a cube in a .ktx2, or convert it with `ktx create`")
    if len(data) < _HEADER.size:
        raise FormatError(path, "KTX2", "its header", f"{_HEADER.size} bytes", str(len(data)))
    _, vk_format, _, width, height, depth, layers, faces, count, scheme, *_ = _HEADER.unpack_from(data)
    if scheme:
        raise UnreadableFile(
            f"{path}: supercompressed (scheme {scheme}); write it again without, as with `ktx deflate`"
        )
    if vk_format not in _NUMBERS:
        raise UnreadableFile(
            f"{path}: its vkFormat is {vk_format}; relume reads 97 (RGBA half) and 109 (RGBA float): convert it"
        )
    if faces != 6 or layers or depth or width != height:
        shown = f"{width} x {height} x {depth} pixels, {faces} face(s), {layers} layer(s)"
        raise UnreadableFile(f"{path}: no cube map: {shown}; give one of 6 square faces")
    refuse_absurd_size(path, width, height, options)
    if count > width.bit_length():
        raise FormatError(path, "KTX2", "levelCount", f"at most {width.bit_length()} for {width} pixels", str(count))
    number, levels, seen_through = _NUMBERS[vk_format], [], 0
    for level in range(max(1, count)):
        entry = _HEADER.size + level * _LEVEL.size
        size = width >> level
        if entry + _LEVEL.size > len(data):
            raise FormatError(path, "KTX2", f"the index of level {level}", "an entry", f"the end at byte {len(data)}")
        offset, length, _ = _LEVEL.unpack_from(data, entry)
        if length != 24 * size * size * number.itemsize:
            expected = f"{24 * size * size * number.itemsize} bytes of 6 faces"
            raise FormatError(path, "KTX2", f"level {level}", expected, f"{length} bytes")
        if offset + length > len(data):
            expected = f"{length} bytes from byte {offset}"
            raise FormatError(path, "KTX2", f"level {level}", expected, f"{len(data)} bytes of file")
        texels = np.frombuffer(data, number, 24 * size * size, offset).reshape(6, size, size, 4)
        seen_through += np.count_nonzero(texels[..., 3] != 1)
        levels.append(texels[..., :3].astype(np.float32))
    if seen_through:
        warn(f"{path}: alpha is left out, though {seen_through} texels are not opaque")
    return levels


def write_cube_hdr(path: str | os.PathLike[str], levels: Sequence[np.ndarray], *, unit: str = "relative") -> list[Path]:
    """Write each level as a Radiance strip, the six faces below each other: name_0.hdr (S × 6·S pixels), name_1.hdr, …

    A vertical strip, in the order of KTX2, because Unity, Godot, Filament's cmgen and DirectXTex's texassemble all read
    it (Godot no cross), and because no face in it is turned and no part empty, as in a cross.

    Returns the paths. Each file is written whole or not at all. Raises ValueError for another suffix, other shapes, a
    unit beside "relative" and "cd/m²", and values that RGBE cannot hold; OutputNotWritten.
    """
    path = Path(path)
    if path.suffix.lower() != ".hdr":
        raise ValueError(f'{path} ends in "{path.suffix}"; strips of a cube are written to .hdr')
    written = []
    for level, plane in enumerate(_checked(levels)):
        strip = RadianceMap(plane.reshape(6 * plane.shape[1], plane.shape[1], 3), unit=unit)
        written.append(path.with_name(f"{path.stem}_{level}{path.suffix}"))
        radiance_hdr.write(written[-1], strip)
    return written


def _checked(levels: Sequence[np.ndarray]) -> list[np.ndarray]:
    """The levels as float32; raises ValueError for shapes that are no cube's and values that are not finite."""
    shapes = [np.shape(level) for level in levels]
    size = shapes[0][1] if shapes and len(shapes[0]) == 4 else 0
    wanted = [(6, size >> level, size >> level, 3) for level in range(len(shapes))]
    if size < 1 or shapes != wanted or len(shapes) > size.bit_length():
        raise ValueError(
            f"levels have the shapes {shapes}; expected [(6, S, S, 3), (6, S/2, S/2, 3), …], down to S = 1"
        )
    with np.errstate(over="ignore"):
        planes = [np.asarray(level).astype(np.float32) for level in levels]
    unfit = sum(np.count_nonzero(~np.isfinite(plane)) for plane in planes)
    if unfit:
        raise ValueError(f"levels hold {unfit} values that are NaN, infinite or beyond float32; mend them first")
    return planes


def _descriptor(width: int) -> bytes:
    """The data format descriptor of R, G, B, A floats of `width` bytes each: linear, BT.709, straight alpha."""
    signed_float = 0xC0
    samples = b"".join(
        # Bit offset, bits less one, channel with qualifiers, position of the sample; −1 and 1 as floats.
        struct.pack("<HBB4x2f", 8 * width * place, 8 * width - 1, signed_float | channel, -1.0, 1.0)
        for place, channel in enumerate((0, 1, 2, 15))
    )
    # Khronos' vendor and basic type are 0; version 2; model RGBSDA 1, primaries BT.709 1, transfer linear 1, flags 0;
    # texel block less one; bytes of the one plane.
    block = struct.pack("<IHH4B4B8B", 0, 2, 24 + len(samples), 1, 1, 1, 0, 0, 0, 0, 0, 4 * width, *[0] * 7) + samples
    return struct.pack("<I", 4 + len(block)) + block


def _keys(values: dict[str, str]) -> bytes:
    """Keys, which the format wants sorted, with values: each with its length before it, padded to 4 bytes."""
    pairs = [f"{key}\0{values[key]}\0".encode() for key in sorted(values)]
    return b"".join(struct.pack("<I", len(pair)) + pair + bytes(-len(pair) % 4) for pair in pairs)
