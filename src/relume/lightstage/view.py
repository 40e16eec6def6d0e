"""A relit subject from a new viewpoint, on a mesh of it: what `relume stage view` calls."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass, replace

from relume.lightstage.blocks import Cluster, scratch_if
from relume.lightstage.direct_light.model import DirectLightSettings
from relume.lightstage.field.field import ReflectanceField
from relume.lightstage.novel_view.new_views import direct_light_view, measured_view
from relume.lightstage.novel_view.source_views import Blending, NewView, SourceView
from relume.lightstage.relighting.interpolation import NearestLight
from relume.lightstage.relighting.relight_settings import SubjectMesh
from relume.lightstage.relighting.stage_lighting import StageLighting, as_lighting
from relume.lightstage.surface.separation import separate
from relume.scene.cameras.camera import Camera
from relume.scene.shapes.shapes import Mesh
from relume.sphere.environment_map import EnvironmentMap


@dataclass(frozen=True)
class ViewSettings:
    """How a new view is made.

    measured : measured reflectance functions are carried to the new view (Debevec et al. 2000, eq. 9) instead of
        computing direct light on the mesh; quicker, and less exact where the light is narrow
    nearest : with `measured`, all light goes to the nearest light of the stage, as in the paper
    direct_light : how direct light is fitted; its `light_radius` is the mesh's where that has one
    blending : how much each source camera counts
    """

    measured: bool = False
    nearest: bool = False
    direct_light: DirectLightSettings = DirectLightSettings()
    blending: Blending = Blending()


def view(
    sources: ReflectanceField | SourceView | Sequence[ReflectanceField | SourceView],
    light: StageLighting | EnvironmentMap,
    camera: Camera,
    mesh: SubjectMesh | Mesh | Sequence[Mesh],
    settings: ViewSettings = ViewSettings(),
    *,
    cluster: Cluster = None,
    scratch: str | os.PathLike[str] | None = None,
) -> NewView:
    """The subject under any light, seen by a new camera (Debevec et al. 2000, §4): shadows and highlights move.

    sources : what one camera of the stage took, or several; each field has its camera
    light : an environment map, or lamps and directions
    camera : the new one
    settings : of the method
    mesh : of the subject, metres, in the stage's frame
    cluster : whose workers take bands of rows, as `relume.cluster.run_tasks` takes it; this process for None, and for
        what is `measured`. Of the stage only rows that show the mesh are read for it
    scratch : a folder, or an fsspec URL, that every worker sees, for what bands write until it is put together; the
        system's temporary folder unless given
    Nothing is invented: what no camera saw is a hole in `alpha`, counted by `unseen`. Warns from a quarter of the
    subject on. Raises ValueError for no source, for a source without a camera, for a mesh that does not match the
    pictures, and for a camera that sees nothing of it.
    """
    several = list(sources) if isinstance(sources, Sequence) else [sources]
    views = [each if isinstance(each, SourceView) else SourceView(each) for each in several]
    lighting = as_lighting(light)
    given = mesh if isinstance(mesh, SubjectMesh) else SubjectMesh([mesh] if isinstance(mesh, Mesh) else mesh)
    if settings.measured:
        by = (NearestLight(),) if settings.nearest else ()
        irradiances = [lighting.irradiances(each.field.lights, *by) for each in views]
        parts = [_with_parts(each) for each in views]
        found = measured_view(parts, irradiances, camera, given.meshes, blending=settings.blending)
    else:
        direct_light = given.settings(settings.direct_light)
        directed, blending = lighting.directed(), settings.blending
        with scratch_if(False, scratch, cluster) as place:
            found = direct_light_view(
                views,
                directed,
                camera,
                given.meshes,
                settings=direct_light,
                blending=blending,
                cluster=cluster,
                place=place,
            )
    return replace(found, picture=replace(found.picture, unit=lighting.unit))


def _with_parts(source: SourceView) -> SourceView:
    """The source with diffuse and specular reflection separated, where they are not yet."""
    if source.parts is not None:
        return source
    parts = separate(source.field)
    return replace(source, parts=parts, alpha=parts.alpha)
