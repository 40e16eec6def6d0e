"""Vignetting: how much less of the light reaches the edges of the picture (Debevec & Malik 1997, footnote 3)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, cast

import numpy as np

from relume.errors import NotABracket, warn
from relume.image import files
from relume.image.radiance import OUTSIDE, RadianceMap

TERMS = 3
"""Coefficients recovered, of r², r⁴ and r⁶: what lens profiles use; more would follow the unevenness of the wall."""
BLOCKS = 36
"""Blocks along the picture's longer side whose medians are fitted: dust and noise fall out, falloff is smooth."""
DECENTRED = 0.03
"""Standard deviation, in picture sizes, of how far a lens sits beside the picture's middle; a nearly even slope across
the wall looks like a decentred lens, and only this separates them when there is one picture."""
MARK = 5.0
"""Deviations from the falloff beyond which a block shows something on the wall."""
DOUBTFUL, UNUSABLE = 0.01, 0.05
"""Relative unevenness beyond the falloff above which a flat field is doubted, or is none."""


@dataclass(frozen=True)
class Vignetting:
    """Relative illuminance 1 + a₁r² + a₂r⁴ + … over the picture.

    coefficients : a₁, a₂, …; r is the distance from `centre`, 1 at half the picture's diagonal
    centre : as a fraction of width and height, from the top left
    deviation : standard deviation of each coefficient; empty where it was not measured
    f_number : the aperture it was measured at; None where it holds at any, or nothing is known
    """

    coefficients: tuple[float, ...] = ()
    centre: tuple[float, float] = (0.5, 0.5)
    deviation: tuple[float, ...] = ()
    f_number: float | None = None

    def __post_init__(self) -> None:
        if not np.all(np.isfinite((*self.coefficients, *self.centre, *self.deviation))):
            raise ValueError(f"coefficients {self.coefficients}, centre {self.centre}: all must be finite numbers")
        if len(self.deviation) not in (0, len(self.coefficients)):
            raise ValueError(f"{len(self.deviation)} deviations of {len(self.coefficients)} coefficients; one each")

    def falloff(self, size: tuple[int, int]) -> np.ndarray:
        """Relative illuminance (H, W) float64, 1 at the centre, of a picture of `size` (width, height)."""
        columns, rows = ((np.arange(side) + 0.5) / side for side in size)
        return _polynomial(self.coefficients, _squared_radius(columns, rows[:, None], size, self.centre))

    def to_dict(self) -> dict[str, object]:
        """Plain values for a camera profile; `from_dict` reads them."""
        return {
            "coefficients": list(self.coefficients),
            "centre": list(self.centre),
            "deviation": list(self.deviation),
            "f_number": self.f_number,
        }

    @staticmethod
    def from_dict(table: Mapping[str, object]) -> Vignetting:
        """The vignetting that `to_dict` wrote.

        table : what it returned, as read from a file
        Raises ValueError for anything else.
        """
        try:
            coefficients, centre, deviation = (
                tuple(float(v) for v in table[key])  # type: ignore[union-attr]
                for key in ("coefficients", "centre", "deviation")
            )
            f_number = table["f_number"]
            return Vignetting(
                coefficients,
                (centre[0], centre[1]),
                deviation,
                None if f_number is None else float(f_number),  # type: ignore[arg-type]
            )
        except (KeyError, TypeError, IndexError, ValueError) as error:
            raise ValueError(f"not a vignetting of relume: {error}") from None

    @staticmethod
    def cos4(focal_length: float, size: tuple[int, int]) -> Vignetting:
        """The natural falloff cos⁴α of an uncorrected distortion-free lens (Debevec & Malik 1997, footnote 3).

        focal_length : pixels
        size : (width, height) in pixels
        """
        if not (np.isfinite(focal_length) and focal_length > 0):
            raise ValueError(f"focal_length is {focal_length}; expected a positive number of pixels")
        # With ρ = half diagonal / focal length, cos⁴α = (1 + ρ²r²)⁻², close to a polynomial that is 1 at the centre.
        widest = (size[0] ** 2 + size[1] ** 2) / (2 * focal_length) ** 2
        square = 0.5 - 0.5 * np.cos(np.pi * (np.arange(400) + 0.5) / 400)
        wanted = (1 + widest * square) ** -2.0
        coefficients = np.zeros(0)
        for terms in range(1, 15):
            powers = square[:, None] ** np.arange(1, terms + 1)
            coefficients = np.linalg.lstsq(powers, wanted - 1, rcond=None)[0]
            if np.abs(1 + powers @ coefficients - wanted).max() < 1e-5:
                break
        return Vignetting(tuple(float(a) for a in coefficients))


