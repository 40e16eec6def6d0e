"""Where a frame lies against frames already placed: a coarse search by ranks, then Gauss–Newton on their features."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from relume.capture.alignment.kernel import _agreement, _differentiate, _in_both, _look_up, _match, _place, _whiten
from relume.capture.alignment.pyramid import HIGH, LOW, Level
from relume.capture.alignment.warping import Motion

QUANTILES = np.linspace(0.0, 1.0, 129)
SAMPLES = 10_000
"""Pixels whose ranks are matched."""
FEWEST = 30
"""Features without which nothing is estimated."""
ITERATIONS = 12
STILL = 0.02
"""A step that moves the corners by less than this, in pixels of the level, is the last."""
OUTLIER = 3.0
"""Robust deviations at which a residual counts a quarter: things that moved are far beyond."""
HONESTY = 5.0
"""How much larger errors are than the scatter of residuals suggests: neighbouring features err together, and encodings
bend edges. On 200 synthetic hand-held brackets two thirds of all frames are then within their error."""
SIGNIFICANT = 3.0
"""Errors by which a turn must differ from its neighbour's to be believed."""
CLEAR = 0.6
"""Agreement below which a larger turn is tried; frames of real brackets that lie well reach it with few exceptions."""
TURNS = np.radians([-4.0, -2.0, 2.0, 4.0])
"""First guesses then; from each about 1.5° more is reached."""
DOUBTFUL = 1.5
"""Error at the corners, pixels, beyond which a turn is not believed: a lamp alone does not show one."""


@dataclass(frozen=True, eq=False)
class Placed:
    """A frame whose motion is known."""

    levels: tuple[Level, ...]
    motion: Motion


@dataclass(frozen=True)
class Estimate:
    """A frame's motion and how far it can be believed.

    motion : against the reference
    error : standard error of a corner's place, pixels of the photograph; infinite where nothing was estimated
    agreement : mean cosine between the directions of the edges of both frames; 1 for one scene, 0 for two
    """

    motion: Motion
    error: float
    agreement: float


def inverse(motion: Motion) -> Motion:
    """The motion that undoes `motion`."""
    x, y = Motion(0.0, 0.0, -motion.angle).apply(np.array([motion.dx, motion.dy]))
    return Motion(-float(x), -float(y), -motion.angle)


def estimate(levels: tuple[Level, ...], placed: Sequence[Placed], *, rotation: bool = True) -> Estimate:
    """The motion of a frame, coarse to fine.

    levels : its pyramid
    placed : frames of the same size; the first is the likest, and the coarse search is made against it alone
    rotation : whether a turn is looked for
    """
    start = coarse_motion(placed[0].levels[-1], levels[-1], placed[0].motion)
    if start is None:
        return Estimate(placed[0].motion, np.inf, 0.0)
    result = _from(start[0], levels, placed, rotation)
    if rotation and result.agreement < CLEAR:
        # A turn too large to be reached from none: begin with the likeliest of some.
        others = [coarse_motion(placed[0].levels[-1], levels[-1], placed[0].motion, turn) for turn in TURNS]
        best = max((other for other in others if other is not None), key=lambda other: other[1], default=start)
        again = _from(best[0], levels, placed, rotation)
        result = again if again.agreement > result.agreement + 0.1 else result
    return result


def _from(start: Motion, levels: tuple[Level, ...], placed: Sequence[Placed], rotation: bool) -> Estimate:
    """The motion of a frame, level by level from a first guess."""
    result, points = Estimate(start, np.inf, 0.0), None
    for index in range(len(levels) - 1, -1, -1):
        points = _points(levels, index, placed[:1] if index > 1 else placed, result.motion)
        if points is None:
            return Estimate(placed[0].motion, np.inf, 0.0)
        result = _refined(levels[index], points, result.motion, rotation)
    assert points is not None  # there is always a level
    turn = abs(result.motion.angle - placed[0].motion.angle) * np.hypot(*levels[0].size) / 2
    if rotation and (result.error > DOUBTFUL or turn < SIGNIFICANT * result.error) and turn > 0:
        # The neighbour's turn about the point where the features are, then the shift alone.
        middle = points.positions.mean(0)
        dx, dy = result.motion.apply(middle) - Motion(0.0, 0.0, placed[0].motion.angle).apply(middle)
        return _refined(levels[0], points, Motion(float(dx), float(dy), placed[0].motion.angle), False)
    return result


