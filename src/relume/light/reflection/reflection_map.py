"""Reflection maps: what a surface reflects, tabulated by direction (Miller & Hoffman 1984, §§3 and 6).

The diffuse map D is looked up by the surface normal N, the specular map S by the reflected direction R = 2(E·N)N − E,
or by the view direction for a retro-reflector, or by the refracted direction (§9).
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

import numpy as np

from relume.errors import warn
from relume.light.reflection.convolution import FINEST, as_latlong, convolved, cut_up
from relume.light.reflection.lobes import Lambert, Lobe, Phong
from relume.sphere.environment_map import EnvironmentMap
from relume.sphere.mappings.mapping import LatLong

LAMBERT_ROWS = 36
"""§6.1: "Tables of size 36×72 pixels are adequate to store the Lambert reflection map"."""
ROWS_PER_WIDTH = 12
"""Rows for each π·width⁻¹ of a lobe: bilinear look-up is then within about 0.2 % of its peak."""
MOST_ROWS = 1024


class Normalisation(Enum):
    """What the sum Σ I[L]·Area[L]·f(N·L) is divided by; tables of different normalisation are never mixed.

    RADIOMETRIC : ∫ f/k, so that under constant light the table is k times the light: radiance in, radiance out
    PAPER : 4π, as Miller & Hoffman (1984, §6) print it; constant light of 1 gives Lambert's table 1/4. A mirror's
        share is left whole: "for mirror highlights, the specular reflection map is identical to the illumination map"
    SUM : 1; Lambert's table is irradiance
    """

    RADIOMETRIC = "radiometric"
    PAPER = "paper"
    SUM = "sum"


@dataclass(frozen=True, eq=False)
class ReflectionMap:
    """A table of reflected light.

    light : the table, a lat-long map in the environment map's unit; `lookup` is bilinear over seam and poles
    lobe : what the environment map was convolved with
    normalisation : what the sums were divided by
    error_bound : no entry is further from the exact sum than this share of it, rounding aside
    """

    light: EnvironmentMap
    lobe: Lobe
    normalisation: Normalisation
    error_bound: float

    @property
    def table(self) -> np.ndarray:
        """The table's values, (rows, 2·rows, 3) float32."""
        return self.light.radiance

    def lookup(self, directions: np.ndarray) -> np.ndarray:
        """Reflected light (…, 3) for unit directions (…, 3)."""
        return self.light.lookup(directions)


def reflection_map(
    light: EnvironmentMap,
    lobe: Lobe,
    rows: int | None = None,
    normalisation: Normalisation = Normalisation.RADIOMETRIC,
) -> ReflectionMap:
    """The table of an environment map convolved with a lobe (Miller & Hoffman 1984, §§6.1, 6.2).

    light : in any mapping
    lobe : the convolution function; with a mirror's share, that share of the light itself is added
    rows : the table's height, twice as wide: 36 for Lambert as in the paper, the light's own for a mirror, else
        as fine as the lobe needs
    normalisation : `Normalisation.RADIOMETRIC` unless the paper's or none is wanted

    Raises ValueError for a table without rows, and for a varnish under Normalisation.SUM: its unit is another.
    """
    rows = rows_for(lobe, light.size) if rows is None else rows
    if rows < 1:
        raise ValueError(f"a table of {rows} rows; expected 1 or more, like 36 for Lambert")
    source = as_latlong(light)
    table, bound = np.zeros((rows, 2 * rows, 3)), 0.0
    mirrored = lobe.mirror
    if lobe.integral > 0 and mirrored > 0 and normalisation is Normalisation.SUM:
        raise ValueError(f"{lobe} adds a mirror's radiance to sums of radiance × solid angle; use RADIOMETRIC or PAPER")
    if lobe.integral > 0 and lobe.width < 2 * np.pi / FINEST:
        warn(f"{lobe} is narrower than any map's pixels; it is taken for a mirror")
        mirrored += lobe.integral / _divisor(lobe, normalisation)
    elif lobe.integral > 0:
        sums, bound = convolved(cut_up(source, lobe.width), lobe, rows)
        table = sums / _divisor(lobe, normalisation)
    if mirrored > 0:
        # A perfect mirror's map is the illumination map (§6.2), whatever the sums are divided by.
        seen = source if source.size == rows else source.remapped(LatLong(), rows)
        table = table + mirrored * seen.radiance
    return ReflectionMap(EnvironmentMap(table.astype(np.float32), LatLong(), light.unit), lobe, normalisation, bound)


def reflection_maps(light: EnvironmentMap, specular: Lobe = Phong()) -> tuple[ReflectionMap, ReflectionMap]:
    """The paper's two tables: D for Lambert, and S for a specular lobe (Miller & Hoffman 1984, §6).

    light : in any mapping
    specular : Phong's with n = 50 unless given
    """
    return reflection_map(light, Lambert()), reflection_map(light, specular)


def rows_for(lobe: Lobe, light_rows: int) -> int:
    """Rows that a lobe's table needs for bilinear look-up, a power of two where the paper names no size.

    Tables whose width divides the light's, or nearly, are made several times faster.
    """
    if isinstance(lobe, Lambert):
        return LAMBERT_ROWS
    if lobe.mirror > 0:
        return light_rows
    return int(np.clip(2 ** np.round(np.log2(ROWS_PER_WIDTH * np.pi / max(lobe.width, 1e-6))), 16, MOST_ROWS))


def _divisor(lobe: Lobe, normalisation: Normalisation) -> float:
    if normalisation is Normalisation.RADIOMETRIC:
        return lobe.integral / lobe.k
    return 4 * np.pi if normalisation is Normalisation.PAPER else 1.0
