"""The boundary to the OpenEXR library: parts in, parts out, with every way it can fail silently closed.

The library's wheel prints decoding errors and *leaves out* the part they are in; a part missing after reading means a
damaged file here. Headers and tables are read first (`exr_header`, `exr_chunks`), so that their claims are judged
before anything is allocated. Pixels outside the data window are 0 and marked, and those outside the display window are
left out, with a warning: the display window is the picture (OpenEXR technical introduction, "Display window and data
window").
"""

from __future__ import annotations

import ctypes
import io
import os
import sys
import tempfile
import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, redirect_stdout
from dataclasses import dataclass
from functools import cache
from types import ModuleType
from typing import TYPE_CHECKING, Any

import numpy as np

from relume.errors import FormatError, OutputNotWritten, warn
from relume.image import mapped_arrays
from relume.image.files.atomic import replacing
from relume.image.files.exr import chunks as exr_chunks
from relume.image.files.exr.header import Headers, read_headers, refuse_beyond
from relume.image.files.read_options import OR_SALVAGE, ReadOptions
from relume.image.files.signatures import one_line

if TYPE_CHECKING:
    import OpenEXR

MOST_THREADS = 16
"""Each holds a chunk of its own; more wait for the memory."""

_decoding = threading.Lock()


@dataclass(frozen=True, eq=False)
class Part:
    """One part of an EXR file.

    channels : name → (H, W) float16, float32 or uint32, covering the data window; fewer samples where subsampled. To be
        written also "RGB" → (H, W, 3)
    header : the file's attributes by their own names
    missing : (H, W) bool, where a file that ends early has no pixels; None where it is whole
    """

    name: str
    channels: dict[str, np.ndarray]
    header: dict[str, Any]
    missing: np.ndarray | None = None


def read_parts(path: str | os.PathLike[str], options: ReadOptions = ReadOptions()) -> list[Part]:
    """Every part of an EXR file, level 0 where it has several.

    Raises FormatError when any is damaged or, unless `options.salvage`, cut short; UnreadableFile for deep pixels and
    beyond the limits of `options`. Warns where a file contradicts itself about how its pixels are stored.
    """
    headers = read_headers(path, options)
    refuse_beyond(path, headers, options)
    chunks, end = exr_chunks.find(path, headers)
    lost = exr_chunks.first_missing(headers, chunks)
    if lost and (not options.salvage or lost[1] == lost[2]):
        where, missing, number = lost
        problem = (path, "EXR", where, f"{number} chunks of pixels", f"{number - missing}")
        raise FormatError(*problem, *([OR_SALVAGE] if missing < number else []))
    _warn_of_contradiction(path, headers)
    if lost or any(header.foreign for header in headers.parts):
        with exr_chunks.mended(path, headers, chunks, end) as copy:
            decoded = _decoded(path, copy, headers)
    else:
        decoded = _decoded(path, path, headers)
    parts = []
    for part, header, of_part in zip(decoded, headers.parts, chunks, strict=True):
        planes = {name: channel.pixels for name, channel in part.channels.items()}
        if "RGB" in planes and planes["RGB"].ndim == 3:
            planes = {letter: planes["RGB"][..., i] for i, letter in enumerate("RGB")}
        missing = exr_chunks.missing_pixels(header, of_part)
        parts.append(Part(header.name, planes, {**part.header, **header.texts}, missing))
    return parts


def write_parts(path: str | os.PathLike[str], parts: Sequence[Part], release: Callable[[], None] | None = None) -> None:
    """Write half or float parts of one size, ZIP compressed, whole or not at all; raises OutputNotWritten.

    release : gives back the memory of planes that are in files; called again and again as they are written
    """
    OpenEXR = _library()
    written = []
    for part in parts:
        header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage, **part.header}
        # The library ignores strides: a view into a larger array would be written as other pixels.
        channels = {name: np.ascontiguousarray(plane) for name, plane in part.channels.items()}
        written.append(OpenEXR.Part(header, channels, part.name))
    with replacing(path) as temporary:
        try:
            if release is not None:
                with _Releasing(temporary, release) as file:
                    OpenEXR.File(written).write(file)
            else:
                OpenEXR.File(written).write(str(temporary))
        except RuntimeError as error:
            raise OutputNotWritten(f"{path}: cannot be written: {one_line(error)}") from error


