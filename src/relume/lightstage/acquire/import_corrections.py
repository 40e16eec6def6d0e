"""Corrections on import: calibration on a card, even light, the room's own light, invalid samples, noise."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from relume.errors import warn
from relume.lightstage.acquire.calibration import Calibration, Target, calibrate
from relume.lightstage.acquire.encoding import PhotographEncoding
from relume.lightstage.acquire.import_lights import pictures_in
from relume.lightstage.acquire.picture_folder import PictureFolder
from relume.lightstage.acquire.read_stage import open_pictures
from relume.lightstage.acquire.stage_file import TargetCard, stage_towards
from relume.lightstage.field import invalid_samples
from relume.lightstage.field.bar_shadow import bar_shadow
from relume.lightstage.field.corrected import Corrected, estimate_noise
from relume.lightstage.field.fall_off import FlatField, NearLights, flat_field_of_board, points_on_plane
from relume.lightstage.field.field import Derived, Noise, ReflectanceField
from relume.lightstage.novel_view.projection import Subject
from relume.scene.shapes.meshes import read_meshes

LEAST_PIXELS = 64 * 64
"""Of a picture whose noise is estimated from its detail."""
NO_NOISE = 3e-4
"""Of a value: a deviation that is less is no sensor's, but the rounding of half floats."""


@dataclass(frozen=True)
class Corrections:
    """What is corrected in the pictures of a stage.

    ambient : a picture with all lights off, which is subtracted from every other
    target : a white or grey card in the pictures, on which each light's colour and intensity are measured
    board : a folder with a picture of a white board in the subject's place under each light, in the lights' order. How
        unevenly each light shines over the picture is measured on it and divided out. Photographs of it are encoded as
        the subject's
    near_fall_off : the fall-off of near lamps over the subject, 1/d², is divided out; lamps have to have places in
        metres, and the stage a camera. The subject's mesh is taken, else a plane through its middle that faces the
        camera
    mask : white where samples are invalid: one picture, whose pixels stay black, or a folder with one a light, whose
        samples are filled from neighbouring lights
    flare : samples where a light shines into the lens, and its flare, are invalid
    lamp_diameter : apparent diameter of the lamps, radians, for `flare`; 2° unless given
    bars : the shadow of the stage's own bar is invalid
    noise : of the pictures; estimated from them unless given
    estimate_noise : else, where `noise` is not given, the noise stays unknown
    """

    ambient: Path | None = None
    target: TargetCard | None = None
    board: Path | None = None
    near_fall_off: bool = False
    mask: Path | None = None
    flare: bool = False
    lamp_diameter: float = float(np.radians(2))
    bars: bool = False
    noise: Noise | None = None
    estimate_noise: bool = True

    def __post_init__(self) -> None:
        if self.board is not None and self.near_fall_off:
            raise ValueError("a board shows the fall-off of near lamps too; give one of them")


@dataclass(frozen=True, eq=False)
class WithoutAmbient(Derived):
    """The field less a picture; noise may leave values below 0, which keep their mean right.

    The noise is the field's; the ambient picture's own, one for all, is not counted.

    field : as taken
    ambient : (H, W, 3) float32 radiance, as of the pictures before they were divided by their lights' irradiances
    irradiances : (N, 3), those
    """

    field: ReflectanceField
    ambient: np.ndarray
    irradiances: np.ndarray

    def block(self, lights: slice, rows: slice) -> np.ndarray:
        share = self.ambient[rows] / self.irradiances[lights, None, None].astype(np.float32)
        return self.field.block(lights, rows) - share


@dataclass(frozen=True, eq=False)
class WithoutPixels(Derived):
    """The field with pixels black under every light.

    field : as taken
    left_out : (H, W) bool
    """

    field: ReflectanceField
    left_out: np.ndarray

    def block(self, lights: slice, rows: slice) -> np.ndarray:
        return np.where(self.left_out[rows][None, ..., None], np.float32(0), self.field.block(lights, rows))


