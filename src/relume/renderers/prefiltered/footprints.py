"""The directions by which samples look tables up, at their middles and corners: found once for all layers that ask."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from relume._kernel import in_threads
from relume.renderers.prefiltered import filter_kernels as kernels
from relume.renderers.prefiltered.shading_samples import Samples
from relume.renderers.prefiltered.shading_terms import Term


@dataclass(frozen=True, eq=False)
class Spans:
    """The samples of a picture, and what was already found of them.

    samples : P of them, with M corners
    threads : all cores for None
    """

    samples: Samples
    threads: int | None = None
    _found: dict[tuple, np.ndarray] = field(default_factory=dict)

    def middle_directions(self, term: Term) -> np.ndarray:
        """Directions (P, 3) float32."""
        return self._once(kernels.directions, self.samples.normal, self.samples.to_eye, 3, term)

    def corner_directions(self, term: Term) -> np.ndarray:
        """Directions (M, 3) float32; up to four samples share one."""
        return self._once(kernels.directions, self.samples.corner_normal, self.samples.corner_to_eye, 3, term)

    def middle_points(self, term: Term) -> np.ndarray:
        """Their image points (P, 2) float32 in a lat-long map."""
        return self._once(kernels.image_points, self.samples.normal, self.samples.to_eye, 2, term)

    def corner_points(self, term: Term) -> np.ndarray:
        """Image points (M, 2) float32."""
        return self._once(kernels.image_points, self.samples.corner_normal, self.samples.corner_to_eye, 2, term)

    def _once(
        self, find: Callable[..., Any], normals: np.ndarray, views: np.ndarray, size: int, term: Term
    ) -> np.ndarray:
        wanted = (id(normals), size, term.kind, float(term.ratio))
        if wanted not in self._found:
            values = np.empty((len(normals), size), np.float32)
            in_threads(
                lambda begin, end: find(values, normals, views, term.kind, term.ratio, begin, end),
                len(values), self.threads,
            )  # fmt: skip
            self._found[wanted] = values
        return self._found[wanted]
