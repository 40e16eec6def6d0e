"""Whether plate and light belong together: one scale, one white, one place, one time.

What both show is compared. A pixel of the plate shows a place on a real surface or on the distant scene, and the map
of the light shows that place too, as seen from the probe. Where they agree but for a factor, the factor is the scale
between them and its colour the difference of their whites. Walls count before tables: seen along its surface from a
ball that stands on it, a table shines with what is mirrored in it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from relume.errors import warn
from relume.image.colour import luminance
from relume.image.radiance import RadianceMap
from relume.project.insertion.photographs import Calibrated
from relume.project.insertion.place import bare_place, turned_light
from relume.project.insertion.unknown_scale import (
    CONTRADICTED,
    FEWEST,
    SAME,
    Scale,
    by_reflectance,
    by_usual_places,
)
from relume.project.shot_file.shot import Shot
from relume.renderers.mitsuba.distant import wall_distances
from relume.renderers.raytrace.raycast import RayCaster
from relume.scene.cameras.camera import Camera
from relume.scene.scene import Scene
from relume.sphere.directions import UP, normalised
from relume.sphere.environment_map import EnvironmentMap

ACROSS = 64
"""Places across the plate that are compared: each so wide that a tape measure's error moves it by less."""
ROWS = 128
"""Rows of the map that they are looked up in, 1.4° each."""
NEAR = 0.15
"""Of the camera's distance to the probe: nearer to the probe than this a place is hidden by the ball, or mirrors it."""
ALIKE = 0.5
"""Correlation of ln luminance from which on plate and light show the same place."""
UNLIKE = 0.2
"""Correlation below which they do not."""
CONTRAST = 0.35
"""Standard deviation of ln luminance from which on a picture has something to be compared by."""
SPREAD = float(np.log(2))
"""Standard deviation of the ln of the ratios up to which their median is a scale."""
EVEN = 0.06
"""The same of an even wall that both show: 0.02 in the room of the examples, 0.05 to 0.6 where its light is turned."""
LOST = 1.2
"""Times as bright as the ball shows it that the plate shows a place, from which on the ball took some of the light."""
DOUBTED = 1.0
"""Stops by which the scale by exposures may differ from what both show before it is doubted."""
WHITE = 0.15
"""Stops between channels from which on whites are said to differ."""
ELSEWHERE = 0.2
"""The effect of a light that may be another place's: a frame that was measured badly looks alike."""


@dataclass(frozen=True, eq=False)
class SeenByBoth:
    """Plate and light at the places that both show.

    ratio : (3,) the plate's radiance over the light's, median
    white : (3,) the same of each place's colour alone: factors on the light's channels, of luminance 1, that give it
        the plate's white
    white_spread : standard deviation of the ln of the two channels' ratio that differ most in `white`, by its median
        deviation
    spread : standard deviation of the ln of their luminances' ratio, by its median deviation
    likeness : correlation of their ln luminance; None where one of them is too even to say
    share : of the plate that was compared
    distant : whether the places lie on the distant scene, not on real surfaces near the probe
    """

    ratio: np.ndarray
    white: np.ndarray
    white_spread: float
    spread: float
    likeness: float | None
    share: float
    distant: bool

    @property
    def unlike(self) -> bool:
        """Whether they do not show the same place."""
        return self.spread > SPREAD if self.likeness is None else self.likeness < UNLIKE

    @property
    def alike(self) -> bool:
        """Whether they show the same place, their colours included."""
        return self.distant and (self.spread < EVEN if self.likeness is None else self.likeness > ALIKE)

    @property
    def scale(self) -> float:
        """The factor on the light that makes both alike."""
        return float(luminance(self.ratio))


def on_one_scale(shot: Shot, calibrated: Calibrated, camera: Camera) -> Calibrated:
    """The same with the light on the plate's scale and with its white, as far as they can be found; warns of each.

    camera : the plate's
    Raises InvalidShot where the place cannot be made.
    """
    gains = gains_on_one_scale(shot, calibrated, camera)
    if np.all(gains == 1):
        return calibrated
    light = calibrated.probe.light
    scaled = replace(light, radiance=(light.radiance * gains).astype(np.float32))
    return replace(calibrated, probe=replace(calibrated.probe, light=scaled))


