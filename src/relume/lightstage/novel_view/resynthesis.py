"""Reflectance functions as another viewer would have measured them (Debevec et al. 2000, §4.3, §4.4, Fig. 12).

A specular value shows how many facets face the half vector of light and view. For another view, the light that would
have been mirrored by the same facets to the first is looked up, and what depends on the view besides is divided out
and put in (eq. 9). The diffuse part keeps its amount; its chromaticity moves along its ramp (eq. 6, 7).

Reflectance functions are (N, …, 3) under N lights; normals and views (…, 3) are unit vectors, world, views from the
surface to the viewer. Where the new view is the old one, the values are returned as they were.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from relume.lightstage.field.lights import StageLights
from relume.lightstage.surface.chromaticity import ramp, ramped
from relume.lightstage.surface.torrance_sparrow import grooved_reflection, half_vector, mirrored
from relume.sphere.directions import normalised

COVERED = np.radians(45)
"""Radians: a direction without a light within this angle is in no light's neighbourhood. Of the corners and faces of a
cube, those so far from all lights fill the gaps: then the triangles go all round, whatever the lights."""
HORIZON = 0.3
"""Cosine, 17° above the horizon, below which light shows less and less of the facets: its G goes to nothing with it,
and values are divided by that."""
STEP = np.radians(4)
"""Between the angles at which a distribution of facets is kept: half of the half vectors' steps of lights 15° apart."""
NEIGHBOUR = 0.25
"""Weight of the steps on both sides: enough to fill one where nothing was measured, too little to blur the rest."""
REACH = np.radians(72)
"""The largest angle kept; facets that lean more are hidden by others."""


