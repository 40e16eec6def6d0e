"""The shot file's [camera]: a grid, a pose, lines on the plate, the ball or another program's camera; the lens."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from pydantic import BeforeValidator, Field, model_validator

from relume.errors import InvalidShot, warn
from relume.image import files
from relume.project.schema import Positive, Table, Vector
from relume.project.shot_file.ball_table import BallOnTable
from relume.project.shot_file.camera_file import CameraFile, camera_of_file
from relume.project.shot_file.sequence_table import CameraKey, require_rising
from relume.scene.cameras.camera import Camera
from relume.scene.cameras.distortion import Distortion
from relume.scene.cameras.fit import CameraFit
from relume.scene.cameras.grid import fit_grid
from relume.scene.cameras.known_lengths import CameraHeight, GroundLength, KnownLength, UprightLength
from relume.scene.cameras.vanishing_lines import AxisLines, fit_vanishing_lines
from relume.scene.toml_tables import DistortionTable

Pixel = tuple[float, float]
"""A point of the photograph: x right and y down from its upper left corner."""
Segment = tuple[float, float, float, float]
"""A line drawn on the photograph: x and y of one end, x and y of the other."""
SOURCES = ("grid", "pose", "lines", "ball", "file")
GRID_RESIDUAL = 1.0
"""Pixels, RMS, from which on a grid's corners doubt the lens: they are found to a tenth even in a noisy JPEG."""
LINES_RESIDUAL = 3.0
"""Pixels, RMS, from which on lines doubt their axes or the lens: a person draws them to one or two."""
GIANT = 1.0
"""Metres of a square from which on its length was given in another unit: no board is printed so large."""
ZOOMED = 0.02
"""Share by which the EXIF focal lengths of plate and grid may differ: millimetres are rounded to a few parts in 100."""


class Grid(Table):
    """A chequered board on the ground, photographed by the plate's camera, and what to estimate from it.

    thickness : metres by which its printed surface lies above what it lies on, where the objects stand too
    """

    photograph: str
    squares: tuple[Annotated[int, Field(ge=3)], Annotated[int, Field(ge=3)]]
    square: Positive
    thickness: Annotated[float, Field(ge=0)] = 0.0
    estimate_focal_length: bool = False
    estimate_k1: bool = False

    @model_validator(mode="after")
    def _in_metres(self) -> Grid:
        long = self.squares[0] * self.square
        if self.square >= GIANT:
            raise ValueError(f"square is {self.square:g} m, so the board {long:g} m; lengths are metres: 3 cm are 0.03")
        if self.thickness > long:
            raise ValueError(
                f"thickness is {self.thickness:g} m, and the board {long:g} m long; lengths are metres: 1 mm is 0.001"
            )
        return self


class Pose(Table):
    """Where the plate's camera stood and looked, horizon level."""

    position: Vector
    look_at: Vector


class Length(Table):
    """Two points of the plate and the metres between them at the place."""

    between: tuple[Pixel, Pixel]
    metres: Positive


class Lines(Table):
    """Lines drawn on the plate along the world's axes, where its origin is, and one length that was measured."""

    x: list[Segment] = Field(default_factory=list)
    y: list[Segment] = Field(default_factory=list)
    z: list[Segment] = Field(default_factory=list)
    level: bool = False
    origin: Pixel
    length: Length | None = None
    upright: Length | None = None
    camera_height: Positive | None = None
    estimate_centre: bool = False

    @model_validator(mode="after")
    def _one_length(self) -> Lines:
        if sum(known is not None for known in (self.length, self.upright, self.camera_height)) != 1:
            raise ValueError("give one of length, upright and camera_height, which sets the scale")
        return self

    def known_length(self) -> KnownLength:
        """The one that is given."""
        if self.length is not None:
            return GroundLength(*self.length.between, self.length.metres)
        if self.upright is not None:
            return UprightLength(*self.upright.between, self.upright.metres)
        assert self.camera_height is not None  # _one_length
        return CameraHeight(self.camera_height)


