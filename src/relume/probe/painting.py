"""Light from a painting: an encoded picture of an environment whose values are explained (Miller & Hoffman 1984)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from relume.errors import warn
from relume.image.colour import decode_srgb, luminance
from relume.image.colour_space import colour_space_of, decoded, in_rec709
from relume.image.photograph import Photograph
from relume.image.primaries import inside_gamut
from relume.image.radiance import RadianceMap
from relume.sphere.environment_map import EnvironmentMap
from relume.sphere.mappings.mapping import LatLong, Mapping

FAINTEST = 1 / 65535
"""Share of white that stands for black where a mask mixes logarithms: the least above 0 that 16 bits hold."""

Unit = Literal["relative", "cd/m²"]


@dataclass(frozen=True, eq=False)
class HotSpot:
    """Part of a painting that is brighter than paint can be: a lamp, a window, the sun.

    mask : (H, W) float, 0 where the painting stays as it is, 1 where it is as bright as said, or an image (H, W, 3)
        whose mean counts. Between the two logarithms are mixed, so that a soft edge falls off evenly to the eye
    factor : times what the painting shows there, which keeps its detail; exactly one of factor and radiance is given
    radiance : of the spot itself, in the unit of `white`: a number for all channels or one each
    name : for messages
    """

    mask: np.ndarray
    factor: float | None = None
    radiance: float | tuple[float, float, float] | None = None
    name: str = "hot spot"

    def __post_init__(self) -> None:
        if (self.factor is None) == (self.radiance is None):
            raise ValueError(f"{self.name}: give either a factor or a radiance, so that it is known how bright it is")
        value = np.asarray(self.factor if self.radiance is None else self.radiance, np.float64)
        if value.shape not in ((), (3,)) or not np.all(np.isfinite(value)) or value.min() <= 0:
            raise ValueError(f"{self.name} is {value.tolist()} bright; expected a number above 0, or three")
        mask = np.asarray(self.mask)
        if mask.ndim not in (2, 3) or not mask.size or not (mask.min() >= 0 and mask.max() <= 1):
            raise ValueError(f"{self.name}: the mask is {mask.shape}; expected (H, W) numbers from 0 to 1")

    @staticmethod
    def of_picture(
        picture: Photograph,
        *,
        factor: float | None = None,
        stops: float | None = None,
        radiance: float | tuple[float, float, float] | None = None,
    ) -> HotSpot:
        """The spot that a picture's white marks; its grey values are shares of the way, as they are encoded.

        picture : as large as the painting
        factor, radiance : as of the spot itself
        stops : 2^stops is the factor
        """
        if stops is not None:
            if factor is not None:
                raise ValueError(f"{picture.name}: give a factor or stops, not both")
            factor = float(2.0**stops)
        mask = picture.pixels.mean(axis=2, dtype=np.float64) / np.iinfo(picture.pixels.dtype).max
        if picture.outside is not None:
            mask = np.where(picture.outside, 0.0, mask)
        return HotSpot(np.minimum(mask, 1.0), factor, radiance, picture.name)


def environment_from_painting(
    painting: Photograph,
    gamma: float | Literal["srgb"],
    white: float | tuple[float, float, float] = 1.0,
    hot: Sequence[HotSpot] = (),
    *,
    mapping: Mapping = LatLong(),
    unit: Unit = "relative",
) -> EnvironmentMap:
    """The environment map that a painting shows.

    painting : 8 or 16 bits, laid out in `mapping`; where it is transparent it is black
    gamma : of the display it was painted on, 2.2 for most; or "srgb" for the curve of that standard, or of its
        profile. It has no default: half the light of a map hangs on it, and no file holds it for certain
    white : radiance of its white, a number or one a channel; 2^stops for an exposure in stops
    hot : parts that are brighter, each raising what those before have left
    unit : of `white`
    Raises ValueError for a gamma that is none, a painting of another shape than the mapping's, a mask of another size.
    Warns of a painting that is black all over, and of black that a factor was to raise. Without hot spots nothing is
    brighter than white: that is a choice, and not warned of.
    """
    levels = np.iinfo(painting.pixels.dtype).max
    scale = np.broadcast_to(np.asarray(white, np.float64), 3)
    if not np.all(np.isfinite(scale)) or scale.min() <= 0:
        raise ValueError(f"{painting.name}: white is {white}; expected a radiance above 0, or three")
    if colour_space_of(painting) is None:
        light = _decoded(painting.pixels / levels, gamma, painting.name)
    elif gamma == "srgb":
        light = inside_gamut(decoded(painting))
    else:
        own = _decoded(painting.pixels / levels, gamma, painting.name).astype(np.float32)
        light = inside_gamut(in_rec709(RadianceMap(own), painting).radiance)
    radiance = light * scale
    if painting.outside is not None:
        radiance[painting.outside] = 0
    rows, columns = radiance.shape[:2]
    if tuple(mapping.shape(rows)) != (rows, columns):
        raise ValueError(
            f"{painting.name} is {columns}×{rows} pixels, and a {mapping.name} map of {rows} rows is "
            f"{mapping.shape(rows)[1]} wide; scale the painting, or give its mapping"
        )
    if not hot and float(luminance(radiance).max(initial=0)) < 1e-6 * float(scale.max()):
        warn(f"{painting.name}: black all over, so it lights nothing; raise parts of it")
    for spot in hot:
        radiance = _raised(radiance, spot, scale, painting.name)
    return EnvironmentMap(radiance.astype(np.float32), mapping, unit)


def read_gamma(text: str | None, name: str = "the painting") -> float | Literal["srgb"]:
    """The gamma that words of the command line give; raises ValueError where they give none.

    text : a number, like 2.2, or "srgb"; None where nothing was said
    """
    if text is None:
        raise ValueError(
            f"{name}: a painting does not say how bright its values are; say for which display it was painted, "
            "like 2.2, or srgb"
        )
    word = text.strip().lower()
    if word == "srgb":
        return "srgb"
    try:
        gamma = float(word)
    except ValueError:
        gamma = np.nan
    if not 0.1 <= gamma <= 10:
        raise ValueError(f'{name}: "{text}" is no display gamma; write a number, like 2.2, or srgb')
    return gamma


def _decoded(encoded: np.ndarray, gamma: float | Literal["srgb"], name: str) -> np.ndarray:
    if gamma == "srgb":
        return decode_srgb(encoded)
    if isinstance(gamma, str) or not np.isfinite(gamma) or gamma <= 0:
        raise ValueError(f'{name}: gamma is {gamma!r}; expected a number above 0, like 2.2, or "srgb"')
    return np.asarray(encoded, np.float64) ** gamma


def _raised(radiance: np.ndarray, spot: HotSpot, white: np.ndarray, name: str) -> np.ndarray:
    """The painting with one spot at its brightness: ln L moves by the mask's share of the way."""
    mask = np.asarray(spot.mask, np.float64)
    mask = mask if mask.ndim == 2 else mask.mean(axis=2)
    if mask.shape != radiance.shape[:2]:
        raise ValueError(
            f"{spot.name} is {mask.shape[1]}×{mask.shape[0]} pixels, {name} {radiance.shape[1]}×{radiance.shape[0]}; "
            "a mask marks pixels of the painting, so make it as large"
        )
    share = mask[..., None]
    if spot.factor is not None:
        black = int(np.count_nonzero((mask >= 0.5) & ~radiance.any(axis=-1)))
        if black:
            warn(
                f"{spot.name}: {black} pixels of {name} are black there, and stay so times {spot.factor:.6g}; paint "
                "them, or give the spot's radiance"
            )
        return radiance * spot.factor**share
    goal = np.broadcast_to(np.asarray(spot.radiance, np.float64), 3)
    start = np.maximum(radiance, FAINTEST * white)
    raised = np.exp((1 - share) * np.log(start) + share * np.log(goal))
    # Where the mask says nothing the painting stays, its black too.
    return np.where(share > 0, raised, radiance)
