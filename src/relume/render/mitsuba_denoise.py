"""Denoising a pair of renders by Open Image Denoise, so that what the objects do not change stays untouched."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from relume.render.renderer import Render


def denoise_pair(with_: Render, without: Render) -> tuple[Render, Render]:
    """The same two renders with less noise.

    The picture without objects is denoised alone. To it the difference of the two, in which the noise they share
    has cancelled, is added, and the sum is denoised: so the two keep sharing what they share, and pixels where they
    were equal stay equal to the bit.
    """
    import mitsuba_oidn

    def clean(radiance: np.ndarray, guide: Render) -> np.ndarray:
        picture = np.ascontiguousarray(np.maximum(radiance, 0), np.float32)
        albedo, normal = (np.ascontiguousarray(p, np.float32) for p in (guide.albedo, guide.normal))
        return np.asarray(mitsuba_oidn.denoise(picture, np.clip(albedo, 0, 1), normal, hdr=True))

    smooth = clean(without.radiance, without)
    difference = with_.radiance - without.radiance
    changed = clean(smooth + difference, with_)
    equal = np.all(difference == 0, axis=-1) & (with_.matte == 0)
    return (
        replace(with_, radiance=np.where(equal[..., None], smooth, changed)),
        replace(without, radiance=smooth),
    )
