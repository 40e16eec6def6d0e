"""A mirrored ball's rim by the likelihood of whole profiles across it, as sharp as the picture allows.

What is seen along a line across the place is taken for a random walk in angle: things that are twice as far apart
differ twice as much, squared. Outside the rim pixels are steps of that walk, alike everywhere; inside, at the depth s,
a ball of radius R shows what lies 2·acos(1 − s/R) aside of the rim, so that the walk is squeezed ever more towards it.
At the rim it goes on, or jumps where the ball reflects less than all. Lens and pixel blur all of it. So for every place
of the rim the covariance of a profile is known, and the place at which the profiles are likeliest is the rim. How much
a profile varies, how noisy it is, how lively its outside is and how far it jumps differ from ray to ray: each ray is a
mixture over those, whose shares the picture gives (empirical Bayes). Unlike an edge this also holds where blur reaches
as deep as the squeezing, or the ball is 20 pixels large. Pixel frame as in `silhouette`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache

import numpy as np

from relume.probe.ball.edge_tracking import profiles
from relume.probe.ball.mirror_edge import Part, Rim, best_move, reduced_radii, white, window_about
from relume.probe.ball.silhouette import Cone, Outline, cone_through, outline_of
from relume.probe.ball.windows import Pyramid, outline_within, outline_without

LOOKED_AT = (80.0, 56.0, 40.0, 28.0, 20.0)
"""Radius of the ball, in pixels, of the pictures that are tried: the next where the last is blurred."""
BLURS = (0.0, 0.45, 0.85, 1.3)
"""Standard deviations of the lens's blur that are tried, pixels; at the last a smaller picture is taken."""
NEARER, NEAR, LEANING, AS_SURE = 0.2, 0.9, 0.85, 0.9
"""Pixels about the blur that was found by which others are tried for the last place: a blur taken 0.2 pixels too small
moved rims of traced balls outward by a third of a pixel, one after the other. And how far from the likeliest rim
of the root the one of linear light may lie: 0.2 to 0.8 pixels where it was better; beyond 1 lamps decided it. And
the blur below which it must have this share of the other's evidence: it had 0.75 where it took a sharp real rim 0.7 %
too far down."""
PIXEL = 0.5
"""The same of what a pixel, and looking up between pixels, blur by themselves: √(1/12 + 1/6)."""
RAY_COUNT, STEP, MOVED = 240, 0.5, 0.25
"""Rays; pixels between the samples of a profile, and between the places of the rim that are tried."""
FINE = 0.1
"""Pixels between the steps of the walk."""
OUTSIDES = ((1e-3, 0.0), (3e-2, 0.0), (3e-2, 0.5), (1.0, 0.5))
"""Variance of the walk for each pixel outside, and of a jump at the rim, against that of a radian inside."""
NOISES = (1e-4, 1e-3, 1e-2, 1e-1, 1.0)
"""Variance of noise, against the same."""
USUAL, LIKE_USUAL = (0.5, 0.1, 0.3, 0.1), 0.5
"""Shares of the rays for each of `OUTSIDES`, as they come out on photographs (uiuc, xu, pietka, the room),
and how much that counts against the picture's own, or wrong rims are explained by lively surroundings."""
MIRRORED = 0.5
"""Share of the rays before white that meet white in the ball too."""
DEPTH, LEAST_DEPTH, AROUND, LEAST_AROUND = 0.12, 6.0, 0.08, 4.0
"""How much is looked at inside and outside the rim, in radii and at least in pixels."""
REACHES, LEAST_REACH, LAST_REACH = (0.02, 0.05), 2.0, 1.5
"""How far off the rim is sought, in radii and at least in pixels, and farther where it is not plain; then in pixels."""
VISIBLE, FEWEST = 4.0, 8
"""Profiles that the picture's edge cuts are used to whole multiples of so many pixels, and of so many samples."""
PLAIN = 1.2
"""Log-likelihood for each ray, against the rim 1.5 pixels aside, from which on the rim is believed: 1.2 to 7 where it
was right to a per cent, in photographs and traced, 0.1 to 1 where a band beside it was taken. It does not say that a
ball is there: a place without one may give as much."""


def likeliest_rim(pyramid: Pyramid, outline: Outline) -> Rim | None:
    """The rim near an outline at which the profiles across it are likeliest; None where none is plainly so.

    pyramid : of the whole picture; its focal length is taken
    outline : within a few per cent of the rim
    """
    found, at = None, 0.0
    for reach in REACHES:
        found, at = _sharpest(pyramid, outline, reach, LOOKED_AT if found is None else (at,))
        if found.evidence >= PLAIN:
            return found
    return None


def sharpest_rim(pyramid: Pyramid, outline: Outline) -> Rim:
    """The likeliest rim within two per cent of an outline, however little speaks for it."""
    return _sharpest(pyramid, outline, REACHES[0], LOOKED_AT)[0]


