"""A quick look at an insertion: the same chain over a plate that is a few hundred pixels wide, with few rays.

What the photographs give is taken from the job's own stages, and made for them where it is missing. Of the plate a
small copy is kept, so that a second look, after an object was moved, reads no photograph. It begins with a rougher one.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from math import sqrt
from pathlib import Path

import numpy as np

from relume.image.photograph import Photograph
from relume.image.radiance import RadianceMap
from relume.image.resizing import cropped, resized
from relume.project.insertion.agreement import on_one_scale
from relume.project.insertion.composite import development_of
from relume.project.insertion.photographs import Calibrated, calibrate, read_photographs
from relume.project.insertion.place import Place, find_camera
from relume.project.insertion.render_change import Previews, change_about
from relume.project.shot_file.shot import Shot
from relume.project.stages import Stages, Steps
from relume.renderers.mitsuba.differential import Differential
from relume.scene.cameras.fit import CameraFit
from relume.scene.shapes.shapes import Mesh

PIXELS = 140_000
"""Of the small plate, about 460 × 305: large enough to see where a thing stands and how it is lit."""
RAYS = 6
"""A pixel; with Open Image Denoise after them soft shadows show and caustics are guessed at."""
ROUGHER = 2
"""Of its pixels along each side become one of the rough picture."""
BOUNCES = 8
SMALL_FILE = 100_000
"""Bytes of a file beside the photographs that may list their exposures."""


@dataclass(frozen=True, eq=False)
class SmallShot:
    """A shot's photographs, calibrated, with a plate made smaller.

    calibrated : its plate and its photographs are small
    fit : the camera of the small plate
    """

    calibrated: Calibrated
    fit: CameraFit


def small_shot(shot: Shot, steps: Steps) -> SmallShot:
    """The shot's photographs with a plate of about PIXELS; kept beside the stages of `steps`, whose own are used."""
    # Its seconds are those of the job's own stages, which are counted already.
    own = Steps(Stages(steps.stages.folder / "preview"), steps.progress, kept=steps.kept)

    def make() -> SmallShot:
        bare = shot.model_copy(update={"plate": shot.plate.model_copy(update={"denoise": False})})
        calibrated = calibrate(bare, read_photographs(bare), steps)
        fit = find_camera(bare, calibrated, steps)
        calibrated = on_one_scale(bare, calibrated, fit.camera)
        across, down = calibrated.plate.size
        return _smaller(calibrated, fit, max(1, round(sqrt(across * down / PIXELS))))

    return own.keep("small", _made_from(shot), make)


def quick(shot: Shot) -> Shot:
    """The shot as it is looked at quickly: nothing is measured of the plate's look, and nothing shown meanwhile."""
    render = shot.render.model_copy(update={"preview": False, "denoise": True})
    match = shot.match.model_copy(update={"sharpness": False, "grain": False, "occluder": None})
    plate = shot.plate.model_copy(update={"denoise": False})
    return shot.model_copy(update={"render": render, "match": match, "plate": plate})


def quick_renderer(shot: Shot, threads: int | None) -> Differential:
    """The renderer of a quick look."""
    rays, bounces = min(RAYS, shot.render.samples), min(BOUNCES, shot.render.depth)
    return Differential(rays, depth=bounces, threads=threads, quick=True)


def rough_shot(small: SmallShot) -> SmallShot:
    """The same still smaller: what it shows comes in a second, and is worth as much."""
    return _smaller(small.calibrated, small.fit, ROUGHER)


def look_about(
    shot: Shot, small: SmallShot, place: Place, rough: np.ndarray, about: tuple[float, float], meshes: Sequence[Mesh],
    renderer: Differential, out: Path,
) -> None:  # fmt: skip
    """Write the previews with the small plate's own pixels about a place, and a rougher composite around them.

    place : of the small plate
    rough : (h, w, 3) the composite of `rough_shot`
    about : shares of the picture's width and height
    """
    from relume.renderers.mitsuba.denoise import denoised

    calibrated, plate = small.calibrated, small.calibrated.plate
    change, part = change_about(
        renderer, place.relit(shot).adding(*meshes), place.camera, plate.radiance, about, shot.render.seed
    )
    real = place.recovered
    change = denoised(change, plate.radiance[part], None if real is None else real.textured[part], True)
    # Each rough pixel as large as it is; what is left of the plate at the ends is like the last.
    rows, columns = (
        np.minimum(np.arange(many) // ROUGHER, few - 1)
        for many, few in zip(plate.radiance.shape[:2], rough.shape[:2], strict=True)
    )
    around = RadianceMap(rough[np.ix_(rows, columns)], unit=plate.unit)
    Previews(out, plate, development_of(shot, calibrated).film).of_part(change, part, around)


def _made_from(shot: Shot) -> list[object]:
    """What the small shot depends on: its file but for the objects and their render, and what that names."""
    tables = shot.model_dump(mode="json", exclude={"objects", "render", "match", "sequence"})
    patterns = [shot.plate.photographs, *(table.photographs for table in shot.light.balls or ())]
    photographs = [path for each in patterns for path in shot.files(each)]
    named = [shot.folder / text for text in _texts(tables)]
    # A list of exposures beside the photographs counts too.
    folders = sorted({path.parent for path in photographs})
    beside = [path for folder in folders for path in sorted(folder.iterdir()) if path.suffix.lower() != ".toml"]
    small = [path for path in beside if path.is_file() and path.stat().st_size < SMALL_FILE]
    return [tables, PIXELS, [str(path) for path in photographs], photographs,
            [path for path in named if path.is_file()], small]  # fmt: skip


def _texts(value: object) -> Iterator[str]:
    if isinstance(value, str):
        yield value
    elif isinstance(value, dict | list):
        for each in value.values() if isinstance(value, dict) else value:
            yield from _texts(each)


def _smaller(calibrated: Calibrated, fit: CameraFit, step: int) -> SmallShot:
    """The same with whole squares of `step` pixels of the plate as its pixels."""
    plate, bracket, stood = calibrated.plate, calibrated.bracket, calibrated.stood
    width, height = (length // step for length in plate.size)
    bare = replace(plate, variance=None)
    small = resized(cropped(bare, 0, 0, width * step, height * step), width, height)
    if bracket is not None:
        photographs = tuple(_smaller_photograph(each, step) for each in bracket.photographs)
        bracket = replace(bracket, photographs=photographs)
    camera = fit.camera.window(0, 0, width * step, height * step).resized(width, height)
    fit = replace(fit, camera=camera, points=fit.points / step, offsets=fit.offsets / step)
    focal_length = calibrated.focal_length and calibrated.focal_length / step
    return SmallShot(
        replace(
            calibrated, plate=RadianceMap(small.radiance, None, small.clipped, plate.unit, plate.attributes),
            bracket=bracket, focal_length=focal_length, stood=stood and replace(stood, fit=fit),
        ),
        fit,
    )  # fmt: skip


def _smaller_photograph(photograph: Photograph, step: int) -> Photograph:
    import cv2

    width, height = (length // step for length in photograph.size)
    part = slice(0, height * step), slice(0, width * step)
    pixels = cv2.resize(photograph.pixels[part], (width, height), interpolation=cv2.INTER_AREA)
    outside = photograph.outside
    if outside is not None:
        outside = outside[part].reshape(height, step, width, step).any((1, 3))
    focal_length = photograph.focal_length and photograph.focal_length / step
    return replace(photograph, pixels=np.asarray(pixels), outside=outside, focal_length=focal_length)
