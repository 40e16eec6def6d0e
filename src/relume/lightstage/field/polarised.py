"""Specular and diffuse parts of a subject that was taken twice through polarisers (Debevec et al. 2000, §4.1, Fig. 9).

With the camera's polariser along the light's, a picture holds the specular part and half of the diffuse one; across
it, half of the diffuse part alone, for light from below the surface has lost its polarisation.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from relume.errors import warn
from relume.lightstage.blocks import sum_of_lights
from relume.lightstage.field.field import Derived, Noise, ReflectanceField

SAME_DIRECTION = 1e-3
"""Radians: lights of the two takes that are nearer than this are the same one."""
REACH = 5
"""Pixels that a take is tried to be shifted by, either way."""
DARKER = 0.98
"""A crossed take must hold less than this share of the parallel one's light. A surface of index 1.5 reflects 0.04 of
the light or more, so that even over a white body, whose half is 0.5, the share is 0.93."""
CLEARLY = 0.8
"""A shift must leave fewer than this share of the unlike pixels to be believed."""


@dataclass(frozen=True, eq=False)
class PolarisedPair:
    """Two takes of one subject under the same lights, separated block by block.

    parallel : with the polarisers along each other: S + D/2
    crossed : across each other: D/2

    The specular part is parallel − crossed and the diffuse one 2 × crossed; together they are parallel + crossed, the
    subject without polarisers. Noise makes values of the specular part that are below 0; they stay, so that sums over
    lights are unbiased.
    Raises ValueError where the takes differ in size or lights, seem to be swapped or are equally bright; warns where
    one is shifted by a pixel or more.
    """

    parallel: ReflectanceField
    crossed: ReflectanceField

    def __post_init__(self) -> None:
        first, second = self.parallel, self.crossed
        if first.shape != second.shape:
            raise ValueError(
                f"the parallel take is {first.shape[1]}×{first.shape[0]} pixels and the crossed one "
                f"{second.shape[1]}×{second.shape[0]}; take both with one camera"
            )
        if len(first.lights) != len(second.lights):
            raise ValueError(
                f"the parallel take has {len(first.lights)} lights and the crossed one {len(second.lights)}; "
                "expected the same ones"
            )
        apart = np.linalg.norm(first.lights.directions - second.lights.directions, axis=1)
        if apart.max() > SAME_DIRECTION:
            odd = int(np.argmax(apart))
            raise ValueError(
                f'the light "{first.lights.names[odd]}" of the parallel take is "{second.lights.names[odd]}" of the '
                f"crossed one, {np.degrees(apart[odd]):.2f}° away; give both takes the same lights in the same order"
            )
        bright, dark = sum_of_lights(first), sum_of_lights(second)
        if DARKER * dark.sum() > bright.sum():
            raise ValueError("the crossed take is brighter than the parallel one; swap the two")
        if dark.sum() >= DARKER * bright.sum():
            raise ValueError(_alike(bright, dark))
        across, down = _shift(bright, dark)
        if (across, down) != (0, 0):
            warn(
                f"the crossed take is shifted by ({across:+d}, {down:+d}) pixels against the parallel one; align "
                "them, or edges pass for highlights"
            )

    @property
    def diffuse(self) -> PolarisedPart:
        """The diffuse reflectance field, 2 × crossed."""
        return PolarisedPart(self.parallel, self.crossed, specular=False)

    @property
    def specular(self) -> PolarisedPart:
        """The specular reflectance field, parallel − crossed."""
        return PolarisedPart(self.parallel, self.crossed, specular=True)


@dataclass(frozen=True, eq=False)
class PolarisedPart(Derived):
    """One part of a polarised pair, whose parallel take is `field`, as a reflectance field."""

    field: ReflectanceField
    crossed: ReflectanceField
    specular: bool

    @property
    def noise(self) -> Noise | None:
        """Of 2 × crossed: four times its constant, twice its slope. Of the difference: the sum of both variances,
        which its own values give only where neither depends on the light; else unknown."""
        first, second = self.field.noise, self.crossed.noise
        if not self.specular:
            return None if second is None else Noise(4 * second.constant, 2 * second.slope)
        if first is None or second is None or first.slope or second.slope:
            return None
        return Noise(first.constant + second.constant)

    def block(self, lights: slice, rows: slice) -> np.ndarray:
        crossed = self.crossed.block(lights, rows)
        return self.field.block(lights, rows) - crossed if self.specular else 2 * crossed


def _alike(bright: np.ndarray, dark: np.ndarray) -> str:
    """What is wrong with takes that are equally bright."""
    if not bright.any():
        return "both takes are black; expected pictures of a subject through polarisers"
    if np.array_equal(bright, dark):
        return "the crossed take is the parallel one itself; give the other take"
    return (
        f"the crossed take holds {dark.sum() / bright.sum():.1%} of the parallel one's light, and nothing is left for "
        "highlights; turn its polariser by 90°, or, if the subject is all matte, use no polarisers"
    )


def _shift(first: np.ndarray, second: np.ndarray) -> tuple[int, int]:
    """Whole pixels (right, down) from the first picture to the second; 0, 0 unless another shift is clearly better.

    Pictures are compared as above or below the subject's median: that depends neither on brightness nor on
    highlights, which only one of them has (Ward 2003).
    """
    if min(first.shape) < 8 * REACH:  # too small to compare
        return 0, 0
    above = [picture > np.median(picture[picture > 0.05 * picture.mean()]) for picture in (first, second)]
    inner = above[0][REACH:-REACH, REACH:-REACH]
    height, width = inner.shape
    span = range(-REACH, REACH + 1)
    unlike = {
        (across, down): np.count_nonzero(
            inner ^ above[1][REACH + down : REACH + down + height, REACH + across : REACH + across + width]
        )
        for across in span
        for down in span
    }
    best = min(unlike, key=lambda shift: (unlike[shift], abs(shift[0]) + abs(shift[1])))
    return best if unlike[best] < CLEARLY * unlike[0, 0] else (0, 0)