def _sharpest(pyramid: Pyramid, outline: Outline, reach: float, radii: Sequence[float]) -> tuple[Rim, float]:
    """The same whatever the evidence, in the first picture that is sharp, and the radius that the ball has there."""
    found, at = Rim(outline, 0.0), np.inf
    for at in reduced_radii(outline.radius, radii):
        window, light = window_about(pyramid, outline, at)
        # The root keeps lamps from outweighing all else, and makes the noise of photons even.
        part = Part(np.sqrt(light), window.size, window.focal_length)
        rough = outline_within(window, outline)
        cone = cone_through(rough.points, window.size, window.focal_length)
        wide = float(np.ceil(max(reach * rough.radius, LEAST_REACH)))
        cone, blur, _ = _placed(part, cone, rough.radius, wide, BLURS[2:3], learn=False)
        cone, blur, evidence = _placed(part, cone, rough.radius, LAST_REACH, BLURS)
        if blur < BLURS[-1] or at == radii[-1]:
            cone, _, evidence = _placed(part, cone, rough.radius, LAST_REACH, (blur,))
            # A lens blurs light and not its root, in which a blurred rim leans towards the darker side.
            linear = replace(part, light=light)
            nearer = tuple(each for each in (blur - NEARER, blur, blur + NEARER) if each >= 0)
            sharper, _, sure = _placed(linear, cone, rough.radius, LAST_REACH, nearer)
            # Where little is blurred little leans, and lamps may say more than the rim.
            believed = blur >= LEANING or sure > AS_SURE * evidence
            cone = sharper if believed and _near(part, cone, sharper) else cone
        placed = outline_of(cone, part.size, part.focal_length, coverage=outline.coverage)
        found = Rim(replace(outline_without(window, placed, pyramid), rivals=outline.rivals), evidence)
        if blur < BLURS[-1]:
            break
    return found, at