def _turned(level: Level, turn: float) -> Level:
    """The level as a frame turned back by `turn` radians shows it; the nearest pixels will do for a coarse search."""
    rows, columns = (a.ravel() for a in np.indices(level.values.shape))
    x, y = level.indices(Motion(0.0, 0.0, turn).apply(level.centred(rows, columns)))
    x, y = np.rint(x).astype(int), np.rint(y).astype(int)
    height, width = level.values.shape
    within = (x >= 0) & (y >= 0) & (x < width) & (y < height)
    x, y = np.clip(x, 0, width - 1), np.clip(y, 0, height - 1)
    values, valid, inside = (plane[y, x].reshape(height, width) for plane in (level.values, level.valid, level.inside))
    return replace(level, values=values, valid=valid, inside=inside * within.reshape(height, width).astype(np.uint8))


def coarse_motion(fixed: Level, moving: Level, prior: Motion, turn: float = 0.0) -> tuple[Motion, float] | None:
    """The shift of `moving` by the highest correlation of ranks, and how high; None without tones in common.

    prior : of `fixed`
    turn : of `moving` beyond the prior's, radians; taken for granted

    Exposure keeps the order of brightness: clipped to the ranks that both frames measure, their pictures are alike.
    """
    from scipy.fft import irfft2, next_fast_len, rfft2
    from scipy.ndimage import gaussian_filter

    moving = _turned(moving, turn) if turn else moving
    (a, low_a, high_a), (b, low_b, high_b) = fixed.ranks, moving.ranks
    low, high = max(low_a, low_b), min(high_a, high_b)
    if high - low < 0.01:
        return None
    shape = [int(next_fast_len(int(1.5 * n), True) or n) for n in a.shape]
    planes, masks = [], []
    for ranks, level in ((a, fixed), (b, moving)):
        inside = level.inside.astype(np.float32)
        bounded = (np.clip(ranks, low, high) - low) / (high - low)
        smooth = gaussian_filter(bounded * inside, 8.0)
        if not level.inside.all():
            smooth /= np.maximum(gaussian_filter(inside, 8.0), 1e-3)
        planes.append((bounded - smooth) * inside)
        masks.append(inside)
    fa, fb, fa2, fb2, fma, fmb = (
        np.asarray(rfft2(plane, shape)) for plane in (*planes, planes[0] ** 2, planes[1] ** 2, *masks)
    )
    product, energy_a, energy_b = (
        np.asarray(irfft2(np.conj(first) * second, shape)) for first, second in ((fa, fb), (fa2, fmb), (fma, fb2))
    )
    whole = float(np.sqrt((planes[0] ** 2).sum() * (planes[1] ** 2).sum()))
    energy = np.sqrt(np.maximum(energy_a, 0) * np.maximum(energy_b, 0))
    # Where little overlaps anything correlates: shifts that leave less than a quarter of the detail are not believed.
    score = np.where(energy > 0.25 * whole, product / np.maximum(energy, 1e-9 + 1e-3 * whole), -1.0)
    y, x = np.unravel_index(int(np.argmax(score)), score.shape)
    if score[y, x] <= 0:
        return None
    dy, dx = (i - n if i > n // 2 else i for i, n in zip((y, x), shape, strict=True))
    # p in the reference → `fixed` → the shift → the turn.
    shifted = np.array([prior.dx + dx * fixed.scale, prior.dy + dy * fixed.scale])
    x, y = Motion(0.0, 0.0, turn).apply(shifted)
    return Motion(float(x), float(y), prior.angle + turn), float(score.max())


@dataclass(frozen=True, eq=False)
class _Points:
    """Features of placed frames, in the reference's frame: what the frame should show, and how sure that is."""

    positions: np.ndarray
    targets: np.ndarray
    weights: np.ndarray
    gradients: np.ndarray


def _points(levels: tuple[Level, ...], index: int, partners: Sequence[Placed], motion: Motion) -> _Points | None:
    most = sum(len(partner.levels[index].features.values) for partner in partners)
    points = _Points(np.empty((most, 2)), np.empty(most), np.empty(most), np.empty((most, 2)))
    count, limits = 0, (LOW * 255 + 2, HIGH * 255 - 3)
    for partner in partners:
        found = partner.levels[index].features
        table = _relation(partner, levels, motion)
        if table is None:
            continue
        back = inverse(partner.motion)
        place = np.cos(back.angle), np.sin(back.angle), back.dx, back.dy, count
        written = points.positions, points.targets, points.weights, points.gradients
        count = _match(table, found.values, found.positions, found.gradients, *limits, *place, *written)
    if count < FEWEST:
        return None
    return _Points(points.positions[:count], points.targets[:count], points.weights[:count], points.gradients[:count])


def _relation(partner: Placed, levels: tuple[Level, ...], motion: Motion) -> np.ndarray | None:
    """What every quarter of a value from −4 to 260 turns into: the rising relation from the partner's values to the
    frame's, by matching ranks where both show the scene."""
    index = max(0, len(levels) - 2)
    fixed, moving = partner.levels[index], levels[index]
    step = max(1, int(np.sqrt(fixed.values.size / SAMPLES)))
    # Where the pixel (0, 0) of the partner lies, and how far from there the next ones in its row and column.
    corner = fixed.centred(np.array([0, 0, 1]), np.array([0, 1, 0]))
    across, down = (
        np.array([a[0], a[1] - a[0], a[2] - a[0]])
        for a in moving.indices(motion.apply(inverse(partner.motion).apply(corner)))
    )
    ours, theirs = np.empty((2, -(-fixed.values.shape[0] // step) * -(-fixed.values.shape[1] // step)), np.float32)
    count = _in_both(fixed.values, fixed.inside, moving.values, moving.inside, step, across, down, ours, theirs)
    if count < 100:
        return None
    chosen = np.rint(QUANTILES * (count - 1)).astype(int)
    return np.interp(np.arange(-4, 260.25, 0.25), np.sort(ours[:count])[chosen], np.sort(theirs[:count])[chosen])


def _refined(level: Level, points: _Points, motion: Motion, rotation: bool) -> Estimate:
    """Gauss–Newton with weights that leave out what moved."""
    radius = np.hypot(*level.size) / 2
    parameters = 3 if rotation else 2
    count = len(points.targets)
    (x, y, whitened, residual), seen = np.empty((4, count)), np.empty((count, 4))
    jacobian, weighted = np.empty((count, 3)), np.empty((count, parameters))
    known = points.positions, points.targets, points.weights
    error = np.inf
    for _ in range(ITERATIONS):
        turned = np.cos(motion.angle), np.sin(motion.angle), motion.dx, motion.dy
        _place(points.positions, *turned, *level.size, level.scale, x, y)
        _look_up(level.values, level.valid, x, y, 0, len(x), seen)
        count = _whiten(seen, points.targets, points.weights, whitened)
        if count < FEWEST:
            return Estimate(motion, np.inf, 0.0)
        spread = 1.4826 * float(np.median(np.abs(whitened[:count:4]))) + 1e-6
        limits = level.scale, radius, OUTLIER * spread
        _differentiate(seen, whitened, known, *turned, *limits, residual, jacobian, weighted)
        normal = weighted[:count].T @ jacobian[:count, :parameters]
        if np.linalg.cond(normal) > 1e8:
            return Estimate(motion, np.inf, 0.0)
        step = np.zeros(3)
        step[:parameters] = -np.linalg.solve(normal, weighted[:count].T @ residual[:count])
        motion = Motion(motion.dx + step[0], motion.dy + step[1], motion.angle + step[2] / radius)
        covariance = np.linalg.inv(normal) * spread**2
        error = HONESTY * float(np.sqrt(np.trace(covariance)))
        if np.abs(step).sum() < STILL * level.scale:
            break
    return Estimate(motion, error, _agreement(seen, points.gradients))
