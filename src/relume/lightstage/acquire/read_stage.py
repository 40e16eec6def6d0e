"""A stage from where it lies: a folder with its `stage.json` or `.lp`, one of these files, or an imported store."""

from __future__ import annotations

import os
from collections.abc import Collection
from pathlib import Path

import numpy as np

from relume.errors import InvalidStage, warn
from relume.image import files
from relume.lightstage.acquire.encoding import PhotographEncoding
from relume.lightstage.acquire.light_files import LIST, read_lp
from relume.lightstage.acquire.picture_folder import KEPT, PictureFolder
from relume.lightstage.acquire.stage_file import STAGE_FILE, LightEntry, Stage, StageCamera
from relume.lightstage.acquire.stage_file_reading import read_stage_file
from relume.lightstage.acquire.store_place import is_url
from relume.lightstage.field.field import ReflectanceField
from relume.scene.cameras.camera import Camera

PICTURES = (".exr", ".hdr", ".pic", ".pfm", ".float", ".jpg", ".jpeg", ".png", ".tif", ".tiff")
"""Endings of files that would be a light's picture; camera raws are developed or merged first."""

MESHES = (".glb", ".gltf", ".obj", ".ply", ".stl", ".usd", ".usda", ".usdc", ".usdz")


def read_stage(path: str | os.PathLike[str], camera: str | None = None, *, kept: int = KEPT) -> ReflectanceField:
    """The reflectance field at a path; its pictures are read when it is asked for them.

    path : a folder with a `stage.json` or a single `.lp`, such a file itself, or a store that was imported, which may
        be named by an fsspec URL
    camera : whose pictures, where the stage file names several; the first that it lists unless given
    kept : bytes of decoded pictures held in memory, so that blocks of rows need not read all files anew; 0 suits a
        field whose lights are asked for once
    Raises InvalidStage where there is neither, where pictures are missing, and for a camera that the stage does not
    have; UnreadableFile. Warns of pictures that no light names, and of a stage file's `target`, on which only an import
    measures the lights.
    """
    from relume.lightstage.acquire.store import is_store, read_store

    if is_url(path):
        if camera is not None:
            raise InvalidStage(f"{path}: a URL names a store, which holds the pictures of one camera; leave it out")
        return read_store(path)
    path = Path(path)
    if is_store(path):
        if camera is not None:
            raise InvalidStage(f'{path}: a store holds the pictures of one camera; import camera "{camera}" by itself')
        return read_store(path)
    stage, source = find_stage_file(path)
    if stage.target is not None:
        warn(f'{source}: its "target" is passed over here; an import of the stage measures the lights on it')
    return open_pictures(stage, source, camera, kept=kept)


def find_stage_file(path: str | os.PathLike[str]) -> tuple[Stage, Path]:
    """The stage that a folder or file describes, and its stage file or `.lp`; no picture is looked at.

    Raises InvalidStage where there is neither.
    """
    source = _source(Path(path))
    if source.suffix.lower() == LIST:
        return _listed(source), source
    return read_stage_file(source), source


def stage_camera(
    path: str | os.PathLike[str], camera: str | None = None, *, width: int = 512, height: int = 512
) -> Camera:
    """Where a camera of a stage stands and looks, whether the stage has pictures of it or not.

    path : as of `read_stage`
    camera : its name in the stage file; the one of the pictures unless given
    width, height : pixels of the picture that a named camera takes
    Raises as `read_stage` does, and InvalidStage for a stage that names no camera.
    """
    if camera is not None and not is_url(path) and (Path(path) / STAGE_FILE).is_file():
        named = find_stage_file(path)[0].cameras
        if camera in named:
            return named[camera].camera(width, height)
    found = read_stage(path, camera).camera
    if found is None:
        raise InvalidStage(f"{path}: has no camera, which gives the frame; add it to stage.json")
    return found


def stage_geometry(path: str | os.PathLike[str]) -> tuple[Path | None, float | None]:
    """The mesh of the subject that a stage has, and the radius of its lights, radians; None where it has neither.

    The mesh is the one that `stage.json` names as "mesh", else the only one in the folder `objects` beside it.
    Raises InvalidStage for a name without a file.
    """
    from relume.lightstage.acquire.store import is_store, stored_geometry

    if is_url(path):
        return stored_geometry(path)
    path = Path(path)
    if is_store(path):
        return stored_geometry(path)
    file = path / STAGE_FILE if path.is_dir() else path
    if file.name != STAGE_FILE or not file.is_file():
        return None, None
    stage = read_stage_file(file)
    radius = None if stage.angular_diameter is None else stage.angular_diameter / 2
    if (named := stage.others.get("mesh")) is not None:
        if not isinstance(named, str) or not (file.parent / named).is_file():
            raise InvalidStage(f'{file}: "mesh" is {named!r}; name a file beside the stage file')
        return file.parent / named, radius
    objects = file.parent / "objects"
    found = [each for each in sorted(objects.iterdir()) if each.suffix.lower() in MESHES] if objects.is_dir() else []
    return (found[0] if len(found) == 1 else None), radius


