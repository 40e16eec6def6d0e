"""The place file: photographs, blocks with their constraints, marked edges and known lengths, in TOML.

[[photographs]]
name = "north"
file = "north.jpg"            # beside the place file

[[blocks]]
name = "house"
kind = "box"
width = 8.0                   # metres; what is left out is found

[[blocks]]
name = "roof"
kind = "roof"
on = "house"                  # stands on it, turned as it is
width = "house.width"         # as wide
depth = "house.depth"
centre_x = "house.centre_x"   # aligned with it
centre_z = "house.centre_z"

[marks.north.house]           # photograph, block
front_top = [[312.5, 208.0], [655.0, 190.5]]     # points on an edge, pixels: x right, y down
front_left_top = [[311.0, 207.5]]                # or a corner
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field, model_validator

from relume.errors import InvalidPlace
from relume.scene.cameras.camera import Camera
from relume.scene.cameras.distortion import Distortion
from relume.scene.toml_tables import DistortionTable, Positive, Table, Vector, checked, read_toml

Name = Annotated[str, Field(pattern=r"^[\w-]+$")]
Pixel = tuple[float, float]
Sought = float | str | None
"""A number of metres, another block's ("house.width"), or what is to be found."""
SIZES = ("width", "height", "depth")
SIDES = (("left", "centre_x", "right"), ("bottom", "centre_y", "top"), ("back", "centre_z", "front"))
"""Where along x, y and z a block's low side, middle and high side lie."""


class PhotographTable(Table):
    """A photograph of the place.

    file : relative to the place file
    size : (width, height), pixels; the file's unless given
    focal_length : pixels, where it is known exactly; else found, from the file's EXIF on where that has it
    lens : photographs that name the same lens share the focal length that is found
    """

    name: Name
    file: str
    size: tuple[Annotated[int, Field(gt=0)], Annotated[int, Field(gt=0)]] | None = None
    focal_length: Positive | None = None
    lens: str | None = None
    centre: Pixel | None = None
    distortion: DistortionTable | None = None

    @model_validator(mode="after")
    def _lens(self) -> PhotographTable:
        if self.distortion is not None and self.focal_length is None:
            raise ValueError("distortion is of normalised coordinates; give the focal_length that goes with it")
        return self


class Mirrored(Table):
    """Symmetry: as large as another block, and as far from a plane on its other side."""

    of: str
    across: str


class BlockTable(Table):
    """A block: what it is, where it stands and what is known of it.

    on : the block that it stands on; the ground unless given
    turn : degrees about +Y, counter-clockwise from above; "unknown", or a block that is turned alike. As what it stands
        on, or as the first block, unless given
    profile : of a revolution, (radius, height) from the bottom to the top, as shares
    The first block sets the frame: its foot lies in the middle of the ground, unless its sides say otherwise.
    """

    name: Name
    kind: Literal["box", "roof", "gable", "wedge", "pyramid", "wall", "floor", "arch", "revolution"]
    on: str | None = None
    width: Sought = None
    height: Sought = None
    depth: Sought = None
    left: Sought = None
    centre_x: Sought = None
    right: Sought = None
    bottom: Sought = None
    centre_y: Sought = None
    top: Sought = None
    back: Sought = None
    centre_z: Sought = None
    front: Sought = None
    turn: float | str | None = None
    mirrored: Mirrored | None = None
    profile: tuple[Pixel, ...] | None = None

    @model_validator(mode="after")
    def _one_side_an_axis(self) -> BlockTable:
        for sides in SIDES:
            if len(given := [side for side in sides if getattr(self, side) is not None]) > 1:
                raise ValueError(f"both {' and '.join(given)}; give one of them, and the size beside")
        for size in SIZES:
            value = getattr(self, size)
            if isinstance(value, int | float) and not value > 0:
                raise ValueError(f"{size} is {value:g}; expected metres, more than 0")
        if self.profile is not None and self.kind != "revolution":
            raise ValueError(f"profile is of a revolution, not of a {self.kind}; leave it out")
        if self.on is not None and any(getattr(self, side) is not None for side in SIDES[1]):
            raise ValueError("on says where its bottom is; leave bottom, centre_y and top out")
        return self


class LengthTable(Table):
    """A distance that was measured between two corners, such as "house.front_left_top".

    deviation : metres, one standard deviation; 2 mm unless given, as a tape measures
    """

    between: tuple[str, str]
    metres: Positive
    deviation: Positive = 0.002


