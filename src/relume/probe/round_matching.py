"""How round views were turned, found from what they have in common.

Features are looked for in a stereographic picture of each view, which keeps angles all the way to the rim, where
neighbours overlap: there a fisheye bends what the other shows straight. The turn between two views is the one that most
matches agree with; all turns are then fitted together, and with them the field of the lens: one that is off by a degree
would turn neighbours by as much.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy import optimize, sparse
from scipy.sparse import csgraph

from relume.errors import NotAPanorama, warn
from relume.image.colour import luminance
from relume.image.radiance import OUTSIDE, RadianceMap
from relume.probe.panorama.matching import (
    BORDER,
    Features,
    Matching,
    described,
    in_stops,
    match,
    most_agreed_rotation,
)
from relume.probe.round_views import FisheyeLens, ParabolicMirror, RoundLens, RoundView
from relume.sphere.directions import rotation_angle, rotation_from_vector

FARTHEST = 2.4
"""Radians from a view's middle beyond which no feature is looked for: a stereographic picture would be too large."""
ROUND = Matching(width=1800, features=6000)
"""As wide as 1800 pixels, for the stereographic picture of a fisheye is half rim."""
PRIOR_FIELD = 0.03
"""Standard deviation of ln field about what was given: makers round."""
ROUNDS = 3
"""Fits, each to the matches that agree by the one before."""
BESIDE = 3.0
"""Medians of what agreeing matches differ by, up to which one agrees."""
LEAST_DEVIATION = 1e-5
"""Radians, of a match: exact pictures must not make an infinite weight."""
DOUBTED, REFUSED = 0.05, 0.15
"""Shares by which the field that is found may differ from the one given: makers round by less than the first; beyond
the second, matches that agree by chance were bent until they did."""
SURE = 3.0
"""Deviations by which matches must contradict a turn that is given, for it to be doubted; `LOOSE` at least."""
LOOSE = np.radians(0.3)
"""What matches may differ by before the lens is doubted: some pixels of a fisheye."""


@dataclass(frozen=True, eq=False)
class OrientedViews:
    """Round views with the rotations that were found.

    views : as given, with rotations; those that are known are their own. Their lens has the field that was found
    error : root mean square of what agreeing matches differ by, radians
    deviations : (N,) radians, standard deviation of each view's turn beside those known, by the matches' scatter:
        errors of the lens and of the rim, which move all matches together, are not in it
    matches : (N,) agreeing, of each view with all others
    """

    views: tuple[RoundView, ...]
    error: float
    deviations: np.ndarray
    matches: np.ndarray


@dataclass(frozen=True, eq=False)
class _Pair:
    """Two views' directions of the same, unit (M, 3) each in its camera's frame.

    agreeing : (M,) bool
    rotation : (3, 3) first-from-second
    """

    first: int
    second: int
    a: np.ndarray
    b: np.ndarray
    agreeing: np.ndarray
    rotation: np.ndarray


def orient_round_views(
    views: Sequence[RoundView], method: Matching = ROUND, *, known: Sequence[bool] | None = None
) -> OrientedViews:
    """Find how round views from one place were turned, from what they have in common.

    views : two or more; those that are known keep their rotations, those of the others are found, not used
    method : as of a panorama; `width` is that of the stereographic picture, and `distortion` finds the field of the
        lens, where all views have the same and it has one: within some per cent of what is given
    known : (N,) whose rotations are known; the first's alone unless given. What known views share is no part of the fit
    Features are Lowe's (2004). Random pairs of matches give the turn that most of them agree with (Fischler & Bolles
    1981; Kabsch 1976); robust least squares then finds all turns together. Neighbours need an overlap of some 15°: two
    fisheyes of 195° back to back have it. Raises NotAPanorama for a lone view, by name for views that have too little
    in common with the others, and where the field that is found differs by more than 15 % from the one given. Warns
    where it differs by more than 5 %, and where matches differ by more than 0.3°: then the lens or its rim is another
    than was given. Warns of a known rotation that matches contradict by more than three of their deviations, 0.3° at
    least.
    Raises ValueError where `known` is not said of each view, or is true of all or of none.
    """
    if len(views) < 2:
        raise NotAPanorama(f"{len(views)} round views; their turns are found from two or more")
    named = [replace(view, name=f"view {i + 1}") if view.name == "view" else view for i, view in enumerate(views)]
    held = np.eye(1, len(named))[0] > 0 if known is None else np.asarray(known, bool)
    if held.shape != (len(named),) or not held.any() or held.all():
        raise ValueError(f"known: {held.tolist()} of {len(named)} views; say it of each, of one at least, not of all")
    features = [round_features(view, method) for view in named]
    pairs = [
        pair
        for second in range(1, len(named))
        for first in range(second)
        if (pair := _paired(named, features, first, second, method)) is not None
    ]
    _doubt_contradicted(named, held, pairs, method)
    fitting = [pair for pair in pairs if not (held[pair.first] and held[pair.second])]
    found = _fitted(named, _from_the_known(named, held, fitting, method), fitting, method, ~held)
    _require_field_as_given(named[0].lens, found.lens)
    if found.error > LOOSE:
        warn(
            f"what the views have in common differs by {np.degrees(found.error):.2g}°; check the lens's field and its "
            "rim, and that all were taken from one place"
        )
    counts = np.zeros(len(named), int)
    for pair in found.pairs:
        counts[[pair.first, pair.second]] += pair.agreeing.sum()
    turned = tuple(
        replace(view, rotation=view.rotation if given else turn, lens=found.lens or view.lens)
        for view, turn, given in zip(named, found.turns, held, strict=True)
    )
    return OrientedViews(turned, found.error, found.deviations, counts)


