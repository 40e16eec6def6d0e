"""A radiance map: scene-linear pixels with their unit, their variance and what no photograph could measure."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

SATURATED, BLACK, OUTSIDE = 1, 2, 3


@dataclass(frozen=True, eq=False)
class RadianceMap:
    """Scene-linear radiance per pixel, Rec. 709 primaries.

    radiance : (H, W, 3) float32, in `unit`
    variance : (H, W, 3) float32, squared unit; None where unknown
    clipped : (H, W) uint8; 0 measured, 1 saturated in every photograph (radiance is a lower bound),
        2 black in every photograph (radiance is an upper bound), 3 outside every photograph (radiance is 0 and says
        nothing); None where unknown
    unit : "cd/m²" when calibrated, else "relative"
    attributes : what else the file stores (text), e.g. {"mapping": "latlong"}
    """

    radiance: np.ndarray
    variance: np.ndarray | None = None
    clipped: np.ndarray | None = None
    unit: str = "relative"
    attributes: dict[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        shape = self.radiance.shape
        if self.radiance.ndim != 3 or shape[2] != 3 or self.radiance.dtype != np.float32:
            raise ValueError(f"radiance is {shape} {self.radiance.dtype}; a radiance map is (H, W, 3) float32")
        if self.variance is not None and self.variance.shape != shape:
            raise ValueError(f"variance is {self.variance.shape}; expected the radiance's {shape}")
        if self.clipped is not None and self.clipped.shape != shape[:2]:
            raise ValueError(f"clipped is {self.clipped.shape}; expected {shape[:2]}")
        for key, text in self.attributes.items():
            if not (isinstance(key, str) and isinstance(text, str)):
                raise ValueError(f"the attribute {key!r} is {text!r}; attributes are texts: write it as one")
        if self.unit not in ("relative", "cd/m²"):
            raise ValueError(f'unit is "{self.unit}"; expected "relative" or "cd/m²"')

    @property
    def size(self) -> tuple[int, int]:
        """The (width, height) in pixels."""
        return self.radiance.shape[1], self.radiance.shape[0]

    def _repr_html_(self) -> str:
        """What a notebook shows: the picture at a fair exposure, and its facts."""
        from relume.image.files.photographs.notebook_html import picture_html, three

        width, height = self.size
        finite = self.radiance[np.isfinite(self.radiance).all(axis=-1)]
        facts = {"radiance map": f"{width} × {height} pixels, {self.unit}"}
        if len(finite):
            facts |= {"mean": three(finite.mean(axis=0, dtype=np.float64)), "most": three(finite.max(axis=0))}
        if self.clipped is not None:
            facts["saturated in every photograph"] = f"{np.mean(self.clipped == SATURATED):.2%}"
        return picture_html(self.radiance, facts)
