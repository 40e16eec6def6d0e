"""The shot file: one TOML that says which photographs, camera, light, surfaces and objects make a composite.

Paths are relative to the file; lengths are metres, angles degrees. An unknown key is an error, never ignored.
"""

from __future__ import annotations

import os
import re
import tomllib
from collections.abc import Sequence
from glob import escape, glob
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal

from pydantic import Field, model_validator

from relume.errors import InvalidShot, UnreadableFile
from relume.project.mesh_tables import EdgeAngle, MaterialTable, Placement
from relume.project.place_tables import MediumTable
from relume.project.schema import Names, Positive, Table, checked, read_toml
from relume.project.shot_file.camera_table import CameraTable
from relume.project.shot_file.light_table import Light, MergeTable
from relume.project.shot_file.local_table import LocalTable
from relume.project.shot_file.match_table import MatchTable
from relume.project.shot_file.new_shot import NEW_RENDER, NewShot, write_new_shot
from relume.project.shot_file.sequence_table import ObjectKey, SequenceTable, require_rising
from relume.project.shot_file.views_table import ViewTable

TABLE = 24.0
"""Ball radii across which a table of unknown size is taken to reach: 1.2 m for a ball of 10 cm."""


class Spot(Table):
    """A place of the plate whose luminance was measured, by which plate and light are in cd/m².

    at : its pixel, column and row from 0 at the top left
    luminance : cd/m²
    radius : pixels of the disc whose mean is compared; a spot meter's 1° unless given
    """

    at: tuple[Annotated[int, Field(ge=0)], Annotated[int, Field(ge=0)]]
    luminance: Positive
    radius: Positive | None = None


class Plate(MergeTable):
    """The photograph that receives the objects: a bracket, a single photograph, one radiance map or a video's frame.

    frame : of a video, 1 for its first; that of each frame in a sequence
    """

    photographs: Names = Field(min_length=1)
    frame: Annotated[int, Field(ge=1)] | None = None
    times: list[Positive] | None = None
    denoise: bool = False
    spot: Spot | None = None


class Object(Placement):
    """A mesh to insert.

    size : metres of its longest side, in place of its own
    stand : [x, z] where the middle of its foot stands on the table, before it is moved by `translate`; at the origin
        unless given where the camera is found from the ball and there is no `translate`, elsewhere as the file has it
    smooth : degrees; edges where two faces turn by less are shaded smooth. Unless given by the file's normals, and flat
        where it has none
    stage : a light stage of the real thing that the mesh is of, in its frame: the thing's own pixels are shown
    stage_cameras : whose pictures, where the stage has several; the first camera's unless given
    """

    mesh: str
    size: Positive | None = None
    stand: tuple[float, float] | Literal[False] | None = None
    smooth: EdgeAngle | None = None
    stage: str | None = None
    stage_cameras: list[str] | None = None
    material: MaterialTable = MaterialTable()
    time: float | None = None
    keyframes: tuple[ObjectKey, ...] = ()

    @model_validator(mode="after")
    def _keys_rise(self) -> Object:
        require_rising(self.keyframes)
        if self.stage is None and self.stage_cameras is not None:
            raise ValueError("stage_cameras are those of a stage; give stage too, or leave them out")
        if self.stage is not None and (self.size is not None or self.stand):
            raise ValueError("a thing from a light stage has its own size and place; leave size and stand out")
        if self.stage is not None and self.time is not None:
            raise ValueError("a thing from a light stage has the pose it was taken in; leave time out")
        if self.stage is not None and self.smooth is not None:
            raise ValueError("a thing from a light stage shows its own pixels; leave smooth out")
        return self


class RenderTable(Table):
    """How long to render."""

    samples: Annotated[int, Field(ge=2, le=1_000_000)] = 256
    noise: Positive | None = None
    depth: Annotated[int, Field(ge=1, le=1000)] = 12
    seed: Annotated[int, Field(ge=0)] = 0
    denoise: bool = False
    preview: bool = True


class DevelopTable(Table):
    """How the composite becomes a picture: the plate's response, or the sRGB curve; exposure in stops on top."""

    response: Literal["plate", "srgb"] = "plate"
    exposure: float = 0.0


