"""How a stage's subject is relit, and the mesh of it."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

from relume.lightstage.acquire.read_stage import stage_geometry
from relume.lightstage.direct_light.model import DirectLightSettings
from relume.lightstage.relighting.relighting import MEMORY
from relume.scene.shapes.meshes import read_meshes
from relume.scene.shapes.shapes import Mesh

Compression = Literal["cosine", "low-rank"]


@dataclass(frozen=True)
class RelightSettings:
    """How a subject is relit.

    nearest : all light goes to the nearest light of the stage, as in the paper; no mesh is used then
    direct_light : how direct light on a mesh is fitted; its `light_radius` is the mesh's where that has one
    compression : of the field, once, before a sequence is relit; a single picture is quicker without
    threads : every core for None
    memory : bytes for blocks and sums, of each worker where there are several
    scratch : a folder, or an fsspec URL, that every worker sees, for what blocks write until it is put together; the
        system's temporary folder unless given
    """

    nearest: bool = False
    direct_light: DirectLightSettings = DirectLightSettings()
    compression: Compression | None = None
    threads: int | None = None
    memory: int = MEMORY
    scratch: str | os.PathLike[str] | None = None


@dataclass(frozen=True, eq=False)
class SubjectMesh:
    """A mesh of a stage's subject, metres, in the stage's frame.

    meshes : the surfaces
    light_radius : radians, half the apparent diameter of the stage's lights; None where unknown
    name : for messages
    required : whether a mesh that does not match the pictures is refused; else it is not used, with a warning
    checked : whether it is known to match them (`usable_mesh`)
    """

    meshes: Sequence[Mesh]
    light_radius: float | None = None
    name: str = "the mesh"
    required: bool = True
    checked: bool = False

    def settings(self, settings: DirectLightSettings) -> DirectLightSettings:
        """The settings, for lights of this radius where it is known."""
        return settings if self.light_radius is None else replace(settings, light_radius=self.light_radius)


def subject_mesh(stage: str | os.PathLike[str], mesh: str | os.PathLike[str] | None = None) -> SubjectMesh | None:
    """The mesh that is given, else the one that the stage has; None where it has none.

    stage : a folder, a stage file or a store
    mesh : a mesh file; the stage's own unless given
    Raises InvalidStage and UnreadableFile.
    """
    own, radius = stage_geometry(stage)
    chosen = own if mesh is None else Path(mesh)
    return None if chosen is None else SubjectMesh(read_meshes(chosen), radius, str(chosen), required=mesh is not None)
