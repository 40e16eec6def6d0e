"""A sun that clipped, recovered from a matte ball or a chart that stood in the same light.

Clipped pixels hold a lower bound. How much they lack is measured by things that average light: a grey ball of known
albedo reflects ρ/π times its irradiance, which is that of the map as it is plus x max(0, n·ω) of every clipped source.
The x ≥ 0 of each channel are the least squares fit over all sides of the ball that are seen (Debevec et al.,
"Estimating Surface Reflectance Properties of a Complex Scene under Captured Natural Illumination", 2004, with one sun;
several sources by one linear system as in Debevec et al., "A Single-Shot Light Probe", 2012).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from relume.errors import SunNotRecovered, warn
from relume.image.colour import LUMINANCE_WEIGHTS
from relume.light.reflection.lobes import Lambert
from relume.light.reflection.reflection_map import reflection_map
from relume.light.suns.clipped_regions import ClippedPixels, Shape, clipped_pixels, middle_of, sources
from relume.light.suns.matte_readings import MatteReadings
from relume.sphere.environment_map import EnvironmentMap
from relume.sphere.mappings.mapping import pixel_directions

APART = np.radians(15)
"""Sources nearer than this light a matte ball so much alike that they are recovered as one."""
MOST = 8
"""Sources recovered at once: a matte ball measures about nine numbers a channel (Ramamoorthi & Hanrahan 2001)."""
SEEN = 0.2
"""Cosine that the best lit reading must reach for a source to be recovered from it."""
MODEL = 0.01
"""Share of a reading by which paint, the ball's shape and interpolation may be off; weighs dark sides against lit."""
DISAGREEMENT = 0.1
"""Mean relative residual from which on the result is doubtful."""
AGREEMENT = 0.05
"""Share by which readings and map may differ where nothing clipped."""
WIDEST = np.radians(3)
"""Width of a clipped source from which on it matters where in it the light was: real suns with haze about them, cut so
low that the haze clipped too, leave irradiance wrong by 5 % and more in some directions."""
_TABLE_ROWS = 72
_PRODUCTS = 4_000_000
"""Cosines held at once."""


@dataclass(frozen=True, eq=False)
class RecoveredSource:
    """One clipped source and what it was found to hold.

    direction : (3,), unit, towards its middle
    solid_angle : of its clipped pixels, steradians
    held : (3,), ∫ L dω of the clipped pixels as they were
    irradiance : (3,), the same recovered: what a surface facing the source receives
    uncertainty : (3,), standard deviation of `irradiance`
    """

    direction: np.ndarray
    solid_angle: float
    held: np.ndarray
    irradiance: np.ndarray
    uncertainty: np.ndarray

    @property
    def width(self) -> float:
        """Radians, the diameter of a round source of as large a solid angle."""
        return 2 * float(np.arccos(max(1 - self.solid_angle / (2 * np.pi), -1)))

    @property
    def factor(self) -> np.ndarray:
        """(3,), by how much the clipped pixels were too dark."""
        return self.irradiance / np.maximum(self.held, 1e-300)


