"""A room's radiance in textures: seen from elsewhere, as light at a point, with its lamp as a light."""

from typing import Any

import numpy as np
import pytest

import relume as rl
import virtual_place as place
from relume.renderers.projective.atlas import atlas_of
from relume.renderers.projective.place_light import Arriving
from relume.renderers.projective.shining_meshes import place_of
from relume.renderers.raytrace.raycast import RayCaster
from relume.sphere.directions import normalised

DARK = rl.EnvironmentMap(np.zeros((4, 8, 3), np.float32))


@pytest.fixture(scope="module")
def baked():
    return rl.renderers.bake(place.meshes(), place.photographs())


def truth_along(origin, directions):
    distance = RayCaster.of(place.meshes()).nearest(origin, directions).distance
    return place.radiance_at(origin + distance[:, None] * directions)


def test_an_atlas_lays_each_wall_down_to_scale_and_knows_where_each_texel_lies():
    atlas = atlas_of(place.meshes()[0], 0.1, 4096)
    # Six walls, of 126 m² in all, and a rim round each.
    assert np.isclose(atlas.inner.sum() * 0.01, 126, rtol=0.02)
    assert np.isclose(np.abs(atlas.points).max(axis=0), [3, 3, 2.5], atol=0.01).all()
    # The texture coordinates of a triangle's middle are those of the texel that lies there.
    mesh, (width, height) = atlas.mesh, atlas.size
    assert mesh.uv is not None
    middles, at = mesh.vertices[mesh.faces].mean(axis=1), mesh.uv[mesh.faces].mean(axis=1)
    columns, rows = (at[:, 0] * width).astype(int), ((1 - at[:, 1]) * height).astype(int)
    for middle, row, column in zip(middles, rows, columns, strict=True):
        (texel,) = np.flatnonzero((atlas.rows == row) & (atlas.columns == column))
        assert np.linalg.norm(atlas.points[texel] - middle) < 0.1


def test_an_atlas_that_would_be_too_large_gets_coarser():
    atlas = atlas_of(place.meshes()[0], 0.001, 256)
    assert max(atlas.size) <= 256 and atlas.texel > 0.04


def test_a_baked_room_sends_out_what_it_did(baked):
    directions = normalised(np.random.default_rng(0).normal(size=(4000, 3)))
    origin = np.array([0.3, 1.4, 1.0])
    shown, truth = Arriving(baked).along(origin, directions), truth_along(origin, directions)
    lamp = truth[:, 0] > 10
    near = np.abs(shown - truth)[~lamp].max(axis=-1) < 0.05
    assert near.mean() > 0.97


def test_holes_are_told_and_filled(baked):
    assert 0.01 < baked.holes < 0.12
    room, block, _ = baked.parts
    # Nobody sees what the block stands on: a square of the floor, and the block's own sixth side.
    assert block.holes > 0.1
    assert np.all(room.radiance[room.used & ~room.seen] > 0)
    assert np.all(np.isfinite(room.radiance))


@pytest.mark.parametrize("normal", [(0, 1, 0), (0, -1, 0), (1, 0, 0), (0.6, 0.0, -0.8)])
def test_its_irradiance_is_the_rooms(baked, normal):
    point, up = np.array([0.2, 1.3, 0.6]), np.array(normal, float)
    directions = normalised(np.random.default_rng(1).normal(size=(200_000, 3)))
    cosine = np.maximum(directions @ up, 0)[:, None]
    truth = 4 * np.pi * (cosine * truth_along(point, directions)).mean(axis=0)
    # The same rays, so that what differs is the place and not their chance.
    found = 4 * np.pi * (cosine * Arriving(baked).along(point, directions)).mean(axis=0)
    assert np.allclose(found, truth, rtol=0.03)
    # And as its lamps and its glow give it.
    assert np.allclose(rl.renderers.place_irradiance(baked, point[None], up[None])[0], truth, rtol=0.05)


def test_the_lamp_becomes_a_light_where_it_is(baked):
    found = rl.renderers.place_lights(baked)
    lamp = found.lights[0]
    assert np.allclose(lamp.position, [1, 3, 0], atol=0.04)
    assert np.allclose(lamp.towards, [0, -1, 0], atol=1e-6)
    assert np.allclose(sorted(lamp.size), [0.6, 0.8], rtol=0.05)
    # Its blurred rim stays in the texture, and the two together send out what was there.
    power = np.prod(lamp.size) * np.array(lamp.radiance)
    assert 0.85 < power[1] / (0.48 * place.LAMP) < 1
    sent, left = (
        sum(part.radiance[part.used].sum(axis=0, dtype=float) * part.texel**2 for part in each.parts)
        for each in (baked, found.residual)
    )
    assert np.allclose(
        left + sum(np.prod(each.size) * np.array(each.radiance) for each in found.lights), sent, rtol=1e-4
    )


def test_faces_turn_to_who_sees_them():
    # The same room with its walls' triangles the wrong way round shines inwards all the same.
    turned = tuple(map(place.seen_from_behind, place.meshes()))
    baked = rl.renderers.bake(turned, place.photographs(2), texel=0.1)
    up = Arriving(baked).along(np.array([0.0, 1.5, 1.0]), np.array([[0.0, 0, -1], [0, -1, 0]]))
    assert np.all(up > 0.01)


