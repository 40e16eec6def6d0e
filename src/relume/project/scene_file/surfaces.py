"""Tables of measured and of scratched surfaces in a scene file."""

from __future__ import annotations

import math
from dataclasses import replace
from difflib import get_close_matches
from pathlib import Path
from typing import Any, Literal

import numpy as np

from relume.project.mesh_tables import MaterialTable
from relume.project.scene_file.images import colour_of, number_of
from relume.project.schema import Paint, Positive, Share, Table
from relume.scene.materials.abc_facets import MERL_FITS, ABCFacets
from relume.scene.materials.materials import Ward
from relume.scene.materials.measured import MeasuredBRDF


class MeasuredTable(Table):
    """A measured surface: a MERL `.binary` file, or a published fit to one by its preset."""

    kind: Literal["measured"]
    file: str | None = None
    preset: str | None = None
    scale: Positive | None = None

    def made(self, name: str, folder: Path) -> MeasuredBRDF | ABCFacets:
        """The material; raises ValueError unless one of file and preset is given."""
        if (self.file is None) == (self.preset is None):
            raise ValueError(f"has {'neither' if self.file is None else 'both'}; give one of file and preset")
        if self.preset is not None and self.preset not in MERL_FITS:
            near = get_close_matches(self.preset, MERL_FITS, 3, 0.3) or list(MERL_FITS)[:3]
            raise ValueError(
                f"preset: there is no measured surface {self.preset!r}; the nearest of {len(MERL_FITS)} are "
                f"{', '.join(near)} (all are in rl.scene.MERL_FITS)"
            )
        return replace(
            MaterialTable(file=self.file, preset=self.preset, scale=self.scale).apply(None, folder), name=name
        )


class WardTable(Table):
    """Ward's elliptical gloss, of one or two sets of scratches; numbers from images go from black to white."""

    kind: Literal["ward"]
    reflectance: Paint
    diffuse: Paint = (0.0, 0.0, 0.0)
    alpha_x: Positive | str
    alpha_y: Positive | str
    rotation: float | str = 0.0
    crossed: Share = 0.0
    crossing: float = 90.0

    def made(self, name: str, folder: Path, place: str) -> Ward:
        """The surface; an image of directions goes from 0° at black to 180° at white."""
        reflectance, diffuse = (
            colour_of(getattr(self, key), folder, f"{place}.{key}") for key in ("reflectance", "diffuse")
        )
        along, across = (number_of(getattr(self, key), folder, f"{place}.{key}") for key in ("alpha_x", "alpha_y"))
        if isinstance(self.rotation, str):
            turn: Any = np.float32(np.pi) * number_of(self.rotation, folder, f"{place}.rotation")
        else:
            turn = math.radians(self.rotation)
        return Ward(
            reflectance, along, across, diffuse, name, turn, self.crossed, math.radians(self.crossing)
        )  # fmt: skip
