"""Relighting a stage's subject by any light, with or without a mesh of it: what `relume stage relight` calls."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from relume.errors import warn
from relume.image import files
from relume.image.mapped_arrays import give_back_freed
from relume.image.radiance import RadianceMap
from relume.lightstage.acquire.read_stage import read_stage
from relume.lightstage.blocks import Cluster, scratch_if
from relume.lightstage.direct_light.control_variate import estimate_seconds, relight_with_mesh, row_blocks
from relume.lightstage.direct_light.light_directions import DirectedLight
from relume.lightstage.field.field import ReflectanceField
from relume.lightstage.field.lights import StageLights
from relume.lightstage.novel_view.projection import Subject, check_mesh_matches
from relume.lightstage.relighting.cosine import compress_cosine
from relume.lightstage.relighting.diffuse_fit import DiffuseFit, fit_diffuse, needs_fit
from relume.lightstage.relighting.interpolation import (
    Barycentric,
    NearestLight,
    Remainder,
    Smooth,
    reached,
    unreached_share,
)
from relume.lightstage.relighting.low_rank import compress_low_rank
from relume.lightstage.relighting.relight_in_bands import (
    in_bands_needed,
    pictures_in_bands,
    shared_out,
    sum_of_pictures,
)
from relume.lightstage.relighting.relight_settings import RelightSettings, SubjectMesh
from relume.lightstage.relighting.relighting import (
    Progress,
    labelled,
    weighted_sum,
    weighted_sum_per_pixel,
    weighted_sums,
    within,
)
from relume.lightstage.relighting.relit_bands import (
    fits_at_once,
)
from relume.lightstage.relighting.specular_spikes import (
    relight_spiky,
    relight_spiky_sequence,
    share_below,
    warn_below,
)
from relume.lightstage.relighting.stage_lighting import StageLighting, as_lighting
from relume.lightstage.relighting.voronoi_cells import even_directions
from relume.scene.shapes.shapes import Mesh
from relume.sphere.environment_map import EnvironmentMap

FAR = 0.05
"""Share of the light that comes from where the stage has no lights from which on relighting warns."""


def relight(
    stage: ReflectanceField | str | os.PathLike[str],
    light: StageLighting | EnvironmentMap,
    mesh: SubjectMesh | Sequence[Mesh] | None = None,
    settings: RelightSettings = RelightSettings(),
    *,
    cluster: Cluster = None,
    progress: Progress | None = None,
) -> RadianceMap:
    """The subject under any light, in the light's unit; with its variance where the noise is known.

    Without a mesh the picture is the sum of the stage's pictures, each times what its light has to give (Debevec et
    al. 2000, eq. 4), interpolated smoothly between the lights. Where these are few, or on one side alone, a Lambertian
    fit of each pixel stands for what no light shows. With a mesh direct light is fitted to each pixel, so that shadows
    and highlights stand where the light is. The variance is that of the plain sum.

    stage : a reflectance field, or where one lies, as `read_stage` takes it
    light : an environment map, or all that shines on the subject
    mesh : as `subject_mesh` finds it
    settings : interpolation, direct light, memory
    cluster : whose workers relight bands of rows, as `relume.cluster.run_tasks` takes it; this process for None, with
        the same bytes. Incomplete names the rows that failed
    progress : called with the share of the work that is done, 0 to 1
    Warns of light from where the stage has no lights, of a mesh that is not used and of pixels below 0.
    Raises ValueError for a mesh that does not match, and for too little memory.
    """
    field = read_stage(stage) if isinstance(stage, str | os.PathLike) else stage
    model = None if settings.nearest else usable_mesh(field, mesh, settings, cluster=cluster)
    field, (lighting,), unit = prepared(field, [light], fitted=model is None and not settings.nearest)
    threads, memory = settings.threads, settings.memory
    if model is not None:
        picture = _relight_on(field, lighting.directed(), model, settings, cluster, progress)
    elif in_bands_needed(field, 1, settings, cluster):
        with pictures_in_bands(field, [lighting], settings, cluster, progress) as frames:
            picture = frames.frame(0)
        if not settings.nearest:
            warn_below(share_below(picture.radiance))
    elif settings.nearest:
        given = lighting.irradiances(field.lights, NearestLight())
        picture = weighted_sum(field, given, threads=threads, memory=memory, progress=progress)
    else:
        fit, rest = _fit(field, settings, progress)
        smooth = lighting.irradiances(field.lights, Smooth() if fit is None else Remainder())
        barycentric = lighting.irradiances(field.lights, Barycentric())
        added = None if fit is None else fit.added(lighting, field.lights, smooth)
        picture = relight_spiky(field, smooth, barycentric, threads=threads, memory=memory, progress=rest, added=added)
    return replace(picture, unit=unit)


def relight_sequence(
    stage: ReflectanceField | str | os.PathLike[str],
    lights: Sequence[StageLighting | EnvironmentMap],
    settings: RelightSettings = RelightSettings(),
    *,
    cluster: Cluster = None,
    progress: Progress | None = None,
) -> Iterator[RadianceMap]:
    """The subject under each light in turn, by sums of the stage's pictures; the field is read as rarely as possible.

    stage, settings : as of `relight`
    lights : of the pictures, in one unit; `StageLighting.turntable` makes them for a map that turns
    cluster : as of `relight`; none with a compression
    progress : called with the share of the work that is done, 0 to 1
    With `settings.compression` the field is made small first: pictures then differ by the error that is warned of.
    Where not all frames fit into the memory together, bands of rows of all of them are made first.
    Raises ValueError as `relight`, and for lights in two units.
    """
    field, several, unit = prepared(stage, lights, fitted=not settings.nearest)
    if settings.compression is None and in_bands_needed(field, len(several), settings, cluster):
        return _from_bands(field, several, settings, cluster, unit, progress)
    if cluster is not None:
        raise ValueError("a compressed field is in this process; leave the compression or the cluster out")
    threads, memory = settings.threads, settings.memory
    fit, rest = (None, progress) if settings.nearest else _fit(field, settings, progress)
    given = shared_out(field, several, settings, fit)
    added = None if fit is None else _added(fit, field, several, given)
    if settings.compression is not None:
        pictures = _relight_compressed(field, given, settings, rest)
        if added is not None:
            pictures = map(_plus, pictures, added)
    elif settings.nearest:
        pictures = weighted_sums(field, given, threads=threads, memory=memory, progress=rest)
    else:
        barycentric = np.stack([each.irradiances(field.lights, Barycentric()) for each in several])
        pictures = relight_spiky_sequence(
            field, given, barycentric, threads=threads, memory=memory, progress=rest, added=added
        )
    return (replace(picture, unit=unit) for picture in pictures)


def relight_per_pixel(
    stage: ReflectanceField | str | os.PathLike[str],
    labels: np.ndarray | str | os.PathLike[str],
    lights: Sequence[StageLighting | EnvironmentMap],
    settings: RelightSettings = RelightSettings(),
    *,
    cluster: Cluster = None,
    progress: Progress | None = None,
) -> RadianceMap:
    """The subject with a light of its own at every pixel, as under leaves (Debevec et al. 2000, §3.4).

    stage : as of `relight`
    labels : (H, W) integers, which of the lights shines on each pixel; or a picture with a grey level for each light,
        the darkest for the first
    lights : by the numbers in `labels`, in one unit
    settings : as of `relight`
    cluster : as of `relight`
    progress : called with the share of the work that is done, 0 to 1
    Warns of light from where the stage has no lights. Raises ValueError for labels of another shape or number, and for
    lights in two units.
    """
    field, several, unit = prepared(stage, lights, fitted=not settings.nearest)
    if isinstance(labels, str | os.PathLike):
        levels, labels = np.unique(files.read_photograph(labels).pixels[..., 1], return_inverse=True)
        if len(levels) != len(several):
            raise ValueError(
                f"the labels have {len(levels)} grey levels for {len(several)} lights; give one level each"
            )
    labels = np.asarray(labels)
    if cluster is not None:
        labelled(field, labels, shared_out(field, several, settings, None))
        with pictures_in_bands(field, several, settings, cluster, progress, labels) as frames:
            return replace(frames.frame(0), unit=unit)
    fit, rest = (None, progress) if settings.nearest else _fit(field, settings, progress)
    given, labels = shared_out(field, several, settings, fit), np.asarray(labels)
    picture = weighted_sum_per_pixel(field, labels, given, memory=settings.memory, progress=rest)
    if fit is not None:
        for label, added in enumerate(_added(fit, field, several, given)):
            picture.radiance[labels == label] += added[labels == label]
    return replace(picture, unit=unit)


def prepared(
    stage: ReflectanceField | str | os.PathLike[str], lights: Sequence[StageLighting | EnvironmentMap], *, fitted: bool
) -> tuple[ReflectanceField, list[StageLighting], str]:
    """The field, the lights for it and their unit; raises ValueError for two units, warns of light it cannot show.

    fitted : whether a fit stands for the lights that the stage does not have
    """
    field = read_stage(stage) if isinstance(stage, str | os.PathLike) else stage
    several = [as_lighting(light) for light in lights]
    if len({each.unit for each in several}) != 1:
        raise ValueError(f"{len(several)} lights in several units; give one light or more, in one unit")
    warn_unreached(field.lights, several, fitted)
    return field, several, several[0].unit


def _fit(
    field: ReflectanceField, settings: RelightSettings, progress: Progress | None
) -> tuple[DiffuseFit | None, Progress | None]:
    """The Lambertian fit of each pixel, where the field's lights need it, and the progress of what comes after."""
    if not needs_fit(field.lights):
        return None, progress
    fit = fit_diffuse(field, settings.memory, within(progress, slice(0, 1), 2))
    return fit, within(progress, slice(1, 2), 2)