@dataclass(frozen=True, eq=False)
class RecoveredSun:
    """A map whose clipped sources were recovered, and the record of it.

    light : the map; recovered pixels are no longer marked as saturated
    sources : the strongest first, as they were found to be
    residual : root mean square of (fit − reading) / reading
    agreement : by which factor the readings exceed the map where no clipped light falls; 1 ± `agreement_uncertainty`
        if albedo, exposure and orientation are right. NaN where there are too few readings
    source : what was read, as in "a grey ball of albedo 0.18"
    """

    light: EnvironmentMap
    sources: tuple[RecoveredSource, ...]
    residual: float
    agreement: float
    agreement_uncertainty: float
    source: str

    @property
    def attributes(self) -> dict[str, str]:
        """What a file of the map should store."""
        vectors_by_name = {
            "direction": [each.direction for each in self.sources],
            "irradiance": [each.irradiance for each in self.sources],
            "uncertainty": [each.uncertainty for each in self.sources],
            "factor": [each.factor for each in self.sources],
        }
        texts = {
            f"sun_recovered_{name}": "; ".join(",".join(f"{v:.6g}" for v in vector) for vector in vectors)
            for name, vectors in vectors_by_name.items()
        }
        texts["sun_recovered_residual"] = f"{self.residual:.4g}"
        if np.isfinite(self.agreement):
            texts["sun_recovered_agreement"] = f"{self.agreement:.4g} ± {self.agreement_uncertainty:.2g}"
        return {"sun_recovered": f"from {self.source}", **texts}

    def facts(self) -> dict[str, object]:
        """Sources and fit, for a person or a machine."""
        return {
            "from": self.source,
            "sources": [
                {
                    "direction": [round(float(value), 4) for value in source.direction],
                    "irradiance": [float(f"{value:.5g}") for value in source.irradiance],
                    "uncertainty": [float(f"{value:.2g}") for value in source.uncertainty],
                    "factor": [float(f"{value:.4g}") for value in source.factor],
                }
                for source in self.sources
            ],
            "residual": float(f"{self.residual:.3g}"),
        }

    @property
    def doubts(self) -> tuple[str, ...]:
        """Why the recovered light may be wrong: a line, or none."""
        remedy = "; is the reflectance right, and were both exposed alike at one place?"
        if abs(self.agreement - 1) > AGREEMENT:
            return (f"where nothing clipped the readings are {self.agreement:.3g} times the map{remedy}",)
        if self.residual > DISAGREEMENT:
            return (f"the recovered sun misses the readings by {100 * self.residual:.2g} %{remedy}",)
        return ()


def recover_sun(
    light: EnvironmentMap,
    readings: MatteReadings,
    *,
    level: float | None = None,
    shape: Shape = ClippedPixels(),
    apart: float = APART,
) -> RecoveredSun:
    """The map with as much light in its clipped pixels as matte things in the same light say there was.

    light : in any mapping; what lies below the horizon (the ground) belongs to it, since the ball is lit by it
    readings : by `measure_grey_ball` or `measure_chart`, in the same unit and exposure, at the place of the map
    level : radiance from which on pixels count as clipped; the map's own mask, else its plateau of brightest pixels
    shape : `ClippedPixels()` scales what the clipped pixels hold; `SunDisc()` puts what is missing into a disc of the
        sun's size, where the shadows' sharpness matters and a lens or the bracket clipped more than the sun
    apart : radians; clipped pixels nearer than this, 15° unless given, are one source

    Raises ValueError for readings in another unit, SunNotRecovered when nothing clipped, no reading sees the clipped
    light, the readings are black, too few or darker than the map without more light already makes them. Warns of
    readings that fit badly, or that disagree with the map by a factor in light that did not clip: then the albedo or
    the exposure is wrong, and so is the sun.
    """
    if readings.unit != light.unit:
        raise ValueError(f'readings are "{readings.unit}" and the map "{light.unit}"; bring both to one unit first')
    if not readings.irradiance.any():
        raise SunNotRecovered(f"{readings.source}: black all over, so nothing is known of the light; photograph it lit")
    # The clipped sources, and how each lights the readings' normals.
    directions = pixel_directions(light.mapping, light.size)
    mask = clipped_pixels(light, level)
    gathered = sources(light, directions, mask, apart)
    areas = light.mapping.solid_angles(light.size).reshape(-1)
    placed = [shape.place(light, directions, pixels) for pixels in gathered]
    lit = np.stack(
        [
            _cosines(directions.reshape(-1, 3)[pixels], areas[pixels] * each, readings.normals)
            for pixels, each in placed
        ],
        axis=-1,
    )
    chosen = _distinguishable(lit, [middle_of(light, directions, pixels) for pixels in gathered], readings)
    lit, gathered, placed = lit[:, chosen], [gathered[k] for k in chosen], [placed[k] for k in chosen]
    # The light that the readings have and the map does not, given to the sources.
    before = _irradiance(light, directions, mask, readings.normals)
    missing, spread, residual = _fitted(readings, before, lit)

    radiance = light.radiance.reshape(-1, 3).astype(np.float64)
    held = [areas[pixels] @ radiance[pixels] for pixels in gathered]
    for (pixels, each), more in zip(placed, missing, strict=True):
        radiance[pixels] += each[:, None] * more
    clipped = None if light.clipped is None else light.clipped.copy()
    if clipped is not None:
        clipped.reshape(-1)[np.concatenate(gathered)] = 0
    # What was found of each source, and how sure it is.
    recovered = [
        RecoveredSource(middle_of(light, directions, pixels), float(areas[pixels].sum()), was, was + more, error)
        for pixels, was, more, error in zip(gathered, held, missing, spread, strict=True)
    ]
    recovered.sort(key=lambda each: -float(each.irradiance @ LUMINANCE_WEIGHTS))
    agreement, uncertainty, scaled = _agreement(readings, before, lit)
    _warn(recovered, min(residual, scaled), agreement, uncertainty)
    result = replace(light, radiance=radiance.reshape(light.radiance.shape).astype(np.float32), clipped=clipped)
    return RecoveredSun(result, tuple(recovered), residual, agreement, uncertainty, readings.source)


