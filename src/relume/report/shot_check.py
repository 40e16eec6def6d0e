"""What the photographs of a shot show, in seconds: times, the board, the balls, the camera and where objects stand.

Nothing is merged or rendered. Each ball is sought in one photograph of its bracket, made small, and its rim is followed
in that photograph whole. The job itself looks at the merged bracket: it may find a rim some pixels beside this one, or
none, so what is found is said to be of one photograph.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from relume.capture.brackets.merging import BracketSource
from relume.capture.exposure.bracket import Bracket
from relume.capture.exposure.consistency import check
from relume.capture.exposure.exposures import seconds_in_words
from relume.errors import BallNotFound, Doubt, GatheredDoubts, ranked
from relume.image import files
from relume.image.photograph import Photograph
from relume.image.radiance import RadianceMap
from relume.probe.ball.edge_tracking import refined
from relume.probe.ball.silhouette import Outline, outline_through
from relume.probe.ball.unwrapping import unwrap_ball
from relume.probe.clipped_light import linear
from relume.project.forecast import Forecast, forecast
from relume.project.insertion.ball_camera import camera_of_ball
from relume.project.insertion.frame_shots import at_frame, frames_of
from relume.project.insertion.photographs import read_photographs
from relume.project.shot_file.camera_table import camera_fit
from relume.project.shot_file.light_table import picked_by_key
from relume.project.shot_file.objects import doubts_about, placed_meshes
from relume.project.shot_file.sequence_table import frames_as_text
from relume.project.shot_file.shot import Shot
from relume.scene.cameras.camera import Camera
from relume.scene.cameras.fit import CameraFit

SIDE = 1000
"""Longer side, pixels, of the pictures in which balls are sought."""


@dataclass(frozen=True, eq=False)
class ShotCheck:
    """What `check_shot` found in a shot.

    facts : by their names, for a person or a machine
    doubts : what the user should know, what matters most first
    """

    facts: dict[str, object]
    doubts: tuple[Doubt, ...]


def check_shot(shot: Shot, *, progress: Callable[[str, float], None] = lambda step, share: None) -> ShotCheck:
    """Read all that a shot names and say what is in it: what `insert` would use.

    Of a shot with a sequence all frames are checked to have their plates, cameras and maps of light. The first is
    looked at, and the estimate is of all, as if each were the first.
    shot : as `read_shot` or `Shot.new` made it
    progress : called with the name of each step and the share of it that is done, 0 to 1
    Raises RelumeError for what `insert` would refuse of it.
    """
    found: list[Doubt] = []
    facts: dict[str, object] = {}
    with GatheredDoubts() as gathered:
        # Of a sequence the frames, and its first as a plain shot.
        count = 1
        if shot.sequence is not None:
            numbers = frames_of(shot)
            shot, count = at_frame(shot, numbers[0]), len(numbers)
            facts["frames"] = f"{count}: {frames_as_text(numbers)}; what follows is of frame {numbers[0]}"
        # The photographs and their times.
        progress("photographs", 0.0)
        meshes = placed_meshes(shot)
        photographs = read_photographs(shot)
        plate = photographs.plate
        facts["plate"] = "radiance map" if isinstance(plate, RadianceMap) else _times(plate)
        for each in (plate, *photographs.balls):
            if isinstance(each, Bracket) and len(each.photographs) > 1:
                found += [doubt.ranked for doubt in check(each)]
        progress("photographs", 1.0)

        # The balls, each in one of its photographs.
        progress("balls", 0.0)
        like = None if isinstance(plate, RadianceMap) else next(iter(_by_exposure(plate)), None)
        seen = [_by_exposure(source, like) for source in photographs.balls]
        # A rim that is given is not sought: where it is, the ball may be one that is not found.
        given = [table.outline() for table in shot.light.balls or ()]
        found_in = [
            _any_ball(each, index) if known is None else _Seen(known, "the shot file")
            for index, (each, known) in enumerate(zip(seen, given, strict=True))
        ]
        outlines = [each and each.outline for each in found_in]
        facts["balls"] = [
            {
                "photographs": _times(source),
                "ball": "raws are looked at when they are merged" if o is None else o.facts(),
            }
            for source, o in zip(photographs.balls, found_in, strict=True)
        ]
        progress("balls", 1.0)

        # The camera, and the objects in its frame.
        progress("camera", 0.0)
        size, focal_length, picture = _plate(plate)
        fit = _camera(shot, size, focal_length, picture, seen, outlines)
        if fit is not None:
            facts["camera"] = {
                "at": [round(float(v), 3) for v in fit.camera.position],
                "from": fit.agreement,
                "focal length, pixels": round(fit.camera.focal_length, 1),
            }  # fmt: skip
            found += doubts_about(meshes, fit.camera, ())
        progress("camera", 1.0)

        # What it will take.
        progress("estimate", 0.0)
        expected = None if fit is None or not meshes else forecast(shot, fit.camera, meshes)
        progress("estimate", 1.0)
    if shot.camera.of_ball is not None and "local" not in shot.model_fields_set:
        across = shot.surfaces()[0].size
        assert across is not None
        facts["table"] = f"{across[0]:g} × {across[1]:g} m about the ball, a guess; [[local]] gives its size"
    facts["objects"] = {mesh.name: _extent(mesh.vertices, fit and fit.camera) for mesh in meshes}
    facts["pixels"], facts["samples"] = f"{size[0]} × {size[1]}", shot.render.samples
    if expected is not None:
        facts |= _in_words(expected, count)
    return ShotCheck(facts, ranked([*gathered.doubts, *found]))


def _in_words(expected: Forecast, count: int) -> dict[str, object]:
    """What an insertion into so many frames will take, as it is said; a sequence has no quick look."""
    minutes = max(1, round(count * expected.seconds / 60))
    of_all = f" for {count} frames" if count > 1 else ""
    estimate = (
        f"{minutes} min{of_all} on this machine as busy as it is, {expected.memory / 1e9:.2g} GB of memory, "
        f"{count * expected.disk / 1e9:.2g} GB of disk"
    )
    facts: dict[str, object] = {
        "rays a pixel": round(expected.rays, 1),
        "rays": f"{count * expected.total / 1e6:.3g} million{of_all}",
        "estimate": estimate,
    }
    return facts if count > 1 else facts | {"quick look": "--preview"}


def _times(source: BracketSource) -> dict[str, str]:
    """The exposure of each photograph, by its name."""
    if isinstance(source, Bracket):
        known = [(photograph.name, photograph.exposure) for photograph in source.photographs]
    else:
        known = [(facts.name, facts.exposure) for facts in (files.read_facts(Path(str(path))) for path in source)]
    return {Path(name).name: "unknown" if e is None else seconds_in_words(e.seconds) for name, e in known}


def _by_exposure(source: BracketSource, like: Photograph | None = None) -> list[Photograph]:
    """The photographs, those exposed most like another first, or those of a middle grey; none for raws."""
    if not isinstance(source, Bracket):
        return []
    if like is not None and like.exposure is not None:
        wanted = np.log(like.exposure.factor)
        away = [np.inf if p.exposure is None else abs(np.log(p.exposure.factor) - wanted) for p in source.photographs]
    else:
        middles = [float(np.median(p.pixels[::8, ::8])) / np.iinfo(p.pixels.dtype).max for p in source.photographs]
        away = [abs(middle - 0.5) for middle in middles]
    return [source.photographs[index] for index in np.argsort(away, kind="stable")]


@dataclass(frozen=True)
class _Seen:
    """A ball's outline, and where it was seen."""

    outline: Outline
    where: str

    def facts(self) -> dict[str, object]:
        (x, y), radius = self.outline.centre, self.outline.radius
        return {"x": round(x, 1), "y": round(y, 1), "radius": round(radius, 1), "from": self.where}


