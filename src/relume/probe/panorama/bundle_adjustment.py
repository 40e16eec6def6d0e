"""All views of a panorama turned together (bundle adjustment): rotations, one focal length, one term of distortion."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy import sparse
from scipy.sparse.csgraph import connected_components

from relume.errors import NotAPanorama
from relume.probe.panorama.matching import Matching, Pair, find_pairs
from relume.probe.panorama.views import PanoramaView, rays_through
from relume.sphere.directions import UP, normalised, rotation_between, rotation_from_vector

MATCHES = 200
"""Of a pair that take part, at most: more do not help, and a rich pair would outweigh the others."""
ROUNDS = (0.02, 0.006, 0.003, 0.003)
"""Radians by which matches may disagree to take part, round after round, while the focal length settles."""
PRIOR_FOCAL, PRIOR_DISTORTION = 0.1, 0.05
"""Standard deviations of ln focal length about what was given, and of the distortion about 0."""
FEATURE = 0.7
"""Pixels, in the picture they were found in, that the place of a feature is uncertain by."""
STEPS = 20
"""Of Gauss–Newton in a round, at most."""
LOSS = 2.0
"""Deviations at which a match counts half."""
ALONE = 0.05
"""Share of the views' right axes that has to be out of one line for them to show the horizon."""
ALIKE = 0.5
"""Of the views that belong together, from which another group is of similar size: it may be the panorama as well."""


@dataclass(frozen=True, eq=False)
class Adjusted:
    """Views with their rotations, and how well they fit.

    views : as given, with rotation, focal length and distortion found, without those that are left out
    pairs : that were matched, with the matches that agree in the end; their indices are those of `views`
    error : root mean square of what agreeing matches differ by, radians; 0 where nothing was matched
    scale : of all focal lengths
    left_out : views that have too little in common with the others
    apart : whether given and matched orientations share nothing, so that the given ones count from the first
        matched view, held level
    """

    views: tuple[PanoramaView, ...]
    pairs: tuple[Pair, ...]
    error: float
    scale: float
    left_out: tuple[PanoramaView, ...] = ()
    apart: bool = False


def orient(views: Sequence[PanoramaView], method: Matching = Matching()) -> Adjusted:
    """Find the rotations that are not known, from what the views have in common.

    Views whose rotation is known keep it, and with it the world; where there are none the horizon is found from the
    views (the camera is held level on the average, Brown & Lowe 2007, §5) and the first looks towards −Z. All focal
    lengths are scaled by one factor, for one lens took all. Views that have nothing in common with the others, as of a
    clear sky, are left out while most belong together.
    Raises NotAPanorama naming the views that have nothing in common with the others, where they are too many.
    """
    given, pairs = views, find_pairs(views, method)
    kept, anchor = _belonging(views, pairs)
    left_out = tuple(view for i, view in enumerate(given) if i not in kept)
    views = [given[i] for i in kept]
    place = {i: new for new, i in enumerate(kept)}
    pairs = [
        replace(pair, first=place[pair.first], second=place[pair.second])
        for pair in pairs
        if pair.first in place and pair.second in place
    ]
    anchor = None if anchor is None else place[anchor]
    start = _from_neighbours(views, _linked(views, pairs, anchor), anchor)
    problem = _Bundle(views, pairs, start, method, anchor)
    # A focal length that is off by 3 % leaves a ring of views open by 11°, which no robust loss would close: at first
    # every pair is believed.
    rotations, scale, distortion = problem.solved(start, 1.0, 0.0, loss=np.inf)
    for tolerance in ROUNDS:
        problem = problem.with_agreeing(rotations, scale, distortion, tolerance)
        rotations, scale, distortion = problem.solved(rotations, scale, distortion)
    problem = problem.with_agreeing(rotations, scale, distortion, ROUNDS[-1])
    error = problem.error(rotations, scale, distortion)
    unknown = [i for i, view in enumerate(views) if view.rotation is None]
    apart = anchor is not None and len(unknown) < len(views)
    if anchor is not None and (method.level or apart):
        level = levelling([rotations[i] for i in unknown])
        rotations = [level @ turn if i in unknown else turn for i, turn in enumerate(rotations)]
    found = tuple(
        replace(view, rotation=rotation, focal_length=view.focal_length * scale, distortion=distortion)
        for view, rotation in zip(views, rotations, strict=True)
    )
    return Adjusted(found, tuple(problem.pairs), error, scale, left_out, apart)


