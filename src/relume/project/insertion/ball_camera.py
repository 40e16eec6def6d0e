"""The plate's camera found from the ball, and the ball's view turned as that camera was.

Which of the ball's photographs the plate's camera took from the plate's place is known from their size: a tripod that
was moved is noticed by what surrounds the ball, which the plate shows too.

What a ball stands on is seen below it: a cup or a glass is narrower than the ball and reaches straight down from it. A
shadow is as wide as the ball where it begins, and a ball that lies on the table has nothing below it but that.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from relume.errors import InvalidShot, warn
from relume.image import files
from relume.image.colour import luminance
from relume.image.radiance import RadianceMap
from relume.probe.ball.silhouette import Outline, outline_of_circle
from relume.probe.ball.unwrapping import CAMERA_FROM_PIXELS, BallView, unwrap_ball
from relume.probe.clipped_light import linear
from relume.project.shot_file.ball_table import GUESSED_PLACE, GUESSED_SIZE, BallOnTable
from relume.project.shot_file.camera_table import CameraTable
from relume.project.shot_file.light_table import picked_by_key
from relume.project.shot_file.shot import Shot
from relume.scene.cameras.camera import Camera
from relume.scene.cameras.distortion import Distortion
from relume.scene.cameras.fit import CameraFit

BLOCKS = 48
"""Blocks across in which plate and ball photograph are compared: coarser than a tripod's shake."""
SAME_VIEW = 0.5
"""Correlation of ln luminance beside the ball below which the camera was moved: the room's own is 0.99."""
CROP_GUESSED = 0.2
"""What that guess does to the light: it is turned by the camera's unknown way to the ball."""
STAND_FOUND = 0.1
"""What a foot that was found a tenth of a radius off does: the object stands as much too near."""
GUESSED_FOCAL_LENGTH, FOCAL_LENGTH_GUESSED = 0.8, 0.05
"""Of the longer side, 29 mm on a full frame, between phones and cameras; and what a wrong one does to the light: the
ball is seen from a wrong distance, which shifts what its rim shows, and hardly what its middle does."""

STAND_CHANGED = 0.45
"""Difference of ln luminance from which on a pixel shows another thing; soft shadows stay below."""
STAND_NOISE = 6.0
"""Times the usual difference between the two pictures beside the ball, at least."""
STEM, BESIDE = 0.6, (0.85, 1.6)
"""Ball radii to both sides of its middle within which a stand is seen, and between which nothing may have changed."""
STAND_SHARE = 0.15
"""Of the pixels beside it that may have changed all the same: what a shadow falls on."""
STAND_GAP = 0.8
"""Radii along which a stand may look like what is behind it, as a glass's stem does."""
STAND_ACROSS = 0.04
"""Radii across which something must have changed in a row: less is a grain, or an edge that moved a little."""
STAND_LEAST = 0.6
"""Radii below the rim to which a stand reaches at least; a contact shadow ends before."""


@dataclass(frozen=True, eq=False)
class BallCamera:
    """The plate's camera by the ball.

    fit : the camera; its frame has its origin on the table, below the ball
    centre : of the ball, metres
    outline : of the ball in the first bracket of light.balls, where the plate's camera took that from the plate's
        place; None where it was another photograph, or a rim that was given
    """

    fit: CameraFit
    centre: tuple[float, float, float]
    outline: Outline | None

    def turned(self, view: BallView) -> BallView:
        """The view of the ball from the plate's own place, turned exactly as the plate's camera was."""
        return replace(view, world_from_pixels=self.fit.camera.rotation @ CAMERA_FROM_PIXELS)


def camera_of_ball(
    shot: Shot, asked: BallOnTable, plate: RadianceMap, focal_length: float | None,
    balls: Sequence[tuple[str, RadianceMap]], outline: Outline | None = None,
) -> BallCamera:  # fmt: skip
    """The plate's camera by the ball's outline; warns of what is guessed.

    plate : merged
    focal_length : of the plate's EXIF, pixels; None where it has none
    balls : name and radiance of light.balls; may be empty where another photograph or a rim is given
    outline : of the ball in the first of them, where it was found already
    Raises InvalidShot, BallNotFound, UnreadableFile.
    """
    lens = _lens(shot.camera, plate.size, focal_length)
    radius = asked.radius if asked.radius is not None else shot.light.ball and shot.light.ball.radius
    assert radius is not None  # Shot._frame_fault
    found, picture, name = None, None, ""
    if asked.rim is not None:
        rim = outline_of_circle(*asked.rim).points
    elif asked.photograph is not None:
        photograph = files.read_photograph(shot.path(asked.photograph))
        if photograph.size != plate.size:
            raise InvalidShot(
                f"camera.ball.photograph: {photograph.name} is {photograph.size[0]}×{photograph.size[1]}, the plate "
                f"{plate.size[0]}×{plate.size[1]}; photograph the ball with the plate's camera from its place"
            )
        name, picture = photograph.name, linear(photograph)
        with picked_by_key("camera.ball", "rim"):
            rim = _seen(picture, lens, name).outline.points
    elif balls[0][1].size == plate.size:
        name, picture = balls[0]
        with picked_by_key("light.balls.0"):
            found = outline or _seen(picture, lens, name).outline
        rim = found.points
    else:
        rim, picture = _guessed_rim(plate, *balls[0]), None
    # A picture from the plate's place also shows whether the ball stands on something.
    if picture is not None:
        _require_same_view(plate, picture, rim, name)
        asked = _on_its_stand(asked, foot_of_stand(plate, picture, rim))
    fit, raised = asked.camera(rim, lens, radius, plate)
    return BallCamera(fit, (0.0, radius + raised, 0.0), found)


