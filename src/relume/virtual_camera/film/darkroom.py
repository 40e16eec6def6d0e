"""The Virtual Darkroom (Cachelin 2001): a picture exposed on film, developed, and printed on paper."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from relume.capture.scale.absolute import Q
from relume.image.bands import in_threads
from relume.image.photograph import Exposure
from relume.virtual_camera.film.film import warn_of_range
from relume.virtual_camera.film.negative import FilmStock, Paper
from relume.virtual_camera.protocols import Adaptation
from relume.virtual_camera.view import View

FRAME = 36_000.0
"""µm, the longer side of a frame of 35 mm film."""
LOWEST, FINENESS, ENTRIES = -2.0, 1024.0, 8194
"""Densities −2 to 6 are printed from a table, 1024 entries to one: noise and crosstalk go beyond a film's own. Lines
between them err by 3e-6 of the reflectance on the hardest paper."""
ROWS = 64


@dataclass(frozen=True, eq=False)
class Darkroom:
    """A camera with film in it, and the enlarger.

    negative : the film
    paper : what it is printed on; None to look at the film itself, as one does with a slide. Its clear part is white
    exposure : shutter and f-number of the camera, for pictures whose cd/m² are known. None exposes by a light meter:
        the log mean of the picture gets the exposure that the film's speed gives a meter's reading
    stops : longer than that; "varying only the negative exposure time" (Cachelin)
    print_stops : longer exposure of the paper than that which prints the meter's grey as 0.18: darker
    frame : µm, longer side of the picture on the film; decides how large grain and halation show. That of 35 mm film,
        36 mm, unless given

    Its `Adaptation` is the ln of the log mean luminance, cd/m² or relative; empty with an exposure of its own.
    Raises ValueError for an exposure without f-number, or with another ISO number than the film's.
    """

    negative: FilmStock
    paper: Paper | None = None
    exposure: Exposure | None = None
    stops: float = 0.0
    print_stops: float = 0.0
    frame: float = FRAME

    def __post_init__(self) -> None:
        for name in ("stops", "print_stops"):
            if not np.isfinite(getattr(self, name)):
                raise ValueError(f"{name} is {getattr(self, name)}; expected factors of two")
        if not (np.isfinite(self.frame) and self.frame > 0):
            raise ValueError(f"frame is {self.frame}; expected micrometres, positive")
        if self.exposure is not None and self.exposure.f_number is None:
            raise ValueError("the exposure has no f-number; give one, or no exposure to have the light metered")
        if self.exposure is not None and self.exposure.iso not in (None, self.negative.speed):
            raise ValueError(
                f"the exposure is at ISO {self.exposure.iso:g} and the film's speed is {self.negative.speed:g}; "
                "leave ISO out, or put film of that speed in"
            )

    @property
    def absolute(self) -> bool:
        """Whether luminances have to be in cd/m²: where shutter and aperture expose, and no meter."""
        return self.exposure is not None

    def adapt(self, radiance: np.ndarray, view: View) -> Adaptation:
        """What the light meter reads: the log mean of what is lit; of a black picture that of luminance 1.

        radiance, view : (H, W, 3) float32 in the picture's unit, and the picture's view (`VirtualCamera.view`)
        """
        if self.exposure is not None:
            return Adaptation(np.zeros(0))
        from relume.virtual_camera.tone.luminance_statistics import log_average

        return Adaptation(np.log([log_average(radiance)]))

    def display_values(self, radiance: np.ndarray, view: View, adaptation: Adaptation) -> np.ndarray:
        """The print by white light: 1 is white paper, or clear film. The same seed gives the same grain.

        radiance, view, adaptation : (H, W, 3) float32 in the picture's unit, the picture's view (`VirtualCamera.view`),
            and what `adapt` returned
        Warns where most of the picture is beyond the range of the film.
        """
        from relume.virtual_camera.film.printing_kernel import print_rows

        radiance = np.ascontiguousarray(radiance)
        height, width = radiance.shape[:2]
        pixel = self.frame / max(height, width)
        film, layers = self.negative, len(self.negative.curves)
        factor = self.exposed(view, adaptation)
        warn_of_range(radiance, lambda light: film.exposures(light, factor), *film.reach())
        sensitivity = (film.sensitivity * factor).astype(np.float32)
        shares, halo, step = self._halo(radiance, sensitivity, pixel)
        curves = film.curves
        taps, strengths, fog = np.ones(1), np.zeros(layers), 0.0
        if film.grain is not None:
            taps, fog = film.grain.taps(pixel), film.grain.fog
            strengths = np.array([film.grain.strength(curve) / pixel for curve in curves])
        minima = np.array([curve.minimum for curve in curves])
        constants = (
            film_tables(film),
            *(np.asarray(a, np.float32) for a in (strengths, minima - fog, [c.maximum for c in curves], taps)),
            np.uint64(view.grain_seed),
            *(a.astype(np.float32) for a in (minima, film.crosstalk)),
            np.float32(LOWEST),
            np.float32(FINENESS),
            self.print_tables(),
        )
        out = np.empty(radiance.shape, np.float32)

        def work(begin: int, end: int) -> None:
            print_rows(radiance, sensitivity, shares, halo, step, *constants, begin, end, out)

        in_threads(work, height, chunk=ROWS)
        return out

    def exposed(self, view: View, adaptation: Adaptation) -> float:
        """The exposure of the film, lx·s per unit of radiance: H = q L t / N² (ISO 12232), or what the meter says.

        view : of the picture, by `VirtualCamera.view`
        adaptation : by `adapt`
        """
        if self.exposure is None:
            return self.negative.grey_exposure / float(np.exp(adaptation.values[0])) * 2.0**self.stops
        assert self.exposure.f_number is not None
        settings = self.exposure.seconds / self.exposure.f_number**2
        return Q * view.luminance_scale * settings * 2.0**self.stops

    def shown(self, density: np.ndarray, layer: int) -> np.ndarray:
        """Display values (…) at densities (…) of the film, as seen through one layer.

        density : (…) of the film
        layer : its number, from 0
        """
        film = self.negative
        if self.paper is None:
            return 10 ** (film.curves[layer].minimum - density)
        grey = float(film.density(np.array(film.grey_exposure), layer))
        light = self.paper.grey_exposure() + grey + self.print_stops * np.log10(2)
        return self.paper.reflectance(light - density)

    def print_tables(self) -> np.ndarray:
        """(layers, ENTRIES) float32 of `shown`, at densities LOWEST + i / FINENESS."""
        density = LOWEST + np.arange(ENTRIES) / FINENESS
        return np.stack([self.shown(density, k) for k in range(len(self.negative.curves))]).astype(np.float32)

    def _halo(self, radiance: np.ndarray, sensitivity: np.ndarray, pixel: float) -> tuple[np.ndarray, np.ndarray, int]:
        """Shares (layers,), and the halos' exposures (layers, rows, columns) on blocks of step × step pixels."""
        from relume.virtual_camera.film.printing_kernel import gather

        halation, layers = self.negative.halation, len(self.negative.curves)
        shares = np.zeros(layers, np.float32)
        if halation is None or not any(halation.share):
            return shares, np.zeros((layers, 1, 1), np.float32), 1
        from scipy.signal import oaconvolve

        step = halation.step(pixel)
        rows, columns = (-(-side // step) for side in radiance.shape[:2])
        halo = np.empty((layers, rows, columns), np.float32)
        in_threads(lambda begin, end: gather(radiance, sensitivity, step, begin, end, halo), rows, chunk=ROWS)
        shares[:] = halation.share
        kernel = halation.kernel(pixel * step).astype(np.float32)
        reach = kernel.shape[0] // 2
        lit = np.flatnonzero(shares)

        def spread(begin: int, end: int) -> None:
            for layer in lit[begin:end]:
                # At the border the picture goes on as its mirror image: what leaves the frame comes back in.
                padded = np.pad(halo[layer], reach, mode="symmetric")
                halo[layer] = np.maximum(oaconvolve(padded, kernel, mode="valid"), 0)

        in_threads(spread, lit.size, chunk=1)
        return shares, halo, step


def film_tables(film: FilmStock) -> np.ndarray:
    """(layers, N) float32 tables of density over exposure, for `float_table`."""
    from relume.virtual_camera.film.float_table import tabulated

    return np.stack([tabulated(lambda exposure, k=k: film.density(exposure, k)) for k in range(len(film.curves))])
