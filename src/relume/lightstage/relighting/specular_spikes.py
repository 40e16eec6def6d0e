"""Pixels whose reflectance functions are spikes, as a mirror's are: relit without a share below 0.

Smooth interpolation has shares below 0, which a spike turns into negative light beside it. Where a pixel's greatest
value is many times its mean over the sphere, its sum takes irradiances whose shares are not (`Barycentric`). That is
found from the field alone, never from the light, so that a picture stays linear in its light.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace

import numpy as np

from relume.errors import warn
from relume.image.radiance import RadianceMap
from relume.lightstage.field.field import ReflectanceField
from relume.lightstage.field.lights import StageLights
from relume.lightstage.relighting.interpolation import shares_of_what_is_known
from relume.lightstage.relighting.relighting import MEMORY, Progress, checked, cut, pictures_at_once, summed, within

SPIKE = 8.0
"""The greatest value over the mean: 4 for a matte surface that faces a light, 5 … 7 for skin, hundreds for a mirror. On
a rendered head under 288 lights 6 … 10 do nearly as well."""
MIRROR = 0.5
"""The part of the mean that one light alone makes in a pixel that reflects it as a mirror does."""
_TINY = 1e-3
"""Of a picture's brightest hundredth: what is below 0 by less is no more than the noise of its source."""


def find_spikes(peak: np.ndarray, mean: np.ndarray) -> np.ndarray:
    """Which pixels' functions are spikes: bool of the shape (…) of two arrays (…, 3).

    peak : the greatest value over the lights, channel by channel
    mean : over the sphere, Σ R_i Ω_i / 4π, or over what part of it the lights stand for
    """
    return np.asarray(peak.sum(axis=-1) > SPIKE * np.maximum(mean.sum(axis=-1), 0))


def spiky_and_mirror_pixels(values: np.ndarray, lights: StageLights) -> tuple[np.ndarray, np.ndarray]:
    """Which of K pixels' functions (N, K, 3) are spikes, and in which one light alone makes most: two (K,) bool."""
    shares = shares_of_what_is_known(lights).astype(np.float32)
    mean = np.einsum("nkc,n->kc", values, shares)
    alone = (values.sum(axis=2) * shares[:, None]).max(axis=0)
    return find_spikes(values.max(axis=0), mean), np.asarray(alone > MIRROR * np.maximum(mean.sum(axis=1), 0))


def relight_spiky(
    field: ReflectanceField,
    smooth: np.ndarray,
    barycentric: np.ndarray,
    *,
    threads: int | None = None,
    memory: int = MEMORY,
    progress: Progress | None = None,
    added: np.ndarray | None = None,
) -> RadianceMap:
    """The subject under one light, spikes summed without shares below 0; one pass over the field.

    smooth, barycentric : (N, 3), the same light shared out by `Smooth` and by `Barycentric`
    threads, memory : as of `relighting.weighted_sum`
    added : (H, W, 3), what is added where the smooth sum is taken (`diffuse_fit`)
    Raises ValueError as `weighted_sum`, and warns where some of the picture is below 0.
    """
    given = checked(field.lights, smooth)[None], checked(field.lights, barycentric)[None]
    extra = None if added is None else [added]
    sequence = relight_spiky_sequence(field, *given, threads=threads, memory=memory, progress=progress, added=extra)
    return next(sequence)


def relight_spiky_sequence(
    field: ReflectanceField,
    smooth: np.ndarray,
    barycentric: np.ndarray,
    *,
    threads: int | None = None,
    memory: int = MEMORY,
    progress: Progress | None = None,
    added: Iterable[np.ndarray] | None = None,
) -> Iterator[RadianceMap]:
    """Pictures under each light, in their order, each the very bytes of `relight_spiky`'s.

    smooth, barycentric : (K, N, 3) each, as of `relight_spiky`
    memory : bytes; where they do not hold all pictures, the field is read again for the next of them
    added : (H, W, 3) each, asked for one after another, as of `relight_spiky`
    Raises ValueError as `weighted_sum`, before the first picture. With the last one, a warning counts
    what is below 0.
    """
    pairs = [np.asarray(each, np.float64) for each in (smooth, barycentric)]
    if pairs[0].ndim != 3 or len(pairs[0]) == 0 or pairs[0].shape != pairs[1].shape:
        raise ValueError(
            f"irradiances are {pairs[0].shape} and {pairs[1].shape}; expected (pictures, {len(field.lights)} lights, "
            "3) both"
        )
    for each in np.concatenate(pairs):
        checked(field.lights, each)
    return _passes(field, pairs[0], pairs[1], threads, memory, progress, added)


