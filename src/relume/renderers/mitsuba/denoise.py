"""Denoising a pair of renders by Open Image Denoise, so that what the objects do not change stays untouched."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from relume.renderers.results import Change, Render

FAINT = 0.1
"""Of a pixel: less than that shows more noise than colour."""


def denoise_pair(with_: Render, without: Render) -> tuple[Render, Render]:
    """The same two renders with less noise.

    The picture without objects is denoised alone, and so is what the objects cover. Beside them the light that they
    take and the light that they add are denoised each on its own: the noise that both renders share has cancelled
    there. Pixels where the two were equal stay equal to the bit.
    """
    import mitsuba_oidn

    def clean(radiance: np.ndarray, guide: Render) -> np.ndarray:
        picture = np.ascontiguousarray(np.maximum(radiance, 0), np.float32)
        albedo, normal = (np.ascontiguousarray(p, np.float32) for p in (guide.albedo, guide.normal))
        return np.asarray(mitsuba_oidn.denoise(picture, np.clip(albedo, 0, 1), normal, hdr=True))

    smooth = clean(without.radiance, without)
    difference = with_.radiance - without.radiance
    covered = clean(with_.radiance, with_)
    cover = with_.matte[..., None]
    outside = difference * (1 - cover)
    beside = smooth + clean(np.maximum(outside, 0), with_) - clean(np.maximum(-outside, 0), with_)
    equal = (cover == 0) & np.all(difference == 0, axis=-1, keepdims=True)
    radiance = np.where(equal, smooth, cover * covered + (1 - cover) * beside)
    return replace(with_, radiance=radiance.astype(np.float32)), replace(without, radiance=smooth)


def denoised(change: Change) -> Change:
    """The same change with less noise, by Open Image Denoise: the objects and the signed difference apart.

    Albedo and normals guide both. The light that is taken and the light that is added are cleaned each on its own, for
    the filter knows no negative light. All are cleaned as they would be if the matte had no edges, and matted again:
    the matte has next to no noise, and its edges stay as they are. What is exactly 0 stays so.
    """
    albedo = np.ascontiguousarray(np.clip(change.albedo, 0, 1), np.float32)
    normal = np.ascontiguousarray(change.normal, np.float32)
    cover = change.matte[..., None]
    objects = _clean(_unmatted(change.objects, change.matte), albedo, normal)
    added, taken = (
        _clean(np.maximum(sign * _unmatted(change.difference, 1 - change.matte), 0), albedo, normal) for sign in (1, -1)
    )
    changes = np.any(change.difference != 0, axis=-1, keepdims=True)
    return replace(
        change,
        objects=(cover * objects).astype(np.float32),
        difference=np.where(changes, (1 - cover) * (added - taken), 0).astype(np.float32),
    )


def _unmatted(premultiplied: np.ndarray, matte: np.ndarray) -> np.ndarray:
    """A plane without its matte; where next to nothing of it shows, what the nearest pixel shows."""
    from scipy.ndimage import distance_transform_edt

    shows = matte > FAINT
    if not shows.any():
        return np.zeros_like(premultiplied)
    plain = premultiplied / np.maximum(matte, FAINT)[..., None]
    rows, columns = distance_transform_edt(~shows, return_distances=False, return_indices=True)  # pyright: ignore[reportGeneralTypeIssues]
    return plain[rows, columns].astype(np.float32)


def _clean(radiance: np.ndarray, albedo: np.ndarray, normal: np.ndarray) -> np.ndarray:
    import mitsuba_oidn

    picture = np.ascontiguousarray(radiance, np.float32)
    if not picture.any():
        return picture
    guides = (np.ascontiguousarray(p, np.float32) for p in (albedo, normal))
    return np.asarray(mitsuba_oidn.denoise(picture, *guides, hdr=True))
