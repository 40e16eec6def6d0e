"""The scale of a light that no exposure ties to the plate: a finished map beside a photograph.

What ties them, in this order: a reflectance that is given, places that both show, and what usual places look like. Of
the last a table's reflectance alone is a bad measure, 0.05 of a desk and 0.8 of paper: the plate's whites are looked at
too. Something white in the light of the place is about as bright as the brightest parts of the plate.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from relume.errors import InvalidShot, per_cent
from relume.image.colour import luminance
from relume.project.shot_file.shot import Shot
from relume.scene.scene import Scene
from relume.scene.shapes.shapes import Plane

FEWEST = 60
"""Places of the plate from which on something is said."""
WHITES = 97
"""Percentile of the plate's luminance that counts as its whites: above are lamps, gleams and windows."""
MIDDLE = 0.4
"""The geometric mean of what the surface's median and the plate's whites reflect. Seven places of which the scale is
known have 0.2 to 0.57 (decision 34); the surface alone has 0.08 to 0.4, the whites 0.4 to 1.9."""
UNSURE = 0.3
"""By what share the light is wrong by that guess: half a stop either way is usual, a whole one happens."""
LEFT = 2.0
"""Factor within which that guess cannot refute that the map is on the plate's scale already, as relume's maps are."""
CONTRADICTED = 4.0
"""Factor by which places that look a little alike may contradict that guess before they are not believed."""
SAME = float(np.log(1.5))
"""Of a scale: what gloss and the tape measure make of two pictures of one place; a scale so near to 1 is left."""


@dataclass(frozen=True)
class Scale:
    """A factor on the light.

    factor : that puts it on the plate's scale
    why : what gives it, to go on with after "it is made … times as bright, "
    effect : by what share it is likely wrong
    """

    factor: float
    why: str
    effect: float

    @property
    def guessed(self) -> bool:
        """Whether nothing but usual places give it."""
        return self.effect >= UNSURE

    def line(self, untied: str) -> str:
        """What a user should know of it, and what to do.

        untied : why no exposure gives it
        """
        changed = "it is taken as it is" if self.factor == 1 else f"it is made {self.factor:.3g} times as bright"
        line = f"light: {untied}, so no exposure gives its scale; {changed}, {self.why}: "
        if not self.guessed:
            return line + "give light.scale if the objects come out too dark or too bright"
        return (
            f"{line}a guess, wrong by half a stop mostly; give light.surface_reflectance, the share of light that the "
            "surface under the objects gives back (white paper 0.8, light wood 0.4, asphalt 0.1), or, after a look at "
            f"the composite, light.scale: {self.factor / 2:.3g} makes the objects half as bright and "
            f"{2 * self.factor:.3g} twice as bright"
        )


def by_reflectance(shot: Shot, place: Scene, brightness: np.ndarray, hits: np.ndarray, arriving: float) -> Scale | None:
    """The scale from L = ρ E / π, where a reflectance is given; None where none is, or the plate does not show it.

    brightness : (N,) luminance of the plate's places, NaN where it was not measured
    hits : (N,) index of the real surface that each shows, −1 for none
    arriving : irradiance from above by the light as it is
    Raises InvalidShot for a reflectance of what the plate does not show.
    """
    measured = np.isfinite(brightness)
    if (share := shot.light.surface_reflectance) is not None:
        there = measured & (hits >= 0)
        if there.sum() < FEWEST:
            raise InvalidShot("light.surface_reflectance: the plate hardly shows a real surface; give light.scale")
        wanted = float(np.median(brightness[there])) * np.pi / share
        return Scale(wanted / arriving, f"by light.surface_reflectance {share:g}", 0.1)
    for index, table in enumerate(shot.surfaces()):
        if isinstance(table.reflectance, str) or table.mirror or len(shot.surfaces()) != len(place.local):
            continue
        there, share = measured & (hits == index), float(luminance(np.array(table.reflectance)))
        # What reflects nothing says nothing of the light.
        if isinstance(place.local[index], Plane) and share > 0 and there.sum() >= FEWEST:
            wanted = float(np.median(brightness[there])) * np.pi / share
            return Scale(wanted / arriving, "by the reflectance given for what the plate shows", 0.1)
    return None


def by_usual_places(brightness: np.ndarray, whites: np.ndarray, hits: np.ndarray, arriving: float) -> Scale:
    """The scale by which surface and whites of the plate reflect what they usually do.

    whites : (N,) luminance of the plate's places, where it is white too
    The rest as in `by_reflectance`.
    """
    measured = np.isfinite(brightness)
    there = measured & (hits >= 0) if (measured & (hits >= 0)).sum() >= FEWEST else measured
    if not there.any():
        return Scale(1.0, "for the plate is white or black everywhere", 1.0)
    surface = float(np.median(brightness[there]))
    white = max(float(np.percentile(whites[np.isfinite(whites)], WHITES)), surface)
    factor = float(np.sqrt(surface * white)) * np.pi / (arriving * MIDDLE)
    if 1 / LEFT <= factor <= LEFT:
        factor = 1.0
    reflected = [_share(each * np.pi / (arriving * factor)) for each in (surface, white)]
    why = f"by which the real surface reflects {reflected[0]} of it and the plate's whites {reflected[1]}"
    return Scale(factor, why, UNSURE)


def _share(value: float) -> str:
    return per_cent(value) if value < 0.095 else f"{value:.0%}"