def levelling(rotations: Sequence[np.ndarray]) -> np.ndarray:
    """The turn of the world that makes the views level and lets the first look towards −Z.

    Cameras are tilted but hardly rolled, so that their right axes lie in the horizon: up is what they are all square
    to. Where they lie on one line, as of one view or a column of them, up is the mean of the cameras' own.
    """
    right, own_up = (np.stack([rotation[:, axis] for rotation in rotations]) for axis in (0, 1))
    values, vectors = np.linalg.eigh(right.T @ right / len(right))
    mean_up = own_up.mean(0)
    if values[1] > ALONE:
        up = vectors[:, 0] * (1 if vectors[:, 0] @ mean_up >= 0 else -1)
    else:
        along = vectors[:, 2]
        up = normalised(mean_up - (mean_up @ along) * along)
    level = rotation_between(up, UP)
    ahead = -(level @ rotations[0])[:, 2]
    if np.hypot(ahead[0], ahead[2]) < 1e-6:
        return level
    yaw = np.arctan2(ahead[0], -ahead[2])
    return rotation_from_vector(yaw * UP) @ level


def _belonging(views: Sequence[PanoramaView], pairs: Sequence[Pair]) -> tuple[list[int], int | None]:
    """Indices of the views that belong together, and the one that the others are turned to where none is given.

    Views with a given orientation belong; so do views linked to them. Where none is, it is the largest linked
    group; given views are then beside it, as of a sky that nothing can be matched in.
    """
    groups = _groups(len(views), pairs)
    strength = np.zeros(len(views))
    for pair in pairs:
        strength[[pair.first, pair.second]] += pair.agreeing.sum()
    given = {i for i, view in enumerate(views) if view.rotation is not None}
    with_given = set().union(*(group for group in groups if group & given))
    rest = (group for group in groups if not group & given)
    without = sorted(rest, key=lambda group: (len(group), strength[list(group)].sum()), reverse=True)
    anchor, kept = None, with_given
    if without and with_given == given and len(without[0]) > max(1, len(given) / ALIKE):
        main = without.pop(0)
        anchor, kept = max(main, key=lambda i: strength[i]), given | main
    elif without and not given:
        kept = without.pop(0)
        anchor = max(kept, key=lambda i: strength[i])
    lost = sum(len(group) for group in without)
    if len(kept) < 2 or lost >= len(kept) or (without and len(without[0]) >= ALIKE * len(kept)):
        names = ", ".join(view.name for i, view in enumerate(views) if i not in kept)
        found = [view.name for i, view in enumerate(views) if i in kept]
        raise NotAPanorama(
            f"{names}: too little in common with {', '.join(found) if len(found) < 3 else 'the others'} "
            "to find the orientation; let views overlap by a third, or give how each was turned: with "
            "--orientations a table of these alone is enough"
        )
    return sorted(kept), anchor


def _groups(count: int, pairs: Sequence[Pair]) -> list[set[int]]:
    """Views that pairs link, directly or through others."""
    ends = np.array([(pair.first, pair.second) for pair in pairs], int).reshape(-1, 2)
    links = sparse.csr_array((np.ones(len(ends)), (ends[:, 0], ends[:, 1])), (count, count))
    labels = connected_components(links, directed=False)[1]
    return [set(np.flatnonzero(labels == label).tolist()) for label in range(labels.max() + 1)]


def _linked(views: Sequence[PanoramaView], pairs: Sequence[Pair], anchor: int | None) -> list[tuple[int, int, Pair]]:
    """The strongest pairs that join all views, from those whose rotation is known outwards: (known, new, pair)."""
    known = {i for i, view in enumerate(views) if view.rotation is not None or i == anchor}
    order: list[tuple[int, int, Pair]] = []
    while len(known) < len(views):
        ways = [(int(pair.agreeing.sum()), pair) for pair in pairs if (pair.first in known) != (pair.second in known)]
        pair = max(ways, key=lambda way: way[0])[1]
        old, new = (pair.first, pair.second) if pair.first in known else (pair.second, pair.first)
        order.append((old, new, pair))
        known.add(new)
    return order


