"""Measuring grain: of a photograph, of one photograph of a bracket, and of a radiance map."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from relume.capture.denoising import denoise
from relume.capture.exposure.bracket import Bracket
from relume.capture.merging import merge
from relume.errors import NotABracket
from relume.image.photograph import Photograph
from relume.image.radiance import RadianceMap
from relume.image.response import Response
from relume.virtual_camera.film.film import Film
from relume.virtual_camera.film.grain import REACH, ROUNDING, Grain
from relume.virtual_camera.plate_matching.flat_patches import FlatPatches, flat_patches

ENOUGH = 800_000
"""Pixels of the middle of a photograph from which its grain is measured: 3000 patches."""


def photograph_grain(
    photograph: Photograph, *, clean: np.ndarray | None = None, response: Response | None = None
) -> Grain | None:
    """The grain of a photograph, in its pixel values; None where it cannot be measured.

    clean : (H, W, 3) the values, not rounded, that the photograph would have without noise: its bracket merged,
        denoised and developed again. Without it the photograph's own flat patches are looked at, and fine texture
        that is everywhere (wood, cloth) is taken for grain
    response : of its camera. Its deviation is the noise of values that no flat patch shows; None takes the nearest
        that is shown

    The photograph is believed before the response, which knows nothing of what JPEG took from flat places.
    None when the photograph has too few flat patches and there is no response.
    """
    white = float(np.iinfo(photograph.pixels.dtype).max)
    found = _flat(photograph, clean)
    if found is None:
        return None if response is None else _by_response(response, white)
    return _measured(found, ROUNDING) if response is None else _corrected(found, response, white)


def _flat(photograph: Photograph, clean: np.ndarray | None) -> FlatPatches | None:
    white = float(np.iinfo(photograph.pixels.dtype).max)
    return flat_patches(
        photograph.pixels.astype(np.float32), clean, darkest=0.01 * white, brightest=0.99 * white, least=2 * ROUNDING
    )


def _corrected(found: FlatPatches, response: Response, white: float) -> Grain:
    """The grain of flat patches, and of values that none of them shows as the response has it."""
    grain = _measured(found, ROUNDING)
    given = _by_response(response, white)
    deviation = given.deviation.copy()
    for c, values in enumerate(given.values):
        # Flat patches correct the response where they are; beyond them it keeps its shape.
        factor = grain.deviation[c] / np.maximum(np.interp(grain.values[c], values, deviation[c]), 1e-6)
        deviation[c] *= np.interp(values, grain.values[c], factor)
    return Grain(given.values, deviation, grain.correlation)


def bracket_grain(bracket: Bracket, index: int, response: Response) -> Grain | None:
    """The grain of one photograph of a bracket, in its pixel values; None where it cannot be measured.

    index : of the photograph in the bracket
    response : of the camera

    What it would be without noise is taken from the others, merged and denoised: a merge with its own noise in it would
    hide some. Of a bracket of one, or where the others do not overlap with it in brightness, the photograph's flat
    patches are looked at instead.
    """
    photograph = bracket.photographs[index]
    if len(bracket.photographs) == 1:
        return photograph_grain(photograph, response=response)
    rows, columns = (slice((n - m) // 2, (n + m) // 2) for n, m in _middle(photograph.pixels.shape[:2]))
    cut = [_cut(p, rows, columns) for p in bracket.photographs]
    others = Bracket(tuple(p for i, p in enumerate(cut) if i != index))
    try:
        merged = denoise(merge(others, response))
    except NotABracket:
        return photograph_grain(photograph, response=response)
    white = float(np.iinfo(photograph.pixels.dtype).max)
    film = Film(float(bracket.exposures[index]), response)
    clean = film.pixel_values(merged.radiance) * (white / 255)
    if merged.clipped is not None:
        clean[merged.clipped != 0] = np.nan
    found = _flat(cut[index], clean)
    if found is None:
        return photograph_grain(photograph, response=response)
    return _corrected(found, response, white)


def _middle(shape: tuple[int, ...]) -> list[tuple[int, int]]:
    """Each side, and how much of its middle is looked at, so that denoising takes seconds for any photograph."""
    scale = min(1.0, np.sqrt(ENOUGH / (shape[0] * shape[1])))
    return [(n, int(n * scale)) for n in shape]


def _cut(photograph: Photograph, rows: slice, columns: slice) -> Photograph:
    outside = None if photograph.outside is None else photograph.outside[rows, columns]
    return replace(photograph, pixels=np.ascontiguousarray(photograph.pixels[rows, columns]), outside=outside)


def radiance_grain(plate: RadianceMap) -> Grain | None:
    """The grain of a radiance map that was not denoised, in its unit; None where it cannot be measured.

    Where the map has a variance plane, its noise is what `denoise` takes from it; else what its flat patches show.
    Beyond the brightest and darkest patches the deviation goes on as that of photon noise, with the root of the light.
    """
    # In float32, as it is: of a large plate only the patches are made double.
    radiance = plate.radiance
    clean = None if plate.variance is None else denoise(plate).radiance
    if plate.clipped is not None:
        radiance = np.where((plate.clipped != 0)[..., None], np.nan, radiance)
    found = flat_patches(radiance, clean)
    if found is None:
        return None
    grain = _measured(found, 0.0)
    steps = 2.0 ** np.arange(1, 16)
    low, high = grain.values[:, :1], grain.values[:, -1:]
    values = np.concatenate([low / steps[::-1], grain.values, high * steps], axis=1)
    ends = grain.deviation[:, :1] / np.sqrt(steps[::-1]), grain.deviation[:, -1:] * np.sqrt(steps)
    return Grain(values, np.concatenate([ends[0], grain.deviation, ends[1]], axis=1), grain.correlation)


def _by_response(response: Response, white: float) -> Grain:
    """Uncorrelated noise of the size that the response knows."""
    values = np.broadcast_to(np.arange(response.levels) * (white / (response.levels - 1)), (3, response.levels))
    correlation = np.zeros((3, 3, 2 * REACH + 1, 2 * REACH + 1))
    correlation[np.arange(3), np.arange(3), REACH, REACH] = 1
    variance = np.maximum(response.deviation**2 - ROUNDING, 0)
    # The ends saturate and their scatter says nothing: take it from where light is measured.
    inner = np.clip(np.arange(response.levels), response.levels // 64, response.levels - 1 - response.levels // 64)
    return Grain(values, np.sqrt(variance[:, inner]), correlation)


def _measured(found: FlatPatches, rounding: float) -> Grain:
    variance = np.maximum(found.variance - rounding, 0)
    # Rounding adds to no neighbour's covariance, only to the middle of each channel's own.
    covariance = found.covariance.copy()
    for c in range(3):
        covariance[c, c, REACH, REACH] = max(covariance[c, c, REACH, REACH] - found.rounding_share[c] * rounding, 1e-9)
    size = np.sqrt(np.array([covariance[c, c, REACH, REACH] for c in range(3)]))
    return Grain(found.values, np.sqrt(variance), covariance / (size[:, None] * size)[..., None, None])