class Shot(Table):
    """A whole shot file: a field for each of its tables.

    `folder` is where its relative paths start, `new_render` the [render] of a shot that is begun.
    """

    new_render: ClassVar[dict[str, Any]] = NEW_RENDER
    plate: Plate
    camera: CameraTable = CameraTable()
    light: Light
    medium: MediumTable | None = None
    local: list[LocalTable] = Field(default_factory=lambda: [LocalTable(shape="plane")])
    views: list[ViewTable] = Field(default_factory=list)
    objects: list[Object] = Field(default_factory=list)
    match: MatchTable = MatchTable()
    render: RenderTable = RenderTable()
    develop: DevelopTable = DevelopTable()
    sequence: SequenceTable | None = None
    folder: Path = Field(default=Path("."), exclude=True)

    @model_validator(mode="after")
    def _one_frame(self) -> Shot:
        if fault := self._frame_fault():
            raise ValueError(fault)
        return self

    def _frame_fault(self) -> str | None:
        """What contradicts that all lengths are in one frame: the ball's, or that of another source of the camera."""
        ball, balls, asked = self.light.ball, self.light.balls or [], self.camera.of_ball
        placed = [each.camera is not None for each in balls]
        if asked is None:
            if ball is not None and ball.centre is None:
                return "light.ball.centre: missing; it is known only where the camera is found from the ball"
            if not all(placed):
                return f"light.balls.{placed.index(False)}.camera: missing; give where that camera stood, in metres"
            return None
        # The frame of the ball.
        if self.camera.keyframes:
            return "camera.keyframes: they move a pose; give [camera] pose"
        if self.camera.ball is not None and not (ball or asked.radius):
            return "camera.ball.radius: missing; give the ball's in metres, as there is no light.ball to take it from"
        if not (ball or asked.radius) or not (balls or asked.photograph or asked.rim):
            return "camera: give one of grid, pose, lines and file, or ball = { photograph, radius }"
        if ball is not None and asked.radius not in (None, ball.radius):
            return f"camera.ball.radius is {asked.radius:g} and light.ball.radius {ball.radius:g}; give it once"
        measured = (
            "light.ball.centre" if ball and ball.centre else "light.balls.0.camera" if placed[:1] == [True] else ""
        )
        if measured and self.camera.ball is None:
            return f"{measured}: in which frame? give one of grid, pose, lines and file as [camera], or leave it out"
        if ball is not None and ball.centre is not None:
            return "light.ball.centre: with camera.ball the ball stands at the origin; leave it out"
        if placed[:1] == [True] and not (asked.photograph or asked.rim):
            return "light.balls.0.camera: camera.ball says that the plate's camera took it; leave one of them out"
        return None

    @classmethod
    def new(
        cls,
        path: str | Path | None,
        *,
        plate: Sequence[str | Path],
        balls: Sequence[str | Path] = (),
        objects: Sequence[str | Path],
        light: str | Path | None = None,
        radius: float | None = None,
        foot: tuple[float, float] | None = None,
        rim: tuple[float, float, float] | None = None,
        times: Sequence[float] | None = None,
        times_from_names: bool = False,
        surface_reflectance: float | None = None,
        force: bool = False,
    ) -> Shot:
        """The shortest useful shot, written as its file: camera and frame come from the ball's outline.

        path : of the file, .toml, whose folder is made; None writes none
        plate : its photographs, or one radiance map
        balls : photographs of the ball where the objects shall stand, by the plate's camera from the plate's place;
            every folder is a further view. With `light` one photograph that shows where the camera stood, or none
        objects : meshes, stood side by side in the ball's place; one that is not of a table's size gets one
        light : a finished map, EXR or .hdr, in place of the light that the ball shows
        radius : of the ball, metres; 0.05 unless given, with a warning: it sets the scale alone
        foot : where a stand under the ball meets the table, x and y in pixels; the ball lies on the table unless given
        rim : where the plate would show a ball that it does not: x, y, radius in pixels
        times : seconds of the ball's photographs, or of the plate's and then the ball's; the EXIF's unless given
        times_from_names : read them from names like cp_t160.jpg instead
        surface_reflectance : of what the objects stand on, 0 to 1: the scale of the light where no exposure gives it
        force : whether another file of that name is replaced
        Raises OutputNotWritten, UnreadableFile, NotABracket, InvalidShot, ValueError; what is no shot is not written.
        """
        file = Path("shot.toml") if path is None else Path(path)
        photographs, seen, meshes = ([Path(each) for each in paths] for paths in (plate, balls, objects))
        given = NewShot(
            photographs, seen, meshes, radius, foot, rim, None if light is None else Path(light), times,
            times_from_names, surface_reflectance,
        )  # fmt: skip
        text = given.text(file.parent)
        shot = checked(Shot, tomllib.loads(text), file, "shot file", InvalidShot)
        if path is not None:
            write_new_shot(file, text, force)
        return shot.model_copy(update={"folder": file.parent})

    def surfaces(self) -> list[LocalTable]:
        """The tables [[local]]; unless given one endless plane at 0, or one about the ball where it gives the camera.

        Of such a place nothing is measured: the plane ends where a table may, lest walls count as the table.
        """
        asked = self.camera.of_ball
        if "local" not in self.model_fields_set and self.light.distant.radiance == "own":
            return []  # the place is its own surfaces
        if "local" in self.model_fields_set or asked is None:
            return self.local
        radius = asked.radius or (self.light.ball and self.light.ball.radius)
        assert radius is not None  # _frame_fault
        return [LocalTable(shape="plane", size=(TABLE * radius, TABLE * radius))]

    def with_render(self, *, samples: int | None = None, seed: int | None = None, noise: float | None = None) -> Shot:
        """The shot with other values in [render]; None keeps the file's.

        samples : rays a pixel, at most
        seed : of what is random
        noise : the share of noise at which the render may stop
        Raises pydantic's ValidationError, which is a ValueError.
        """
        given = {"samples": samples, "seed": seed, "noise": noise}
        changes = {name: value for name, value in given.items() if value is not None}
        return self.model_copy(update={"render": RenderTable.model_validate(self.render.model_dump() | changes)})

    def named_files(self) -> list[str]:
        """Every file that it names beside photographs: meshes, maps, mattes."""
        given = (self.light.map, self.light.distant.mesh, self.match.occluder)
        light = [*self.light.names_of_maps(self.folder), *(name for name in given if name is not None)]
        profiles = [table.profile for table in (self.plate, *(self.light.balls or ())) if table.profile is not None]
        return [
            *profiles,
            *light,
            *(name for table in self.local for name in table.files()),
            *(name for view in self.views for name in view.files()),
            *(name for o in self.objects for name in (o.mesh, o.material.file) if name is not None),
        ]

    def name_of_light(self) -> str | None:
        """What messages call light that is not measured from photographs; None where it is."""
        probes = [each.map for each in self.light.probes or ()]
        first = self.light.map or next(iter([*(self.light.maps or ()), *probes]), None)
        return str(self.path(first)) if first else "light.sky" if self.light.sky is not None else None

    def path(self, name: str) -> Path:
        """The file or folder of a name in the shot file."""
        return _direct(self.folder / name)

    def files(self, patterns: Sequence[str]) -> list[Path]:
        """The files that names and patterns stand for, in order; raises UnreadableFile where one is none."""
        found: list[Path] = []
        for pattern in patterns:
            path = self.folder / pattern
            # The folder is a name, whatever brackets are in it; so is a file that is there.
            wild = any(c in pattern for c in "*?[") and not path.is_file()
            place = pattern if Path(pattern).is_absolute() else os.path.join(escape(str(self.folder)), pattern)
            named = [_direct(Path(name)) for name in glob(place)] if wild else [_direct(path)]
            if not (matches := sorted(named, key=_natural)):
                raise UnreadableFile(f"{path}: no such photographs; check the pattern in the shot file")
            found.extend(matches)
        return found


def _direct(path: Path) -> Path:
    """The path as a person writes it, relative or whole, whichever is shorter: without the detours of `a/../..`."""
    if ".." not in path.parts:
        return path
    whole = path.resolve()
    try:
        near = Path(os.path.relpath(whole, Path.cwd().resolve()))
    except ValueError:  # another drive
        return whole
    return min(near, whole, key=lambda each: len(str(each)))


def _natural(path: Path) -> list[tuple[int, int | str]]:
    """IMG_2 before IMG_10, as a person counts, so that a list of times goes to the right photographs."""
    return [(0, int(part)) if part.isdigit() else (1, part) for part in re.split(r"(\d+)", str(path))]


def read_shot(path: str | Path) -> Shot:
    """Read a shot file.

    path : the file, .toml; paths in it begin at its folder
    Raises InvalidShot naming the key and what it should be, UnreadableFile.
    """
    path = Path(path)
    table = read_toml(path, "shot file", InvalidShot)
    if "folder" in table:
        raise InvalidShot(f"{path}: folder: unknown key; remove it")
    return checked(Shot, table, path, "shot file", InvalidShot).model_copy(update={"folder": path.parent})