def recover_vignetting(
    pictures: RadianceMap | Sequence[RadianceMap], *, f_number: float | None = None, terms: int = TERMS
) -> Vignetting:
    """The vignetting that makes pictures of an evenly lit surface even.

    pictures : radiance maps of one lens at one aperture, of one size; each may slope as a plane does (a wall lit from
        one side), which is taken out. Several with different slopes, the camera turned between them, also show
        where the falloff is centred; one alone can hardly
    f_number : kept with the result
    terms : coefficients of r², r⁴, …; 3 as lens profiles have, since more would follow the wall's own unevenness

    Blocks' medians are fitted in ln radiance; blocks with marks are found by a robust loss and do not count.
    Raises NotABracket for pictures of different sizes, mostly clipped, or of no even surface; warns where they are
    doubtful.
    Raises ValueError where no picture is given.
    """
    from scipy.optimize import least_squares

    pictures = [pictures] if isinstance(pictures, RadianceMap) else list(pictures)
    if not pictures:
        raise ValueError("no radiance maps were given; give one of an evenly lit surface")
    fields = [_field(picture, i, pictures) for i, picture in enumerate(pictures)]
    problem = _Flat(fields, pictures[0].size, terms)
    # The loss needs a scale: the scatter that a first, plain fit leaves.
    first = least_squares(problem.misfit, problem.start(), x_scale="jac")
    scatter = max(robust_deviation(first.fun[: problem.values]), 1e-6)
    rough = least_squares(
        problem.misfit, first.x, x_scale="jac", loss="soft_l1", f_scale=2 * scatter, kwargs={"scatter": scatter}
    )
    scatter = max(robust_deviation(rough.fun[: problem.values]), 1e-6)
    # Dust and marks found, the rest is fitted plainly, so that its errors are those of least squares.
    clean = problem.without(np.abs(rough.fun[: problem.values]) > MARK * scatter)
    fit = least_squares(clean.misfit, rough.x, x_scale="jac", kwargs={"scatter": scatter})
    unevenness = max(robust_deviation(fit.fun[: clean.values]), 1e-6)
    # What no falloff explains is the surface's, or its light's.
    if unevenness > UNUSABLE:
        raise NotABracket(
            f"the flat field varies by {100 * unevenness:.0f} % beyond any vignetting; photograph an evenly lit, "
            "plain surface that fills the picture, out of focus"
        )
    if unevenness > DOUBTFUL:
        warn(
            f"the flat field varies by {100 * unevenness:.1f} % beyond the vignetting, which is no surer than that; "
            "photograph a more evenly lit surface",
            unevenness,
        )
    covariance = np.linalg.pinv(fit.jac.T @ fit.jac) * unevenness**2
    sigma = np.sqrt(np.diag(covariance))[2 : 2 + terms]
    return Vignetting(
        tuple(float(a) for a in fit.x[2 : 2 + terms]),
        (float(fit.x[0]), float(fit.x[1])),
        tuple(float(s) for s in sigma),
        f_number,
    )


def read_flat_fields(paths: Sequence[str | Path]) -> tuple[Vignetting, ...]:
    """The vignetting in radiance maps of an evenly lit wall by one lens; empty without any.

    paths : of the maps, at one aperture
    Raises UnreadableFile; NotABracket for maps of no even wall.
    """
    if not paths:
        return ()
    walls = [files.read_radiance(path) for path in paths]
    # `relume merge` writes the aperture into its maps.
    apertures = {wall.attributes.get("f_number") for wall in walls}
    known = apertures.pop() if len(apertures) == 1 else None
    return (recover_vignetting(walls, f_number=float(known) if known else None),)


def corrected(
    picture: RadianceMap, vignetting: Vignetting | Sequence[Vignetting], *, f_number: float | None = None
) -> RadianceMap:
    """The map of a lens without vignetting: radiance divided by the falloff, variance by its square.

    vignetting : of the lens; of several, measured at different apertures, the nearest to `f_number` counts
    f_number : of the photographs; None where unknown
    Warns where the vignetting was measured at another aperture: it shrinks as the lens is stopped down.
    Raises ValueError where the falloff is not positive in the picture.
    """
    chosen = _chosen([vignetting] if isinstance(vignetting, Vignetting) else list(vignetting), f_number)
    falloff = chosen.falloff(picture.size)
    inside = np.ones(falloff.shape, bool) if picture.clipped is None else picture.clipped != OUTSIDE
    lowest = float(falloff[inside].min(initial=1.0))
    if lowest <= 0:
        raise ValueError(f"the falloff reaches {lowest:.3g} in the picture; a vignetting leaves some light everywhere")
    gain = np.where(inside, 1 / np.where(inside, falloff, 1.0), 1.0)[..., None].astype(np.float32)
    return replace(
        picture,
        radiance=picture.radiance * gain,
        variance=None if picture.variance is None else picture.variance * gain**2,
    )


