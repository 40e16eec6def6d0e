"""A scene seen and shown band by band, from the coarsest to the finest."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from relume._kernel import in_threads
from relume.virtual_camera.tone.pattanaik.kernels import add_band, shown_base
from relume.virtual_camera.tone.pattanaik.pyramid import Level
from relume.virtual_camera.tone.pattanaik.transducers import CONES, RODS

_BAND = 64


@dataclass(frozen=True, eq=False)
class Eye:
    """From a scene's radiance to a screen's luminances, for whatever the gains are.

    seen : (4, 3) from radiance, linear Rec. 709, to signals of long, middle and short cones and of rods
    achromatic : (3,) from cones to their achromatic signal
    shown : (3, 3) from the cones' adapted signals to luminances of the screen, linear Rec. 709
    """

    seen: np.ndarray
    achromatic: np.ndarray
    shown: np.ndarray

    def base(self, scene: np.ndarray) -> np.ndarray:
        """What the screen shows of the coarsest blur (h, w, 3)."""
        picture = np.empty_like(scene)
        shown_base(scene, self.seen, self.shown, picture)
        return picture

    def small_bands(self, blurs: list[Level]) -> np.ndarray | None:
        """What the screen shows up to the sharpest blur that is smaller than the picture; None where none is."""
        picture = None
        for index in reversed(range(len(blurs))):
            if blurs[index].size == 1:
                break
            if picture is None:
                picture = self.base(blurs[index].pixels)
            else:
                picture = self._small_band(index + 1, blurs[index], blurs[index + 1], picture)
        return picture

    def full_bands(
        self, radiance: np.ndarray, blurs: list[Level], picture: np.ndarray | None, begin: int, end: int
    ) -> np.ndarray:
        """Rows begin…end of what the screen shows, from what it shows up to the sharpest small blur."""
        full = [Level(radiance, 0.0, 1), *(blur for blur in blurs if blur.size == 1)]
        if picture is None:
            index, coarse, ratio, first = len(full) - 2, full[-1].rows(begin, end), 1, 0
            picture = self.base(coarse)
        else:
            index, ratio, first = len(full) - 1, blurs[len(full) - 1].size, begin
            coarse = blurs[index].pixels
        for band in range(index, -1, -1):
            fine = full[band].rows(begin, end)
            picture = self._with_band(band, fine, coarse, picture, ratio, first)
            coarse, ratio, first = fine, 1, 0
        return picture

    def _small_band(self, band: int, fine: Level, coarse: Level, picture: np.ndarray) -> np.ndarray:
        finer = np.empty_like(fine.pixels)

        def add(begin: int, end: int) -> None:
            rows, ratio = fine.pixels[begin:end], coarse.size // fine.size
            finer[begin:end] = self._with_band(band, rows, coarse.pixels, picture, ratio, begin)

        in_threads(add, len(finer), chunk=_BAND)
        return finer

    def _with_band(
        self, band: int, fine: np.ndarray, coarse: np.ndarray, picture: np.ndarray, ratio: int, first: int
    ) -> np.ndarray:
        bends = np.array([(t.threshold, t.meeting, t.exponent) for t in (CONES[band], RODS[band])])
        rods_see, finer = not RODS[band].is_blind, np.empty_like(fine)
        add_band(fine, coarse, picture, ratio, first, self.seen, self.achromatic, self.shown, bends, rods_see, finer)
        return finer