def _passes(
    field: ReflectanceField,
    smooth: np.ndarray,
    barycentric: np.ndarray,
    threads: int | None,
    memory: int,
    progress: Progress | None,
    added: Iterable[np.ndarray] | None,
) -> Iterator[RadianceMap]:
    below = 0.0
    for index, picture in enumerate(spiky_pictures(field, smooth, barycentric, threads, memory, progress, added)):
        below = max(below, share_below(picture.radiance))
        if index == len(smooth) - 1:
            warn_below(below)
        yield picture


def spiky_pictures(
    field: ReflectanceField,
    smooth: np.ndarray,
    barycentric: np.ndarray,
    threads: int | None,
    memory: int,
    progress: Progress | None,
    added: Iterable[np.ndarray] | None,
) -> Iterator[RadianceMap]:
    """The pictures of `relight_spiky_sequence`, whose arguments these are, without its checks and its warning."""
    extras = None if added is None else iter(added)
    count, together = len(smooth), max(1, (pictures_at_once(field, memory) - 2) // 2)
    peak = np.full((*field.shape, 3), -np.inf, np.float32)
    even = np.repeat(shares_of_what_is_known(field.lights)[:, None], 3, axis=1)[None]
    spiky: np.ndarray | None = None

    def seen(rows: slice, values: np.ndarray, scale: np.ndarray | None) -> None:
        """Keep the greatest of each pixel's values while the sum reads them."""
        if scale is None:
            np.maximum(peak[rows], values.max(axis=0), out=peak[rows])
            return
        for picture, one in zip(values, scale.astype(np.float32), strict=True):
            np.maximum(peak[rows], picture * one, out=peak[rows])

    for part in cut(count, together):
        # The first pass finds the spikes beside its pictures.
        extra = [even] if spiky is None else []
        pictures = list(
            summed(
                field,
                np.concatenate([*extra, smooth[part], barycentric[part]]),
                threads=threads,
                memory=memory - peak.nbytes,
                progress=within(progress, part, count),
                seen=seen if spiky is None else None,
            )
        )
        if spiky is None:
            spiky = find_spikes(peak, pictures.pop(0).radiance)
        half = len(pictures) // 2
        for index in range(half):
            smooth_one = pictures[index]
            if extras is not None:
                smooth_one = replace(smooth_one, radiance=smooth_one.radiance + next(extras))
            yield chosen(spiky, pictures[half + index], smooth_one)


def chosen(where: np.ndarray, first: RadianceMap, other: RadianceMap) -> RadianceMap:
    """The first picture in some pixels (H, W) bool, the other in the rest."""
    radiance = np.where(where[..., None], first.radiance, other.radiance)
    if first.variance is None or other.variance is None:
        return RadianceMap(radiance)
    return RadianceMap(radiance, np.where(where[..., None], first.variance, other.variance))


def share_below(radiance: np.ndarray) -> float:
    """The share of pixels with a channel below 0, by more than a thousandth of what 1 in 100 pixels exceed."""
    bright = max(float(np.quantile(radiance.max(axis=-1), 0.99)), 0.0)
    return float(np.mean(radiance.min(axis=-1) < -_TINY * bright))


def warn_below(share: float) -> None:
    """Warn of pixels below 0; they are left as they are, for a sum stays linear only so."""
    if share > 0:
        warn(
            f"{100 * share:.2g}% of the picture's pixels are below 0, as smooth interpolation makes them beside "
            "bright light; they are written as they are"
        )
