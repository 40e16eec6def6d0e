"""Cameras and blocks of a place found together from marked edges, and how well the marks determine them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from relume.scene.places.ends import with_ends
from relume.scene.places.first_views import Lens, Start, first_views
from relume.scene.places.fitting import Distance, Fit, View
from relume.scene.places.photographs import PhotographFacts
from relume.scene.places.place_tables import PhotographTable, PlaceTables, camera_of, require_known
from relume.scene.places.quantities import Model, modelled
from relume.scene.places.sightings import sightings

ROBUST = 3.0
"""Standard deviations beyond which a mark counts linearly and not squared (Huber): of sound marks, 3 in 1000."""
UNDETERMINED = 0.5
"""Share of a size, or of the place's extent, from which on a deviation means that the marks do not determine it."""
LOOSE = 0.05
"""Share of a size from which on its deviation is worth a word."""
ELSEWHERE = 0.01
"""Share of the picture's longer side by which the marks of a photograph miss that does not belong to the place."""
STRAY = 5.0
"""Standard deviations from which on a single mark is named."""
EXIF_DEVIATION = 0.02
"""Share by which focal lengths of EXIF are off: they are rounded to millimetres, and a lens breathes."""


@dataclass(frozen=True, eq=False)
class Solution:
    """A fit at its minimum.

    values : of all unknowns; covariance : of them
    names : of the unknowns, for messages
    residuals : of marks, in their standard deviation; edges first, then corners, x then y
    """

    fit: Fit
    values: np.ndarray
    covariance: np.ndarray
    names: tuple[str, ...]
    residuals: np.ndarray
    chi_square: float
    doubts: tuple[str, ...]

    @property
    def freedom(self) -> int:
        """Residuals beyond the unknowns."""
        return len(self.residuals) - len(self.values)


def solved(tables: PlaceTables, facts: tuple[PhotographFacts, ...]) -> Solution:
    """Find all cameras and sizes; raises ValueError, one line, where the marks do not determine them."""
    model = modelled(tables.blocks)
    fit, start = _posed(tables, facts, model)
    begin = fit.start(start.lengths, start.turns, _lens_focals(fit, start))
    scale = _steps(fit, begin)
    values = _nearest(fit, begin, scale)
    if tables.ends:
        fit = with_ends(fit, values)
        values = _nearest(fit, values, scale)
    residuals = fit.errors(values)
    names = _names(fit, tables)
    _require_one_place(fit, tables, residuals, facts)
    covariance = _covariance(fit, values, residuals, names, scale)
    doubts = _doubts(fit, tables, values, residuals, covariance, names)
    return Solution(fit, values, covariance, names, residuals, float(np.sum(residuals**2)), doubts)


def _nearest(fit: Fit, begin: np.ndarray, scale: np.ndarray) -> np.ndarray:
    """The unknowns that explain the marks best, from a start; `scale` : a step of each."""
    from scipy.optimize import least_squares

    slope: Any = lambda x: fit.jacobian(x * scale) * scale  # noqa: E731  SciPy's stubs know strings alone
    try:
        found = least_squares(
            lambda x: fit.errors(x * scale), begin / scale, jac=slope, loss="huber", f_scale=ROBUST, method="trf",
            xtol=1e-12, ftol=1e-12, gtol=1e-10, max_nfev=300,
        )  # fmt: skip
    except ValueError:  # SciPy's, of numbers that are not finite
        raise ValueError("no place explains the marks; has each mark its own edge's name?") from None
    return found.x * scale


def _posed(tables: PlaceTables, facts: tuple[PhotographFacts, ...], model: Model) -> tuple[Fit, Start]:
    """The problem with its start."""
    marks = sightings(tables, model)
    photographs = tables.photographs
    distances = tuple(known_distance(tables, model, i) for i in range(len(tables.lengths)))
    if not distances and not any(q.constant for b in model.blocks for q in (*b.size, *b.low)):
        raise ValueError("nothing sets the scale; give one size in metres, or a distance in [[lengths]]")
    centres = np.array([t.centre or (f.size[0] / 2, f.size[1] / 2) for t, f in zip(photographs, facts, strict=True)])
    seen = _straight(marks.pixels, marks.photograph, photographs, facts, centres)
    corner_seen = _straight(marks.corner_pixels, marks.corner_photograph, photographs, facts, centres)
    for number, table in enumerate(photographs):
        if not np.any(marks.photograph == number):
            raise ValueError(f"photograph {table.name!r} has no marked edges; mark some, or leave it out")
    # Photographs that name the same lens share its focal length.
    lens_names: list[str] = []
    numbers: list[int | None] = []
    priors: dict[int, tuple[int, float, float]] = {}
    for table, fact in zip(photographs, facts, strict=True):
        if table.focal_length is not None:
            numbers.append(None)
            continue
        name = f"lens {table.lens!r}" if table.lens else f"photograph {table.name!r}"
        if name not in lens_names:
            lens_names.append(name)
        numbers.append(lens_names.index(name))
        if fact.exif_focal_length:
            priors[lens_names.index(name)] = (
                lens_names.index(name), float(np.log(fact.exif_focal_length)), EXIF_DEVIATION,
            )  # fmt: skip
    lenses = [
        Lens(f.size, (float(c[0]), float(c[1])), t.focal_length or f.exif_focal_length)
        for t, f, c in zip(photographs, facts, centres, strict=True)
    ]
    start = first_views(model, marks, seen, lenses, [t.name for t in photographs], distances)
    views = tuple(
        View(start.rotations[k], start.positions[k], start.focal[k], number) for k, number in enumerate(numbers)
    )
    fit = Fit(
        model, marks, seen, corner_seen, views, distances, tables.deviation, tuple(priors.values()), len(lens_names)
    )
    return fit, start


