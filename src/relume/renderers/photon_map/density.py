"""How dense photons lie: irradiance on surfaces, and light scattered in a fog, by the k nearest (Jensen 1996, §4).

The sphere about a point is opened until k photons lie in it; on a surface they lie in a disc of its radius r. The
farthest only says how wide the sphere is: of photons that lie by chance, the k − 1 others give E = Σ Φ / π r² without
bias where the light is even. Where it is not, r blurs it, and at a wall's edge half of the disc hangs in the air: the
estimate's bias. Jensen's cone, w = 1 − d / 1.1 r, weighs near photons more.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.spatial import KDTree

from relume.renderers.photon_map.tracing import Flight, Photons
from relume.scene.materials.media import Medium

CONE = 1.1
ALIKE = 0.7
"""Cosine between the normals of two places that one disc may hold."""
AT_ONCE = 1 << 13


@dataclass(frozen=True, eq=False)
class Density:
    """Photons in a tree.

    neighbours : k
    widest : metres, a sphere's radius at most; so where almost no photons are the light is not smeared
    shrink : share of the radius that k photons need which is looked at; below 1 in later passes
    """

    photons: Photons
    tree: KDTree
    neighbours: int
    widest: float
    shrink: float
    workers: int

    @staticmethod
    def of(photons: Photons, neighbours: int, widest: float, shrink: float, threads: int | None) -> Density:
        """A tree of photons; `widest` is lowered to four times the radius that is usual among them."""
        if not len(photons.position):
            nothing = np.zeros((1, 3))
            photons = Photons(nothing, nothing, nothing, nothing, np.zeros(1, bool))
        # SciPy's own balanced tree is Jensen's data structure.
        tree, k, workers = KDTree(photons.position), neighbours + 1, threads or -1
        some = photons.position[:: max(len(photons.position) // 1000, 1)]
        if len(photons.position) > k:
            usual = float(np.median(np.asarray(tree.query(some, k, workers=workers)[0])[:, -1]))
            widest = min(widest, 4 * usual)
        return Density(photons, tree, k, widest, shrink, workers)

    def irradiance(self, points: np.ndarray, normals: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Irradiance (N, 3) at surface points with unit normals, and the radius (N,) of each estimate's disc."""
        found, radius = np.zeros((len(points), 3)), np.zeros(len(points))
        for part in _parts(len(points)):
            distance, which, radius[part] = self._nearest(points[part])
            alike = np.einsum("nkj,nj->nk", self.photons.normal[which], normals[part]) > ALIKE
            among = alike & (distance < radius[part, None])
            weight = np.where(among, 1 - np.where(among, distance, 0) / (CONE * radius[part, None]), 0)
            area = (1 - 2 / (3 * CONE)) * np.pi * radius[part] ** 2
            found[part] = np.einsum("nk,nkc->nc", weight, self.photons.power[which]) / area[:, None]
        return found, radius

    def scattered(self, points: np.ndarray, towards: np.ndarray, medium: Medium) -> np.ndarray:
        """Radiance (N, 3) that a metre of fog adds at points, to light that goes along unit directions (N, 3)."""
        found = np.zeros((len(points), 3))
        for part in _parts(len(points)):
            distance, which, radius = self._nearest(points[part])
            cosine = np.einsum("nkj,nj->nk", self.photons.direction[which], towards[part])
            weight = medium.phase(cosine) * (distance < radius[:, None])
            volume = 4 / 3 * np.pi * radius**3
            found[part] = np.einsum("nk,nkc->nc", weight, self.photons.power[which]) / volume[:, None]
        return found

    def _nearest(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Distances and numbers (N, k) of the photons nearest to points, ∞ and 0 where there are less, and radii."""
        count = len(self.photons.position)
        distance, which = self.tree.query(
            points, self.neighbours, distance_upper_bound=self.widest, workers=self.workers
        )
        radius = np.where(np.isfinite(distance[:, -1]), distance[:, -1], self.widest) * self.shrink
        return distance, np.where(which < count, which, 0), np.maximum(radius, 1e-12)


class Everywhere:
    """Irradiance where every eighth photon lies, for the many rays of final gathering: each takes what is known at the
    nearest such place whose surface faces alike (Christensen 1999).

    It is estimated from the other photons: a cluster by chance would be asked about less often than its surroundings,
    and the mean come out too dark by one part in `neighbours`.
    """

    def __init__(self, density: Density, places: Photons) -> None:
        self.density, self.normals = density, places.normal
        self.irradiance = density.irradiance(places.position, places.normal)[0]
        self.tree = KDTree(places.position)

    def at(self, points: np.ndarray, normals: np.ndarray) -> np.ndarray:
        """Irradiance (N, 3) at points with unit normals."""
        which = np.minimum(self.tree.query(points, 4, workers=self.density.workers)[1], self.tree.n - 1)
        alike = np.einsum("nkj,nj->nk", self.normals[which], normals) > ALIKE
        found = self.irradiance[np.take_along_axis(which, alike.argmax(1)[:, None], 1)[:, 0]]
        if len(none := np.flatnonzero(~alike.any(1))):
            found[none] = self.density.irradiance(points[none], normals[none])[0]
        return found


class Maps(NamedTuple):
    """What one pass knows of the light.

    surface, caustic : photons on surfaces, seven eighths of them all and those of caustics
    everywhere : irradiance at the other eighth; None where nothing landed
    hanging, indirect : photons in the fog, all and those that did not come straight from a lamp
    """

    surface: Density
    caustic: Density
    everywhere: Everywhere | None
    hanging: Density
    indirect: Density

    @staticmethod
    def of(
        flight: Flight, caustics: Flight, neighbours: int, widest: float, shrink: float, threads: int | None
    ) -> Maps:
        """Maps of where photons went; the numbers are those of `Density.of`."""
        landed, fog = flight.surface, flight.fog
        eighth = np.arange(len(landed.power)) % 8 == 7
        others = landed.only(~eighth)
        others = others._replace(power=others.power * (len(landed.power) / max(len(others.power), 1)))
        surface, caustic, hanging, indirect = (
            Density.of(photons, neighbours, widest, shrink, threads)
            for photons in (others, caustics.surface, fog, fog.only(~fog.direct))
        )
        everywhere = Everywhere(surface, landed.only(eighth)) if eighth.any() else None
        return Maps(surface, caustic, everywhere, hanging, indirect)


def _parts(count: int) -> list[slice]:
    return [slice(begin, begin + AT_ONCE) for begin in range(0, count, AT_ONCE)]