def _from_neighbours(
    views: Sequence[PanoramaView], order: Sequence[tuple[int, int, Pair]], anchor: int | None
) -> list[np.ndarray]:
    rotations: list[np.ndarray | None] = [view.rotation for view in views]
    if anchor is not None:
        rotations[anchor] = np.eye(3)
    for old, new, pair in order:
        first_from_second = pair.rotation if old == pair.first else pair.rotation.T
        before = rotations[old]
        assert before is not None  # views are joined from known ones outwards
        rotations[new] = before @ first_from_second
    return [rotation for rotation in rotations if rotation is not None]


@dataclass(frozen=True, eq=False)
class _Bundle:
    """The misfit of all agreeing matches, in radians over the uncertainty of a feature."""

    views: Sequence[PanoramaView]
    pairs: Sequence[Pair]
    start: Sequence[np.ndarray]
    method: Matching
    anchor: int | None

    @property
    def free(self) -> list[int]:
        """The views that may turn; one is held where none is known, or all could turn together."""
        return [i for i, view in enumerate(self.views) if view.rotation is None and i != self.anchor]

    def with_agreeing(
        self, rotations: Sequence[np.ndarray], scale: float, distortion: float, tolerance: float
    ) -> _Bundle:
        """The same with the matches that agree now."""
        pairs = []
        for pair in self.pairs:
            apart = np.linalg.norm(self._apart(pair, rotations, scale, distortion), axis=-1)
            pairs.append(replace(pair, agreeing=apart < tolerance))
        return replace(self, pairs=pairs)

    def _apart(self, pair: Pair, rotations: Sequence[np.ndarray], scale: float, distortion: float) -> np.ndarray:
        """(N, 3) between the world directions of the matches of a pair."""
        ends = []
        for index, points in ((pair.first, pair.points[:, 0]), (pair.second, pair.points[:, 1])):
            view = self.views[index]
            bent = replace(view, focal_length=view.focal_length * scale, distortion=distortion)
            ends.append(bent.rays(points) @ rotations[index].T)
        return ends[1] - ends[0]

    def solved(
        self, rotations: Sequence[np.ndarray], scale: float, distortion: float, loss: float = LOSS
    ) -> tuple[list[np.ndarray], float, float]:
        """Rotations, focal scale and distortion of the least misfit (Gauss–Newton with Cauchy's weights).

        loss : deviations at which a match counts half
        """
        ends = _Ends.of(self.views, self.pairs, self.method)
        turns, free = np.stack(rotations), self.free
        columns = np.full(len(turns), -1)
        columns[free] = 3 * np.arange(len(free))
        lens = np.array([np.log(scale), distortion])
        deviation = np.array([PRIOR_FOCAL, PRIOR_DISTORTION if self.method.distortion else 1e-9])
        unknown = 3 * len(free) + 2
        for _ in range(STEPS):
            apart, slopes = ends.misfit(turns, lens)
            weight = 1 / (1 + (apart**2).sum(-1) / loss**2)
            jacobian = ends.jacobian(turns, lens, slopes, columns, unknown)
            weighted = jacobian.multiply(np.repeat(weight, 3)[:, None]).tocsr()
            normal = (jacobian.T @ weighted).toarray()
            right = -(weighted.T @ apart.ravel())
            normal[-2:, -2:] += np.diag(1 / deviation**2)
            right[-2:] -= lens / deviation**2
            # Views that no match holds stay where they are.
            step = np.linalg.solve(normal + 1e-9 * np.diag(np.maximum(np.diag(normal), 1.0)), right)
            for index in free:
                turns[index] = rotation_from_vector(step[columns[index] : columns[index] + 3]) @ turns[index]
            lens = np.clip(lens + step[-2:], [-0.5, -0.3], [0.5, 0.3])
            if np.abs(step).max() < 1e-7:
                break
        return list(turns), float(np.exp(lens[0])), float(lens[1])

    def error(self, rotations: Sequence[np.ndarray], scale: float, distortion: float) -> float:
        """Root mean square of what agreeing matches differ by, radians."""
        apart = [self._apart(pair, rotations, scale, distortion)[pair.agreeing] for pair in self.pairs]
        together = np.concatenate(apart)
        return float(np.sqrt((together**2).sum(-1).mean())) if len(together) else 0.0


