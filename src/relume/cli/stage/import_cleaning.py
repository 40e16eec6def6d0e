"""What `relume stage import` does to pictures: calibrates them, leaves out what says nothing, finds their noise."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from relume.lightstage.acquire.calibration import Target
    from relume.lightstage.acquire.stage_file import TargetCard
    from relume.lightstage.field.field import Noise, ReflectanceField

_LEAST_PIXELS = 64 * 64
"""Of a picture whose noise is told from its detail."""
_NO_NOISE = 3e-4
"""Of a value: a deviation that is less is no sensor's, but the rounding of half floats."""


def mended(
    field: ReflectanceField,
    ambient: Path | None,
    card: TargetCard | None,
    mask: Path | None,
    flare: bool,
    lamp_size: float,
    bars: bool,
    noise: Noise | None,
    no_noise: bool,
) -> tuple[ReflectanceField, dict[str, object]]:
    """The field calibrated and filled, with its noise, and what was done to it."""
    import numpy as np

    from relume.lightstage.acquire.calibration import calibrate
    from relume.lightstage.acquire.picture_folder import PictureFolder
    from relume.lightstage.field import masking
    from relume.lightstage.field.ambient import WithoutAmbient, WithoutPixels
    from relume.lightstage.field.bar_shadow import bar_shadow
    from relume.lightstage.field.corrected import Corrected

    facts: dict[str, object] = {}
    rows = slice(0, field.shape[0])
    masks: list[masking.Mask] = []
    step = 0.0
    if isinstance(field, PictureFolder):
        masks.append(masking.Saturated(field))
        step = field.step()
    taken: ReflectanceField = field
    if ambient is not None:
        if not isinstance(field, PictureFolder):
            raise ValueError("--ambient is for pictures, not for a store")
        taken = WithoutAmbient.of(field, ambient)
    gains = None
    if card is not None:
        measured = calibrate(taken, _target(card, taken.shape))
        gains = measured.gains
        facts["target"] = f"{','.join(map(str, card.rectangle))}={card.reflectance:g}"
        facts["irradiance, median"] = [float(f"{v:.4g}") for v in np.median(measured.irradiances, axis=0)]
        facts["lights not on the target"] = int((~measured.measured).sum())
    if flare:
        if taken.camera is None:
            raise ValueError(
                "--flare needs the camera; tell it in stage.json, or with --field-of-view and --camera-distance"
            )
        masks.append(
            masking.lens_flare_and_direct_light(taken, taken.camera, angular_radius=float(np.radians(lamp_size) / 2))
        )
    if bars:
        masks.append(bar_shadow(taken))
    if mask is not None and mask.is_dir():
        masks.append(masking.user_mask(mask, taken.lights, taken.shape))
    elif mask is not None:
        taken = WithoutPixels(taken, masking.user_mask(mask, taken.lights, taken.shape).block(slice(0, 1), rows)[0])
    if noise is None and taken.noise is None and not no_noise:
        noise = _noise_seen(taken, step)
    found = Corrected(taken, gains, mask=masking.AnyOf(tuple(masks)) if masks else None, measured_noise=noise)
    if found.noise is not None:
        facts["noise"] = [float(f"{v:.3g}") for v in (found.noise.constant, found.noise.slope)]
    return found, facts


def _noise_seen(field: ReflectanceField, step: float) -> Noise | None:
    """The noise of the pictures as they show it; None, which is told, where they do not."""
    from relume.lightstage.field.corrected import estimate_noise

    height, width = field.shape
    why = f"pictures of {width}×{height} are too small to tell it from detail"
    if height * width >= _LEAST_PIXELS:
        try:
            found = estimate_noise(field, step=step)
        except ValueError as error:
            why = str(error).partition(";")[0]
        else:
            level = _level(field)
            if found.constant + found.slope * level > (_NO_NOISE * level) ** 2:
                return found
            why = "the pictures show none"
    warnings.warn(f"the noise stays unknown: {why}; --noise tells it", stacklevel=2)
    return None


def _level(field: ReflectanceField) -> float:
    """The mean value of the picture in the middle of the lights."""
    light = len(field.lights) // 2
    return float(field.block(slice(light, light + 1), slice(0, field.shape[0])).mean())


def _target(card: TargetCard, shape: tuple[int, int]) -> Target:
    """The card's pixels in pictures of a shape; raises ValueError where it is not in them."""
    import numpy as np

    from relume.lightstage.acquire.calibration import Target

    left, top, width, height = card.rectangle
    if left + width > shape[1] or top + height > shape[0]:
        raise ValueError(
            f"the target at {left},{top} of {width}×{height} pixels is not within pictures of {shape[1]}×{shape[0]}; "
            "give LEFT,TOP,WIDTH,HEIGHT=REFLECTANCE"
        )
    pixels = np.zeros(shape, bool)
    pixels[top : top + height, left : left + width] = True
    return Target(pixels, card.reflectance)
