"""Less light towards the corners: the natural falloff of any lens, and those measured of one."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np

from relume.capture.lens.vignetting import Vignetting
from relume.image.bands import in_threads
from relume.virtual_camera.protocols import Relative
from relume.virtual_camera.view import View

BAND = 64
"""Rows that are scaled at once."""


class _Falloff(Relative, ABC):
    """A factor on the light by its place in the picture."""

    def apply(self, radiance: np.ndarray, view: View) -> np.ndarray:
        """Radiance (H, W, 3) float32 times the falloff; raises ValueError where that is not above 0."""
        return self._scaled(radiance, view, undo=False)

    def undo(self, radiance: np.ndarray, view: View) -> np.ndarray:
        """Radiance (H, W, 3) float32 over the falloff; raises ValueError where that is not above 0."""
        return self._scaled(radiance, view, undo=True)

    @abstractmethod
    def _rows(self, width: int, height: int, view: View, top: int, bottom: int) -> np.ndarray:
        """The falloff (rows, W) float64 of rows top…bottom."""

    def _scaled(self, radiance: np.ndarray, view: View, *, undo: bool) -> np.ndarray:
        height, width = radiance.shape[:2]
        out = np.empty_like(radiance)

        def work(top: int, bottom: int) -> None:
            share = self._rows(width, height, view, top, bottom)
            gain = (1 / share if undo else share).astype(np.float32)
            np.multiply(radiance[top:bottom], gain[..., None], out=out[top:bottom])

        in_threads(work, height, chunk=BAND)
        return out


@dataclass(frozen=True)
class CosineFourth(_Falloff):
    """The natural falloff cos⁴α of the light at an angle α to the axis, whose lens does not bend lines (ISO 517).

    The angle follows from the view's focal length; the axis meets the picture's middle.
    """

    def _rows(self, width: int, height: int, view: View, top: int, bottom: int) -> np.ndarray:
        # cos²α = f² / (f² + distance²)
        square = _squared_distance(width, top, bottom, width / 2, height / 2)
        return (1 + square / view.focal_length**2) ** -2


@dataclass(frozen=True)
class PolynomialVignetting(_Falloff):
    """Relative illuminance 1 + a₁r² + a₂r⁴ + a₃r⁶ + …, as lens databases have it.

    coefficients : a₁, a₂, …; r is the distance from `centre`, 1 at half the picture's diagonal. Where a database's r
        is 1 elsewhere, say at q half diagonals, its coefficients are divided by q², q⁴, …
    centre : as a fraction of width and height, from the top left
    """

    coefficients: tuple[float, ...]
    centre: tuple[float, float] = (0.5, 0.5)

    def __post_init__(self) -> None:
        self._measured()

    def _rows(self, width: int, height: int, view: View, top: int, bottom: int) -> np.ndarray:
        return self._measured()._rows(width, height, view, top, bottom)

    def _measured(self) -> MeasuredVignetting:
        return MeasuredVignetting(Vignetting(self.coefficients, self.centre))


@dataclass(frozen=True)
class MeasuredVignetting(_Falloff):
    """What `recover_vignetting` found of a lens, or its profile holds.

    vignetting : it holds at the aperture it was measured at
    """

    vignetting: Vignetting

    def _rows(self, width: int, height: int, view: View, top: int, bottom: int) -> np.ndarray:
        x0, y0 = self.vignetting.centre[0] * width, self.vignetting.centre[1] * height
        square = _squared_distance(width, top, bottom, x0, y0) * (4 / (width**2 + height**2))
        share = np.zeros_like(square)
        for coefficient in reversed(self.vignetting.coefficients):
            share = (share + coefficient) * square
        share += 1
        if share.min() <= 0:
            raise ValueError(
                f"the vignetting leaves {share.min():.3g} of the light in row {top + int(share.min(1).argmin())}; "
                "a lens leaves some everywhere: check the coefficients, whose r is 1 at half the diagonal"
            )
        return share


def image_illuminance(
    luminance: np.ndarray | float, f_number: float, *, transmittance: float = 1.0, angle: np.ndarray | float = 0.0
) -> np.ndarray:
    """The illuminance of the sensor, lx: E = (π/4) τ L cos⁴α / N² (ISO 517; Debevec & Malik 1997, §2.1).

    luminance : L, cd/m², of what is seen there
    f_number : N
    transmittance : τ of the glass; 1 is a lens without loss, and the "T-stop" N / √τ holds it already
    angle : α from the axis, radians
    Holds for distances far beyond the focal length. Raises ValueError for an f-number or a transmittance that no lens
    has.
    """
    if not (np.isfinite(f_number) and f_number > 0):
        raise ValueError(f"the f-number is {f_number}; expected a positive number")
    if not 0 < transmittance <= 1:
        raise ValueError(f"the transmittance is {transmittance}; expected above 0, up to 1 for a lens without loss")
    return np.pi / 4 * transmittance * np.asarray(luminance, np.float64) * np.cos(angle) ** 4 / f_number**2


def _squared_distance(width: int, top: int, bottom: int, x: float, y: float) -> np.ndarray:
    """Of the pixels of rows top…bottom from a point, (rows, W) float64, pixels²."""
    return (np.arange(width) + 0.5 - x) ** 2 + ((np.arange(top, bottom) + 0.5 - y) ** 2)[:, None]