class FoundCamera(Table):
    """A camera as found: metres, rows of the world-from-camera rotation, pixels; one standard deviation of each."""

    position: Vector
    rotation: tuple[Vector, Vector, Vector]
    size: tuple[int, int]
    focal_length: Positive
    position_deviation: float
    rotation_deviation: float
    focal_length_deviation: float
    residual: float


class FoundBlock(Table):
    """A block as found: metres along its own axes; the least corner in the frame that is turned as it is; degrees."""

    size: Vector
    deviation: Vector
    low: Vector
    turn: float


class Found(Table):
    """What `relume model` found."""

    cameras: dict[str, FoundCamera]
    blocks: dict[str, FoundBlock]
    chi_square: float
    freedom: int
    doubts: tuple[str, ...] = ()


class PhotogrammetryTable(Table):
    """Cameras and a mesh that another program found, instead of photographs and blocks.

    model : COLMAP's folder, Meshroom's or OpenMVG's .json, or glTF; files are relative to the place file
    metres_per_unit : metres of a unit of the model; or `between` two cameras, numbered points or places, and the
        `metres` that were measured there
    up : what points up in the model's frame
    """

    model: str
    metres_per_unit: Positive | None = None
    between: tuple[str | int | Vector, str | int | Vector] | None = None
    metres: Positive | None = None
    up: Vector | None = None
    mesh: str | None = None
    photographs: str | None = None

    @model_validator(mode="after")
    def _one_scale(self) -> PhotogrammetryTable:
        if (self.between is None) != (self.metres is None):
            raise ValueError("between and metres belong together: two cameras or points, and their distance")
        if self.between is not None and self.metres_per_unit is not None:
            raise ValueError("both metres_per_unit and between; give one of them")
        return self


class PlaceTables(Table):
    """A place file.

    deviation : of a marked point, pixels, one standard deviation; half a pixel is what a careful eye reaches
    ends : whether the outermost two marks of each straight edge are its ends, which sizes then are nearly twice as
        sure from; marks further from an end than ten deviations stay points on the edge
    """

    deviation: Positive = 0.5
    ends: bool = False
    photographs: tuple[PhotographTable, ...] = ()
    blocks: tuple[BlockTable, ...] = ()
    lengths: tuple[LengthTable, ...] = ()
    marks: dict[str, dict[str, dict[str, Annotated[tuple[Pixel, ...], Field(min_length=1)]]]] = Field(
        default_factory=dict
    )
    photogrammetry: PhotogrammetryTable | None = None
    found: Found | None = None

    @model_validator(mode="after")
    def _names(self) -> PlaceTables:
        if self.photogrammetry is not None and (self.photographs or self.blocks):
            raise ValueError("both photogrammetry and photographs or blocks; give one of them")
        if self.photogrammetry is None and not (self.photographs and self.blocks):
            raise ValueError("a place needs [[photographs]] and [[blocks]], or [photogrammetry]")
        for what, entries in (("photographs", self.photographs), ("blocks", self.blocks)):
            names = [entry.name for entry in entries]
            if twice := sorted({name for name in names if names.count(name) > 1}):
                raise ValueError(f"two {what} are named {twice[0]!r}; give each a name of its own")
        for photograph in self.marks:
            require_known(photograph, [entry.name for entry in self.photographs], f"marks.{photograph}", "photograph")
            for block in self.marks[photograph]:
                require_known(block, [b.name for b in self.blocks], f"marks.{photograph}.{block}", "block")
        return self


def camera_of(
    table: PhotographTable, size: tuple[int, int], focal: float, position: np.ndarray, rotation: np.ndarray
) -> Camera:
    """A photograph's camera with the lens that its table describes."""
    lens = Distortion(**table.distortion.model_dump()) if table.distortion is not None else None
    return Camera(size[0], size[1], focal, position, rotation, table.centre, lens)


def require_known(name: str, known: Any, where: str, what: str) -> None:
    """Raises ValueError for a name that is not known, with the nearest one."""
    import difflib

    known = list(known)
    if name not in known:
        near = difflib.get_close_matches(name, known, 1)
        hint = f"did you mean {near[0]}?" if near else f"there are {', '.join(known)}"
        raise ValueError(f"{where}: no {what} {name!r}; {hint}")


def read_tables(path: Path) -> PlaceTables:
    """The place file, checked; raises InvalidPlace naming the key."""
    return checked(PlaceTables, read_toml(path, "place file", InvalidPlace), path, "place file", InvalidPlace)
