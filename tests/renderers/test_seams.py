"""Photographs of a place compared with one another: each with those that it shares places with."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

import relume as rl
import virtual_place as place
from relume.renderers.projective.photographs import ProjectedPhotograph
from relume.renderers.projective.seams import seams

AWAY = np.array([40.0, 0.0, 0.0])


def elsewhere(photograph: ProjectedPhotograph, times: float) -> ProjectedPhotograph:
    """The same photograph of a room that stands elsewhere, and is so many times as bright."""
    camera = replace(photograph.camera, position=photograph.camera.position + AWAY)
    radiance = rl.RadianceMap(np.float32(times) * photograph.radiance.radiance)
    return ProjectedPhotograph(camera, radiance, f"{photograph.name} elsewhere")


def test_photographs_that_share_nothing_say_nothing_of_each_other():
    here = [replace(each, name=f"photo{k}") for k, each in enumerate(place.photographs())]
    there = [elsewhere(each, 9.0 if k == 1 else 3.0) for k, each in enumerate(here)]
    meshes = place.meshes()[:1]
    rooms = [*meshes, *(replace(mesh, vertices=(mesh.vertices + AWAY).astype(np.float32)) for mesh in meshes)]
    baked = rl.renderers.bake(rooms, [*here, *there], texel=0.1)
    gains = seams(baked, [*here, *there]).gains
    wanted = {each.name: 3.0 if each is there[1] else 1.0 for each in [*here, *there]}
    np.testing.assert_allclose([gains[name] for name in wanted], list(wanted.values()), rtol=0.1)
