"""Making what was rendered look as the plate's camera would have drawn it: fall-off, sharpness and grain.

Before compositing, the rendered planes are dimmed and softened as the plate is. After developing, what the objects
cover is given the grain that the photograph has everywhere else.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from relume.capture.lens.vignetting import Vignetting
from relume.image.bands import in_bands
from relume.image.photograph import Photograph
from relume.image.texture import texture
from relume.renderers.results import Change
from relume.virtual_camera.film.grain import ROUNDING, Grain
from relume.virtual_camera.plate_matching.sharpness import PutAway, Sharpness, as_it_is

ROWS = 512
"""Of a picture whose shadows are made less sharp at once."""


@dataclass(frozen=True, eq=False)
class Match:
    """What was measured of a plate and is done to what is rendered; None leaves a property as rendered.

    vignetting : fall-off that is still in the plate's radiance. None for a plate that was divided by it, and for a
        render of which the lens is part
    sharpness : of the plate. None where the camera that rendered has a lens of its own that was out of focus everywhere
    radiance_grain : of the plate's radiance; None for a denoised plate
    photograph_grain : of the photograph that the developed picture sits in
    seed : of all noise that is drawn
    """

    vignetting: Vignetting | None = None
    sharpness: Sharpness | None = None
    radiance_grain: Grain | None = None
    photograph_grain: Grain | None = None
    seed: int = 0


def match_to_plate(
    change: Change,
    match: Match,
    plate: np.ndarray | None = None,
    textured: np.ndarray | None = None,
    put_away: PutAway = as_it_is,
) -> Change:
    """The change as the plate's lens would have drawn it, for compositing over that plate.

    plate : (H, W, 3) its radiance: the lens drew its texture already, so of what shadows take only the share is made
        less sharp. The texture in them too unless given
    textured : (H, W) bool, where real surfaces were rendered with the plate as their texture; all unless given.
        Elsewhere what is taken has none of the plate in it and is made less sharp as it is
    put_away : what is done with each plane that is made, for large ones to go to a file
    Light falls off in front of the sensor and is spread on it, so the fall-off comes first. It dims all that was
    rendered in scene radiance. The reflectance of the real surfaces must then have been recovered from the plate
    divided by the fall-off, and for `Ratio` `without` be dimmed too (`dimmed`): a render from a reflectance that still
    has the fall-off in it would be dimmed twice.
    """
    if match.vignetting is not None:
        falloff = match.vignetting.falloff((change.matte.shape[1], change.matte.shape[0]))[..., None]
        dimmed: dict[str, np.ndarray] = {}
        for name, factor in (
            ("objects", falloff), ("difference", falloff),
            ("objects_variance", falloff**2), ("difference_variance", falloff**2),
        ):  # fmt: skip
            dimmed[name] = put_away(_times(getattr(change, name), factor))
        change = replace(change, **dimmed)
    if match.sharpness is None:
        return change
    if plate is None or match.sharpness.sigma == 0:
        return match.sharpness.apply(change, put_away)
    difference = put_away(_softened(change.difference, texture(plate, textured), match.sharpness))
    # The difference is done: nothing of it is softened once more.
    rest = match.sharpness.apply(replace(change, difference=difference[:0]), put_away)
    return replace(rest, difference=difference)


def _times(plane: np.ndarray, factor: np.ndarray) -> np.ndarray:
    """A plane (H, W, 3) times a factor (H, W, 1), float32; in bands, whose product in double stays small."""
    result = np.empty(plane.shape, np.float32)

    def work(rows: slice) -> None:
        result[rows] = plane[rows] * factor[rows]

    in_bands(plane.shape[0], plane.shape[1], work)
    return result


def _softened(difference: np.ndarray, even: np.ndarray, sharpness: Sharpness) -> np.ndarray:
    """A difference (H, W, 3) whose light is made less sharp, and whose shadows are as shares of the texture `even`.

    By rows, with those that reach into them, so that a large picture takes no more memory than the result.
    """
    result = np.empty_like(difference)
    for top in range(0, len(difference), ROWS):
        bottom = min(top + ROWS, len(difference))
        begin = max(top - sharpness.reach, 0)
        around, own = slice(begin, bottom + sharpness.reach), slice(top - begin, bottom - begin)
        part = difference[around]
        shaded = sharpness.blurred(np.minimum(part, 0) / even[around])[own] * even[top:bottom]
        result[top:bottom] = sharpness.blurred(np.maximum(part, 0))[own] + shaded
    return result


def apply_vignetting(radiance: np.ndarray, match: Match) -> np.ndarray:
    """A render (H, W, 3) with the fall-off that `matched` gives a change; itself where there is none."""
    if match.vignetting is None:
        return radiance
    height, width = radiance.shape[:2]
    return _times(radiance, match.vignetting.falloff((width, height))[..., None])


def grain_share(matte: np.ndarray) -> np.ndarray:
    """(H, W) float64, factor on the grain that the plate's own, left by 1 − matte of it, lacks of the whole.

    Variances add: (1 − m)² are there, so 1 − (1 − m)² are missing. Grain times the matte would leave the edges too
    smooth.
    """
    kept = 1 - np.clip(matte.astype(np.float64), 0, 1)
    return np.sqrt(1 - kept**2)


def add_grain(composite: np.ndarray, matte: np.ndarray, match: Match) -> np.ndarray:
    """The composite (H, W, 3) float32 with the grain of the plate's radiance on what the objects cover.

    Pixels that no object covers keep every bit. Nothing falls below 0.
    """
    if match.radiance_grain is None:
        return composite
    grain, grainy = match.radiance_grain, np.empty(composite.shape, np.float32)
    noise = grain.draw((composite.shape[1], composite.shape[0]), match.seed)

    def work(rows: slice) -> None:
        noisy = grain.apply(composite[rows], grain_share(matte[rows]), noise=noise[rows])
        grainy[rows] = np.where((matte[rows] > 0)[..., None], np.maximum(noisy, 0), composite[rows])

    in_bands(matte.shape[0], matte.shape[1], work)
    return grainy


def composite_into_photograph(
    photograph: Photograph, picture: np.ndarray, before: np.ndarray, matte: np.ndarray, match: Match,
    noise: np.ndarray | None = None,
) -> Photograph:  # fmt: skip
    """The photograph with the objects in it: its own grain where they are not, grain like it where they are.

    photograph : of the plate's bracket
    picture, before : (H, W, 3) values, 0 to 255 and not rounded, of the composite and of the plate, both without grain
        and developed as that photograph (`Film.pixel_values`)
    matte : (H, W), the share of each pixel that objects cover
    noise : (H, W, 3), for some rows of a larger picture the part of its noise (`Grain.draw`)

    Where nothing changed, the photograph's bytes stay. Elsewhere what it has beside the plate, its grain, is kept by
    the share that shows and scaled by how the noise of the new value differs from that of the old: in a shadow and in
    a light that fell on it the grain is another. Where the photograph was white or black it has none to keep, and
    where the picture is, none is drawn.
    """
    if not photograph.pixels.shape == picture.shape == before.shape or matte.shape != picture.shape[:2]:
        raise ValueError(
            f"photograph {photograph.pixels.shape}, picture {picture.shape}, before {before.shape} and matte "
            f"{matte.shape} differ in size; develop them at the photograph's size"
        )
    white = float(np.iinfo(photograph.pixels.dtype).max)
    picture, before = picture * (white / 255), before * (white / 255)
    own = photograph.pixels - before
    shows = 1 - np.clip(matte.astype(np.float64), 0, 1)[..., None]
    cut_off = (photograph.pixels == 0) | (photograph.pixels == white)
    changed = (matte > 0)[..., None] | (picture != before)
    kept = np.where(cut_off & changed, 0.0, shows)
    values = picture + kept * own
    if match.photograph_grain is not None:
        grain = match.photograph_grain
        # Rounding is part of both noises, and keeps the quotient of small ones sound.
        old, new = (np.sqrt(grain.deviation_at(v) ** 2 + ROUNDING) for v in (before, picture))
        # What saturates does so without noise, being far above the largest value or clipped.
        share = np.where((picture >= white) | (picture <= 0), 0.0, np.sqrt(1 - kept**2))
        values = grain.apply(picture, share, seed=match.seed, noise=noise) + kept * own * (new / old)
    pixels = np.rint(np.clip(values, 0, white)).astype(photograph.pixels.dtype)
    return replace(photograph, pixels=np.where(changed, pixels, photograph.pixels), name="developed picture")