@dataclass(frozen=True, eq=False)
class LightTriangles:
    """The triangles that lights make on the sphere, to interpolate between them.

    corners : (T, 3) numbers of vertices
    inverse : (T, 3, 3) float64: times a direction, its weights of the three vertices, up to their sum
    beside : (T, 3) the triangle across from each corner
    light : (V,) the light of each vertex; of those that fill gaps, the nearest one
    real : (V,) bool, False for vertices that fill gaps where no light is near
    start : (S, S, S) int32, for a cell of the cube round the sphere a triangle near it
    """

    corners: np.ndarray
    inverse: np.ndarray
    beside: np.ndarray
    light: np.ndarray
    real: np.ndarray
    start: np.ndarray

    @staticmethod
    def of(lights: StageLights) -> LightTriangles:
        """The spherical Delaunay triangles of the lights, which is the convex hull of their directions."""
        from scipy.spatial import ConvexHull, KDTree

        signs = np.stack(np.meshgrid(*[[-1.0, 0.0, 1.0]] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
        frame = normalised(signs[np.isin(np.abs(signs).sum(1), (1, 3))])
        apart = np.max(frame @ lights.directions.T, axis=1)
        filling = frame[apart < np.cos(COVERED)]
        vertices = np.concatenate([lights.directions, filling])
        nearest = np.argmax(filling @ lights.directions.T, axis=1).reshape(-1)
        hull = ConvexHull(vertices)
        corners = hull.simplices.astype(np.int64)
        inverse = np.linalg.inv(np.swapaxes(vertices[corners], 1, 2))
        size = 48
        side = (np.arange(size) + 0.5) / size * 2 - 1
        cells = np.stack(np.meshgrid(side, side, side, indexing="ij"), axis=-1).reshape(-1, 3)
        middles = KDTree(normalised(vertices[corners].sum(1)))
        start = middles.query(normalised(cells))[1].astype(np.int32).reshape(size, size, size)
        light = np.concatenate([np.arange(len(lights)), nearest])
        return LightTriangles(corners, inverse, hull.neighbors, light, np.arange(len(vertices)) < len(lights), start)

    def weights(self, directions: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Lights (M, 3), their weights (M, 3), which sum to 1, and which are real, for unit directions (M, 3)."""
        size = len(self.start)
        cell = np.clip(((directions + 1) * (size / 2)).astype(np.int64), 0, size - 1)
        triangle = self.start[cell[:, 0], cell[:, 1], cell[:, 2]].astype(np.int64)
        found = np.einsum("mij,mj->mi", self.inverse[triangle], directions)
        out = np.flatnonzero(found.min(axis=1) < 0)
        # Across the side that the direction lies farthest beyond, until it lies within.
        for _ in range(len(self.corners)):
            if not len(out):
                break
            next_one = self.beside[triangle[out], np.argmin(found[out], axis=1)]
            there = np.einsum("mij,mj->mi", self.inverse[next_one], directions[out])
            # On a side both triangles may be a rounding away.
            better = there.min(axis=1) > found[out].min(axis=1)
            better |= found[out].min(axis=1) < -1e-9
            triangle[out[better]], found[out[better]] = next_one[better], there[better]
            out = out[better & (there.min(axis=1) < 0)]
        found = np.maximum(found, 0)
        found[found < 1e-9] = 0
        vertex = self.corners[triangle]
        return self.light[vertex], found / found.sum(axis=1, keepdims=True), self.real[vertex]


def resynthesised_specular(
    specular: np.ndarray,
    lights: StageLights,
    normal: np.ndarray,
    view: np.ndarray,
    new_view: np.ndarray,
    lit: np.ndarray | None = None,
    triangles: LightTriangles | None = None,
) -> np.ndarray:
    """The specular reflectance function (N, …, 3) float32 from a new view, by eq. 9.

    specular : (N, …, 3), from the first view
    normal, view, new_view : (…, 3)
    lit : (N, …) bool, which lights reach the surface straight (`photometric_stereo.lit`); all above the horizon if None
    triangles : of these lights, when they are at hand
    What was read as specular of lights below the horizon or in shadow was mirrored by no facet of this surface;
    it is kept as it was and no highlight appears there. The same for normals that face away from either view.
    """
    shape = specular.shape
    values = np.asarray(specular, np.float32).reshape(shape[0], -1, 3)
    flat = [np.asarray(each, np.float64).reshape(-1, 3) for each in (normal, view, new_view)]
    if len(lights) != shape[0] or any(len(each) != values.shape[1] for each in flat):
        raise ValueError(
            f"specular values {shape} of {len(lights)} lights with normals {np.shape(normal)} and views "
            f"{np.shape(view)} and {np.shape(new_view)}; expected (N, …, 3) and (…, 3)"
        )
    above = lights.directions @ flat[0].T > 0
    reached = above if lit is None else above & np.asarray(lit, bool).reshape(shape[0], -1)
    moved = np.any(flat[1] != flat[2], axis=1)
    moved &= (np.einsum("pk,pk->p", flat[0], flat[1]) > 0) & (np.einsum("pk,pk->p", flat[0], flat[2]) > 0)
    chosen = np.flatnonzero(moved)
    result = values.copy()
    if len(chosen):
        n, first, second = (each[chosen] for each in flat)
        known = triangles or LightTriangles.of(lights)
        result[:, chosen] = _carried(values[:, chosen], lights, n, first, second, reached[:, chosen], known)
    return result.reshape(shape)


def _carried(
    values: np.ndarray,
    lights: StageLights,
    normal: np.ndarray,
    view: np.ndarray,
    new_view: np.ndarray,
    reached: np.ndarray,
    triangles: LightTriangles,
) -> np.ndarray:
    """Eq. 9 for values (N, P, 3) of pixels whose normals face both views."""
    facets = Facets.measured(values, lights, normal, view, reached)
    result = values.copy()
    for index, light in enumerate(lights.directions):
        pixels = np.flatnonzero(reached[index])
        if not len(pixels):
            continue
        n, first, second = normal[pixels], view[pixels], new_view[pixels]
        half = half_vector(second, light)
        asked = mirrored(half, first)
        near, weights, real = triangles.weights(asked)
        # Lights in shadow, and gaps between the lights, showed nothing of these facets.
        weights = weights * (real & reached[near, pixels[:, None]])
        known = weights.sum(axis=1)
        there, here = np.einsum("pk,pk->p", asked, n), n @ light
        known = known * np.clip(there / np.minimum(here, HORIZON), 0, 1) * (np.einsum("pk,pk->p", half, first) > 0)
        share = weights / np.maximum(weights.sum(axis=1), 1e-12)[:, None]
        measured = np.einsum("pk,pkc->pc", share, values[near, pixels[:, None]])
        new_factor = grooved_reflection(second, light, n)
        ratio = new_factor / grooved_reflection(first, asked, n)
        # Facets that could not be measured lean evenly to all sides.
        density = facets.at(np.einsum("pk,pk->p", half, n), pixels)
        unmeasured = ((1 - known) * new_factor)[:, None] * density
        result[index, pixels] = known[:, None] * ratio[:, None] * measured + unmeasured
    return result


def resynthesised_diffuse(
    diffuse: np.ndarray,
    lights: StageLights,
    normal: np.ndarray,
    view: np.ndarray,
    new_view: np.ndarray,
    alpha: np.ndarray,
) -> np.ndarray:
    """The diffuse reflectance function (N, …, 3) float32 from a new view: its chromaticity shifted.

    diffuse : (N, …, 3), from the first view
    normal, view, new_view : (…, 3)
    alpha : (…, 2), α0 and α1 of the ramp (eq. 7)
    The first view's shift is undone and the new one's applied, each to the sample's own chromaticity under white light;
    its length as an RGB vector stays.
    """
    shape = diffuse.shape
    values = np.asarray(diffuse, np.float32).reshape(shape[0], -1, 3)
    n, first, second = (np.asarray(each, np.float64).reshape(-1, 3) for each in (normal, view, new_view))
    parameters, white = np.asarray(alpha, np.float64).reshape(-1, 2), normalised((1.0, 1.0, 1.0))
    incident = np.maximum(lights.directions @ n.T, 0)
    shifts = [ramp(parameters, incident * np.maximum(np.einsum("pk,pk->p", n, each), 0)) for each in (first, second)]
    length = np.linalg.norm(values, axis=-1)
    body = without_shift(values / np.maximum(length, 1e-30)[..., None], shifts[0], white)
    shifted = ramped(body, white, shifts[1])
    same = (shifts[0] == shifts[1]) | (length == 0)
    return np.where(same[..., None], values, length[..., None] * shifted).astype(np.float32).reshape(shape)


def without_shift(chromaticity: np.ndarray, shift: np.ndarray, light: np.ndarray) -> np.ndarray:
    """d0 (…, 3), unit, whose shifted chromaticity normalize(d0 + f (d0 − s)) is the given one: eq. 6 undone.

    chromaticity : (…, 3) unit; shift : f (…); light : s (3,) unit
    With (1 + f) d0 − f s = k c, the length of d0 gives k: k² + 2 k f (c·s) = 1 + 2 f. Where no k above 0 is, for
    f below −½, the chromaticity itself.
    """
    along = shift * (chromaticity @ light)
    inside = along**2 + 1 + 2 * shift
    scale = np.sqrt(np.maximum(inside, 0)) - along
    known = (inside >= 0) & (scale > 0) & (shift > -1)
    body = (scale[..., None] * chromaticity + shift[..., None] * light) / np.where(known, 1 + shift, 1)[..., None]
    return np.where(known[..., None], body, chromaticity)


@dataclass(frozen=True, eq=False)
class Facets:
    """How many facets lean by how much, whatever the side: a symmetric distribution for every pixel.

    It stands for facets that could not be measured, since the light that shows them to the first view is below the
    horizon, in shadow, or no light of the stage. Without it highlights at the far side of a subject are missing; the
    distribution of Torrance and Sparrow is symmetric itself.

    density : (K, P, 3), at angles of 0, `STEP`, 2 `STEP` … between normal and facet; the specular value over
        `grooved_reflection`
    """

    density: np.ndarray

    @staticmethod
    def measured(
        values: np.ndarray, lights: StageLights, normal: np.ndarray, view: np.ndarray, reached: np.ndarray
    ) -> Facets:
        """The mean over what was measured of values (N, P, 3), each as sure as the surface shows its facets."""
        count, pixels = int(REACH / STEP) + 1, np.arange(values.shape[1])
        total, weight = np.zeros((count, values.shape[1], 3)), np.zeros((count, values.shape[1]))
        for index, light in enumerate(lights.directions):
            half = half_vector(view, light)
            factor = grooved_reflection(view, light, normal)
            # A value is density × factor: least squares weigh the quotient by the factor's square, less at the horizon.
            sure = reached[index] * factor * np.clip((normal @ light) / HORIZON, 0, 1)
            lower, part = _place(np.einsum("pk,pk->p", half, normal), count)
            for place, share in ((lower, 1 - part), (lower + 1, part)):
                weight[place, pixels] += sure * share * factor
                total[place, pixels] += (sure * share)[:, None] * values[index]
        # A neighbour's facets where none were measured at this angle.
        total, weight = _smoothed(total), _smoothed(weight)
        return Facets(total / (weight[..., None] + 1e-12))

    def at(self, cosine: np.ndarray, pixels: np.ndarray) -> np.ndarray:
        """Densities (Q, 3) at these cosines (Q,) between normal and facet, of these pixels; 0 beyond `REACH`."""
        lower, part = _place(cosine, len(self.density))
        found = (1 - part)[:, None] * self.density[lower, pixels] + part[:, None] * self.density[lower + 1, pixels]
        return np.where((cosine > np.cos(REACH))[:, None], found, 0)


def _place(cosine: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray]:
    """The step below an angle, and how far it lies beyond it."""
    along = np.arccos(np.clip(cosine, -1, 1)) / STEP
    lower = np.minimum(along.astype(np.int64), count - 2)
    return lower, np.clip(along - lower, 0, 1)


def _smoothed(steps: np.ndarray) -> np.ndarray:
    """Values (K, …), each with a quarter of both its neighbours."""
    result = steps.copy()
    result[1:] += NEIGHBOUR * steps[:-1]
    result[:-1] += NEIGHBOUR * steps[1:]
    return result
