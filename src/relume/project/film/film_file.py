"""The film file: one TOML that says which scene file's sequence becomes a film, how it is rendered and developed.

Paths are relative to the file. An unknown key is an error, never ignored.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any

from pydantic import Field, ValidationError, field_validator

from relume.errors import InvalidScene, InvalidShot
from relume.project.presets.preset import CameraPreset
from relume.project.scene_file.camera import LARGEST
from relume.project.scene_file.images import naming
from relume.project.scene_file.lights import read_light
from relume.project.scene_file.scene_file import SceneFile, read_scene
from relume.project.scene_file.settings import RendererName, RenderSettings
from relume.project.schema import Positive, Table, checked, read_toml
from relume.project.shot_file.sequence_table import SequenceTable, frames_in

Pixels = Annotated[int, Field(ge=1, le=LARGEST)]


class FilmSequence(Table):
    """What the film has in place of the scene file's [sequence]; what it leaves out stays as it is there."""

    frames: str | list[int] | None = None
    rate: Positive | None = None
    shutter: tuple[float, float] | None = None

    @field_validator("frames")
    @classmethod
    def _says_frames(cls, value: str | list[int] | None) -> str | list[int] | None:
        if isinstance(value, str):
            frames_in(value)
        return value


class FilmRender(Table):
    """How the frames are rendered; what is left out is as in `RenderSettings`, but that mitsuba's are denoised.

    size : pixels, at the same field of view across
    """

    renderer: RendererName | None = None
    size: tuple[Pixels, Pixels] | None = None
    samples: Annotated[int, Field(ge=2, le=1_000_000)] | None = None
    noise: Positive | None = None
    depth: Annotated[int, Field(ge=1, le=1000)] | None = None
    denoise: bool | None = None
    seed: Annotated[int, Field(ge=0)] | None = None


class FilmOutput(Table):
    """Where the film goes.

    folder : for frames, developed pictures and the movie
    movie : its name there, .mp4
    sheet : pictures on its contact sheet, sheet.png; 0 for none
    """

    folder: str = "out"
    movie: str = "film.mp4"
    sheet: Annotated[int, Field(ge=0, le=100)] = 12

    @field_validator("movie")
    @classmethod
    def _is_a_movie(cls, value: str) -> str:
        if not value.lower().endswith(".mp4") or Path(value).name != value:
            raise ValueError(f"is {value!r}; give a name that ends in .mp4, without a folder")
        return value


class FilmTable(Table):
    """A whole film file.

    scene : a scene file with a [sequence]
    light : an environment map in place of the scene file's
    develop : the tables of a camera preset, above the `preset` that it may name
    """

    title: str = ""
    scene: str
    light: str | None = None
    sequence: FilmSequence = FilmSequence()
    render: FilmRender = FilmRender()
    develop: dict[str, Any] = Field(default_factory=dict)
    output: FilmOutput = FilmOutput()


@dataclass(frozen=True, eq=False)
class FilmFile:
    """What a film file says.

    scene : its scene file, with the film's own light, size and sequence
    settings : how its frames are rendered
    preset : how they are developed
    output : where they go; the folder is relative to `folder`
    folder : of the film file
    """

    scene: SceneFile
    settings: RenderSettings
    preset: CameraPreset
    output: FilmOutput
    folder: Path


def read_film(path: str | Path, light: str | Path | None = None, size: tuple[int, int] | None = None) -> FilmFile:
    """Read a film file and the scene file that it names.

    light, size : an environment map and pixels in place of the file's
    Raises InvalidScene naming the key and what it should be, UnreadableFile.
    """
    path = Path(path)
    table = checked(FilmTable, read_toml(path, "film file", InvalidScene), path, "film file", InvalidScene)
    folder = path.parent
    if not (folder / table.scene).is_file():
        raise InvalidScene(f"{path}: scene: {folder / table.scene} is no file; give the path of a scene file")
    scene = read_scene(folder / table.scene, size=size or table.render.size)
    if scene.sequence is None:
        raise InvalidScene(f'{folder / table.scene}: sequence: missing; a film needs [sequence] frames = "1-240"')
    if light is not None:
        scene = scene.under(read_light(Path(light)))
    elif table.light is not None:
        with naming(f"{path}: light"):
            scene = scene.under(read_light(folder / table.light))
    assert scene.sequence is not None  # another light leaves it
    sequence = _sequence(table.sequence, scene.sequence.table, path)
    render = table.render.model_dump(exclude={"size"}, exclude_none=True)
    render.setdefault("denoise", table.render.renderer in (None, "mitsuba"))
    scene = replace(scene, sequence=replace(scene.sequence, table=sequence))
    first, camera = scene.at_frame(sequence.frames[0])
    scene = replace(scene, scene=first, camera=camera)
    return FilmFile(scene, RenderSettings(**render), _preset(table.develop, path), table.output, folder)


def _sequence(own: FilmSequence, scenes: SequenceTable, path: Path) -> SequenceTable:
    """The scene file's table with what the film says; raises InvalidScene naming the film's key."""
    given = {name: getattr(own, name) for name in own.model_fields_set}
    try:
        return SequenceTable.model_validate({**scenes.model_dump(), **given})
    except ValidationError as error:
        fault = error.errors()[0]
        keys = ".".join(map(str, ("sequence", *fault["loc"])))
        raise InvalidScene(f"{path}: {keys}: {fault['msg'].removeprefix('Value error, ')}") from None


def _preset(develop: dict[str, Any], path: Path) -> CameraPreset:
    """The camera of [develop]; raises InvalidScene naming the key."""
    tables = dict(develop)
    base = tables.pop("preset", None)
    if base is not None and not isinstance(base, str):
        raise InvalidScene(f"{path}: develop.preset: input should be a name or a file (got {base!r})")
    if base is not None and (path.parent / base).is_file():
        base = path.parent / base
    try:
        return CameraPreset.read(base, tables, place=path)
    except InvalidShot as error:
        line = str(error)
        raise InvalidScene(line.replace(f"{path}: ", f"{path}: develop.", 1)) from None
