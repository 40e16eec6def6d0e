"""A gain map applied to its base picture: the arithmetic of reading, and its loop over the pixels, compiled."""

from __future__ import annotations

import os
from dataclasses import dataclass

import numpy as np

from relume.errors import warn
from relume.image.bands import in_threads
from relume.image.files.gain_map.metadata import GainMapMetadata
from relume.image.files.metadata import icc_profile
from relume.image.kernel import kernel
from relume.image.primaries import REC709, Primaries, between, mixed

_ROWS = 64  # of a picture at a time


@dataclass(frozen=True, eq=False)
class Pictures:
    """Both pictures of a gain map, decoded, and what their codes stand for.

    base : (H, W, 1 or 3) uint8; codes : (h, w, 1 or 3) uint8, the map
    curves : (256, 3) float32, linear values of the base's codes
    base_primaries, gain_primaries : of the base, and those that the gains are for, which the result has
    metadata : the gain map's parameters
    """

    base: np.ndarray
    codes: np.ndarray
    curves: np.ndarray
    base_primaries: Primaries
    gain_primaries: Primaries
    metadata: GainMapMetadata


def pictures(
    path: str | os.PathLike[str],
    base: np.ndarray,
    codes: np.ndarray,
    metadata: GainMapMetadata,
    base_profile: bytes | None,
    map_profile: bytes | None,
) -> Pictures:
    """Decoded pictures with the meaning their ICC profiles give them; warns of a profile that is not understood."""
    profile = _profile(path, base_profile)
    # The map's own profile names its primaries where the gains are not for the base's (ISO 21496-1, 5.2.4).
    gains = profile if metadata.in_base_primaries or map_profile is None else _profile(path, map_profile)
    return Pictures(base, codes, profile.curves, profile.primaries, gains.primaries, metadata)


def _profile(path: str | os.PathLike[str], profile: bytes | None) -> icc_profile.Profile:
    if profile is None:
        return icc_profile.srgb()
    if (parsed := icc_profile.parsed(profile)) is None:
        warn(f"{path}: its colour profile is damaged or none of primaries and curves; taken for sRGB")
        return icc_profile.srgb()
    return parsed


def bright(given: Pictures) -> np.ndarray:
    """(H, W, 3) float32, the bright picture in Rec. 709 primaries, 1 = the base's white."""
    metadata, primaries = given.metadata, given.gain_primaries
    # The matrix into the gains' primaries, each code's factor, and the parameters as the kernel has them.
    same = given.base_primaries.is_close(primaries)
    mixing = (np.eye(3) if same else between(given.base_primaries, primaries)).astype(np.float32)
    low, high, gamma = (np.array(three) for three in (metadata.low, metadata.high, metadata.gamma))
    gains = np.exp2(low + (high - low) * np.linspace(0, 1, 256)[:, None] ** (1 / gamma)).astype(np.float32)
    parameters = np.array([low, high - low, 1 / gamma, metadata.base_offset, metadata.bright_offset], np.float32)
    result = np.empty((*given.base.shape[:2], 3), np.float32)

    def work(begin: int, end: int) -> None:
        rows = result[begin:end]
        _bright_rows(given.base, given.curves, mixing, given.codes, gains, parameters, begin, end, rows)
        if not primaries.is_close(REC709):
            rows[:] = mixed(rows, between(primaries, REC709))

    in_threads(work, len(result), chunk=_ROWS)
    return result


@kernel
def _bright_rows(
    base: np.ndarray,
    curves: np.ndarray,
    mixing: np.ndarray,
    codes: np.ndarray,
    gains: np.ndarray,
    parameters: np.ndarray,
    begin: int,
    end: int,
    result: np.ndarray,
) -> None:
    """Rows begin to end of the bright picture into `result`, in the primaries that gains are for.

    base : (H, W, 1 or 3) uint8; curves : (256, 3) float32, linear values of its codes
    mixing : (3, 3) float32 from the base's primaries to those of the gains
    codes : (h, w, 1 or 3) uint8, the map; gains : (256, 3) float32, factors of its codes, for a map of the base's size
    parameters : (5, 3) float32; low, high − low, 1 / gamma, base offset, bright offset
    result : (end − begin, W, 3) float32
    """
    height, width, base_channels = base.shape
    map_height, map_width, map_channels = codes.shape
    same = map_height == height and map_width == width
    for row in range(begin, end):
        # Centres of pixels: the map's pixel y + ½ lies where the base's does, in shares of the height.
        y = min(max((row + 0.5) * map_height / height - 0.5, 0.0), map_height - 1.0)
        y0 = int(y)
        y1 = min(y0 + 1, map_height - 1)
        dy = np.float32(y - y0)
        for column in range(width):
            x = min(max((column + 0.5) * map_width / width - 0.5, 0.0), map_width - 1.0)
            x0 = int(x)
            x1 = min(x0 + 1, map_width - 1)
            dx = np.float32(x - x0)
            # The base, linear.
            first = curves[base[row, column, 0], 0]
            second = curves[base[row, column, min(1, base_channels - 1)], 1]
            third = curves[base[row, column, base_channels - 1], 2]
            for channel in range(3):
                # The gain of this channel, interpolated where the map is smaller.
                source = min(channel, map_channels - 1)
                if same:
                    factor = gains[codes[row, column, source], channel]
                else:
                    upper = codes[y0, x0, source] * (1 - dx) + codes[y0, x1, source] * dx
                    lower = codes[y1, x0, source] * (1 - dx) + codes[y1, x1, source] * dx
                    code = (upper * (1 - dy) + lower * dy) * np.float32(1 / 255)
                    if parameters[2, channel] != 1:
                        code = code ** parameters[2, channel]
                    factor = np.exp2(parameters[0, channel] + parameters[1, channel] * code)
                # The bright picture, in the primaries of the gains.
                value = mixing[channel, 0] * first + mixing[channel, 1] * second + mixing[channel, 2] * third
                value = (value + parameters[3, channel]) * factor - parameters[4, channel]
                # The offsets may leave a little below black; there is no such light.
                result[row - begin, column, channel] = max(value, np.float32(0))