def gains_on_one_scale(shot: Shot, calibrated: Calibrated, camera: Camera) -> np.ndarray:
    """(3,) factors on the light's channels that put it on the plate's scale and give it its white; warns of each.

    A place of its own radiance is no measured light: what the shot says of its scale holds.
    Raises InvalidShot where the place cannot be made.
    """
    if shot.light.distant.radiance == "own":
        return np.ones(3) * (1.0 if shot.light.scale is None else shot.light.scale)
    place = bare_place(shot, calibrated.probe, calibrated.centre, calibrated.joined)
    seen = seen_by_both(calibrated, camera, place)
    gains = np.ones(3)
    if shot.light.scale is not None:
        gains = gains * shot.light.scale
    elif calibrated.untied is not None or shot.light.surface_reflectance is not None:
        scale = _scale(shot, calibrated, camera, place, seen)
        gains = gains * scale.factor
        if calibrated.untied is not None:
            warn(scale.line(calibrated.untied), effect=scale.effect)
    elif seen is not None and seen.spread < SPREAD and abs(np.log2(seen.scale)) > DOUBTED:
        direction, times = ("bright", seen.scale) if seen.scale > 1 else ("dark", 1 / seen.scale)
        if shot.name_of_light() is None:
            what, why = "the ball's photographs", "were both taken in one light, at the exposures that they hold?"
        else:
            what, why = f"{shot.name_of_light()}", "are both on one scale, of one light?"
        warn(
            f"light: the plate shows the same places {times:.2g} times as {direction} as {what}; {why} If not, give "
            "light.scale",
            effect=abs(seen.scale - 1),
        )
    elif seen is not None and seen.alike and seen.spread < SAME and seen.scale > LOST and shot.light.ball is not None:
        warn(
            f"light: the plate shows the same places {seen.scale:.2f} times as bright as the ball does; a ball that "
            f"reflects {1 / seen.scale:.2f} of the light would: give light.ball.reflectance, or light.scale",
            effect=1 - 1 / seen.scale,
        )
    if seen is not None and seen.unlike:
        warn(
            f"light: what plate and light should both show is not alike in {seen.share:.0%} of the plate: is the light "
            "of another place or time, or is its frame turned (light.heading, the places of the ball's cameras)?",
            effect=ELSEWHERE,
        )
    return gains if isinstance(shot.light.scale, tuple) else gains * _white(calibrated, seen)


