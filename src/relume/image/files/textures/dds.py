"""DDS textures of light: cube maps and plain pictures of floats, halves, shared exponents or BC6H; read, not written.

A file is a header, perhaps a second one (DX10), and the pixels of each face with all of its levels, of which the
largest comes first and is read. The six faces, +X, −X, +Y, −Y, +Z, −Z with row 0 on top, lie as Direct3D and OpenGL
look them up: a strip, as in `relume.sphere.mip_cube`. Blocks of BC6H are decoded by imagecodecs; OpenImageIO 3.2
reads no floats of DDS, and Pillow 13 makes 8 bits of BC6H. Format: Microsoft, "DDS programming guide".
"""

from __future__ import annotations

import os
import struct
from collections.abc import Callable
from pathlib import Path

import numpy as np

from relume.errors import FormatError, UnreadableFile, warn
from relume.image.files.read_options import ReadOptions, refuse_absurd_amount, refuse_absurd_size
from relume.image.files.signatures import one_line
from relume.image.radiance import RadianceMap

_HEADER = struct.Struct("<4s7I44x2I4s5I4I4x")
_SECOND = struct.Struct("<5I")
_CUBE, _FACES, _VOLUME, _CUBE_AGAIN = 0x200, 0xFC00, 0x200000, 0x4
_HALF_RGBA, _FLOAT_RGBA = 10, 2  # DXGI_FORMAT, by which the older codes are called too
_OLD = {113: _HALF_RGBA, 116: _FLOAT_RGBA}  # D3DFMT_A16B16G16R16F, D3DFMT_A32B32G32R32F
_BLOCKS = {94: "BC6HU", 95: "BC6HU", 96: "BC6HS"}
_LEVELS = 17  # of a side of 2^16


def read(path: str | os.PathLike[str], options: ReadOptions = ReadOptions()) -> RadianceMap:
    """The light of a texture; a cube as a strip of its faces, (S, 6S, 3), whose mapping is in its attributes.

    Warns of alpha that is not 1, and of other levels than the largest no further. Raises UnreadableFile, in one line,
    for textures of 8-bit codes, which are no light, for volumes and arrays, and for damage.
    """
    try:
        data = Path(path).read_bytes()
    except OSError as error:
        raise UnreadableFile(f"{path}: cannot be opened: {one_line(error.strerror or error)}; check the path") from None
    # The header, and the second one where there is one.
    if len(data) < _HEADER.size:
        raise FormatError(path, "DDS", "its header", f"{_HEADER.size} bytes", str(len(data)))
    _, size, _, height, width, _, _, count, inner, _, letters, *_, _, kinds, _, _ = _HEADER.unpack_from(data)
    if (size, inner) != (124, 32):
        raise FormatError(path, "DDS", "the sizes of its header", "124 and 32", f"{size} and {inner}")
    begin, cube, kind, array = _HEADER.size, bool(kinds & _CUBE), _OLD.get(int.from_bytes(letters, "little")), 1
    if letters == b"DX10":
        if len(data) < begin + _SECOND.size:
            raise FormatError(path, "DDS", f"byte {begin}", f"a second header of {_SECOND.size} bytes", "the end")
        kind, _, flags, array, _ = _SECOND.unpack_from(data, begin)
        begin, cube = begin + _SECOND.size, cube or bool(flags & _CUBE_AGAIN)
    # What is no light, or no picture or cube, is refused before any pixel is looked at.
    form = _forms().get(kind or 0)
    if form is None:
        said = f"DXGI {kind}" if letters == b"DX10" else ascii(letters.decode("latin-1"))[1:-1]
        raise UnreadableFile(
            f"{path}: a DDS texture of codes ({said}), not of light; save it as BC6H, or as 16- or 32-bit floats"
        )
    refuse_absurd_size(path, width, height, options)
    faces = 6 if cube else 1
    if kinds & _VOLUME or array != 1:
        what = "byte 112: a volume" if kinds & _VOLUME else f"byte 140: an array of {array}"
        raise UnreadableFile(f"{path}: a DDS texture, {what}, where a picture or a cube is read; save one of them")
    if cube and (width != height or (letters != b"DX10" and kinds & _FACES != _FACES)):
        raise UnreadableFile(
            f"{path}: a DDS texture, byte 112: a cube of {width}×{height} pixels, without all six square faces; save a "
            "whole one"
        )
    if count > _LEVELS:
        raise FormatError(path, "DDS", "its levels", f"at most {_LEVELS}", str(count))
    bytes_of, decode = form
    refuse_absurd_amount(path, faces * width * height * 12, len(data), options)
    # The largest level of each face.
    levels = [(max(width >> level, 1), max(height >> level, 1)) for level in range(max(count, 1))]
    step, first = sum(bytes_of(*level) for level in levels), bytes_of(width, height)
    wanted = begin + (faces - 1) * step + first
    if wanted > len(data):
        raise FormatError(path, "DDS", "its pixels", f"{wanted} bytes of file", str(len(data)))
    pictures = [decode(data[begin + face * step :][:first], width, height) for face in range(faces)]
    alpha = sum(np.count_nonzero(picture[..., 3] != 1) for picture in pictures if picture.shape[2] == 4)
    if alpha:
        warn(f"{path}: alpha is left out, though {alpha} texels are not opaque")
    pixels = np.concatenate([picture[..., :3] for picture in pictures], axis=1).astype(np.float32)
    return RadianceMap(np.ascontiguousarray(pixels), attributes={"mapping": "strip"} if cube else {})