def _any_ball(photographs: Sequence[Photograph], index: int) -> _Seen | None:
    """The ball in the first photograph that shows one; None without photographs, else raises BallNotFound.

    index : of their table in light.balls
    """
    for photograph in photographs:
        with suppress(BallNotFound):
            return _Seen(_ball(photograph, SIDE), f"{Path(photograph.name).name} alone")
    if not photographs:
        return None
    # Refused by the whole picture: what is round in a small one is not where the shot file would name it.
    with picked_by_key(f"light.balls.{index}"):
        return _Seen(_ball(photographs[-1], max(photographs[-1].size)), f"{Path(photographs[-1].name).name} alone")


def _ball(photograph: Photograph, side: int) -> Outline:
    """The ball's outline, sought in the photograph made small and followed in the whole; raises BallNotFound.

    side : its longer side where it is made small, pixels
    """
    import cv2

    scale = min(1.0, side / max(photograph.size))
    focal_length, whole = photograph.focal_length, photograph
    if scale < 1:
        pixels = cv2.resize(photograph.pixels, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
        photograph = replace(photograph, pixels=pixels, outside=None)
    view = unwrap_ball(
        linear(photograph), camera=np.array([0.0, 0.0, 1.0]), centre=np.zeros(3), radius=0.05,
        focal_length=focal_length and focal_length * scale, name=photograph.name,
    )  # fmt: skip
    found = view.outline
    if scale == 1:
        return found
    return refined(
        linear(whole).radiance, outline_through(found.points / scale), focal_length or found.focal_length, ()
    )


def _plate(plate: BracketSource | RadianceMap) -> tuple[tuple[int, int], float | None, RadianceMap | None]:
    """Size, focal length in pixels and a picture of the plate, where one is had without merging."""
    if isinstance(plate, RadianceMap):
        return plate.size, None, plate
    if isinstance(plate, Bracket):
        photograph = _by_exposure(plate)[0]
        return photograph.size, photograph.focal_length, linear(photograph)
    return files.read_facts(Path(str(plate[0]))).size, None, None


def _camera(
    shot: Shot, size: tuple[int, int], focal_length: float | None, plate: RadianceMap | None,
    seen: Sequence[Sequence[Photograph]], outlines: Sequence[Outline | None],
) -> CameraFit | None:  # fmt: skip
    """The plate's camera, from whatever the shot has it from; None where raws would have to be merged for it."""
    asked = shot.camera.of_ball
    if plate is None and shot.camera.focal_length is None:
        return None
    if asked is None:
        return camera_fit(shot.camera, size, shot.folder, focal_length)
    if plate is None or (seen and not seen[0]):
        return None
    balls = [(each[0].name, linear(each[0])) for each in seen[:1]]
    return camera_of_ball(shot, asked, plate, focal_length, balls, outlines[0] if outlines else None).fit


def _extent(points: np.ndarray, camera: Camera | None) -> str:
    """How large an object is and where it stands, also in the plate: beside a table's edge it hangs in the air."""
    across, up, along = np.ptp(points, axis=0).tolist()
    low, high = points.min(0), points.max(0)
    # To the hundredth of a millimetre: what is placed to be 0 is.
    foot, x, z = (round(value, 5) + 0.0 for value in (low[1], (low[0] + high[0]) / 2, (low[2] + high[2]) / 2))
    words = f"{across:.3g} × {up:.3g} × {along:.3g} m, foot at {foot:.3g} m over ({x:.3g}, {z:.3g})"
    pixel = None if camera is None else camera.project(np.array([x, foot, z]))
    if pixel is None or not np.isfinite(pixel).all():
        return words
    return f"{words}, in the plate at {pixel[0]:.0f},{pixel[1]:.0f}"
