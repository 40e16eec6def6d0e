"""Irradiance measured by matte things of known reflectance: a grey ball, or patches of a chart."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from relume.errors import UnreadableFile
from relume.image.radiance import BLACK, OUTSIDE, SATURATED, RadianceMap
from relume.probe.ball.outline import find_outline
from relume.probe.ball.silhouette import outline_of_circle
from relume.probe.ball.unwrapping import BallView, unwrap_ball
from relume.sphere.directions import normalised

STEEPEST = 0.3
"""Cosine of view below which a ball is not read: paint is not matte at grazing angles, and the rim is mixed with what
lies behind."""
UNMEASURED = 0.01
"""Share of a patch's pixels that may be clipped: dust on the sensor is left out, a saturated patch is refused."""
CELLS = 64
"""Cells across the ball whose pixels are averaged, against noise; coarser ones would blur a sun's terminator."""


@dataclass(frozen=True, eq=False)
class MatteReadings:
    """The irradiance on N surfaces, E = π · radiance / reflectance.

    normals : (N, 3), unit, world
    irradiance : (N, 3), in the light's unit times steradians (lux for cd/m²)
    deviation : (N, 3), standard deviation of the irradiance by the photographs' noise; 0 where that is unknown
    source : what was read, for a person: "a grey ball of albedo 0.18"
    unit : of the radiance they were made from, "relative" or "cd/m²"
    """

    normals: np.ndarray
    irradiance: np.ndarray
    deviation: np.ndarray
    source: str
    unit: str = "relative"

    def __post_init__(self) -> None:
        shapes = [np.shape(each) for each in (self.normals, self.irradiance, self.deviation)]
        if any(shape != (len(self.normals), 3) for shape in shapes) or not len(self.normals):
            raise ValueError(f"normals, irradiance and deviation have shapes {shapes}; expected (N, 3) each, N ≥ 1")


@dataclass(frozen=True)
class ChartPatch:
    """Where a picture shows a patch of a chart, and what is known of it.

    circle : column, row and radius in pixels
    reflectance : (3,) or one number, linear Rec. 709, above 0 and up to 1
    normal : (3,), world, away from the chart
    """

    circle: tuple[float, float, float]
    reflectance: tuple[float, float, float] | float
    normal: tuple[float, float, float]


def measure_chart(picture: RadianceMap, patches: Sequence[ChartPatch], name: str = "the chart") -> MatteReadings:
    """The irradiance on patches of a chart in a picture.

    picture : exposed like the map whose sun is to be recovered
    name : of the picture, for messages

    The patches are taken to be matte. Raises ValueError for no patch, for one that reaches out of the picture, for a
    reflectance that is not above 0 and at most 1, and for a normal that is no direction; UnreadableFile for a patch
    that is clipped or black.
    """
    if not patches:
        raise ValueError("no patch of the chart is given; one is enough, a white one is best")
    scale = np.pi / np.stack([_reflectance(patch.reflectance) for patch in patches])
    normals = np.array([patch.normal for patch in patches], np.float64)
    if not np.all(np.isfinite(normals)) or not np.all(normals.any(-1)):
        raise ValueError(f"a patch faces {normals.tolist()}; a normal is a direction, like (0, 1, 0)")
    radiance, deviation = np.stack([_measured(picture, patch, name) for patch in patches], axis=1)
    several = f"{len(patches)} patches" if len(patches) > 1 else "one patch"
    return MatteReadings(
        normalised(normals), radiance * scale, deviation * scale, f"{several} of a chart", picture.unit
    )


def measure_grey_ball(
    picture: RadianceMap,
    albedo: tuple[float, float, float] | float,
    camera: ArrayLike = (0.0, 0.0, 1.0),
    radius: float = 0.05,
    circle: tuple[float, float, float] | None = None,
    name: str = "",
) -> MatteReadings:
    """The irradiance on all sides of a matte ball in a picture.

    picture : exposed like the map whose sun is to be recovered
    albedo : of the ball, 0 to 1, one number or linear Rec. 709 (r, g, b)
    camera : (3,), metres from the ball's centre; a metre before it unless given
    radius : of the ball, metres; 0.05 unless given
    circle : the ball's rim, column, row and radius in pixels; found in the picture unless given
    name : of the picture, for messages
    Raises BallNotFound.
    """
    # A matte ball mirrors nothing that would show it among other round things.
    found = find_outline(picture.radiance, name, mirrored=False) if circle is None else outline_of_circle(*circle)
    view = unwrap_ball(
        picture, camera=np.asarray(camera, np.float64), centre=np.zeros(3), radius=radius, outline=found, name=name
    )
    return read_grey_ball(view, albedo)