def _from_bands(
    field: ReflectanceField,
    several: Sequence[StageLighting],
    settings: RelightSettings,
    cluster: Cluster,
    unit: str,
    progress: Progress | None,
) -> Iterator[RadianceMap]:
    """The pictures of a sequence, put together from their bands one after another."""
    below = 0.0
    with pictures_in_bands(field, several, settings, cluster, progress) as frames:
        for picture in frames:
            below = max(below, share_below(picture.radiance))
            yield replace(picture, unit=unit)
            # Before the next is put together: the heap would else grow by what was freed in between.
            del picture
            give_back_freed()
    if not settings.nearest:
        warn_below(below)


def _added(
    fit: DiffuseFit, field: ReflectanceField, several: Sequence[StageLighting], given: np.ndarray
) -> Iterator[np.ndarray]:
    """What the fit adds under each light, made when it is asked for."""
    return (fit.added(light, field.lights, each) for light, each in zip(several, given, strict=True))


def _plus(picture: RadianceMap, added: np.ndarray) -> RadianceMap:
    return replace(picture, radiance=picture.radiance + added)


def _relight_compressed(
    field: ReflectanceField, given: np.ndarray, settings: RelightSettings, progress: Progress | None
) -> Iterator[RadianceMap]:
    """Pictures under each of the irradiances (K, N, 3) from the compressed field; its error is warned of."""
    compress = compress_cosine if settings.compression == "cosine" else compress_low_rank
    small = compress(field, memory=settings.memory, progress=progress)
    warn(
        f"the field is compressed to {small.byte_count / 1e6:.3g} MB: pictures differ from exact ones by "
        f"{small.error.random:.1%} under light from everywhere, by up to {small.error.worst:.1%} under one light"
    )
    return (small.relight(each) for each in given)


