"""An energy audit: what an environment map holds before and after a step, and whether the step lost any of it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from relume.image.colour import luminance
from relume.image.radiance import OUTSIDE, SATURATED
from relume.sphere.directions import normalised
from relume.sphere.mappings.mapping import Mapping, pixel_directions

AXES = ("+X", "-X", "+Y", "-Y", "+Z", "-Z")
_NORMALS = np.array(
    [[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]]
    + [normalised([x, y, z]).tolist() for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]
)
"""Surfaces whose irradiance is compared: those that face the axes, and those between."""
_ROWS = 1024
"""Maps with more rows are audited by blocks: a pixel of so many rows is 0.2°, and puts irradiance off by 0.15 %."""
LOSS = 0.01
"""Share of irradiance whose loss is reported: a third of what an eye sees as a step in brightness (1/30 of a stop)."""

GRAZING = 0.003
"""Share of the greatest irradiance that may change besides, at least: a sun that moves by a sixth of a degree."""
_MOVED = 0.5
"""Pixels by which a sun may move in a coarse map, for it stands in the middle of one."""


@dataclass(frozen=True, eq=False)
class Audit:
    """The energy of an environment map, in its unit.

    total : (3,) ∫ L dω over the sphere, per channel
    irradiance : (14, 3) on surfaces facing +X −X +Y −Y +Z −Z and the eight corners between them
    peak : (3,) radiance of the pixel of the greatest luminance
    peak_direction : (3,) unit, towards that pixel
    clipped : steradians whose radiance is only a lower bound
    unseen : steradians that no view saw, filled in
    unit : "relative" or "cd/m²"
    pixel : radians, the side of a pixel of mean solid angle
    """

    total: np.ndarray
    irradiance: np.ndarray
    peak: np.ndarray
    peak_direction: np.ndarray
    clipped: float
    unseen: float
    unit: str
    pixel: float

    def facts(self) -> dict[str, object]:
        """The audit for a person or a machine, six digits."""
        facts: dict[str, object] = {
            "total": six_digits(self.total),
            "irradiance": {axis: six_digits(self.irradiance[index]) for index, axis in enumerate(AXES)},
            "peak": six_digits(self.peak),
            "peak direction": six_digits(self.peak_direction),
        }
        if self.clipped:
            facts["clipped sr"] = float(f"{self.clipped:.4g}")
        if self.unseen:
            facts["unseen sr"] = float(f"{self.unseen:.4g}")
        return facts

    def losses(self, after: Audit) -> tuple[str, ...]:
        """What a step from this audit to `after` lost or added, a line each; none where irradiance agrees within 1 %.

        Compare the light as it was turned: irradiance belongs to directions.
        """
        lines = []
        change = (after.total - self.total) / np.maximum(self.total, 1e-30 + 1e-6 * self.total.max(initial=0))
        if np.abs(change).max() > LOSS:
            percent = ", ".join(f"{100 * each:+.2g} %" for each in change)
            lines.append(f"the light's total changed by {percent} (R, G, B)")
        was, fall = luminance(self.irradiance), luminance(after.irradiance - self.irradiance)
        # A lamp that moves by a share of a pixel is no loss, but counts where it shines along a surface.
        grazing = max(GRAZING, _MOVED * max(self.pixel, after.pixel))
        worst = int(np.argmax(np.abs(fall) / np.maximum(was + grazing / LOSS * was.max(), 1e-30)))
        if abs(fall[worst]) > LOSS * was[worst] + grazing * was.max():
            towards = ", ".join(f"{value:.2g}" for value in _NORMALS[worst])
            share = 100 * fall[worst] / max(was[worst], 1e-30)
            lines.append(f"irradiance on a surface facing ({towards}) changed by {share:+.2g} %")
        lost = luminance(self.peak) * 1e-2 > luminance(after.peak) and np.any(change < -LOSS)
        if lost:
            where = ", ".join(f"{value:.2g}" for value in self.peak_direction)
            lines.append(f"the brightest light, towards ({where}), is gone: it held {luminance(self.peak):.3g}")
        return tuple(lines)


def audit(
    radiance: np.ndarray, mapping: Mapping, clipped: np.ndarray | None, unit: str, rotation: np.ndarray | None = None
) -> Audit:
    """Measure the energy of an environment map: the work of `EnvironmentMap.audit`, whose fields the arguments are.

    Totals are sums over all pixels. Irradiance takes blocks of pixels together where a map has more than 1024 rows.
    """
    turn = np.eye(3) if rotation is None else np.asarray(rotation, np.float64)
    areas = mapping.solid_angles(len(radiance))
    flux, directions = _flux(radiance, mapping, areas)
    cosines = np.maximum(directions @ (_NORMALS @ turn).T.astype(np.float32), 0)
    brightness = luminance(radiance)
    row, column = np.unravel_index(int(brightness.argmax()), brightness.shape)
    height, width = brightness.shape
    middle = mapping.shown(np.array([(column + 0.5) / width, (row + 0.5) / height]))

    def marked(code: int) -> float:
        return 0.0 if clipped is None else float(areas[clipped == code].sum())

    return Audit(
        total=flux.sum(0, dtype=np.float64),
        irradiance=cosines.T.astype(np.float64) @ flux,
        peak=radiance[row, column].astype(np.float64),
        peak_direction=turn @ np.nan_to_num(mapping.directions(middle)),
        clipped=marked(SATURATED),
        unseen=marked(OUTSIDE),
        unit=unit,
        pixel=float(np.sqrt(areas.sum() / max(np.count_nonzero(areas), 1))),
    )


def _flux(radiance: np.ndarray, mapping: Mapping, areas: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Radiance × solid angle (N, 3) float64 of pixels or blocks, and the directions (N, 3) float32 of their middles."""
    rows, columns = radiance.shape[:2]
    block = 1
    while rows // block > _ROWS and _divides(mapping, rows, columns, 2 * block):
        block *= 2
    if block == 1:
        flux = radiance.astype(np.float64) * areas[..., None]
    else:
        # Row by row of blocks, so that no second map of double precision is needed.
        flux = np.empty((rows // block, columns // block, 3))
        for row in range(rows // block):
            lines = slice(row * block, (row + 1) * block)
            part = radiance[lines] * areas[lines, :, None]
            flux[row] = part.reshape(block, columns // block, block, 3).sum((0, 2))
    directions = pixel_directions(mapping, rows // block).astype(np.float32)
    return flux.reshape(-1, 3), directions.reshape(-1, 3)


def _divides(mapping: Mapping, rows: int, columns: int, block: int) -> bool:
    """Whether the map divides into blocks of so many pixels that are pixels of a smaller map."""
    if rows % block or columns % block:
        return False
    try:
        mapping.shape(rows // block)
    except ValueError:
        return False
    return True


def six_digits(values: np.ndarray) -> list[float]:
    """Values with six significant digits, as files of facts show them."""
    return [float(f"{value:.6g}") for value in values]