def open_pictures(
    stage: Stage, source: Path, camera: str | None = None, *, kept: int = KEPT, known: Collection[Path] = ()
) -> PictureFolder:
    """The field over a stage's pictures.

    source : the file that describes them, beside which they lie, or their folder where no file does
    known : pictures in the folder that are meant to be of no light, and are not warned of
    Raises as `read_stage` does, whose `kept` this is.
    """
    folder = source if source.is_dir() else source.parent
    view, key = _view(stage, camera, source)
    paths = tuple(tuple(folder / name for name in entry.files[key]) for entry in stage.lights)
    wanted = [path for names in paths for path in names]
    missing = [path for path in wanted if not path.is_file()]
    if missing:
        raise InvalidStage(
            f"{source}: {len(missing)} of {len(wanted)} pictures are missing, the first {missing[0]}; add them, or "
            "leave out their lights"
        )
    _warn_of_unnamed(stage, folder, source, known)
    exposures = tuple(entry.exposure for entry in stage.lights if entry.exposure is not None)
    if exposures and len(exposures) != len(stage.lights):
        silent = next(entry.label for entry in stage.lights if entry.exposure is None)
        raise InvalidStage(f'{source}: the light "{silent}" has no "exposure", but others have; give it to all')
    first = paths[0][0]
    width, height = (files.read_radiance(first) if files.has_radiance(first) else files.read_photograph(first)).size
    try:
        lights = stage.stage_lights()
    except ValueError as error:
        raise InvalidStage(f"{source}: {error}") from None
    return PictureFolder(
        lights,
        paths,
        np.array([entry.irradiance for entry in stage.lights], np.float64),
        (height, width),
        None if view is None else view.camera(width, height),
        encoding=PhotographEncoding.named(stage.encoding, folder),
        exposures=exposures or None,
        kept=kept,
    )


def _source(path: Path) -> Path:
    """The file that describes the lights."""
    if not path.exists():
        raise InvalidStage(f"{path}: no such folder or file; name the folder of the pictures")
    if path.is_file():
        if path.suffix.lower() not in (LIST, ".json"):
            raise InvalidStage(f"{path}: neither a stage file (.json) nor an .lp; name one, or the pictures' folder")
        return path
    if (path / STAGE_FILE).is_file():
        return path / STAGE_FILE
    lists = sorted(file for file in path.iterdir() if file.suffix.lower() == LIST and not file.name.startswith("."))
    if len(lists) > 1:
        raise InvalidStage(
            f"{path}: {len(lists)} lists of lights, {lists[0].name} and {lists[1].name}; name the one meant"
        )
    if not lists:
        raise InvalidStage(
            f"{path}: the places of the lights are not known; add stage.json or an .lp, or find them from a mirrored "
            "ball in the pictures by an import of the stage"
        )
    return lists[0]


def _listed(source: Path) -> Stage:
    """The stage of an `.lp`, whose names are often paths of the computer that wrote it."""
    (names, directions), folder = read_lp(source), source.parent
    there = {name.lower(): name for name in (path.name for path in folder.iterdir() if path.is_file())}
    entries = []
    for name, (x, y, z) in zip(names, directions.tolist(), strict=True):
        plain = name.replace("\\", "/")
        inside = not plain.startswith("/") and ".." not in plain.split("/") and (folder / plain).is_file()
        last = plain.rsplit("/", 1)[-1]
        file = plain if inside else there.get(last.lower(), last)
        entries.append(LightEntry({"": (file,)}, (x, y, z)))
    if len({entry.label for entry in entries}) != len(entries):
        raise InvalidStage(f"{source}: two lights have the same picture in {folder}; give each its own")
    return Stage(tuple(entries))


def _view(stage: Stage, camera: str | None, source: Path) -> tuple[StageCamera | None, str]:
    """The camera that is asked for, and under which name the lights have its pictures."""
    pictured = list(stage.lights[0].files)
    if pictured == [""]:
        # The pictures are of the stage's own camera: its front, or the only or first one.
        own = "front" if "front" in stage.cameras else next(iter(stage.cameras), None)
        if camera not in (None, own):
            others = f"they are of {own}" if own else "it names no cameras"
            raise InvalidStage(f'{source}: has no pictures of a camera "{camera}"; {others}')
        return (None if own is None else stage.cameras[own]), ""
    chosen = camera or next((name for name in stage.cameras if name in pictured), pictured[0])
    if chosen not in pictured:
        raise InvalidStage(f'{source}: has no pictures of a camera "{camera}"; there are {", ".join(pictured)}')
    return stage.cameras.get(chosen), chosen


def _warn_of_unnamed(stage: Stage, folder: Path, source: Path, known: Collection[Path]) -> None:
    meant = {path.resolve() for path in known}
    named = {folder / name for entry in stage.lights for names in entry.files.values() for name in names}
    beside = sorted(file for place in {path.parent for path in named} for file in place.iterdir())
    pictures = [f for f in beside if f.suffix.lower() in PICTURES and not f.name.startswith(".")]
    odd = [f for f in pictures if f not in named and f.resolve() not in meant]
    if odd:
        warn(
            f"{source}: {len(odd)} pictures beside those of the lights are named by none, such as {odd[0].name}; they "
            "are passed over"
        )