def test_a_floor_that_takes_light_reflects_what_made_it_look_so():
    # Every wall shines with 1 and the floor with 0.3: under π of irradiance that is a reflectance of 0.3.
    walls, floor = place.box((-3, 0, -2.5), (3, 3, 2.5), "walls", inward=True), place.flat_floor()
    camera = place.camera((0, 1.5, 2.4), (0, 0, 0), focal_length=40.0)
    on = RayCaster.of((walls, floor)).nearest(camera.position, camera.rays().reshape(-1, 3)).shape.reshape(120, 160)
    shown = np.repeat(np.where(on == 1, 0.3, 1.0)[..., None], 3, axis=-1).astype(np.float32)
    photograph = rl.renderers.ProjectedPhotograph(camera, rl.RadianceMap(shown))
    baked = rl.renderers.bake((walls, floor), [photograph], texel=0.1)
    meshes: Any = rl.renderers.receiving(baked, ["floor"], rays=256)
    shining, receiving = meshes
    assert shining.material.emits and receiving.name == "floor"
    assert np.isclose(np.median(receiving.material.reflectance), 0.3, rtol=0.02)


def test_a_sunlit_patch_of_a_floor_that_takes_light_is_no_lamp_right_before_it():
    # A ridge of 6 cm beside six sunlit square metres of the same floor. A lamp there, of which 64 spots are looked at,
    # lights places a hand's breadth from a spot several times as much as those between.
    walls, floor = place.box((-3, -0.5, -2.5), (3, 3, 2.5), "walls", inward=True), place.ridged_floor()
    camera = place.camera((-1.2, 2.9, 0.01), (-1, 0, 0), focal_length=50.0)
    rays = camera.rays().reshape(-1, 3)
    hits = RayCaster.of((walls, floor)).nearest(camera.position, rays)
    x, _, z = (camera.position + hits.distance[:, None] * rays).T
    sunlit = (x > -2.15) & (x < -0.15) & (np.abs(z) < 1.5)
    shown = np.where(hits.shape == 1, np.where(sunlit, 12.0, 0.3), 1.0).reshape(120, 160, 1)
    photograph = rl.renderers.ProjectedPhotograph(camera, rl.RadianceMap(np.repeat(shown, 3, axis=-1).astype("f4")))
    baked = rl.renderers.bake((walls, floor), [photograph], texel=0.05)
    with pytest.warns(UserWarning, match="of 'floor' would reflect more than the light it gets"):
        meshes: Any = rl.renderers.receiving(baked, ["floor"], rays=256)
    part, image = baked.parts[1], meshes[1].material.reflectance
    slope = (part.points[..., 0] > -0.13) & (part.points[..., 0] < -0.02) & (np.abs(part.points[..., 2]) < 0.3)
    found = image[part.used & part.seen & slope]
    assert len(found) > 30 and found.min() > 0.8 * np.median(found)


def test_a_bright_spot_that_is_left_out_is_glow(baked):
    # The spot alone, looked at from below: as a rectangle of light or as a part of the room it gives the same.
    assert not rl.renderers.place_lights(baked, leave_out=["room"]).lights
    point, up = np.array([[1.0, 1.0, 0.1]]), np.array([[0.0, 1.0, 0.0]])
    lamp = rl.renderers.place_irradiance(baked, point, up, 4096)
    glow = rl.renderers.place_irradiance(baked, point, up, 4096, leave_out=["room"])
    np.testing.assert_allclose(glow, lamp, rtol=0.05)


def test_what_cannot_be_baked_is_refused(baked):
    taken = place.photographs(1, width=16, height=12, focal_length=8.5)
    with pytest.raises(ValueError, match="no meshes"):
        rl.renderers.bake((), taken)
    with pytest.raises(ValueError, match="no photographs"):
        rl.renderers.bake(place.meshes(), ())
    far = place.box((50, 0, 50), (51, 1, 51), "far")
    with pytest.raises(ValueError, match="no photograph shows any"):
        rl.renderers.bake(
            (far,),
            [
                rl.renderers.ProjectedPhotograph(
                    place.camera((0, 1, 0), (-5, 1, 0), width=16, height=12),
                    rl.RadianceMap(np.ones((12, 16, 3), np.float32)),
                )
            ],
        )
    with pytest.raises(ValueError, match="no mesh 'ceiling'; it has room, block, bench"):
        rl.renderers.receiving(baked, ["ceiling"])
    with pytest.raises(ValueError, match="lights of the place are 0"):
        rl.renderers.place_lights(baked, 0)


@pytest.mark.parametrize("size", [(0.9, 0.9), (1.2, 0.5)], ids=["square", "oblong"])
# What turns go wrong by lies at the edges' own direction, at the diagonals' and between.
@pytest.mark.parametrize("turn", [0.0, 30.0, 45.0, *(pytest.param(t, marks=pytest.mark.slow) for t in (10.0, 70.0))])
def test_a_lamp_lies_along_its_own_edges(size, turn):
    # Four edges of a square bring their directions back every 90°, those of its diagonals lie 45° between them.
    angle = np.radians(turn)
    along, across = np.array([np.cos(angle), 0, np.sin(angle)]), np.array([-np.sin(angle), 0, np.cos(angle)])

    def radiance(at):
        away = at - [0.4, 3.0, -0.3]
        inside = (abs(away @ along) < size[0] / 2) & (abs(away @ across) < size[1] / 2) & (at[:, 1] > 2.99)
        return np.where(inside, 60.0, 0.5)

    walls = place.painted(place.box((-3, 0, -2.5), (3, 3, 2.5), "walls", inward=True), radiance, 0.03, 2048)
    (lamp,) = rl.renderers.place_lights(place_of([walls])).lights
    assert np.allclose(lamp.position, [0.4, 3.0, -0.3], atol=0.02)
    np.testing.assert_allclose(sorted(lamp.size), sorted(size), rtol=0.03)
    # One way along or across it; of the oblong one the long side lies along.
    off = np.degrees(np.arcsin(abs(lamp.frame[:, 0] @ across)))
    assert (min(off, 90 - off) if size[0] == size[1] else off) < 2.0