def _measured(picture: RadianceMap, patch: ChartPatch, name: str) -> np.ndarray:
    """The mean radiance of a patch's pixels, without the few that were not measured, and its deviation: (2, 3)."""
    x, y, radius = patch.circle
    where = f"the patch at ({x:g}, {y:g}) of radius {radius:g}"
    rows, columns = np.indices(picture.radiance.shape[:2]) + 0.5
    inside = np.hypot(columns - x, rows - y) <= radius
    if inside.sum() < 4:
        raise ValueError(f"{name}: {where}: fewer than four pixels lie there; its place is in pixels")
    width, height = picture.size
    if min(x, y, width - x, height - y) < radius:
        raise ValueError(f"{name}: {where} reaches out of the picture, {width}×{height} pixels; give a smaller one")
    values = picture.radiance[inside].astype(np.float64)
    odd = ~np.isfinite(values).all(-1) | (values < 0).any(-1)
    # Every code but 0 marks a bound, or nothing at all: a mean of those would be one too.
    odd |= False if picture.clipped is None else picture.clipped[inside] != 0
    number = int(np.count_nonzero(odd))
    if number >= UNMEASURED * len(values):
        raise UnreadableFile(
            f"{name}: {where}: {number} of its {len(values)} pixels are saturated, black or not seen; expose the chart "
            "so that none is, or give a smaller patch"
        )
    if not values[~odd].any():
        raise UnreadableFile(f"{name}: {where}: black all over; photograph it lit")
    values = values[~odd]
    return np.stack([values.mean(0), values.std(0) / np.sqrt(len(values))])


def read_grey_ball(view: BallView, albedo: tuple[float, float, float] | float) -> MatteReadings:
    """The irradiance on all sides of a matte ball that a photograph shows well, averaged over cells.

    view : of the matte ball, as `relume.probe.ball.unwrapping.unwrap_ball` finds it; its radiance in the light's unit
    albedo : of the ball, (3,) or one number, above 0 and at most 1: 0.18 for a middle grey

    Pixels that are clipped, or see the ball at a grazing angle, are left out; the rest are weighed alike.
    Raises ValueError for another albedo, or a ball with nothing left to read.
    """
    reflectance = _reflectance(albedo)
    rows, columns, normals, cosines = _seen(view)
    good = cosines > STEEPEST
    if view.picture.clipped is not None:
        good &= ~np.isin(view.picture.clipped[rows, columns], (SATURATED, BLACK, OUTSIDE))
    rows, columns, normals = rows[good], columns[good], normals[good]
    if not len(rows):
        raise ValueError("every pixel of the grey ball is clipped or outside; expose it so that none is saturated")
    side = max(int(2 * view.outline.radius / CELLS), 1)
    _, cell = np.unique((rows // side) * 65536 + columns // side, return_inverse=True)
    count = np.bincount(cell).astype(np.float64)[:, None]

    def mean(values: np.ndarray) -> np.ndarray:
        return np.stack([np.bincount(cell, values[:, k]) for k in range(3)], axis=-1) / count

    scale = np.pi / reflectance
    variance = view.picture.variance
    deviation = 0.0 if variance is None else np.sqrt(mean(variance[rows, columns].astype(np.float64)) / count)
    irradiance = mean(view.picture.radiance[rows, columns].astype(np.float64)) * scale
    named = "/".join(f"{a:g}" for a in dict.fromkeys(reflectance.tolist()))
    return MatteReadings(
        normalised(mean(normals)),
        irradiance,
        np.broadcast_to(deviation * scale, irradiance.shape),
        f"a grey ball of albedo {named}",
        view.picture.unit,
    )


def _reflectance(given: ArrayLike) -> np.ndarray:
    """Three reflectances."""
    values = np.broadcast_to(np.asarray(given, np.float64), (3,)) if np.size(given) in (1, 3) else np.zeros(1)
    if not np.all((values > 0) & (values <= 1)):
        raise ValueError(f"reflectance is {given}; expected one number or three, above 0 and at most 1, like 0.18")
    return values


def _seen(view: BallView) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Rows and columns (N,) of the pixels that show the ball, its normals (N, 3) in the world, cosines of view (N,)."""
    width, height = view.picture.size
    x, y = np.arange(width) + 0.5 - width / 2, np.arange(height) + 0.5 - height / 2
    rays = np.stack(np.broadcast_arrays(x[None, :], y[:, None], view.focal_length), axis=-1)
    rays = normalised(rays)
    # |t d − D a| = 1 along the ray d; the nearer of both points is seen.
    along = view.distance * (rays @ view.axis)
    inside = along**2 - (view.distance**2 - 1)
    rows, columns = np.nonzero((inside > 0) & (along > 0))
    reach = along[rows, columns] - np.sqrt(inside[rows, columns])
    rays = rays[rows, columns]
    normals = reach[:, None] * rays - view.distance * view.axis
    return rows, columns, normals @ view.world_from_pixels.T, -(normals * rays).sum(-1)
