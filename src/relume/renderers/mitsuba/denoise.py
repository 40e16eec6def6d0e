"""Denoising by Open Image Denoise: of a change, so that what the objects leave alone stays so, and of irradiance."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np
from scipy.ndimage import distance_transform_edt, gaussian_filter

from relume.image.primaries import REC709
from relume.image.texture import textures
from relume.renderers.results import Change, Render

WHITE_XYZ = (REC709.to_xyz() / REC709.to_xyz().sum(axis=1, keepdims=True)).astype(np.float32)
"""(3, 3) from linear Rec. 709 to X, Y, Z in which white is (1, 1, 1) too."""
Cleaner = Callable[[np.ndarray, np.ndarray, np.ndarray], np.ndarray]
ROUNDING = 1e-5
"""Of sums of float32, as a share of their parts."""
FAINT = 0.1
"""Of a pixel: less than that shows more noise than colour."""
BORDER, GRID = 96, 16
"""Pixels about what shows that a filter is given too, and those at whose multiples its networks halve pictures: half of
the 174 that a pixel depends on, in whole steps of the grid. With them what shows has the bits that it has in the whole
picture, without the grid an error of some per cent."""
_BLOCK, _DARK = 16, 1e-8
"""Pixels along the blocks whose means are taken, and of a block that is not counted."""
NEIGHBOURS, EDGE = 16.0, 2.0
"""σ in pixels of the places whose light is kept as a whole, and in σ where they end: as far as a tile of a large
picture is denoised beyond its edges. Some 3000 pixels are as one with as many times the rays; 4 to 32 do as well."""
PEAK, NARROW, MOST = 4.0, 4.0, 4.0
"""A highlight is so many times as bright, cleaned, as what is about it; σ in pixels of the place whose light it keeps;
how many times as bright as it was cleaned it may become."""


def denoised(
    change: Change, plate: np.ndarray | None = None, textured: np.ndarray | None = None, quick: bool = False
) -> Change:  # fmt: skip
    """The same change with less noise, by Open Image Denoise: the objects, and what they add and take beside them.

    plate : (H, W, 3) radiance that the change is composited with: of what is taken its share of the plate is cleaned,
        and what is left of it, for what the filter rounded of the plate's texture would stand in a shadow several
        times as strong as beside it. None for a plate without texture
    textured : (H, W) bool, where real surfaces were rendered with the plate as their texture; all unless given.
        Elsewhere, as for an even colour, what is taken has none of the plate in it and is cleaned as it is
    quick : by OIDN's smaller network, in half the time
    The light that is added and the light that is taken are cleaned each on its own, as they were traced: neither is
    ever negative, so the filter needs not be given one half of a noisy difference, whose mean would be too bright.
    Only of renderers that know no more than the difference its two signs are cleaned. Each keeps the light that was
    traced about every place: a filter that is trained to err little takes rare bright paths for errors. Albedo and
    normals guide all, for objects those of what smooth mirrors and clear glass show. All are cleaned as they would be
    if the matte had no edges, and matted again: the matte has next to no noise, and its edges stay as they are. What is
    exactly 0 stays so.
    """
    guides = np.clip(change.albedo, 0, 1), change.normal
    through = guides
    if change.guide_albedo is not None and change.guide_normal is not None:
        through = np.clip(change.guide_albedo, 0, 1), change.guide_normal
    cover = change.matte[..., None]
    objects = _clean(_unmatted(change.objects, change.matte), *through, quick, change.matte > 0)
    difference, beside = change.difference, 1 - change.matte
    changes = np.any(difference != 0, axis=-1, keepdims=True)
    shows = beside[..., None] * changes
    clean_up: Cleaner = partial(_clean, quick=quick, shown=shows[..., 0] > 0)
    taken = np.maximum(-difference, 0) if change.taken is None else change.taken
    added = difference + taken
    # What was added up in another order may be below 0 by its rounding; pure wavelengths are by more.
    layers = (np.where(added > -ROUNDING * (np.abs(difference) + taken), np.maximum(added, 0), added), taken)
    added = _as_bright(clean_up(_unmatted(layers[0], beside), *guides), layers[0], shows)
    if plate is None:
        clean = clean_up(_unmatted(taken, beside), *guides)
    else:
        as_seen, as_rendered = textures(plate, textured, (False, True))
        share = _unmatted(taken / as_rendered, beside)
        albedo = np.where(True if textured is None else textured[..., None], 1, guides[0])
        clean = as_seen * _share(share, albedo, change.normal, textured, clean_up)
    taken = _as_bright(clean, taken, shows)
    return replace(
        change,
        objects=(cover * objects).astype(np.float32),
        difference=(shows * (added - taken)).astype(np.float32),
        taken=None,
        guide_albedo=None,
        guide_normal=None,
    )


def denoised_render(render: Render, quick: bool = False) -> Render:
    """The same picture with less noise, by Open Image Denoise; as bright about each place as it was traced.

    quick : by OIDN's smaller network, in half the time
    It is guided by what smooth mirrors and clear glass show, where the renderer knows. Its variance is that of the
    picture before: how far a filter errs is not known.
    """
    guided = render.guide_albedo is not None and render.guide_normal is not None
    albedo = render.guide_albedo if render.guide_albedo is not None and guided else render.albedo
    normal = render.guide_normal if render.guide_normal is not None and guided else render.normal
    clean = _clean(render.radiance, np.clip(albedo, 0, 1), normal, quick)
    if not render.radiance.min() < 0:
        clean = np.maximum(clean, 0)
    kept = _as_bright(clean, render.radiance, np.ones((*render.radiance.shape[:2], 1), np.float32), True)
    return replace(render, radiance=kept.astype(np.float32))


def _share(
    share: np.ndarray, albedo: np.ndarray, normal: np.ndarray, textured: np.ndarray | None, clean_up: Cleaner
) -> np.ndarray:  # fmt: skip
    """The share (H, W, 3) of the light that is lost, cleaned; where not `textured`, light itself and no share.

    The filter errs in proportion to what it sees: a twentieth of the light that is lost in a deep shadow is as much as
    half of what is left there, and it would stand as a pattern. So what is lost and what is left are both cleaned,
    and each counts by the inverse of its squared error, as two measurements of one thing do.
    """
    lost = clean_up(share, albedo, normal)
    if textured is not None and not textured.any():
        return lost
    left = clean_up(np.maximum(1 - share, 0), albedo, normal)
    weights = np.square(np.maximum(left, 0)), np.square(lost)
    total = np.maximum(weights[0] + weights[1], 1e-6)
    # Of an even value in place of a texture more than all may be lost, of which nothing is left.
    alone = lost > 1 if textured is None else (lost > 1) | ~textured[..., None]
    return np.where(alone, lost, (weights[0] * lost + weights[1] * (1 - left)) / total)


def _as_bright(clean: np.ndarray, traced: np.ndarray, shows: np.ndarray, highlights: bool = False) -> np.ndarray:
    """A cleaned plane with as much light about each pixel as was traced there.

    The filter errs by a share of the light, by more the rarer its paths. Where it put that light is right, so it is
    scaled: a plane of light that was lost would lie beside its edges.
    traced : (H, W, 3), as it shows; shows : (H, W, 1), the share of `clean` that does
    highlights : whether what is bright may be lamps in mirrors; of a change it is caustics, whose light lies about them
    """

    def about(light: np.ndarray, reach: float = NEIGHBOURS) -> np.ndarray:
        return gaussian_filter(light, reach, truncate=EDGE)

    def ratio(left: np.ndarray, arrived: np.ndarray, reach: float) -> np.ndarray:
        left, arrived = about(left, reach), about(arrived, reach)
        lit = left > 1e-6 * left.max()  # below that there is nothing to scale
        return np.where(lit, arrived / np.where(lit, left, 1), 1)

    shown, bright = ((light.sum(-1, dtype=np.float64)) for light in (shows * clean, traced))
    if not highlights:
        return clean * ratio(shown, bright, NEIGHBOURS)[..., None].astype(np.float32)
    # A highlight keeps its own light: spread about it, what the filter took of it would stand as a halo.
    peaks = shown > PEAK * about(shown)
    own = ratio(shown * peaks, bright * peaks, NARROW)
    # What the filter made dark by far was a rare bright path, which stands for the light about it.
    kept = np.minimum(own, MOST)
    rest = np.where(peaks, shown * (own - kept), bright)
    scale = np.where(peaks, kept, ratio(shown * ~peaks, rest, NEIGHBOURS))
    return clean * scale[..., None].astype(np.float32)


def _unmatted(premultiplied: np.ndarray, matte: np.ndarray) -> np.ndarray:
    """A plane without its matte; where next to nothing of it shows, what the nearest pixel shows."""
    shows = matte > FAINT
    if not shows.any():
        return np.zeros_like(premultiplied)
    plain = premultiplied / np.maximum(matte, FAINT)[..., None]
    rows, columns = distance_transform_edt(~shows, return_distances=False, return_indices=True)  # pyright: ignore[reportGeneralTypeIssues]
    return plain[rows, columns].astype(np.float32)


def _clean(
    radiance: np.ndarray, albedo: np.ndarray, normal: np.ndarray, quick: bool = False, shown: np.ndarray | None = None
) -> np.ndarray:
    """The picture (H, W, 3) without its noise, and 0 far from where it is `shown`, (H, W) bool; all is unless given."""
    import mitsuba_oidn

    picture = np.ascontiguousarray(radiance, np.float32)
    if not picture.any():
        return picture
    quality = mitsuba_oidn.Quality.Fast if quick else mitsuba_oidn.Quality.High
    # OIDN takes what is below 0 for 0. Pure wavelengths are outside of Rec. 709, and none is outside of X, Y, Z.
    pure = bool(picture.min() < 0)
    if pure:
        picture = np.ascontiguousarray(picture @ WHITE_XYZ.T, np.float32)
    part = (slice(None), slice(None)) if shown is None else _about(shown)
    inputs = (np.ascontiguousarray(plane[part], np.float32) for plane in (picture, albedo, normal))
    clean = mitsuba_oidn.denoise(*inputs, hdr=True, quality=quality, input_scale=exposure(picture))
    whole = np.zeros_like(picture)
    whole[part] = clean
    return whole @ np.linalg.inv(WHITE_XYZ).T.astype(np.float32) if pure else whole


def _about(shown: np.ndarray) -> tuple[slice, slice]:
    """Rows and columns that hold all that shows, and the border that a filter looks at."""
    parts = []
    for axis in (1, 0):
        size, there = shown.shape[1 - axis], np.flatnonzero(shown.any(axis))
        first, last = (there[0], there[-1] + 1) if there.size else (0, 1)
        begin, end = max(first - BORDER, 0) // GRID * GRID, -(-(last + BORDER) // GRID) * GRID
        parts.append(slice(int(begin), min(int(end), size)))
    return parts[0], parts[1]


def exposure(picture: np.ndarray) -> float:
    """The factor that makes a picture (H, W, 3) middle grey, as Open Image Denoise finds it where it is given none.

    Its sums are those of its threads, so that the result would have other last bits for another number of them.
    """
    luminance = picture @ np.array([0.212671, 0.715160, 0.072169])
    for axis in (0, 1):
        size = luminance.shape[axis]
        blocks = -(-size // _BLOCK)
        starts = np.arange(blocks) * size // blocks
        sums = np.add.reduceat(luminance, starts, axis)
        luminance = sums / np.diff(starts, append=size).reshape((-1, 1) if axis == 0 else -1)
    lit = luminance[luminance > _DARK]
    return float(0.18 / np.exp2(np.log2(lit).mean())) if lit.size else 1.0


def smoothed(picture: np.ndarray, normal: np.ndarray, parts: np.ndarray) -> np.ndarray:
    """The picture (H, W, 3) without its noise, float32; edges of the guides are kept.

    picture : 0 or more; textures must have been divided out, so that what is left to see is light
    normal : (H, W, 3), world
    parts : (H, W) int, another number for each surface
    """
    guide = (0.2 + 0.6 * (parts % 4) / 3).astype(np.float32)
    return _clean(np.maximum(picture, 0), np.broadcast_to(guide[..., None], picture.shape), normal)