class _Releasing(io.BufferedWriter):
    """A file that gives back, as it grows, the memory of the planes that it is written from."""

    def __init__(self, path: os.PathLike[str], release: Callable[[], None]) -> None:
        super().__init__(io.FileIO(path, "wb"))
        self._release, self._written = release, 0

    def write(self, data: Any) -> int:
        """Write some bytes."""
        self._written += len(data)
        if self._written > mapped_arrays.LARGE:
            self._release()
            self._written = 0
        return super().write(data)


def placed(header: Mapping[str, Any], planes: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Planes (H, W) moved from the data window of `header` into its display window; 0 where they have no pixels."""
    data, display = (header[name] for name in ("dataWindow", "displayWindow"))
    (width, height), (data_width, data_height) = extent(display), extent(data)
    low, high, inside = _common(header)
    if inside == width * height == data_width * data_height:
        return dict(planes)
    canvases = {name: np.zeros((height, width), plane.dtype) for name, plane in planes.items()}
    if inside:
        (x, y), (u, v), (w, h) = low - display[0], low - data[0], high - low
        for name, plane in planes.items():
            canvases[name][y : y + h, x : x + w] = plane[v : v + h, u : u + w]
    return canvases


def outside(header: Mapping[str, Any]) -> np.ndarray | None:
    """(H, W) bool over the display window, True where the data window has no pixels; None where it covers it."""
    display = header["displayWindow"]
    width, height = extent(display)
    low, high, inside = _common(header)
    if inside == width * height:
        return None
    padding = np.ones((height, width), bool)
    if inside:
        (left, top), (right, bottom) = low - display[0], high - display[0]
        padding[top:bottom, left:right] = False
    return padding


def meets(header: Mapping[str, Any]) -> bool:
    """Whether any pixel of the data window lies in the display window."""
    return _common(header)[2] > 0


def warn_of_overscan(path: str | os.PathLike[str], header: Mapping[str, Any]) -> None:
    """Say how many pixels of the data window lie outside the display window."""
    width, height = extent(header["dataWindow"])
    if outside := width * height - _common(header)[2]:
        warn(f"{path}: {outside} pixels around the display window (overscan) are left out", 0.0)


def _warn_of_contradiction(path: str | os.PathLike[str], headers: Headers) -> None:
    """Say where the attribute "type" of a file of one part is not what its version field says.

    They must agree ("OpenEXR File Layout", "Multi-Part and Deep Data Header Attributes"); libraries go by the version
    field, and chunks laid out in another way would not have been found.
    """
    header = headers.parts[0]
    claimed = header.texts.get("type")
    expected, stored = ("scanlineimage", "scan lines") if header.tiling is None else ("tiledimage", "tiles")
    if headers.many or claimed is None or claimed == expected:
        return
    found = f'its attribute "type" is {claimed[:40]!a}, but its version field says {stored}'
    warn(f"{path}: {found}, and as those it is read; save it again")


def _common(header: Mapping[str, Any]) -> tuple[np.ndarray, np.ndarray, int]:
    """The corner, the one after the end and the number of the pixels in both windows."""
    data, display = (header[name] for name in ("dataWindow", "displayWindow"))
    low, high = np.maximum(data[0], display[0]), np.minimum(data[1], display[1]) + 1
    return low, high, int(np.prod(np.maximum(high - low, 0).astype(np.int64)))


def _decoded(path: str | os.PathLike[str], copy: str | os.PathLike[str], headers: Headers) -> list[OpenEXR.Part]:
    """What the library reads of `copy`; `path` is for messages."""
    OpenEXR = _library()
    streams = (1, 2) if any(header.compression.talkative for header in headers.parts) else (2,)
    where = f"bytes {headers.end} to {os.path.getsize(path)}, pixels"
    try:
        with gathered_messages(streams) as messages:
            parts = OpenEXR.File(str(copy), separate_channels=not _is_plain(headers)).parts
    except MemoryError:
        raise
    except Exception as error:  # the library raises RuntimeError, ValueError or UnicodeDecodeError for a damaged file
        raise _damaged(path, copy, messages or [one_line(error)], where) from error
    if messages or len(parts) != len(headers.parts):
        lost = f"{len(headers.parts) - len(parts)} of {len(headers.parts)} parts cannot be decoded"
        raise _damaged(path, copy, messages or [lost], where)
    for part, header in zip(parts, headers.parts, strict=True):
        read = sorted(part.channels) if list(part.channels) != ["RGB"] else ["B", "G", "R"]
        if read != sorted(channel.name for channel in header.channels):
            raise _damaged(path, copy, [", ".join(read)], "its channels")
    return parts


@cache
def _library() -> ModuleType:
    """The library, which works on all cores from now on: by itself it packs and unpacks on one.

    A program that has chosen a number of threads keeps it.
    """
    import OpenEXR

    if OpenEXR.global_thread_count() == 0:
        OpenEXR.set_global_thread_count(min(os.cpu_count() or 1, MOST_THREADS))
    return OpenEXR


def _is_plain(headers: Headers) -> bool:
    """Whether every part is R, G and B alike and nothing else, or one channel: the library then mixes R, G, B itself.

    That takes half the memory of mixing planes.
    """
    for header in headers.parts:
        names = {channel.name for channel in header.channels}
        kinds = {(channel.kind, channel.x_sampling, channel.y_sampling) for channel in header.channels}
        if len(header.channels) != 1 and (names != {"R", "G", "B"} or len(kinds) > 1 or max(kinds)[1:] != (1, 1)):
            return False
    return True


def _damaged(
    path: str | os.PathLike[str], copy: str | os.PathLike[str], messages: list[str], where: str
) -> FormatError:
    found = messages[0].replace(f"'{copy}' ", "").replace(str(copy), os.path.basename(path))
    return FormatError(path, "EXR", where, "what its header says", f'"{found}"')


@contextmanager
def gathered_messages(streams: Sequence[int] = (2,)) -> Iterator[list[str]]:
    """What a library prints from C, and from Python on stdout, instead of printing it.

    streams : 2 for stderr, 1 for stdout; the latter only where it is needed, since what other threads of the program
        write there meanwhile, perhaps their very output, is gathered too
    """
    messages: list[str] = []
    with _decoding, tempfile.TemporaryFile() as caught, redirect_stdout(io.StringIO()) as printed:
        if 1 in streams:
            _flush_stdout_of_c()
        before = {stream: _sent_to(caught.fileno(), stream) for stream in streams}
        try:
            yield messages
        finally:
            if 1 in streams:
                _flush_stdout_of_c()
            for stream, terminal in before.items():
                if terminal is not None:
                    os.dup2(terminal, stream)
                    os.close(terminal)
            caught.seek(0)
            lines = caught.read().decode("utf-8", "replace") + printed.getvalue()
            messages += [one_line(line.partition(": ")[2] or line) for line in lines.splitlines() if line.strip()]


def _sent_to(handle: int, stream: int) -> int | None:
    """Send a stream to `handle`; a copy of where it went before, None for a program without it (a service)."""
    try:
        before = os.dup(stream)
    except OSError:
        return None
    os.dup2(handle, stream)
    return before


def _flush_stdout_of_c() -> None:
    """Write out what C holds back of its stdout, where that can be reached: it is a buffer apart from Python's."""
    try:
        library = ctypes.CDLL(None)
        stdout = ctypes.c_void_p.in_dll(library, "__stdoutp" if sys.platform == "darwin" else "stdout")
    except (OSError, TypeError, ValueError):  # Windows, and whatever links C into the program
        return
    library.fflush(stdout)


def extent(window: tuple[np.ndarray, np.ndarray]) -> tuple[int, int]:
    """Width and height of a window whose last pixel is included."""
    (left, top), (right, bottom) = window[0].tolist(), window[1].tolist()
    return right - left + 1, bottom - top + 1