def _straight(
    pixels: np.ndarray, photograph: np.ndarray, tables: tuple[PhotographTable, ...], facts: tuple[PhotographFacts, ...],
    centres: np.ndarray,
) -> np.ndarray:  # fmt: skip
    """Marks (N, 2) as a lens without distortion shows them, x right and y up from the principal point."""
    seen = (pixels - centres[photograph]) * [1, -1]
    for number, (table, fact) in enumerate(zip(tables, facts, strict=True)):
        if table.distortion is not None and table.focal_length is not None:
            rows = photograph == number
            camera = camera_of(table, fact.size, table.focal_length, np.zeros(3), np.eye(3))
            rays = camera.rays_through(pixels[rows])
            if not np.isfinite(rays).all():
                raise ValueError(f"photograph {table.name!r}: a mark lies where the distortion has folded over")
            seen[rows] = table.focal_length * rays[:, :2] / -rays[:, 2:]
    return seen


def known_distance(tables: PlaceTables, model: Model, number: int) -> Distance:
    """A measured distance of the place file; raises ValueError naming a block or corner that there is not."""
    table = tables.lengths[number]
    names = [block.name for block in model.blocks]
    ends = []
    for word in table.between:
        block, _, corner = word.partition(".")
        where = f"lengths.{number}.between"
        require_known(block, names, where, "block")
        index = names.index(block)
        body = model.blocks[index].body
        require_known(corner, body.corners, where, f"corner of a {model.blocks[index].kind}")
        ends.append((model.points(index, [body.corners[corner]])[0], model.blocks[index].turn))
    (a, first), (b, second) = ends
    return Distance(a, b, (first, second), table.metres, table.deviation)


def _lens_focals(fit: Fit, start: Start) -> list[float]:
    """Of each lens the median of where its photographs start."""
    return [
        float(np.median([f for f, view in zip(start.focal, fit.views, strict=True) if view.lens == lens]))
        for lens in range(fit.lenses)
    ]


def _extent(fit: Fit, values: np.ndarray) -> float:
    """How large the place is, metres: the root mean square of its sizes and the cameras' distances."""
    six = values[fit.first_camera : fit.first_lens].reshape(-1, 6)
    return (
        float(np.sqrt(np.mean(np.sum((six[:, 3:] - six[:, 3:].mean(0)) ** 2, axis=-1))))
        + 1e-3
        + float(np.median(np.abs(values[: len(fit.model.lengths)])) if fit.model.lengths else 0.0)
    )


def _steps(fit: Fit, values: np.ndarray) -> np.ndarray:
    """A step of each unknown that moves what is seen about as much."""
    steps = np.full(fit.count, 0.1)
    extent = _extent(fit, values)
    steps[: len(fit.model.lengths)] = 0.1 * extent
    for k in range(len(fit.views)):
        steps[fit.first_camera + 6 * k + 3 : fit.first_camera + 6 * k + 6] = 0.1 * extent
    return steps


def _names(fit: Fit, tables: PlaceTables) -> tuple[str, ...]:
    names = [*fit.model.lengths, *(f"turn of block {fit.model.turns[i].name!r}" for i in fit.unknown_turns)]
    for table in tables.photographs:
        names += [f"rotation of camera {table.name!r}"] * 3 + [f"position of camera {table.name!r}"] * 3
    for lens in range(fit.lenses):
        table = tables.photographs[next(k for k, view in enumerate(fit.views) if view.lens == lens)]
        names.append(f"focal length of {f'lens {table.lens!r}' if table.lens else f'camera {table.name!r}'}")
    return tuple(names)


def _per_photograph(fit: Fit, residuals: np.ndarray, k: int) -> np.ndarray:
    """Residuals (M,) of one photograph's marks, in standard deviations."""
    lines, corners = len(fit.marks.photograph), len(fit.marks.corner_photograph)
    both = residuals[lines : lines + 2 * corners].reshape(2, -1)[:, fit.marks.corner_photograph == k].reshape(-1)
    return np.concatenate([residuals[:lines][fit.marks.photograph == k], both])


