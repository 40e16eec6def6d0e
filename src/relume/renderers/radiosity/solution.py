"""Progressive refinement: the patch with most unshot light shoots it, until hardly any is left (Cohen et al. 1988).

    B_i = E_i + ρ_i Σ_j F_ij B_j        A_i F_ij = A_j F_ji

The form factors F are never stored. A patch sends rays in the cosine's proportion; the share of them that meets an
element is the form factor to it, and every ray carries the same part of the patch's flux. So light is neither made nor
lost: what is not received has left through an opening.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from relume.image.colour import luminance
from relume.renderers.diffuse.direct_light import DirectLight
from relume.renderers.diffuse.scenes import NEAR, DiffuseScene, Seen
from relume.renderers.radiosity.elements import Elements
from relume.renderers.raytrace.raycast import RayCaster
from relume.sphere.sampling import by_cosine, sequences, within_triangles

FEWEST = 16
"""Rays of a shot, at least: so many that a dim patch too sends light to more than its neighbour."""
SKY_RAYS = 256
"""Shadow rays from each element's side to the environment map."""


@dataclass(frozen=True, eq=False)
class Shots:
    """What elements hold after some shots: of T triangles the fronts, then the backs.

    count : shots until now
    irradiance : (2T, 3) received
    unshot : (2T, 3) flux that was received or is emitted, and not sent on yet
    left : the share of all light that is unshot
    """

    count: int
    irradiance: np.ndarray
    unshot: np.ndarray
    left: float


@dataclass(frozen=True, eq=False)
class Shooting:
    """A divided scene, ready to shoot.

    rays : for all the light that sources send out; a shot gets its share of them, and later shots theirs again
    least : the share of unshot light at which it ends
    seed : of the rays
    """

    scene: DiffuseScene
    elements: Elements
    rays: int
    least: float
    seed: int

    def shots(self) -> Iterator[Shots]:
        """The state before the first shot and after each; arrays are the caller's to keep."""
        elements, count = self.elements, 0
        sides, reflectance = np.tile(elements.area, 2)[:, None], np.tile(elements.reflectance, (2, 1))
        irradiance = self._from_outside()
        unshot = reflectance * irradiance * sides
        unshot[: len(elements.area)] += np.pi * elements.emission * elements.area[:, None]
        patch = np.concatenate([elements.patch, elements.patch + elements.patch.max() + 1])
        caster, total = RayCaster.of(elements.meshes), float(luminance(unshot).sum())
        while True:
            power = luminance(unshot)
            left = float(power.sum()) / total if total > 0 else 0.0
            yield Shots(count, irradiance.copy(), unshot.copy(), left)
            if left <= self.least:
                return
            # The patch with most unshot flux, each ray from one of its elements.
            brightest = np.argmax(np.bincount(patch, power))
            mine = np.flatnonzero((patch == brightest) & (power > 0))
            random = np.random.default_rng([self.seed, 0x73686F74, count])
            rays = max(int(np.ceil(self.rays * power[mine].sum() / total)), FEWEST)
            begins = np.cumsum(power[mine]) / power[mine].sum() * rays
            origin = np.minimum(np.searchsorted(begins, np.arange(rays) + random.random()), len(mine) - 1)
            sent = np.bincount(origin, minlength=len(mine))
            # Elements that no ray fell to keep theirs for later.
            flux = unshot[mine] / np.maximum(sent, 1)[:, None]
            unshot[mine[sent > 0]] = 0
            received, where = self._received(caster, mine[origin], flux[origin], random)
            irradiance[where] += received / sides[where]
            unshot[where] += reflectance[where] * received
            count += 1

    def _received(
        self, caster: RayCaster, origin: np.ndarray, flux: np.ndarray, random: np.random.Generator
    ) -> tuple[np.ndarray, np.ndarray]:
        """The flux (K, 3) that K elements' sides get from rays of elements' sides `origin` (N,), and their numbers."""
        elements = self.elements
        u = sequences(random, len(origin), 4)[0]
        triangle, front = np.divmod(origin, len(elements.area))[1], origin < len(elements.area)
        normal = elements.normal[triangle] * np.where(front, 1.0, -1.0)[:, None]
        points, _ = within_triangles(u[:, :2], elements.corners[triangle])
        directions = by_cosine(u[:, 2:], normal)
        hits = caster.nearest(points, directions, beyond=NEAR * self.scene.size, threads=self.scene.threads)
        there = np.flatnonzero(hits.shape >= 0)
        met = elements.first[hits.shape[there]] + hits.primitive[there]
        met += len(elements.area) * (np.einsum("ij,ij->i", elements.normal[met], directions[there]) > 0)
        where, index = np.unique(met, return_inverse=True)
        sums = [np.bincount(index, flux[there, channel], len(where)) for channel in range(3)]
        return np.stack(sums, axis=-1), where

    def _from_outside(self) -> np.ndarray:
        """Irradiance (2T, 3) from the environment map and lamps without a body, at the elements' middles."""
        elements, count = self.elements, len(self.elements.area)
        if self.scene.sky is None and not self.scene.lights and not self.scene.free:
            return np.zeros((2 * count, 3))
        random = np.random.default_rng([self.seed, 0x736B79])
        points = np.tile(elements.corners.mean(axis=1), (2, 1))
        normals = np.concatenate([elements.normal, -elements.normal])
        divided = replace(self.scene, shapes=elements.meshes)
        return DirectLight(divided).irradiance(Seen.places(points, normals), SKY_RAYS, random, lamps=False)


def ambient(elements: Elements, state: Shots) -> np.ndarray:
    """Irradiance (3,) that unshot light will have brought, were it spread evenly: the ambient term (§4).

    Of the sides that have received anything; the others are outside of a room.
    """
    lit = np.flatnonzero(np.any(state.irradiance > 0, axis=1))
    if not lit.size:
        return np.zeros(3)
    area = np.tile(elements.area, 2)[lit]
    mean = (np.tile(elements.reflectance, (2, 1))[lit] * area[:, None]).sum(axis=0) / area.sum()
    return state.unshot.sum(axis=0) / area.sum() / np.maximum(1 - mean, 0.01)