def _distinguishable(lit: np.ndarray, middles: list[np.ndarray], readings: MatteReadings) -> list[int]:
    """Which sources the readings can separate, strongest first; what cannot be stays as it is, and is warned of."""
    seen = [k for k in range(lit.shape[1]) if lit[:, k].max() >= SEEN]
    if not seen:
        towards = ", ".join(f"{v:.2f}" for v in middles[0])
        nearest = np.degrees(np.arccos(np.clip((readings.normals @ middles[0]).max(), -1, 1)))
        raise SunNotRecovered(
            f"{readings.source} shows no side that the clipped light from ({towards}) falls on: the nearest is "
            f"{nearest:.0f}° from facing it; photograph it from the side of the sun"
        )
    if len(readings.normals) < len(seen[:MOST]):
        raise SunNotRecovered(
            f"{len(seen)} sources clipped, which {readings.source} cannot separate; read more sides, or give a "
            "higher level so that only the brightest counts"
        )
    if len(seen[:MOST]) < lit.shape[1]:
        warn(
            f"{lit.shape[1] - len(seen[:MOST])} of {lit.shape[1]} clipped sources light no side that is seen, or are "
            "too many; they stay as dark as they are"
        )
    return seen[:MOST]


def _irradiance(light: EnvironmentMap, directions: np.ndarray, mask: np.ndarray, normals: np.ndarray) -> np.ndarray:
    """Irradiance (N, 3) of the map as it is; the clipped pixels summed one by one, the rest from a fine table."""
    rest = replace(light, radiance=np.where(mask[..., None], np.float32(0), light.radiance), clipped=None)
    table = reflection_map(rest, Lambert(), _TABLE_ROWS)
    areas = light.mapping.solid_angles(light.size)
    clipped = _cosines(directions[mask], light.radiance[mask] * areas[mask][:, None], normals)
    return np.pi * table.lookup(normals) + clipped


