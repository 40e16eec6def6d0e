"""The boundary to the OpenEXR library: parts in, parts out, with every way it can fail silently closed.

The library's wheel prints decoding errors and *leaves out* the part they are in; a part missing after reading means a
damaged file here. The header is read first, so that its claims are judged before anything is allocated. Pixels outside
the data window are 0 and those outside the display window are left out with a warning: the display window is the
picture (OpenEXR technical introduction, "Display window and data window").
"""

from __future__ import annotations

import io
import os
import tempfile
import threading
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, redirect_stdout
from dataclasses import dataclass
from typing import Any

import numpy as np
import OpenEXR

from relume.errors import OutputNotWritten, UnreadableFile
from relume.image.files.atomic import replacing
from relume.image.files.reading import refuse_absurd_size
from relume.image.files.signatures import one_line

_decoding = threading.Lock()


@dataclass(frozen=True, eq=False)
class Part:
    """One part of an EXR file.

    channels : name → (H, W) float16, float32 or uint32, covering the data window
    header : the file's attributes by their own names
    """

    name: str
    channels: dict[str, np.ndarray]
    header: dict[str, Any]


def read_parts(path: str | os.PathLike[str]) -> list[Part]:
    """Every part of an EXR file; raises UnreadableFile when any is damaged, deep, subsampled or absurdly large."""
    headers = [part.header for part in _open(path, header_only=True)]
    _refuse_unusable(path, headers)
    parts = _open(path, header_only=False)
    if len(parts) != len(headers):
        lost = f"{len(headers) - len(parts)} of {len(headers)} parts cannot be decoded"
        raise UnreadableFile(f"{path}: damaged EXR: {lost}; copy it again from where it came")
    return [
        Part(str(part.header.get("name", "")), {n: c.pixels for n, c in part.channels.items()}, dict(part.header))
        for part in parts
    ]


def write_parts(path: str | os.PathLike[str], parts: Sequence[Part]) -> None:
    """Write float32 parts of one size, ZIP compressed, whole or not at all; raises OutputNotWritten."""
    written = []
    for part in parts:
        header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage, **part.header}
        # The library ignores strides: a view into a larger array would be written as other pixels.
        channels = {name: np.ascontiguousarray(plane, dtype=np.float32) for name, plane in part.channels.items()}
        written.append(OpenEXR.Part(header, channels, part.name))
    with replacing(path) as temporary:
        try:
            OpenEXR.File(written).write(str(temporary))
        except RuntimeError as error:
            raise OutputNotWritten(f"{path}: cannot be written: {one_line(error)}") from error


def placed(path: str | os.PathLike[str], part: Part) -> dict[str, np.ndarray]:
    """The channels of a part moved from its data window into its display window; warns where some pixels fall out."""
    data, display = (part.header[name] for name in ("dataWindow", "displayWindow"))
    (width, height), (data_width, data_height) = _extent(display), _extent(data)
    low, high = np.maximum(data[0], display[0]), np.minimum(data[1], display[1]) + 1
    inside = int(np.prod(np.maximum(high - low, 0)))
    if outside := data_width * data_height - inside:
        warnings.warn(f"{path}: {outside} pixels around the display window (overscan) are left out", stacklevel=6)
    if inside == width * height == data_width * data_height:
        return part.channels
    canvases = {name: np.zeros((height, width), plane.dtype) for name, plane in part.channels.items()}
    if inside:
        (x, y), (u, v), (w, h) = low - display[0], low - data[0], high - low
        for name, plane in part.channels.items():
            canvases[name][y : y + h, x : x + w] = plane[v : v + h, u : u + w]
    return canvases


def _open(path: str | os.PathLike[str], *, header_only: bool) -> list:
    try:
        with gathered_messages() as messages:
            parts = OpenEXR.File(str(path), separate_channels=True, header_only=header_only).parts
    except Exception as error:  # the library raises RuntimeError, ValueError or UnicodeDecodeError for a damaged file
        detail = messages[0] if messages else one_line(error).replace(f"'{path}' ", "")
        raise UnreadableFile(f"{path}: damaged EXR: {detail}; copy it again from where it came") from error
    if messages:
        raise UnreadableFile(f"{path}: damaged EXR: {messages[0]}; copy it again from where it came")
    return parts


@contextmanager
def gathered_messages() -> Iterator[list[str]]:
    """What the library prints on stderr (from C) and stdout (from Python), instead of printing it."""
    messages: list[str] = []
    with _decoding, tempfile.TemporaryFile() as caught, redirect_stdout(io.StringIO()) as printed:
        terminal = _stderr_onto(caught.fileno())
        try:
            yield messages
        finally:
            if terminal is not None:
                os.dup2(terminal, 2)
                os.close(terminal)
            caught.seek(0)
            lines = caught.read().decode("utf-8", "replace") + printed.getvalue()
            messages += [one_line(line.partition(": ")[2] or line) for line in lines.splitlines() if line.strip()]


def _stderr_onto(handle: int) -> int | None:
    """Send stderr to `handle`; a copy of where it went before, None for a program without stderr (a service)."""
    try:
        before = os.dup(2)
    except OSError:
        return None
    os.dup2(handle, 2)
    return before


def _refuse_unusable(path: str | os.PathLike[str], headers: list[dict]) -> None:
    samples = 0
    for header in headers:
        if header.get("type") in (OpenEXR.deepscanline, OpenEXR.deeptile):
            raise UnreadableFile(f"{path}: a deep EXR, several samples a pixel; flatten it first")
        for window in (header["displayWindow"], header["dataWindow"]):
            refuse_absurd_size(path, *_extent(window))
        samples += np.prod(_extent(header["dataWindow"])) * len(header["channels"])
        sparse = [c.name for c in header["channels"] if (c.xSampling, c.ySampling) != (1, 1)]
        if sparse:
            raise UnreadableFile(
                f"{path}: channels {', '.join(map(repr, sparse))} are subsampled (luminance/chroma); save it as RGB"
            )
    if samples > 2**31:
        raise UnreadableFile(f"{path}: its header claims {samples} values; relume reads {2**31}: split it")


def _extent(window: tuple[np.ndarray, np.ndarray]) -> tuple[int, int]:
    (left, top), (right, bottom) = window[0].tolist(), window[1].tolist()
    return right - left + 1, bottom - top + 1