def subtype(path: str | os.PathLike[str], options: ReadOptions = ReadOptions()) -> str:
    """A few words from the header: "cube, half"."""
    with open(path, "rb") as file:
        head = file.read(_HEADER.size + _SECOND.size).ljust(_HEADER.size + _SECOND.size, b"\0")
    letters, kinds = head[84:88], int.from_bytes(head[112:116], "little")
    kind = _OLD.get(int.from_bytes(letters, "little"), 0)
    if letters == b"DX10":
        kind, _, flags, *_ = _SECOND.unpack_from(head, _HEADER.size)
        kinds |= _CUBE if flags & _CUBE_AGAIN else 0
    names = {2: "float", 6: "float", 10: "half", 26: "11 bits", 67: "shared exponent"} | dict.fromkeys(_BLOCKS, "BC6H")
    return ("cube, " if kinds & _CUBE else "") + names.get(kind, "codes")


_Form = tuple[Callable[[int, int], int], Callable[[bytes, int, int], np.ndarray]]


def _forms() -> dict[int, _Form]:
    """By DXGI_FORMAT: the bytes of a picture of that width and height, and its decoder to (H, W, 3 or 4)."""
    known: dict[int, _Form] = {
        _FLOAT_RGBA: _plain("<f4", 4),
        6: _plain("<f4", 3),
        _HALF_RGBA: _plain("<f2", 4),
        26: (lambda width, height: 4 * width * height, _small_floats),
        67: (lambda width, height: 4 * width * height, _shared_exponent),
    }
    for kind, name in _BLOCKS.items():
        known[kind] = _blocks(name)
    return known


def _plain(number: str, channels: int) -> _Form:
    kind = np.dtype(number)
    return (
        lambda width, height: channels * kind.itemsize * width * height,
        lambda data, width, height: np.frombuffer(data, kind).reshape(height, width, channels).astype(np.float32),
    )


def _blocks(name: str) -> _Form:
    """16 bytes for each 4 × 4 pixels; those beyond the rim are cut off."""

    def decode(data: bytes, width: int, height: int) -> np.ndarray:
        import imagecodecs

        tall, wide = -(-height // 4) * 4, -(-width // 4) * 4
        texels = imagecodecs.bcn_decode(data, imagecodecs.BCN.FORMAT[name], shape=(tall, wide, 3))
        return np.asarray(texels)[:height, :width].astype(np.float32)

    return (lambda width, height: 16 * -(-width // 4) * -(-height // 4), decode)


def _small_floats(data: bytes, width: int, height: int) -> np.ndarray:
    """R11G11B10_FLOAT: a half without its sign and its last mantissa bits."""
    packed = np.frombuffer(data, "<u4").reshape(height, width)
    halves = np.stack([(packed & 0x7FF) << 4, (packed >> 11 & 0x7FF) << 4, (packed >> 22) << 5], axis=-1)
    return halves.astype(np.uint16).view(np.float16).astype(np.float32)


def _shared_exponent(data: bytes, width: int, height: int) -> np.ndarray:
    """R9G9B9E5_SHAREDEXP: mantissas of 9 bits, times 2^(exponent − 15 − 9)."""
    packed = np.frombuffer(data, "<u4").reshape(height, width)
    mantissas = np.stack([packed & 0x1FF, packed >> 9 & 0x1FF, packed >> 18 & 0x1FF], axis=-1)
    return np.ldexp(mantissas.astype(np.float32), (packed >> 27).astype(np.int32)[..., None] - 24)