def seen_by_both(calibrated: Calibrated, camera: Camera, place: Scene) -> SeenByBoth | None:
    """Plate and light at the places that both show; None where there are too few.

    place : without objects; its light is looked up from its probe
    """
    plate, probe = calibrated.plate, np.array(place.probe)
    colours, points = _coarse(plate, max(1, camera.width // ACROSS))
    rays, eyes = (each.reshape(-1, 3) for each in (camera.rays_through(points), camera.eyes(points)))
    colours = colours.reshape(-1, 3)
    # Where each ray ends: on a real surface, on the distant scene, or at infinity, where its direction is all there is.
    surfaces = RayCaster.of(place.local)
    near = surfaces.nearest(eyes, rays).distance
    far = wall_distances(place.distant, eyes, rays)
    distant = ~(near < far)
    reach = np.minimum(near, far)
    ends = eyes + np.where(np.isfinite(reach), reach, 0.0)[:, None] * rays
    away = np.linalg.norm(ends - probe, axis=-1)
    apart = ~np.isfinite(reach) | (away > NEAR * np.linalg.norm(camera.position - probe))
    towards = np.where(np.isfinite(reach)[:, None], normalised(np.where(apart[:, None], ends - probe, rays)), rays)
    # What a real surface hides from the probe is not in the light: below a ball on a table is the table.
    limits = np.where(np.isfinite(reach), 0.999 * away, np.inf)
    apart &= ~surfaces.occluded(probe, towards, limits)
    # What the light shows there.
    shown = _looked_up(place.light, calibrated.probe.confidence, towards)
    known = apart & np.all(np.isfinite(colours) & (colours > 0), axis=-1) & np.all(shown > 0, axis=-1)
    walls = bool((known & distant).sum() >= FEWEST)
    chosen = known & distant if walls else known
    if chosen.sum() < FEWEST:
        return None
    ratios = np.log(colours[chosen] / shown[chosen])
    ratio = np.exp(np.median(ratios, axis=0))
    ours, theirs = (np.log(luminance(each[chosen])) for each in (colours, shown))
    even = min(ours.std(), theirs.std()) < CONTRAST
    likeness = None if even else float(np.corrcoef(ours, theirs)[0, 1])
    # Brightness differs more from place to place than colour does, and would take the channels' medians apart.
    colour = ratios - (ours - theirs)[:, None]
    white = np.exp(np.median(colour, axis=0))
    extreme = colour[:, np.argmax(white)] - colour[:, np.argmin(white)]
    return SeenByBoth(
        ratio, white / luminance(white), _deviation(extreme), _deviation(ours - theirs), likeness,
        float(chosen.mean()), walls,
    )  # fmt: skip


def _deviation(values: np.ndarray) -> float:
    """The standard deviation by the median deviation from the median."""
    return 1.4826 * float(np.median(np.abs(values - np.median(values))))


def _coarse(plate: RadianceMap, step: int) -> tuple[np.ndarray, np.ndarray]:
    """Means (h, w, 3) over squares of `step` pixels, NaN where any was not measured, and their middles (h, w, 2)."""
    height, width = (n // step for n in plate.radiance.shape[:2])
    blocks = plate.radiance[: height * step, : width * step].reshape(height, step, width, step, 3)
    means = blocks.mean((1, 3), dtype=np.float64)
    if plate.clipped is not None:
        marks = plate.clipped[: height * step, : width * step].reshape(height, step, width, step)
        means[(marks != 0).any((1, 3))] = np.nan
    x, y = (np.arange(width) + 0.5) * step, (np.arange(height) + 0.5) * step
    return means, np.stack(np.broadcast_arrays(x[None, :], y[:, None]), axis=-1)


def _looked_up(light: EnvironmentMap, confidence: np.ndarray, directions: np.ndarray) -> np.ndarray:
    """The light (N, 3) from directions (N, 3), coarsely; 0 where it was not measured."""
    coarse = light if light.size <= ROWS else light.remapped(light.mapping, ROWS)
    points = light.mapping.image_points(directions)
    outside = np.isnan(points[:, 0])
    rows, columns = light.radiance.shape[:2]
    x, y = (np.where(outside, 0, points[:, i] * n).astype(int).clip(0, n - 1) for i, n in ((0, columns), (1, rows)))
    unknown = outside | (confidence[y, x] == 0)
    if light.clipped is not None:
        unknown |= light.clipped[y, x] != 0
    return np.where(unknown[:, None], 0.0, coarse.lookup(directions))


def _scale(shot: Shot, calibrated: Calibrated, camera: Camera, place: Scene, seen: SeenByBoth | None) -> Scale:
    """The factor on a light of unknown scale, why that, and by what share it may be wrong."""
    arriving = float(luminance(turned_light(calibrated.probe.light, shot.light.heading, 0.0).irradiance(UP)))
    if not arriving > 0:
        return Scale(1.0, "for it brings no light from above", 1.0)
    step = max(1, camera.width // ACROSS)
    colours, points = _coarse(calibrated.plate, step)
    whites, _ = _coarse(replace(calibrated.plate, clipped=None), step)
    rays, eyes = (each.reshape(-1, 3) for each in (camera.rays_through(points), camera.eyes(points)))
    hits = RayCaster.of(place.local).nearest(eyes, rays).shape
    brightness, bright = (luminance(each.reshape(-1, 3)) for each in (colours, whites))
    given = by_reflectance(shot, place, brightness, hits, arriving)
    if given is not None:
        return given
    usual = by_usual_places(brightness, bright, hits, arriving)
    if seen is None or seen.unlike or seen.spread >= SPREAD:
        return usual
    # Pictures of two places are a little alike by chance: bright above, dark below, or a table and a floor both even.
    contradicted = not 1 / CONTRADICTED < seen.scale / usual.factor < CONTRADICTED
    if not seen.alike and (seen.likeness is None or contradicted):
        return usual
    if abs(np.log(seen.scale)) < SAME:
        return Scale(1.0, "as plate and light show the same places alike", 0.1)
    return Scale(
        seen.scale, f"by which what both show is equally bright, to a factor of {np.exp(seen.spread):.2g}", 0.2
    )


def _white(calibrated: Calibrated, seen: SeenByBoth | None) -> np.ndarray:
    """(3,) factors that give the light the plate's white; 1 where they agree, or nothing shows it."""
    if seen is None or not seen.alike or seen.spread > SPREAD:
        return np.ones(3)
    bracket = calibrated.bracket
    fixed = bracket is not None and all(each.settings.automatic_white is False for each in bracket.photographs)
    if fixed and len(calibrated.cameras) == 1 and calibrated.untied is None:
        return np.ones(3)
    stops, scatter = np.log2(seen.white), seen.white_spread / np.log(2)
    contrast = float(np.ptp(stops))
    if contrast < WHITE:
        return np.ones(3)
    other = (
        f"light: the plate's white is another than the light's (red {stops[0]:+.2f}, green {stops[1]:+.2f}, blue "
        f"{stops[2]:+.2f} stops, by what both show)"
    )
    # Where places differ from one another by more than that, smeared light or other things may have been compared.
    if contrast < scatter:
        warn(
            f"{other}, but by {scatter:.2f} stops from place to place, so it is left as it is: photograph both with "
            "one camera and a fixed white balance, or give a tinted ball's light.ball.reflectance",
            effect=float(np.exp2(contrast / 2) - 1),
        )
        return np.ones(3)
    warn(
        f"{other}, as automatic white balance or an unknown curve makes it; it is given the plate's: photograph both "
        "with one camera and a fixed white balance",
        effect=float(np.exp2(scatter / 2) - 1),
    )
    return seen.white