def _chosen(known: list[Vignetting], f_number: float | None) -> Vignetting:
    if not known:
        raise ValueError("no vignetting was given; recover one from a flat field")
    if f_number is None:
        if len(known) > 1:
            raise ValueError(f"{len(known)} vignettings were given and no f_number to choose by; give the photographs'")
        return known[0]
    nearest = min(known, key=lambda v: 0.0 if v.f_number is None else abs(float(np.log(v.f_number / f_number))))
    # Nominal f-numbers differ from the true ones by less than 3 %.
    if nearest.f_number is not None and abs(np.log(nearest.f_number / f_number)) > 0.03:
        warn(
            f"the vignetting was measured at f/{nearest.f_number:g}, the photographs are at f/{f_number:g}; measure it "
            "at their aperture"
        )
    return nearest


@dataclass(frozen=True, eq=False)
class _Field:
    """Block medians of one picture: places as fractions of the picture (N, 2), ln radiance (N,), a mean of channels."""

    places: np.ndarray
    logarithm: np.ndarray


def _field(picture: RadianceMap, index: int, pictures: Sequence[RadianceMap]) -> _Field:
    if picture.size != pictures[0].size:
        raise NotABracket(
            f"flat field {index + 1} is {picture.size[0]}×{picture.size[1]}, the first "
            f"{pictures[0].size[0]}×{pictures[0].size[1]}; photograph them alike"
        )
    known = picture.radiance.min(axis=2) > 0
    if picture.clipped is not None:
        known &= picture.clipped == 0
    width, height = picture.size
    edge = max(1, -(-max(width, height) // BLOCKS))
    rows, columns = max(1, height // edge), max(1, width // edge)
    places, logarithm = [], []
    for row in range(rows):
        # Blocks share the pixels evenly, so that none is left over at the far edges.
        top, bottom = row * height // rows, (row + 1) * height // rows
        for column in range(columns):
            left, right = column * width // columns, (column + 1) * width // columns
            inside = known[top:bottom, left:right]
            if inside.mean() > 0.5:
                pixels = picture.radiance[top:bottom, left:right][inside]
                places.append(((left + right) / 2 / width, (top + bottom) / 2 / height))
                logarithm.append(np.log(np.median(pixels, axis=0)).mean())
    if len(places) < rows * columns / 2:
        raise NotABracket(
            f"flat field {index + 1}: {100 * len(places) / (rows * columns):.0f} % of it is well exposed; "
            "vignetting needs a whole picture, so choose exposures that neither clip nor leave it black"
        )
    return _Field(np.array(places), np.array(logarithm))


@dataclass(frozen=True, eq=False)
class _Flat:
    """The misfit of ln radiance = ln brightness + ln slope + ln falloff over all fields.

    Unknowns: the centre (2), the coefficients, then for each field its slope (2) and its brightness.
    """

    fields: Sequence[_Field]
    size: tuple[int, int]
    terms: int

    @property
    def values(self) -> int:
        return sum(f.logarithm.size for f in self.fields)

    def without(self, marked: np.ndarray) -> _Flat:
        """The same without the marked ones of all fields' values."""
        parts = np.split(~marked, np.cumsum([f.logarithm.size for f in self.fields])[:-1])
        fields = [_Field(f.places[kept], f.logarithm[kept]) for f, kept in zip(self.fields, parts, strict=True)]
        return _Flat(fields, self.size, self.terms)

    def start(self) -> np.ndarray:
        own = [np.array([0.0, 0.0, np.median(f.logarithm)]) for f in self.fields]
        return np.concatenate([[0.5, 0.5], np.zeros(self.terms), *own])

    def misfit(self, unknown: np.ndarray, scatter: float = DOUBTFUL) -> np.ndarray:
        centre, coefficients = unknown[:2], unknown[2 : 2 + self.terms]
        parts = []
        for field, own in zip(self.fields, unknown[2 + self.terms :].reshape(-1, 3), strict=True):
            square = _squared_radius(field.places[:, 0], field.places[:, 1], self.size, centre)
            even = _polynomial(coefficients, square) * (1 + (field.places - 0.5) @ own[:2])
            parts.append(field.logarithm - np.log(np.maximum(even, 1e-3)) - own[2])
        # The prior on the centre weighs as one observation of that deviation would.
        return np.concatenate([*parts, (centre - 0.5) * scatter / DECENTRED])


def _polynomial(coefficients: Sequence[float] | np.ndarray, square: np.ndarray) -> np.ndarray:
    result = np.zeros_like(square)
    for coefficient in reversed(coefficients):
        result = (result + coefficient) * square
    return 1 + result


def _squared_radius(
    x: np.ndarray, y: np.ndarray, size: tuple[int, int], centre: Sequence[float] | np.ndarray
) -> np.ndarray:
    """r² of places, as fractions of the picture's width and height."""
    across, down = (x - centre[0]) * size[0], (y - centre[1]) * size[1]
    return (across**2 + down**2) * 4 / (size[0] ** 2 + size[1] ** 2)


def robust_deviation(values: np.ndarray) -> float:
    """A standard deviation that a few outliers do not move."""
    from scipy.stats import median_abs_deviation  # half a second to load

    # Pyright takes scale for a float, as its default is.
    return float(median_abs_deviation(values, scale=cast(Any, "normal")))
