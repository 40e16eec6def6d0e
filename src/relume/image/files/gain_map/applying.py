"""A gain map applied to its base picture: the arithmetic of reading."""

from __future__ import annotations

import os
import warnings
from dataclasses import dataclass

import numpy as np

from relume._kernel import in_threads
from relume.image.files.gain_map import kernels as gain_map_kernels
from relume.image.files.gain_map.metadata import GainMapMetadata
from relume.image.files.metadata import icc_profile
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
        warnings.warn(
            f"{path}: its colour profile is damaged or none of primaries and curves; taken for sRGB", stacklevel=6
        )
        return icc_profile.srgb()
    return parsed


def bright(given: Pictures) -> np.ndarray:
    """(H, W, 3) float32, the bright picture in Rec. 709 primaries, 1 = the base's white."""
    height, width = given.base.shape[:2]
    result = np.empty((height, width, 3), np.float32)
    tables = _tables(given)

    def work(begin: int, end: int) -> None:
        _rows(given, tables, begin, end, result[begin:end])

    in_threads(work, height, chunk=_ROWS)
    return result


def luminance(pixels: np.ndarray) -> np.ndarray:
    """(...) float32 of (..., 3) linear Rec. 709."""
    return pixels @ np.array([0.2126, 0.7152, 0.0722], np.float32)


def _tables(given: Pictures) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The matrix into the gains' primaries, each code's factor, and the parameters as the kernel has them."""
    metadata = given.metadata
    same = given.base_primaries.is_close(given.gain_primaries)
    mixing = np.eye(3) if same else between(given.base_primaries, given.gain_primaries)
    low, high, gamma = (np.array(three) for three in (metadata.low, metadata.high, metadata.gamma))
    gains = np.exp2(low + (high - low) * np.linspace(0, 1, 256)[:, None] ** (1 / gamma))
    parameters = np.array([low, high - low, 1 / gamma, metadata.base_offset, metadata.bright_offset])
    return mixing.astype(np.float32), gains.astype(np.float32), parameters.astype(np.float32)


def _rows(
    given: Pictures, tables: tuple[np.ndarray, np.ndarray, np.ndarray], begin: int, end: int, result: np.ndarray
) -> None:
    mixing, gains, parameters = tables
    gain_map_kernels.bright_rows(given.base, given.curves, mixing, given.codes, gains, parameters, begin, end, result)
    if not given.gain_primaries.is_close(REC709):
        result[:] = mixed(result, between(given.gain_primaries, REC709))