def _placed(
    part: Part, cone: Cone, radius: float, reach: float, blurs: tuple[float, ...], learn: bool = True
) -> tuple[Cone, float, float]:
    """The cone up to `reach` pixels off at which profiles are likeliest, its blur, and its evidence for each ray.

    learn : whether the shares of kinds of rays are learnt from the picture; the usual ones else
    """
    rim, normals = cone.silhouette(part.size, part.focal_length, RAY_COUNT)
    low = -float(np.ceil(max(DEPTH * radius, LEAST_DEPTH))) - reach
    high = float(np.ceil(max(AROUND * radius, LEAST_AROUND))) + reach
    steps = np.arange(low, high + STEP / 2, STEP)
    seen = profiles(part.light, rim, normals, steps)
    shown = profiles(np.ones_like(part.light), rim, normals, steps, mode="constant") > 0.99
    # Of a ball that the picture cuts, or that fills it, the part up to the picture's edge.
    whole = int(VISIBLE / STEP)
    visible = np.where(shown.all(1), len(steps), np.argmin(shown, axis=1) // whole * whole)
    # Radii much alike share their models.
    round_radius = float(np.exp(np.round(20 * np.log(radius)) / 20))
    moves = np.arange(-reach, reach + MOVED / 2, MOVED)
    behind = profiles(white(part.light).astype(np.float64), rim, normals, moves) > 0.5
    best: tuple[float, Cone, float, float] | None = None
    for blur in blurs:
        kinds = _kinds(seen, visible, (round_radius, blur, low, reach, len(moves)))
        likelihood = _hidden(_mixed(kinds, _USUAL), behind)
        by, cost = best_move(-likelihood, moves, normals, 0.9 * reach)
        for _ in range(2 if learn else 0):
            likelihood = _hidden(_mixed(kinds, _learnt(kinds, moves, normals, by)), behind)
            by, cost = best_move(-likelihood, moves, normals, 0.9 * reach)
        if best is None or cost < best[0]:
            worse = max(float(likelihood[:, end].sum()) for end in (0, -1))
            best = cost, part.moved(cone, by), blur, (-cost - worse) / RAY_COUNT
    assert best is not None
    return best[1:]


def _hidden(likelihood: np.ndarray, behind: np.ndarray) -> np.ndarray:
    """The log-likelihood (N, M) of rays of which each may have its rim anywhere in the white that it meets.

    behind : (N, M) whether a place is white. Where the ball mirrors white before white the rim is not seen, and what is
    seen begins where the white ends
    """
    if not behind.any():
        return likelihood
    most = np.where(behind, likelihood, -np.inf).max(1, keepdims=True)
    anywhere = np.where(behind, most + np.log(MIRRORED / likelihood.shape[1]), -np.inf)
    return np.where(behind.any(1, keepdims=True), np.logaddexp(likelihood + np.log(1 - MIRRORED), anywhere), likelihood)


def _near(part: Part, one: Cone, other: Cone) -> bool:
    """Whether two silhouettes are alike to `NEAR` pixels, middle and radius."""
    first, second = (outline_of(each, part.size, part.focal_length) for each in (one, other))
    moved = float(np.hypot(*np.subtract(first.centre, second.centre)))
    return max(moved, abs(first.radius - second.radius)) < NEAR


def _kinds(seen: np.ndarray, visible: np.ndarray, place: tuple[float, float, float, float, int]) -> np.ndarray:
    """The log-likelihood (K, N, M) of profiles (N, …), as rays of each kind, with the rim at each place that is tried.

    visible : (N,) samples of each that lie in the picture
    place : what `_model` needs
    """
    noises = np.array(NOISES)[:, None]
    found = np.zeros((len(_USUAL), len(seen), place[-1]))
    for samples in np.unique(visible[visible >= FEWEST]):
        rows = np.flatnonzero(visible == samples)
        for pair, (lively, jump) in enumerate(OUTSIDES):
            own = slice(pair * len(NOISES), (pair + 1) * len(NOISES))
            for number, (variances, axes) in enumerate(_model(int(samples), lively, jump, *place)):
                # Of a profile of unknown contrast k: −½ ln det k·C − ½ yᵀC⁻¹y/k, at the likeliest k.
                total = variances + noises
                squared = (seen[rows, :samples] @ axes.T) ** 2 @ (1 / total).T
                fit = -0.5 * (samples - 1) * np.log(squared + 1e-12) - 0.5 * np.log(total).sum(1)
                found[own, rows, number] = fit.T
    return found


@lru_cache(maxsize=256)
def _model(
    samples: int, lively: float, jump: float, radius: float, blur: float, low: float, reach: float, count: int
) -> tuple[tuple[np.ndarray, np.ndarray], ...]:
    """For each place of the rim the principal variances (S − 1,) of a profile about its mean, and their axes."""
    fine, met = _steps_met(samples, blur, low, reach, count)
    # The walk begins at the rim: variances of its steps inwards, by the angle that is left, and outwards.
    aside = 2 * np.arccos(np.clip(1 - np.maximum(-fine, 0) / radius, -1, 1))
    step = np.where(fine < 0, aside - np.append(aside[1:], 0), lively * FINE)
    first = np.argmax(fine > 0)
    step[first] = lively * fine[first] + jump
    found = []
    for mixed, varied in met:
        variances, axes = np.linalg.eigh((mixed * step) @ mixed.T)
        found.append((np.maximum(variances, 0), axes.T @ varied))
    return tuple(found)


@lru_cache(maxsize=32)
def _steps_met(
    samples: int, blur: float, low: float, reach: float, count: int
) -> tuple[np.ndarray, tuple[tuple[np.ndarray, np.ndarray], ...]]:
    """The walk's steps (F,), pixels from the rim, and for each place of the rim how much of each step is in each
    sample (S − 1, F), and the axes (S − 1, S) along which those samples differ."""
    steps = low + STEP * np.arange(samples)
    fine = np.arange(low - reach - 4, steps[-1] + reach + 4, FINE) + FINE / 2
    # What all samples share says nothing.
    varied = np.linalg.svd(np.ones((1, samples)))[2][1:]
    found = []
    for move in np.linspace(-reach, reach, count):
        blurred = np.exp(-0.5 * ((steps[:, None] - move - fine) / np.hypot(blur, PIXEL)) ** 2)
        blurred = varied @ (blurred / blurred.sum(1, keepdims=True))
        # A step inwards is in all that lies deeper, one outwards in all that lies farther out.
        deeper = np.cumsum(blurred, axis=1)
        found.append((np.where(fine < 0, deeper, deeper[:, -1:] - deeper + blurred), varied))
    return fine, tuple(found)


_USUAL = np.repeat(USUAL, len(NOISES)) / len(NOISES)


def _mixed(kinds: np.ndarray, shares: np.ndarray) -> np.ndarray:
    """The log-likelihood (N, M) of rays of which each is of one of the kinds (K, N, M)."""
    each = kinds + np.log(shares)[:, None, None]
    most = each.max(0)
    return most + np.log(np.exp(each - most).sum(0))


def _learnt(kinds: np.ndarray, moves: np.ndarray, normals: np.ndarray, by: np.ndarray) -> np.ndarray:
    """The shares of the kinds at a rim moved by `by`, with the usual ones as so many rays more."""
    place = np.rint((by[2] + normals @ by[:2] - moves[0]) / MOVED).astype(int)
    there = kinds[:, np.arange(len(normals)), np.clip(place, 0, len(moves) - 1)]
    shares = _USUAL
    for _ in range(3):
        each = there + np.log(shares)[:, None]
        each = np.exp(each - each.max(0))
        total = (each / each.sum(0)).sum(1) + LIKE_USUAL * len(normals) * _USUAL
        shares = total / total.sum()
    return shares