@dataclass(frozen=True, eq=False)
class _Ends:
    """Both ends of the agreeing matches of all pairs.

    views : (M, 2) indices
    tangents : (M, 2, 2), of the points where the lens puts them, with the focal lengths as given
    deviation : (M,) radians, of what right matches differ by
    """

    views: np.ndarray
    tangents: np.ndarray
    deviation: np.ndarray

    @staticmethod
    def of(views: Sequence[PanoramaView], pairs: Sequence[Pair], method: Matching) -> _Ends:
        """Those of at most MATCHES of each pair."""
        indices, tangents, deviations = [np.zeros((0, 2), int)], [np.zeros((0, 2, 2))], [np.zeros(0)]
        for pair in pairs:
            points = pair.points[_spread(pair.agreeing)]
            both = [views[pair.first], views[pair.second]]
            ends = [(points[:, e] - np.array(v.picture.size) / 2) / v.focal_length for e, v in enumerate(both)]
            pixel = max(max(1.0, max(v.picture.size) / method.width) / v.focal_length for v in both)
            indices.append(np.tile([pair.first, pair.second], (len(points), 1)))
            tangents.append(np.stack(ends, axis=1))
            deviations.append(np.full(len(points), FEATURE * pixel))
        return _Ends(np.concatenate(indices), np.concatenate(tangents), np.concatenate(deviations))

    def rays(self, lens: np.ndarray) -> np.ndarray:
        """(M, 2, 3) of the cameras' frames; lens is ln of the focal length's scale, and the distortion."""
        return rays_through(self.tangents / np.exp(lens[0]), float(lens[1]))

    def misfit(self, turns: np.ndarray, lens: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """What the ends differ by, (M, 3) in deviations, and its slope by both of the lens, (M, 3, 2)."""

        def apart(lens: np.ndarray) -> np.ndarray:
            world = np.einsum("meij,mej->mei", turns[self.views], self.rays(lens))
            return (world[:, 1] - world[:, 0]) / self.deviation[:, None]

        step = 1e-5
        slopes = [(apart(lens + step * axis) - apart(lens - step * axis)) / (2 * step) for axis in np.eye(2)]
        return apart(lens), np.stack(slopes, axis=-1)

    def jacobian(
        self, turns: np.ndarray, lens: np.ndarray, slopes: np.ndarray, columns: np.ndarray, unknown: int
    ) -> sparse.csr_array:
        """(3 M, unknown): the turn of each free view begins at its column, and the lens is last."""
        world = np.einsum("meij,mej->mei", turns[self.views], self.rays(lens)) / self.deviation[:, None, None]
        rows = np.arange(3 * len(world)).reshape(-1, 3)
        entries, down = [slopes.ravel()], [np.repeat(rows.ravel(), 2)]
        across = [np.tile([unknown - 2, unknown - 1], 3 * len(world))]
        for end, sign in ((0, -1.0), (1, 1.0)):
            begins = columns[self.views[:, end]]
            x, y, z = world[begins >= 0, end].T
            none = np.zeros_like(x)
            # ω × r: a row for each component of the difference, a column for each of ω.
            cross = sign * np.stack([[none, z, -y], [-z, none, x], [y, -x, none]])
            entries.append(np.moveaxis(cross, -1, 0).ravel())
            down.append(np.broadcast_to(rows[begins >= 0][:, :, None], (len(x), 3, 3)).ravel())
            turns_of = begins[begins >= 0][:, None, None] + np.arange(3)
            across.append(np.broadcast_to(turns_of, (len(x), 3, 3)).ravel())
        coordinates = (np.concatenate(down), np.concatenate(across))
        return sparse.csr_array((np.concatenate(entries), coordinates), (3 * len(world), unknown))


def _spread(agreeing: np.ndarray) -> np.ndarray:
    """At most MATCHES of the agreeing, evenly from all of them."""
    places = np.flatnonzero(agreeing)
    return places if len(places) <= MATCHES else places[np.linspace(0, len(places) - 1, MATCHES).astype(int)]
