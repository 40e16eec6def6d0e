"""The light on a stage, shared out for sums over its lights, and these sums in bands of rows where they are large."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager

import numpy as np

from relume.image.radiance import RadianceMap
from relume.lightstage.blocks import Cluster, scratch
from relume.lightstage.field.field import ReflectanceField
from relume.lightstage.relighting.diffuse_fit import DiffuseFit, needs_fit, terms
from relume.lightstage.relighting.interpolation import Barycentric, NearestLight, Remainder, Smooth
from relume.lightstage.relighting.relight_settings import RelightSettings
from relume.lightstage.relighting.relighting import Progress, weighted_sum, within
from relume.lightstage.relighting.relit_bands import (
    BandFit,
    Frames,
    Irradiances,
    Means,
    fit_in_bands,
    fits_at_once,
    relit_in_bands,
)
from relume.lightstage.relighting.stage_lighting import StageLighting


def in_bands_needed(field: ReflectanceField, pictures: int, settings: RelightSettings, cluster: Cluster) -> bool:
    """Whether so many pictures are made in bands: by workers, or since they do not fit into the memory together."""
    return cluster is not None or not fits_at_once(field, pictures, settings.memory)


@contextmanager
def pictures_in_bands(
    field: ReflectanceField,
    several: Sequence[StageLighting],
    settings: RelightSettings,
    cluster: Cluster,
    progress: Progress | None,
    labels: np.ndarray | None = None,
) -> Iterator[Frames]:
    """The pictures as bands of rows made them; these are there inside the block."""
    with scratch(settings.scratch, cluster) as place:
        means = Means(cluster, place, settings.memory, settings.threads)
        # What the field's own few lights do not show is fitted first.
        fit, rest = None, progress
        if not settings.nearest and needs_fit(field.lights):
            fit = fit_in_bands(field, means, within(progress, slice(0, 1), 2))
            rest = within(progress, slice(1, 2), 2)
        # What each light of the stage has to give.
        smooth = shared_out(field, several, settings, fit)
        barycentric = None
        if not settings.nearest and labels is None:
            barycentric = np.stack([each.irradiances(field.lights, Barycentric()) for each in several])
        added = () if fit is None else _terms(fit, field, several, smooth)
        yield relit_in_bands(field, Irradiances(smooth, barycentric, added), means, fit, labels, rest)


def _terms(
    fit: BandFit, field: ReflectanceField, several: Sequence[StageLighting], given: np.ndarray
) -> tuple[tuple[np.ndarray, np.ndarray], ...]:
    """By what the fit is lit under each light."""
    return tuple(terms(fit.strengths, *each) for each in zip(several, [field.lights] * len(given), given, strict=True))


def shared_out(
    field: ReflectanceField,
    several: Sequence[StageLighting],
    settings: RelightSettings,
    fit: DiffuseFit | BandFit | None,
) -> np.ndarray:
    """What each of the field's lights gives of each light, (K, N, 3)."""
    by = NearestLight() if settings.nearest else Smooth() if fit is None else Remainder()
    return np.stack([each.irradiances(field.lights, by) for each in several])


def sum_of_pictures(
    field: ReflectanceField, irradiances: np.ndarray, settings: RelightSettings, cluster: Cluster
) -> RadianceMap:
    """`weighted_sum`, in bands where that is called for."""
    if not in_bands_needed(field, 1, settings, cluster):
        return weighted_sum(field, irradiances, threads=settings.threads, memory=settings.memory)
    with scratch(settings.scratch, cluster) as place:
        means = Means(cluster, place, settings.memory, settings.threads)
        return relit_in_bands(field, Irradiances(irradiances[None]), means).frame(0)