def round_features(view: RoundView, method: Matching = ROUND) -> Features:
    """The features of a round view; their `points` (N, 3) are unit directions in the camera's own frame."""
    import cv2

    angles = np.linspace(0, FARTHEST, 2401)
    shown = view.lens.radius(angles) <= 1
    farthest = float(angles[shown].max())
    # As fine as the view's middle, unless that is wider than the method wants.
    native = view.radius * float(view.lens.radius(angles[1])) / angles[1]
    reach = 2 * np.tan(farthest / 2)
    focal_length = min(native, method.width / 2 / reach)
    shrink = min(1.0, focal_length / native)
    width, height = (max(round(side * shrink), 1) for side in view.picture.size)
    small = cv2.resize(view.picture.radiance, (width, height), interpolation=cv2.INTER_AREA)
    codes = view.picture.clipped
    scales = np.array([width, height]) / view.picture.size
    if codes is not None:
        codes = np.where(codes == OUTSIDE, OUTSIDE, 0).astype(np.uint8)
        codes = cv2.resize(codes, (width, height), interpolation=cv2.INTER_NEAREST)
    centre = (float(view.centre[0] * scales[0]), float(view.centre[1] * scales[1]))
    small_view = RoundView(
        RadianceMap(small, clipped=codes), view.lens, centre, view.radius * float(scales[0]), np.eye(3)
    )
    half = int(np.ceil(reach * focal_length))
    x, y = np.meshgrid(np.arange(-half, half + 1), np.arange(-half, half + 1))
    light, weight, _ = small_view.see(_directions(np.stack([x, y], axis=-1) / focal_length, view.lens.ahead))
    inside = cv2.erode((weight > 0).astype(np.uint8), np.ones((2 * BORDER + 1, 2 * BORDER + 1), np.uint8))
    values = in_stops(np.where(weight > 0, np.maximum(luminance(light), 0), 0))
    found, descriptors = described(values, 255 * inside, method.features)
    return Features(_directions((found - half) / focal_length, view.lens.ahead), descriptors, 1.0)


def _directions(flat: np.ndarray, ahead: bool) -> np.ndarray:
    """Unit directions (…, 3) of places (…, 2) of the stereographic plane, x right and y down, seen from inside."""
    quarter = (flat**2).sum(axis=-1) / 4
    depth = np.where(ahead, -1.0, 1.0)
    # Looking along +Z, as a mirror shows it, −X is to the right.
    direction = np.stack([-depth * flat[..., 0], -flat[..., 1], depth * (1 - quarter)], axis=-1)
    return direction / (1 + quarter)[..., None]


def _paired(
    views: Sequence[RoundView], features: Sequence[Features], first: int, second: int, method: Matching
) -> _Pair | None:
    """What two views have in common; None where too few matches agree."""
    matches = match(features[first], features[second], method.ratio)
    if len(matches) < method.least:
        return None
    a, b = features[first].points[matches[:, 0]], features[second].points[matches[:, 1]]
    generator = np.random.default_rng([method.seed, first, second])
    rotation, agreeing = most_agreed_rotation(a, b, method.tolerance, generator)
    # Only where both look should matches agree (Brown & Lowe 2007, eq. 13).
    both = _shown(views[first], b @ rotation.T) & _shown(views[second], a @ rotation)
    if agreeing.sum() <= max(method.least, 8 + 0.3 * both.sum()):
        return None
    return _Pair(first, second, a, b, agreeing, rotation)


def _shown(view: RoundView, directions: np.ndarray) -> np.ndarray:
    """Which directions (N, 3), of the camera's own frame, lie within the rim."""
    depth = -directions[:, 2] if view.lens.ahead else directions[:, 2]
    return view.lens.radius(np.arctan2(np.hypot(directions[:, 0], directions[:, 1]), depth)) <= 1


