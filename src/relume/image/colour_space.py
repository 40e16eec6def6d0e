"""What the codes of a photograph stand for: the primaries and curves of its ICC profile, and the way to Rec. 709.

A camera's response is found from codes, each channel by itself (Debevec & Malik 1997, §2.1), and leads to linear
values of the primaries that the photograph was written in. Only these are mixed into Rec. 709: codes that were mixed
before, or values of another curve, would be no light. A photograph without a profile is sRGB.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache

import numpy as np

from relume.image.bands import in_threads
from relume.image.colour import decode_srgb
from relume.image.files.metadata import icc_profile
from relume.image.files.metadata.icc_profile import Profile
from relume.image.photograph import Photograph
from relume.image.primaries import REC709, between, converted, mixed
from relume.image.radiance import RadianceMap
from relume.image.response import Response

_SAME_CURVE = 0.004  # of white, one code of 255; profiles of one colour space are rounded in many ways
_SHADE = 0.25  # of the first code's light: what the code 0 stands for where a logarithm of it is wanted
_ROWS = 64  # of a picture at a time


def colour_space_of(photograph: Photograph) -> Profile | None:
    """The primaries and the curves at all codes of a photograph; None for sRGB, and where nothing is known."""
    if photograph.profile is None:
        return None
    return _space(photograph.profile, int(np.iinfo(photograph.pixels.dtype).max) + 1)


def name_of(photograph: Photograph) -> str:
    """Of a photograph's colour space, as programs show it: "Display P3"; "sRGB" where it is that, or not known."""
    if photograph.profile is None or colour_space_of(photograph) is None:
        return "sRGB"
    return icc_profile.description(photograph.profile)


def first_apart(photographs: Sequence[Photograph]) -> int | None:
    """The index of the first photograph in another colour space than the first of all; None where all have one."""
    spaces = [colour_space_of(photograph) for photograph in photographs]
    for index, space in enumerate(spaces):
        if (space is None) != (spaces[0] is None):
            return index
        if space is not None and spaces[0] is not None and not _same(space, spaces[0]):
            return index
    return None


def decoded(photograph: Photograph) -> np.ndarray:
    """(H, W, 3) float32 linear Rec. 709 of a photograph, white 1, as its profile has it, else sRGB.

    Colours outside Rec. 709 have a negative channel.
    """
    space, codes = colour_space_of(photograph), photograph.pixels
    if space is None:
        return decode_srgb(codes / np.float32(np.iinfo(codes.dtype).max))
    linear = np.stack([space.curves[codes[..., channel], channel] for channel in range(3)], axis=-1)
    return mixed(linear, between(space.primaries, REC709))


def response_of(photograph: Photograph) -> Response | None:
    """The curves of a photograph's profile as a camera's response, exposure 1 white; None for sRGB.

    Its only noise is that of rounding. The code 0 has no logarithm: it stands for a quarter of the least light.
    """
    if (space := colour_space_of(photograph)) is None:
        return None
    curves = space.curves.astype(np.float64)
    light = np.maximum.accumulate(np.maximum(curves, _SHADE * curves[curves > 0].min()), axis=0)
    # A response rises; a curve may stand still, by no more than its own rounding.
    rising = np.log(light) + 1e-9 * np.arange(len(light))[:, None]
    return Response(rising.T.copy(), np.full(3, np.sqrt(1 / 12)))


def in_rec709(picture: RadianceMap, photograph: Photograph) -> RadianceMap:
    """A map of linear values that a photograph's own channels gave, in Rec. 709; itself where they are that already.

    Its attribute `primaries` then holds the photograph's. An infinite variance, of a channel that no photograph
    measured, stays with its channel; in the others, to which it gives a small share, its bound counts as uncertain by
    the whole of itself.
    """
    space = colour_space_of(photograph)
    if space is None or space.primaries.is_close(REC709):
        return picture
    matrix = between(space.primaries, REC709)
    result = converted(replace(picture, variance=None), matrix, space.primaries)
    if picture.variance is None:
        return result
    radiance, given = picture.radiance, picture.variance
    variance = np.empty_like(given)

    def work(begin: int, end: int) -> None:
        unknown = np.isinf(given[begin:end])
        with np.errstate(over="ignore"):
            known = np.where(unknown, np.square(radiance[begin:end]), given[begin:end])
        variance[begin:end] = mixed(known, matrix**2)
        variance[begin:end][unknown] = np.inf

    in_threads(work, len(given), chunk=_ROWS)
    return replace(result, variance=variance)


def to_own_primaries(pixels: np.ndarray, photograph: Photograph) -> np.ndarray:
    """Linear Rec. 709 pixels (H, W, 3) in the primaries of a photograph, in which it is developed."""
    space = colour_space_of(photograph)
    if space is None or space.primaries.is_close(REC709):
        return pixels
    return mixed(pixels, between(REC709, space.primaries))


@lru_cache(maxsize=8)
def _space(profile: bytes, levels: int) -> Profile | None:
    space = icc_profile.parsed(profile, levels)
    return None if space is None or _same(space, icc_profile.srgb(levels)) else space


def _same(first: Profile, second: Profile) -> bool:
    near = np.abs(first.curves - second.curves).max() < _SAME_CURVE
    return bool(near) and first.primaries.is_close(second.primaries)