class CameraTable(Table):
    """The plate's camera: from a grid, lines, a file or the ball, or given; from the ball unless asked otherwise.

    readout : seconds from the moment of the picture's first row to that of its last, of a sensor that is read row after
        row while the camera of a file moves; below 0 where the lowest row is the first. The frame's moment is that of
        the middle row. All rows are of one moment unless given
    """

    grid: Grid | None = None
    pose: Pose | None = None
    lines: Lines | None = None
    ball: BallOnTable | None = None
    file: Annotated[CameraFile | None, BeforeValidator(lambda v: {"path": v} if isinstance(v, str) else v)] = None
    focal_length: Positive | None = None
    centre: Pixel | None = None
    distortion: DistortionTable | None = None
    readout: Annotated[float, Field(ge=-1, le=1)] | None = None
    keyframes: tuple[CameraKey, ...] = ()

    @property
    def of_ball(self) -> BallOnTable | None:
        """The ball as the camera saw it, where the camera is found from it: unless another source is given."""
        if any(getattr(self, source) is not None for source in SOURCES if source != "ball"):
            return None
        return self.ball or BallOnTable()

    @model_validator(mode="after")
    def _one_source(self) -> CameraTable:
        require_rising(self.keyframes)
        if self.grid is not None and self.grid.squares[0] <= self.grid.squares[1]:
            raise ValueError(
                f"grid.squares is {list(self.grid.squares)}; the long side comes first, and must be longer"
            )
        if sum(getattr(self, source) is not None for source in SOURCES) > 1:
            raise ValueError("give one of grid, pose, lines, ball and file")
        given = self.focal_length is not None or self.centre is not None
        if self.file is not None and given and not self.file.numbered:
            raise ValueError("file holds the focal length and the centre; leave focal_length and centre out")
        if self.file is not None and self.keyframes:
            raise ValueError("both file and keyframes; the file says where the camera is: leave one of them out")
        if self.readout is not None and self.file is None:
            raise ValueError("readout is of a camera that moves in a file; give file, or leave readout out")
        if self.focal_length is not None and self.grid is not None and self.grid.estimate_focal_length:
            raise ValueError("both focal_length and grid.estimate_focal_length; give one of them")
        if self.distortion is not None and self.grid is not None and self.grid.estimate_k1:
            raise ValueError("both distortion and grid.estimate_k1; give one of them")
        if self.centre is not None and self.lines is not None and self.lines.estimate_centre:
            raise ValueError("both centre and lines.estimate_centre; give one of them")
        return self


def camera_fit(table: CameraTable, size: tuple[int, int], folder: Path, focal_length: float | None) -> CameraFit:
    """The plate's camera, and how well the photograph agrees with it.

    table : [camera]
    size : (width, height) of the plate, pixels
    folder : where its relative paths start
    focal_length : pixels, of the plate's EXIF; None where it holds none
    Raises InvalidShot naming the key, UnreadableFile and GridNotFound.
    """
    distortion = Distortion(**table.distortion.model_dump()) if table.distortion is not None else None
    if table.grid is not None:
        fit = _from_grid(table, table.grid, size, folder, focal_length, distortion)
    elif table.lines is not None:
        fit = _from_lines(table, table.lines, size, focal_length, distortion)
    elif table.file is not None:
        fit = CameraFit(camera_of_file(
            table.file, size, folder, focal_length=table.focal_length, exif=focal_length, centre=table.centre,
            distortion=distortion, readout=table.readout or 0.0,
        ))  # fmt: skip
    else:
        assert table.pose is not None  # else it is found from the ball: CameraTable.of_ball
        fit = CameraFit(_from_pose(table, table.pose, size, focal_length, distortion))
    _warn_of_residual(table, fit)
    return fit


def _warn_of_residual(table: CameraTable, fit: CameraFit) -> None:
    if fit.residual is None or fit.residual <= (GRID_RESIDUAL if table.grid is not None else LINES_RESIDUAL):
        return
    source = "grid" if table.grid is not None else "lines"
    remedy = "is focal_length right, or distortion missing?" if source == "grid" else "check which axis each is along"
    warn(f"camera.{source} fits badly: {fit.agreement}; {remedy}")