def correct(
    field: ReflectanceField,
    corrections: Corrections,
    mesh: Path | None = None,
    subject: Sequence[float] = (0.0, 0.0, 0.0),
) -> tuple[ReflectanceField, Calibration | None]:
    """The field calibrated, even and with invalid samples filled, and what was measured on the card.

    mesh, subject : of the stage: the mesh's file, and the subject's middle, metres
    Overexposed samples of photographs are always invalid. Warns where the noise stays unknown.
    Raises ValueError for corrections that this stage does not allow.
    """
    taken, step = field, 0.0
    masks: list[invalid_samples.Mask] = []
    # Photographs: overexposed samples, their rounding, and the room's own light.
    if isinstance(field, PictureFolder):
        masks.append(invalid_samples.Saturated(field))
        step = field.step()
        if corrections.ambient is not None:
            taken = WithoutAmbient(field, field.beside(corrections.ambient), field.irradiances)
    elif corrections.ambient is not None:
        raise ValueError("an ambient picture is for pictures, not for a store")
    # What each light gives, and how evenly.
    measured = None
    if corrections.target is not None:
        measured = calibrate(taken, _target(corrections.target, taken.shape))
    encoding = field.encoding if isinstance(field, PictureFolder) else PhotographEncoding()
    even = _fall_off(taken, corrections, mesh, np.array(subject, np.float64), encoding)
    # Invalid samples.
    if corrections.flare:
        if taken.camera is None:
            raise ValueError(
                "lens flare is found with the camera; give it in stage.json, or by the field of view and the camera's "
                "distance"
            )
        radius = corrections.lamp_diameter / 2
        masks.append(invalid_samples.lens_flare_and_direct_light(taken, taken.camera, angular_radius=radius))
    if corrections.bars:
        masks.append(bar_shadow(taken))
    if corrections.mask is not None:
        painted = invalid_samples.user_mask(corrections.mask, taken.lights, taken.shape)
        if corrections.mask.is_dir():
            masks.append(painted)
        else:
            taken = WithoutPixels(taken, painted.block(slice(0, 1), slice(0, taken.shape[0]))[0])
    # Noise of what is left.
    noise = corrections.noise
    if noise is None and taken.noise is None and corrections.estimate_noise:
        noise = _estimated_noise(taken, step)
    gains = None if measured is None else measured.gains
    return Corrected(taken, gains, even, masks, measured_noise=noise), measured


def _fall_off(
    field: ReflectanceField,
    corrections: Corrections,
    mesh: Path | None,
    subject: np.ndarray,
    encoding: PhotographEncoding,
) -> FlatField | NearLights | None:
    """The patterns by which the lights are made even."""
    if corrections.board is not None:
        return flat_field_of_board(_board(corrections.board, field, encoding))
    if not corrections.near_fall_off:
        return None
    camera, positions = field.camera, field.lights.positions
    if camera is None or positions is None:
        missing = "no camera" if camera is None else "no places of its lamps in metres"
        raise ValueError(f"the fall-off of near lamps: the stage has {missing}; give it in stage.json, or by balls")
    if mesh is not None:
        seen = Subject.of(read_meshes(mesh)).seen(camera)
        points = np.where(seen.met[..., None], seen.points, np.nan)
    else:
        points = points_on_plane(camera, subject, camera.position - subject)
    return NearLights(positions, points, subject)


def _board(folder: Path, field: ReflectanceField, encoding: PhotographEncoding) -> ReflectanceField:
    """The pictures of a white board under the field's lights, in their order."""
    paths = pictures_in(folder)
    if len(paths) != len(field.lights):
        raise ValueError(f"{folder}: {len(paths)} pictures of the board for {len(field.lights)} lights; give one each")
    stage = stage_towards([path.name for path in paths], field.lights.directions)
    board = replace(open_pictures(stage, folder), encoding=encoding)
    if board.shape != field.shape:
        raise ValueError(
            f"{folder}: pictures of {board.shape[1]}×{board.shape[0]}, the subject's are "
            f"{field.shape[1]}×{field.shape[0]}; take them with the same camera"
        )
    return board


def _estimated_noise(field: ReflectanceField, step: float) -> Noise | None:
    """The noise of the pictures as they show it; None, with a warning, where they do not."""
    height, width = field.shape
    why = f"pictures of {width}×{height} are too small to separate it from detail"
    if height * width >= LEAST_PIXELS:
        try:
            found = estimate_noise(field, step=step)
        except ValueError as error:
            why = str(error).partition(";")[0]
        else:
            light = len(field.lights) // 2
            level = float(field.block(slice(light, light + 1), slice(0, height)).mean())
            if found.constant + found.slope * level > (NO_NOISE * level) ** 2:
                return found
            why = "the pictures show none"
    warn(f"the noise stays unknown: {why}; give it, if it is known")
    return None


def _target(card: TargetCard, shape: tuple[int, int]) -> Target:
    """The card's pixels in pictures of a shape; raises ValueError where it is not in them."""
    left, top, width, height = card.rectangle
    if left + width > shape[1] or top + height > shape[0]:
        raise ValueError(
            f"the target at {left},{top} of {width}×{height} pixels is not within pictures of {shape[1]}×{shape[0]}; "
            "give LEFT,TOP,WIDTH,HEIGHT=REFLECTANCE"
        )
    pixels = np.zeros(shape, bool)
    pixels[top : top + height, left : left + width] = True
    return Target(pixels, card.reflectance)
