"""What `relume develop` is told of the scene: the angle seen, its unit, its depth and motion."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from relume.cli.develop_planes import Along, read_depth, read_motion

if TYPE_CHECKING:
    from relume.image.radiance import RadianceMap
    from relume.project.presets.preset import Preset
    from relume.virtual_camera.view import View
    from relume.virtual_camera.virtual_camera import VirtualCamera


@Parameter(name="*")
@dataclass(frozen=True)
class ViewOptions:
    """The picture's own facts, which no file tells for certain."""

    field_of_view: Annotated[
        float | None, Parameter(help="Horizontal, degrees; the preset's, or 50, unless given.")
    ] = None
    luminance: Annotated[
        float | None, Parameter(help="cd/m² per unit of a relative map, for glare and tones that model the eye.")
    ] = None
    depth: Annotated[
        Path | None, Parameter(help="An EXR with a depth layer, metres, as `relume insert` writes (layers.exr).")
    ] = None
    depth_along: Annotated[
        Along | None,
        Parameter(help="What the depth is along: the axis, as most programs write, or rays, as relume's layers do; "
                  "told by the file unless given."),
    ] = None  # fmt: skip
    vectors: Annotated[
        Path | None, Parameter(help="An EXR of motion, pixels right in R and down in G while the shutter is open.")
    ] = None
    seed: Annotated[int | None, Parameter(help="Of grain and needles; the same seed gives the same picture.")] = None

    def view(self, picture: RadianceMap, camera: VirtualCamera, preset: Preset) -> View:
        """The view of a picture; raises ValueError for planes of another size, UnreadableFile."""
        told = preset.view
        degrees = told.field_of_view if self.field_of_view is None else self.field_of_view
        # A preset knows nothing of the picture; what is in cd/m² needs no scale of its.
        preset_scale = None if picture.unit == "cd/m²" else told.luminance
        scale = preset_scale if self.luminance is None else self.luminance
        focal_length = picture.size[0] / 2 / math.tan(math.radians(degrees) / 2) if 0 < degrees < 180 else 1.0
        return camera.view(
            picture,
            field_of_view=math.radians(degrees),
            luminance_scale=scale,
            depth=None if self.depth is None else read_depth(self.depth, focal_length, self.depth_along),
            motion=None if self.vectors is None else read_motion(self.vectors),
            seed=told.seed if self.seed is None else self.seed,
        )