def residual_of(fit: Fit, residuals: np.ndarray, k: int) -> float:
    """Root mean square of a photograph's residuals, pixels."""
    return float(np.sqrt(np.mean(_per_photograph(fit, residuals, k) ** 2))) * fit.deviation


def _require_one_place(
    fit: Fit, tables: PlaceTables, residuals: np.ndarray, facts: tuple[PhotographFacts, ...]
) -> None:
    """A stray mark is named later; where a third of a photograph's marks or more are off, it is another place."""
    off = [float(np.quantile(np.abs(_per_photograph(fit, residuals, k)), 2 / 3)) for k in range(len(fit.views))]
    shares = [each * fit.deviation / max(fact.size) for each, fact in zip(off, facts, strict=True)]
    k = int(np.argmax(shares))
    if not shares[k] <= ELSEWHERE:
        raise ValueError(
            f"photograph {tables.photographs[k].name!r} does not agree with the others: a third of its marks lie more "
            f"than {off[k] * fit.deviation:.0f} pixels from their edges; does it show the same place, and has each "
            "mark its own edge's name?"
        )


def _covariance(
    fit: Fit, values: np.ndarray, residuals: np.ndarray, names: tuple[str, ...], scale: np.ndarray
) -> np.ndarray:
    """(N, N) of the unknowns; raises ValueError naming one that the marks do not determine."""
    slope = fit.jacobian(values) * scale
    _, singular, axes = np.linalg.svd(slope, full_matrices=False)
    loose = singular <= 1e-9 * singular[0]
    weights = np.where(loose, 0.0, 1 / np.where(loose, 1.0, singular))
    spare = max(len(residuals) - len(values), 1)
    # Marks that fit better than a person draws do so by chance; those that fit worse make all less sure.
    noise = max(1.0, float(np.sqrt(np.mean(np.minimum(residuals**2, ROBUST**2)) * len(residuals) / spare)))
    covariance = noise**2 * (axes.T * weights**2) @ axes * np.outer(scale, scale)
    free = 1 - np.sum(axes[~loose] ** 2, axis=0) > 1e-6
    deviations = np.sqrt(np.diag(covariance))
    extent = _extent(fit, values)
    lengths = len(fit.model.lengths)
    for number, name in enumerate(names):
        limit = UNDETERMINED * extent if number < fit.first_lens else UNDETERMINED
        if number < lengths:
            limit = max(UNDETERMINED * abs(values[number]), 0.05 * extent)
        elif number < fit.first_camera or (number < fit.first_lens and (number - fit.first_camera) % 6 < 3):
            limit = UNDETERMINED
        if free[number] or not deviations[number] <= limit:
            raise ValueError(f"{name} is not determined: {_remedy(name)}")
    return covariance


def _remedy(name: str) -> str:
    """What to do about an unknown that the marks do not determine."""
    if "camera" in name or "lens" in name:
        about = "give its focal_length, or " if name.startswith("focal") else ""
        return f"{about}mark more edges in that photograph, along all three axes and at several depths"
    block = name.rpartition(" ")[2].strip("'")
    word = name.split(" ")[0]
    what = {"width": "left or right end of", "height": "top or bottom of", "depth": "front or back of"}.get(word)
    if what:
        return f"mark an edge at the {what} {block!r}, or give {word} in metres or by another block's"
    return f"mark more edges of {block!r}, or align it with another block"


def _doubts(
    fit: Fit, tables: PlaceTables, values: np.ndarray, residuals: np.ndarray, covariance: np.ndarray,
    names: tuple[str, ...],
) -> tuple[str, ...]:  # fmt: skip
    """One line each: marks far off, photographs that fit badly, sizes that are known loosely."""
    lines, corners = len(fit.marks.photograph), len(fit.marks.corner_photograph)
    off = np.abs(residuals[:lines])
    if corners:
        off = np.concatenate([off, np.hypot(*residuals[lines : lines + 2 * corners].reshape(2, -1))])
    doubts = [
        f"mark {fit.marks.labels[i]} lies {off[i] * fit.deviation:.1f} pixels from the edge; has it the right name?"
        for i in np.argsort(-off)[:3]
        if off[i] > STRAY
    ]
    for number in range(len(fit.model.lengths)):
        deviation, value = float(np.sqrt(covariance[number, number])), float(values[number])
        if names[number].split(" ")[0] in ("width", "height", "depth"):
            if value <= 0:
                doubts.append(
                    f"{names[number]} comes out as {value:.3g} m; are left and right, or front and back, swapped?"
                )
            elif deviation > LOOSE * value:
                doubts.append(
                    f"{names[number]} is {value:.3g} m ± {100 * deviation / value:.0f} % only; mark more of it"
                )
    return tuple(dict.fromkeys(doubts))