def _cosines(directions: np.ndarray, flux: np.ndarray, normals: np.ndarray) -> np.ndarray:
    """Σ flux · max(0, n·ω) over directions (M, 3), flux (M, …), for normals (N, 3): (N, …)."""
    step = max(_PRODUCTS // len(directions), 1)
    blocks = [normals[k : k + step] for k in range(0, len(normals), step)]
    return np.concatenate([np.maximum(block @ directions.T, 0) @ flux for block in blocks])


def _fitted(readings: MatteReadings, before: np.ndarray, lit: np.ndarray) -> tuple[np.ndarray, np.ndarray, float]:
    """Missing irradiance (K, 3) of the sources, its standard deviation (K, 3), and the relative residual."""
    from scipy.optimize import nnls

    missing, spread = np.empty((lit.shape[1], 3)), np.empty((lit.shape[1], 3))
    for c in range(3):
        weight = _weights(readings)[:, c]
        columns, wanted = lit * weight[:, None], (readings.irradiance - before)[:, c] * weight
        missing[:, c], _ = nnls(columns, wanted)
        freely, deviation = _least_squares(columns, wanted)
        spread[:, c] = deviation
        worst = int(np.argmin(freely / np.maximum(deviation, 1e-300)))
        if freely[worst] < -3 * deviation[worst] and not missing[:, c].any():
            share = float(readings.irradiance[:, c].sum() / before[:, c].sum())
            raise SunNotRecovered(
                f"{readings.source} reflects {share:.2f} of what the map lights it with as it is, so no light is "
                "missing; check the albedo, and that both have the same exposure and unit"
            )
    off = before + lit @ missing - readings.irradiance
    largest = readings.irradiance.max()
    residual = float(np.sqrt(np.mean((off / np.maximum(readings.irradiance, 1e-3 * largest)) ** 2)))
    return missing, spread, residual


def _agreement(readings: MatteReadings, before: np.ndarray, lit: np.ndarray) -> tuple[float, float, float]:
    """The factor between readings and map where both sources and map are free, its standard deviation, the residual."""
    if len(readings.normals) < lit.shape[1] + 3:
        return float("nan"), float("nan"), float("inf")
    values, was = readings.irradiance @ LUMINANCE_WEIGHTS, before @ LUMINANCE_WEIGHTS
    weight = 1 / (MODEL * np.maximum(values, 1e-3 * values.max()))
    columns = np.column_stack([was, lit]) * weight[:, None]
    factors, deviation = _least_squares(columns, values * weight)
    off = columns @ factors - values * weight
    return float(factors[0]), float(deviation[0]), MODEL * float(np.sqrt(np.mean(off**2)))


def _weights(readings: MatteReadings) -> np.ndarray:
    floor = 1e-3 * readings.irradiance.max()
    model = MODEL * np.maximum(readings.irradiance, max(floor, 1e-300))
    return 1 / np.hypot(readings.deviation, model)


def _least_squares(columns: np.ndarray, wanted: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The solution and its standard deviations; weights are taken for true where there are no readings to spare."""
    solution, *_ = np.linalg.lstsq(columns, wanted, rcond=None)
    spare = len(wanted) - columns.shape[1]
    scatter = max(float(((columns @ solution - wanted) ** 2).sum() / spare), 1.0) if spare > 0 else 1.0
    return solution, np.sqrt(scatter * np.diag(np.linalg.pinv(columns.T @ columns)))


def _warn(recovered: list[RecoveredSource], residual: float, agreement: float, uncertainty: float) -> None:
    if residual > DISAGREEMENT:
        warn(
            f"matte readings and map differ by {residual:.0%} (root mean square) even with the recovered sun; check "
            "that both face the same way and stood in the same light"
        )
    elif abs(agreement - 1) > max(AGREEMENT, 3 * uncertainty):
        warn(
            f"where no clipped light falls the readings are {agreement:.3g} times what the map gives: the reflectance "
            "is that much of the given one, or one exposure is off; the recovered sun is off by as much"
        )
    for each in recovered:
        if each.width > WIDEST:
            warn(
                f"clipped pixels reach over {np.degrees(each.width):.0f}°, and where among them the light was is not "
                "known: shadows and some directions will be off; photograph it with a shorter exposure"
            )
        if each.uncertainty @ LUMINANCE_WEIGHTS > 0.2 * (each.irradiance @ LUMINANCE_WEIGHTS):
            towards = ", ".join(f"{v:.2f}" for v in each.direction)
            warn(f"the light from ({towards}) is uncertain by more than a fifth")