def _lens(table: CameraTable, size: tuple[int, int], exif: float | None) -> Camera:
    """The plate's lens, its pose not known; a focal length that nothing gives is guessed, with a warning."""
    focal_length = table.focal_length or exif
    if focal_length is None:
        focal_length = GUESSED_FOCAL_LENGTH * max(size)
        warn(
            f"camera.focal_length: missing, and the plate's EXIF has none; {focal_length:.0f} pixels are taken, and "
            "the perspective of the objects is that of such a lens; give it in pixels: millimetres ∕ sensor width × "
            "picture width",
            effect=FOCAL_LENGTH_GUESSED,
        )
    distortion = None if table.distortion is None else Distortion(**table.distortion.model_dump())
    try:
        return Camera(*size, focal_length, np.zeros(3), np.eye(3), table.centre, distortion)
    except ValueError as error:
        raise InvalidShot(f"camera.distortion: {error}") from None


def _seen(picture: RadianceMap, lens: Camera, name: str) -> BallView:
    """The ball in a picture of the plate's camera; where it stands does not matter here."""
    return unwrap_ball(
        picture, camera=np.array([0.0, 0.0, 1.0]), centre=np.zeros(3), focal_length=lens.focal_length, name=name
    )


def _require_same_view(plate: RadianceMap, picture: RadianceMap, rim: np.ndarray, name: str) -> None:
    """Raises InvalidShot where what surrounds the ball is not what the plate shows there: the camera was moved."""
    step = max(1, plate.size[0] // BLOCKS)
    first, second = (_blocks(np.log(np.maximum(luminance(each.radiance), 1e-9)), step) for each in (plate, picture))
    rows, columns = np.indices(first.shape)
    centre, reach = rim.mean(0) / step, 1.6 * np.ptp(rim, axis=0).max() / 2 / step
    inside = np.hypot(columns + 0.5 - centre[0], rows + 0.5 - centre[1]) < reach
    a, b = first[~inside], second[~inside]
    if a.size < 50 or min(a.std(), b.std()) < 1e-3:
        return
    likeness = float(np.corrcoef(a, b)[0, 1])
    if likeness < SAME_VIEW:
        raise InvalidShot(
            f"camera: {name} does not show the plate's view beside the ball (likeness {likeness:.2f}), so the ball "
            "does not say where the plate's camera stood; photograph it from the plate's place, or give [camera] "
            "grid, pose, lines or file"
        )


def _blocks(values: np.ndarray, step: int) -> np.ndarray:
    height, width = (side // step for side in values.shape)
    return values[: height * step, : width * step].reshape(height, step, width, step).mean((1, 3))


def _on_its_stand(asked: BallOnTable, foot: tuple[float, float] | None) -> BallOnTable:
    """What is asked, with the foot of the ball's stand where one is seen and nothing else is given; warns."""
    if foot is None or asked.foot is not None or asked.raised is not None or asked.camera_height is not None:
        return asked
    warn(
        f"camera.ball: the ball seems to stand on something that meets the table at {foot[0]:.0f},{foot[1]:.0f}, and "
        "objects are stood there; give foot = [x, y] (--foot X,Y) where that is not so, or raised = 0 for a ball on "
        "the table",
        effect=STAND_FOUND,
    )
    return asked.model_copy(update={"foot": foot})


def _guessed_rim(plate: RadianceMap, name: str, ball: RadianceMap) -> np.ndarray:
    """Where a ball of which only crops exist may have stood in the plate; warns."""
    width, height = plate.size
    x, y, size = GUESSED_PLACE[0] * width, GUESSED_PLACE[1] * height, GUESSED_SIZE * width
    warn(
        f"camera: {name} is not of the plate's size ({ball.size[0]}×{ball.size[1]} against "
        f"{width}×{height}), so where the ball stood in the plate is not known; x,y,radius {x:.0f},{y:.0f},{size:.0f} "
        "are taken: give [camera] ball = { rim = [x, y, radius] } (--rim X,Y,RADIUS), as the plate would show a ball "
        "where the objects shall stand",
        effect=CROP_GUESSED,
    )
    return outline_of_circle(x, y, size).points


def foot_of_stand(plate: RadianceMap, picture: RadianceMap, rim: np.ndarray) -> tuple[float, float] | None:
    """Where the stand of a ball meets the table, x and y in pixels; None for a ball without one.

    plate, picture : from one place, without and with the ball
    rim : (N, 2) pixels of the ball's rim
    """
    from scipy.ndimage import gaussian_filter

    middle, radius = rim.mean(0), float(np.ptp(rim, axis=0).max()) / 2
    first, second = (np.log(np.maximum(luminance(each.radiance), 1e-9)) for each in (plate, picture))
    change = gaussian_filter(second - first, max(0.7, radius / 40))
    usual = float(np.median(change))
    limit = max(STAND_CHANGED, STAND_NOISE * float(np.median(np.abs(change - usual))))
    changed = np.abs(change - usual) > limit
    # Down from the rim, row by row, for as long as something narrow is there.
    aside = np.abs(np.arange(changed.shape[1]) + 0.5 - middle[0]) / radius
    within, beside = aside < STEM, (aside > BESIDE[0]) & (aside < BESIDE[1])
    start, last = int(middle[1] + 1.05 * radius), None
    for row in range(max(start, 0), changed.shape[0]):
        if (last is None and row > start + STAND_GAP * radius) or (
            last is not None and row > last + STAND_GAP * radius
        ):
            break
        if changed[row, within].sum() >= STAND_ACROSS * radius and changed[row, beside].mean() < STAND_SHARE:
            last = row
    if last is None or last < middle[1] + (1 + STAND_LEAST) * radius:
        return None
    # A picture that ends before the stand does says nothing.
    if last >= changed.shape[0] - 2:
        return None
    return float(middle[0]), float(last + 1)