def _with(camera: Camera, key: str, **changes: Any) -> Camera:
    try:
        return replace(camera, **changes)
    except ValueError as error:
        raise InvalidShot(f"{key}: {error}") from None


def _from_grid(
    table: CameraTable,
    grid: Grid,
    size: tuple[int, int],
    folder: Path,
    exif: float | None,
    distortion: Distortion | None,
) -> CameraFit:
    """The camera from the board, at the plate's size where the board was photographed or saved at another."""
    photograph = files.read_photograph(folder / grid.photograph)
    scale = photograph.size[0] / size[0]
    if abs(photograph.size[1] - scale * size[1]) > max(1.0, scale):
        raise InvalidShot(
            f"camera.grid.photograph: {photograph.name} is {photograph.size[0]}×{photograph.size[1]}, the "
            f"plate {size[0]}×{size[1]}; photograph the grid with the plate's camera and size, both uncropped"
        )
    centre = None if table.centre is None else (table.centre[0] * scale, table.centre[1] * scale)
    focal_length = table.focal_length
    if focal_length is None and exif is not None and not grid.estimate_focal_length:
        own = photograph.focal_length
        if own is None:
            focal_length = exif
        elif abs(own / (exif * scale) - 1) > ZOOMED:
            warn(
                f"{photograph.name}: its EXIF has a focal length of {own / scale:.0f} pixels of the plate, the plate's "
                f"own {exif:.0f}: zoomed or cropped between the two? photograph the grid just as the plate, or give "
                "focal_length",
                effect=abs(own / (exif * scale) - 1),
            )
    try:
        found = fit_grid(
            photograph, squares=grid.squares, square=grid.square, thickness=grid.thickness,
            focal_length=None if focal_length is None else focal_length * scale,
            centre=centre, distortion=distortion,
            estimate_focal_length=grid.estimate_focal_length, estimate_k1=grid.estimate_k1,
        )  # fmt: skip
    except ValueError as error:
        raise InvalidShot(f"camera.grid: {error}") from None
    if photograph.size == size:
        return found
    return CameraFit(found.camera.resized(*size), found.points / scale, found.offsets / scale)


def _from_lines(
    table: CameraTable, lines: Lines, size: tuple[int, int], exif: float | None, distortion: Distortion | None
) -> CameraFit:
    """Two sets of lines determine the focal length where they can; else that of the EXIF is used."""

    def fit(focal_length: float | None) -> CameraFit:
        return fit_vanishing_lines(
            size, drawn, origin=lines.origin, length=known, focal_length=focal_length, centre=table.centre,
            distortion=distortion, estimate_centre=lines.estimate_centre,
        )  # fmt: skip

    try:
        x, y, z = (np.array(s, np.float64).reshape(-1, 2, 2) for s in (lines.x, lines.y, lines.z))
        drawn, known = AxisLines(x, y, z, lines.level), lines.known_length()
        # The terms of a distortion refer to a focal length, and lines along one axis determine none.
        needed = distortion is not None or sum(len(s) > 1 for s in (x, y, z)) < 2
        given = table.focal_length or (exif if needed else None)
        if given is not None or exif is None:
            return fit(given)
        try:
            return fit(None)
        except ValueError:
            found = fit(exif)
        warn(f"camera.lines do not determine the focal length; that of the plate's EXIF is used: {exif:.0f} pixels")
        return found
    except ValueError as error:
        raise InvalidShot(f"camera.lines: {error}") from None


def _from_pose(
    table: CameraTable, pose: Pose, size: tuple[int, int], exif: float | None, distortion: Distortion | None
) -> Camera:
    focal_length = table.focal_length or exif
    if focal_length is None:
        raise InvalidShot("camera.focal_length: missing, and the plate's EXIF has none; give it in pixels")
    try:
        camera = Camera.looking_at(
            np.array(pose.position), np.array(pose.look_at), width=size[0], height=size[1], focal_length=focal_length
        )
    except ValueError as error:
        raise InvalidShot(f"camera.pose: {error}") from None
    return _with(camera, "camera.distortion", centre=table.centre, distortion=distortion)
