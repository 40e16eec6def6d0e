"""What the user should know of an insertion's measurements, and how much each matters to the light."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from relume.composite.borders import changed_borders
from relume.errors import Doubt
from relume.image.colour import luminance
from relume.image.radiance import BLACK, SATURATED
from relume.project.insertion.photographs import Calibrated
from relume.project.insertion.place import Place
from relume.project.schema import Vector
from relume.renderers.projective.place_light import CLEAR, Arriving
from relume.renderers.projective.shining_meshes import place_of
from relume.renderers.raytrace.raycast import RayCaster
from relume.renderers.results import Change
from relume.scene.materials.materials import Material, is_image
from relume.scene.shapes.shapes import Mesh, Shape

DARK = 0.03
"""The reflectance of coal and of black velvet: hardly anything reflects less."""
BRIGHT = 0.9
"""The reflectance of white paper and of snow: hardly anything reflects more."""
BORDERS = 3
"""Borders that are named, at most."""
COMPARED = 20_000
"""Pixels of the plate that are compared with a place of its own radiance."""
COMMON = 0.02
"""Share of them that has to show the place."""
APART = 0.25
"""Stops by which the two may differ before it is said: seams and blur of photographs are below a fifth of one."""
TWO_CAMERAS = 0.2
"""By what share two cameras' scales differ, usually: their ISO and aperture are true to a quarter of a stop or so."""


def doubts_on(
    calibrated: Calibrated, place: Place, matte_of_objects: np.ndarray | None, scale: float | Vector | None
) -> tuple[Doubt, ...]:
    """What the user should know of the measurements.

    matte_of_objects : None where there are no objects
    scale : by which the light was multiplied already; None where the shot gives none
    """
    return (
        *calibrated.probe.notes, *_of_clipping(calibrated), *_of_surfaces(place), *_of_cameras(calibrated),
        *_of_shining(calibrated, place, 1.0 if scale is None else scale),
        *([_unseen()] if matte_of_objects is not None and not matte_of_objects.any() else []),
    )  # fmt: skip


def doubts_at_borders(
    calibrated: Calibrated, place: Place, change: Change, objects: Sequence[Shape]
) -> tuple[Doubt, ...]:
    """Where the objects still change the picture at the end of a real surface, the most first."""
    if not place.bare.local or not objects:
        return ()
    found = changed_borders(change, calibrated.plate, place.camera, place.bare.local, objects)
    return tuple(Doubt(each.line(), abs(each.change)) for each in found[:BORDERS])


def _unseen() -> Doubt:
    line = "no object is seen in the picture; are they in metres, and in the frame that the camera is in?"
    return Doubt(line, 1.0)


def _of_clipping(calibrated: Calibrated) -> Iterator[Doubt]:
    plate, probe = calibrated.plate, calibrated.probe
    if plate.clipped is not None and plate.clipped.any():
        white, black = int((plate.clipped == SATURATED).sum()), int((plate.clipped == BLACK).sum())
        single = calibrated.bracket is not None and len(calibrated.bracket.photographs) == 1
        if white and single:
            line = f"{white} pixels of the plate are white and stay so; what is seen through a shadow there is a guess"
            yield Doubt(line, 0.1 * white / plate.clipped.size)
        elif white:
            # Of what is white the reflectance is not known; it matters where the objects shadow it.
            yield Doubt(
                f"{white} pixels of the plate are white in every photograph; take shorter exposures as well",
                0.1 * white / plate.clipped.size,
            )
        if black and not single:
            line = f"{black} pixels of the plate are black in every photograph; take longer exposures as well"
            yield Doubt(line, 0.01 * black / plate.clipped.size)
    if probe.clipped_solid_angle > 0:
        yield Doubt(
            f"{probe.clipped_solid_angle:.2g} sr of the light are saturated in every photograph: the light is a lower "
            "bound there; add shorter exposures of the ball",
            probe.share(SATURATED),
        )


def _of_surfaces(place: Place) -> Iterator[Doubt]:
    recovered = place.recovered
    if recovered is None:
        return
    yield from (Doubt(line) for line in recovered.notes)
    for found in recovered.surfaces:
        if found.measured is None:
            continue
        brightest = max(found.measured)
        if brightest < DARK:
            stops = np.log2(0.2 / max(brightest, 1e-6))
            yield Doubt(
                f"the surface reflects only {brightest:.2g} of the light that was measured, less than coal; "
                f"the light is far too strong for the plate (are the exposures of both right?), by some {stops:.0f} "
                "stops if the surface is a usual one",
                DARK / max(brightest, 1e-6),
            )
        if brightest > 1:
            yield Doubt(
                f"the surface reflects {brightest:.2f} times the light that was measured; the light is too "
                "weak (was the ball's reflectance given? were its lamps saturated?)",
                brightest / BRIGHT - 1,
            )


def _of_shining(calibrated: Calibrated, place: Place, scale: float | Vector) -> Iterator[Doubt]:
    """Whether a place of its own radiance is as bright as the plate where the camera sees it."""
    shining = [shape for shape in place.bare.local if isinstance(shape, Mesh) and _shines(shape)]
    if not shining:
        return
    plate, camera = calibrated.plate.radiance, place.camera
    step = max(1, round((plate.shape[0] * plate.shape[1] / COMPARED) ** 0.5))
    rays = camera.rays()[step // 2 :: step, step // 2 :: step].reshape(-1, 3)
    eyes = camera.eyes(camera.middles())[step // 2 :: step, step // 2 :: step].reshape(-1, 3)
    light = Arriving(place_of(shining))
    shown = luminance(light.along(eyes, rays))
    seen = luminance(plate[step // 2 :: step, step // 2 :: step].reshape(-1, 3))
    # What takes light may hide what shines, or lie on it: the plate shows that, which this place does not know.
    others = RayCaster.of([shape for shape in place.bare.local if not (isinstance(shape, Mesh) and _shines(shape))])
    behind = light.caster.nearest(eyes, rays, beyond=CLEAR).distance
    both = (shown > 0) & (seen > 0) & (others.nearest(eyes, rays).distance > behind + CLEAR)
    if both.mean() < COMMON:
        return
    ratio = float(np.median(seen[both] / shown[both]))
    if abs(np.log2(ratio)) > APART:
        # The place was multiplied by the present scale before it was compared.
        wanted = ", ".join(f"{ratio * each:.3g}" for each in np.atleast_1d(scale))
        yield Doubt(
            f"the plate is {ratio:.2g} times as bright as light.distant where both show one place; if the photographs "
            f"on it are of another exposure, give light.scale = {wanted if np.ndim(scale) == 0 else f'[{wanted}]'}",
            abs(float(np.log2(ratio))),
        )


def _shines(mesh: Mesh) -> bool:
    return isinstance(mesh.material, Material) and is_image(mesh.material.emission)


def _of_cameras(calibrated: Calibrated) -> Iterator[Doubt]:
    if len(calibrated.cameras) > 1 and calibrated.untied is None:
        yield Doubt(
            "plate and light come from different cameras: only their exposures tie their scales, to about half a stop; "
            "give light.scale if the objects come out too dark or too bright",
            TWO_CAMERAS,
        )