def _from_the_known(
    views: Sequence[RoundView], held: np.ndarray, pairs: Sequence[_Pair], method: Matching
) -> list[np.ndarray]:
    """World-from-view rotations of all; raises NotAPanorama for views that no matches join to one that is known."""
    turns = _along(views, held, pairs)
    if lost := [view.name for view, turn in zip(views, turns, strict=True) if turn is None]:
        joined = views[int(np.flatnonzero(held)[0])].name
        raise NotAPanorama(
            f"{', '.join(lost)}: too little in common with {joined} and what is joined to it, fewer than "
            f"{method.least} matches agree; let views overlap by 15° or more, or give how each was turned"
        )
    return [turn for turn in turns if turn is not None]


def _along(views: Sequence[RoundView], held: np.ndarray, pairs: Sequence[_Pair]) -> list[np.ndarray | None]:
    """World-from-view rotations along the pairs that agree most, None of views that none reaches from a known one."""
    root = len(views)
    # The more matches agree, the shorter the way; the spanning tree takes the shortest. Known views hang on the world.
    ends = [(pair.first, pair.second) for pair in pairs] + [(int(i), root) for i in np.flatnonzero(held)]
    ways = [1.0 / pair.agreeing.sum() for pair in pairs] + [1e-9] * int(held.sum())
    first, second = np.array(ends, int).T
    graph = sparse.csr_array((ways, (first, second)), (root + 1, root + 1))
    order, before = csgraph.breadth_first_order(csgraph.minimum_spanning_tree(graph), root, directed=False)
    by_ends = {(pair.first, pair.second): pair.rotation for pair in pairs}
    turns: list[np.ndarray | None] = [None] * root
    for new in order[1:]:
        old = before[new]
        reached = None if old == root else turns[old]
        if reached is None:
            turns[new] = np.asarray(views[new].rotation)
        else:
            turns[new] = reached @ (by_ends[(old, new)] if (old, new) in by_ends else by_ends[(new, old)].T)
    return turns


def _doubt_contradicted(views: Sequence[RoundView], held: np.ndarray, pairs: Sequence[_Pair], method: Matching) -> None:
    """Warn of known rotations beside the first known one that matches contradict, where matches join the two."""
    anchor = int(np.flatnonzero(held)[0])
    turns = _along(views, np.arange(len(views)) == anchor, pairs)
    joined = np.array([turn is not None for turn in turns])
    if (held & joined).sum() < 2:
        return
    # All but the first known one are free: what the matches alone say.
    start = [np.asarray(view.rotation) if turn is None else turn for view, turn in zip(views, turns, strict=True)]
    inside = [pair for pair in pairs if joined[pair.first]]
    free = joined & (np.arange(len(views)) != anchor)
    found = _fitted(views, start, inside, method, free)
    for index in np.flatnonzero(held & free).tolist():
        beside = rotation_angle(np.asarray(views[index].rotation).T @ found.turns[index])
        if beside > max(SURE * float(found.deviations[index]), LOOSE):
            warn(
                f"{views[index].name}: what it has in common with {views[anchor].name} and others says that it was "
                f"turned by {np.degrees(beside):.2g}° otherwise than given, known within "
                f"{np.degrees(found.deviations[index]):.1g}°; it is left as given: check the table"
            )


def _require_field_as_given(given: RoundLens, found: FisheyeLens | ParabolicMirror | None) -> None:
    """Refuse a field that is another than was given, and warn of one that may be."""
    if found is None or not isinstance(given, FisheyeLens | ParabolicMirror):
        return
    beside = abs(found.field / given.field - 1)
    words = f"the views fit a field of {np.degrees(found.field):.4g}°, not the {np.degrees(given.field):.4g}° given"
    if beside > REFUSED:
        raise NotAPanorama(f"{words}; give the angle across the rim within 15 %, and check the rim")
    if beside > DOUBTED:
        warn(f"{words}; check it, and the rim")


@dataclass(frozen=True, eq=False)
class _Fit:
    """World-from-view rotations, the lens where its field was found, and how well the matches agree by them."""

    turns: list[np.ndarray]
    lens: FisheyeLens | ParabolicMirror | None
    pairs: list[_Pair]
    error: float
    deviations: np.ndarray