def usable_mesh(
    field: ReflectanceField,
    mesh: SubjectMesh | Sequence[Mesh] | None,
    settings: RelightSettings,
    *,
    cluster: Cluster = None,
) -> SubjectMesh | None:
    """The mesh where it stands where the pictures show the subject; None, with a warning, where it does not.

    field : the reflectance field whose pictures show the subject
    mesh : the one that was given, or None
    settings, cluster : as of `relight`
    Raises ValueError where such a mesh is required.
    """
    if mesh is None:
        return None
    given = mesh if isinstance(mesh, SubjectMesh) else SubjectMesh(mesh)
    if given.checked:
        return given
    try:
        if field.camera is None:
            raise ValueError("the stage has no camera, so that nothing says where the mesh is seen; add it")
        seen = Subject.of(given.meshes).seen(field.camera)
        check_mesh_matches(_brightness(field, settings, cluster), seen, "the stage's camera")
    except ValueError as error:
        if given.required:
            raise ValueError(f"{given.name}: {error}") from None
        warn(f"{given.name} is not used: {error}")
        return None
    return replace(given, checked=True)


def mesh_seconds(
    field: ReflectanceField, light: StageLighting, mesh: SubjectMesh, settings: RelightSettings = RelightSettings()
) -> float:
    """About how long `relight` takes with a mesh, seconds; raises ValueError for too little memory.

    field, light, mesh, settings : as of `relight`
    """
    row_blocks(field, settings.memory)
    direct_light = mesh.settings(settings.direct_light)
    return estimate_seconds(field, light.directed(), mesh.meshes, direct_light, threads=settings.threads)


def warn_unreached(lights: StageLights, several: Sequence[StageLighting], fitted: bool = False) -> None:
    """Warn of light that comes from where the stage has no lights.

    fitted : whether a fit of each pixel stands for them, and not the nearest light
    """
    if reached(lights, even_directions(4096)).min() == 1:
        return
    directed = (each.directed() for each in several)
    share = max(unreached_share(lights, each.directions, each.irradiances) for each in directed)
    if share >= FAR:
        most = "up to " if len(several) > 1 else ""
        warn(
            f"{most}{share:.0%} of the light comes from where the stage has no lights; "
            + ("a matte surface fitted to each pixel" if fitted else "the nearest light")
            + " gives it instead, "
            + ("without its shadows and highlights" if fitted else "and shading and shadows are wrong for it")
        )


def _relight_on(
    field: ReflectanceField,
    light: DirectedLight,
    mesh: SubjectMesh,
    settings: RelightSettings,
    cluster: Cluster,
    progress: Progress | None,
) -> RadianceMap:
    direct_light, threads, memory = mesh.settings(settings.direct_light), settings.threads, settings.memory
    with scratch_if(not fits_at_once(field, 1, memory), settings.scratch, cluster) as place:
        radiance = relight_with_mesh(
            field,
            light,
            mesh.meshes,
            direct_light,
            progress=progress,
            threads=threads,
            memory=memory,
            cluster=cluster,
            place=place,
        )
    warn_below(share_below(radiance))
    variance = None
    if field.noise is not None:
        given = direct_light.remainder.gathered(field.lights, light.directions, light.irradiances)
        variance = sum_of_pictures(field, given, settings, cluster).variance
    return RadianceMap(radiance, variance)


def _brightness(field: ReflectanceField, settings: RelightSettings, cluster: Cluster) -> np.ndarray:
    """The mean (H, W) of a field's pictures over the sphere."""
    even = np.repeat(field.lights.solid_angles[:, None] / (4 * np.pi), 3, axis=1)
    return sum_of_pictures(field, even, settings, cluster).radiance.mean(axis=-1)