@dataclass(frozen=True, eq=False)
class _Unknowns:
    """What numbers (K,) mean: three for the small turn of each view that is free, and ln of the field's change.

    start : world-from-view rotations before
    lens : whose field is found; None where it is not
    free : (N,) bool
    """

    start: Sequence[np.ndarray]
    lens: FisheyeLens | ParabolicMirror | None
    free: np.ndarray

    @property
    def turning(self) -> int:
        return 3 * int(self.free.sum())

    def turns(self, numbers: np.ndarray) -> list[np.ndarray]:
        steps = np.zeros((len(self.start), 3))
        steps[self.free] = numbers[: self.turning].reshape(-1, 3)
        return [rotation_from_vector(step) @ turn for step, turn in zip(steps, self.start, strict=True)]

    def lens_of(self, numbers: np.ndarray) -> FisheyeLens | ParabolicMirror | None:
        if self.lens is None:
            return None
        return replace(self.lens, field=float(min(self.lens.field * np.exp(numbers[-1]), 2 * np.pi)))

    def apart(self, pairs: Sequence[_Pair], numbers: np.ndarray) -> list[np.ndarray]:
        """What all matches of each pair differ by, (M, 3), in the world."""
        turns, new = self.turns(numbers), self.lens_of(numbers)
        found = []
        for pair in pairs:
            ends = [pair.a, pair.b]
            if self.lens is not None and new is not None:
                ends = [_bent(each, self.lens, new) for each in ends]
            found.append(ends[0] @ turns[pair.first].T - ends[1] @ turns[pair.second].T)
        return found


def _fitted(
    views: Sequence[RoundView], start: Sequence[np.ndarray], pairs: Sequence[_Pair], method: Matching, free: np.ndarray
) -> _Fit:
    """The turns that are free, (N,) bool, and the field, by robust least squares of what agreeing matches differ by."""
    lens = views[0].lens if method.distortion and all(view.lens == views[0].lens for view in views) else None
    unknowns = _Unknowns(start, lens if isinstance(lens, FisheyeLens | ParabolicMirror) else None, free)
    numbers = np.zeros(unknowns.turning + (unknowns.lens is not None))
    chosen = [pair.agreeing for pair in pairs]
    for _ in range(ROUNDS):
        found = _solved(unknowns, numbers, pairs, chosen)
        numbers, kept = found.x, chosen
        lengths = [np.linalg.norm(each, axis=-1) for each in unknowns.apart(pairs, numbers)]
        chosen = [
            length < BESIDE * max(float(np.median(length[near])), LEAST_DEVIATION)
            for length, near in zip(lengths, kept, strict=True)
        ]
    square = np.concatenate([length[near] for length, near in zip(lengths, kept, strict=True)]) ** 2
    # Of three components two are free, for both ends are unit vectors; half of such squares are below 2 ln 2 variances.
    variance = max(float(np.median(square)) / (2 * np.log(2)), LEAST_DEVIATION**2)
    covariance = np.linalg.pinv(found.jac.T @ found.jac) * variance
    spread = np.sqrt(np.diagonal(covariance)[: unknowns.turning].reshape(-1, 3).sum(axis=1))
    agreeing = [replace(pair, agreeing=near) for pair, near in zip(pairs, kept, strict=True)]
    deviations = np.zeros(len(views))
    deviations[free] = spread
    return _Fit(unknowns.turns(numbers), unknowns.lens_of(numbers), agreeing, float(np.sqrt(square.mean())), deviations)


def _solved(
    unknowns: _Unknowns, numbers: np.ndarray, pairs: Sequence[_Pair], chosen: Sequence[np.ndarray]
) -> optimize.OptimizeResult:
    """The numbers of the least robust misfit of the chosen matches (M,) bool of each pair."""

    def left(numbers: np.ndarray) -> np.ndarray:
        return np.concatenate([a[near] for a, near in zip(unknowns.apart(pairs, numbers), chosen, strict=True)])

    scale = max(float(np.median(np.linalg.norm(left(numbers), axis=-1))), LEAST_DEVIATION)

    def misfit(numbers: np.ndarray) -> np.ndarray:
        return np.concatenate([left(numbers).ravel(), scale * numbers[unknowns.turning :] / PRIOR_FIELD])

    return optimize.least_squares(misfit, numbers, loss="soft_l1", f_scale=2 * scale, x_scale=scale)


def _bent(directions: np.ndarray, old: FisheyeLens | ParabolicMirror, new: FisheyeLens | ParabolicMirror) -> np.ndarray:
    """Directions (N, 3) that a lens would see where another sees these."""
    ring = np.hypot(directions[:, 0], directions[:, 1])
    depth = -1.0 if old.ahead else 1.0
    angle = new.angle(old.radius(np.arctan2(ring, depth * directions[:, 2])))
    side = directions[:, :2] * (np.sin(angle) / np.maximum(ring, 1e-12))[:, None]
    return np.concatenate([side, depth * np.cos(angle)[:, None]], axis=1)
