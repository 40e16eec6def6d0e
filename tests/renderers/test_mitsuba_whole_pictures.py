"""Whole pictures by relume's transport: the bits of differential rendering, lenses, lamps, motion, and denoising."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from lights import constant
from relume.errors import Interrupted, UnsupportedScene
from relume.renderers.mitsuba.denoise import denoised_render
from relume.renderers.mitsuba.differential import Differential
from relume.renderers.mitsuba.path_tracer import Mitsuba
from relume.renderers.progressive.accumulation import RenderSession
from relume.renderers.whitted.whitted import Whitted
from relume.scene.cameras.camera import Camera
from relume.scene.cameras.distortion import Distortion
from relume.scene.lights import PointLight, RectangleLight, SphereLight
from relume.scene.materials.materials import Diffuse, Material
from relume.scene.motion.keyframes import Shutter
from relume.scene.scene import Box, Scene
from relume.scene.shapes.shapes import Plane, Sphere
from relume.sphere.environment_map import EnvironmentMap

pytestmark = pytest.mark.usefixtures("mi")
BLACK = EnvironmentMap(np.zeros((4, 8, 3), np.float32))
FLOOR = Plane(Diffuse((0.7, 0.5, 0.3)), (4.0, 4.0))
CAMERA = Camera.looking_at(np.array([0, 1.1, 2.6]), np.array([0.1, 0.15, 0]), width=36, height=24, focal_length=33)
LAMPS = (
    PointLight((1.0, 1.5, 0.3), (3.0, 3.0, 3.0)),
    RectangleLight((0.0, 1.6, -1.0), (0.0, -1.0, 0.7), (0.5, 0.3), (5.0, 5.0, 9.0)),
    SphereLight((-0.8, 1.5, 0.4), 0.1, (40.0, 34.0, 28.0)),
)
GLASS = Material(roughness=0.0, transmission=1.0)
PLASTIC = Material((0.5, 0.6, 0.7), roughness=0.3)
MILK = replace(GLASS, ior=1.33, scattering_distance=(0.1, 0.1, 0.1), scattering_albedo=(0.9, 0.8, 0.7))


def ball(material: Material, x: float = 0.0) -> Sphere:
    return Sphere((x, 0.4, 0.0), 0.35, material)


def sky() -> EnvironmentMap:
    light = np.full((8, 16, 3), 0.3, np.float32)
    light[2, 3] = 40.0
    return EnvironmentMap(light)


def scene() -> Scene:
    """Glass, plastic and milk in a room with lamps of all kinds."""
    balls = (ball(GLASS, -0.7), ball(PLASTIC), ball(MILK, 0.7))
    return Scene(sky(), (FLOOR,), balls, LAMPS, Box((-3, -1, -3), (3, 3, 3)), (0.0, 0.4, 0.0))


def test_where_objects_fill_a_pixel_render_and_change_have_the_same_bits():
    change = Differential(8).change(scene(), CAMERA, seed=3)
    # A change has fewer and larger passes: as many of the same size.
    whole = replace(Mitsuba(16), passes=change.passes).render(scene(), CAMERA, seed=3)
    assert (whole.samples, whole.passes) == (change.samples, change.passes)
    assert np.array_equal(whole.matte, change.matte)
    # Lamps before the object are in the whole picture alone.
    filled = change.matte == 1
    assert filled.sum() > 100
    assert np.array_equal(whole.radiance[filled], change.objects[filled])
    for name in ("normal", "albedo", "guide_normal"):
        assert np.array_equal(getattr(whole, name)[filled], getattr(change, name)[filled])


def test_a_lens_bends_and_blurs_what_is_seen():
    black = Scene(constant(8, (1, 1, 1)), objects=(Sphere((0.0, 0.0, 0.0), 0.5, Diffuse((0.0, 0.0, 0.0))),))
    plain = Camera(32, 32, 64.0, np.array([0, 0, 3.0]), np.eye(3))
    straight, barrel = (
        Mitsuba(16).render(black, replace(plain, distortion=each)).matte.sum() for each in (None, Distortion(-0.9))
    )
    # k1·r²: a ball of half a metre 3 m away is seen smaller.
    assert barrel < 0.96 * straight
    blurred = Mitsuba(16).render(black, replace(plain, aperture=0.3, focus=1.0, centre=(15.0, 17.0))).matte
    assert ((blurred > 0.05) & (blurred < 0.95)).mean() > 0.2


def test_a_rectangle_lights_a_floor_as_its_area_and_the_cosines_have_it():
    lamp = RectangleLight((0.3, 2.0, -0.2), (0.0, -1.0, 0.0), (0.02, 0.04), (500.0, 1000.0, 250.0))
    camera = Camera.looking_at(np.array([0.1, 1.0, 1.0]), np.array([0.0, 0, 0]), width=2, height=2, focal_length=2000)
    found = Mitsuba(16).render(Scene(BLACK, (FLOOR,), lights=(lamp,)), camera).radiance.mean((0, 1))
    square = 0.3**2 + 2.0**2 + 0.2**2
    # Both cosines are 2 m over the distance.
    expected = np.array([0.7, 0.5, 0.3]) / np.pi * np.array(lamp.radiance) * 0.0008 * 4 / square**2
    np.testing.assert_allclose(found, expected, rtol=5e-3)
    assert found[1] == pytest.approx(0.02986, rel=0.01)


@pytest.mark.parametrize("variant", [None, "scalar_rgb"])
def test_a_rectangle_is_seen_from_before_and_not_from_behind(variant):
    lamp = RectangleLight((0.0, 0.0, -1.0), (0.0, 0.0, 1.0), (0.5, 0.25), (3.0, 2.0, 1.0))
    camera = Camera(16, 16, 16.0, np.zeros(3), np.eye(3))
    seen = Mitsuba(16, variant=variant).render(Scene(BLACK, lights=(lamp,)), camera).radiance
    np.testing.assert_allclose(seen.mean((0, 1)), np.array(lamp.radiance) * 0.5 * 0.25, rtol=0.02)
    np.testing.assert_allclose(seen[6:10, 4:12], np.broadcast_to(lamp.radiance, (4, 8, 3)), rtol=1e-6)
    away = replace(lamp, towards=(0.0, 0.0, -1.0))
    assert Mitsuba(16, variant=variant).render(Scene(BLACK, lights=(away,)), camera).radiance.max() == 0


def test_others_refuse_a_rectangle_in_one_line():
    with pytest.raises(UnsupportedScene, match="rectangle") as caught:
        Whitted().render(Scene(BLACK, (FLOOR,), lights=LAMPS[1:2]), CAMERA)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("given", "line"),
    [
        ({"size": (0.0, 1.0)}, "size of a rectangle"),
        ({"towards": (0.0, 0.0, 0.0)}, "point somewhere"),
        ({"radiance": (1.0, -1.0, 0.0)}, "radiance of a rectangle"),
    ],
)
def test_a_rectangle_that_cannot_be_is_refused(given, line):
    with pytest.raises(ValueError, match=line):
        replace(LAMPS[1], **given)


def test_a_lamp_that_faces_along_its_up_has_a_frame():
    frame = RectangleLight((0.0, 2.0, 0.0), (0.0, -2.0, 0.0), (1.0, 1.0), (1.0, 1.0, 1.0)).frame
    np.testing.assert_allclose(frame.T @ frame, np.eye(3), atol=1e-12)
    np.testing.assert_allclose(frame[:, 2], [0, -1, 0])
    assert np.linalg.det(frame) == pytest.approx(1)


def test_nothing_but_light_is_a_picture_too():
    camera = Camera(4, 4, 4.0, np.zeros(3), np.eye(3))
    found = Mitsuba(4).render(Scene(constant(8, (1.0, 2.0, 3.0))), camera)
    np.testing.assert_allclose(found.radiance, np.broadcast_to([1.0, 2.0, 3.0], (4, 4, 3)), rtol=1e-6)
    assert found.matte.max() == found.depth.max() == 0


# --- motion ----------------------------------------------------------------------------------------------------------

BRIGHT = Diffuse((0.8, 0.8, 0.8))
SIDE = Camera(32, 8, 32.0, np.array([0, 0.4, 3.0]), np.eye(3))


def moment(time: float) -> tuple[Scene, Camera]:
    """A ball that moves by a metre in a frame's time."""
    return Scene(constant(8, (1, 1, 1)), objects=(Sphere((time, 0.4, 0.0), 0.2, Diffuse((0.0, 0.0, 0.0))),)), SIDE


def test_what_moves_while_the_shutter_is_open_is_blurred():
    world, camera = moment(0.0)
    still = Mitsuba(64).render(world, camera, seed=1)
    moved = Mitsuba(64).render(world, camera, seed=1, moments=moment, shutter=Shutter(-0.5, 0.5))
    # As much is covered, over a longer way: 0.4 m and 1.4 m of it.
    assert moved.matte.sum() == pytest.approx(still.matte.sum(), rel=0.1)
    widths = [(found.matte[4] > 0.02).sum() for found in (still, moved)]
    assert widths[1] > 2 * widths[0]
    differential = Differential(64).change(world, camera, seed=1, moments=moment, shutter=Shutter(-0.5, 0.5))
    assert np.array_equal(moved.matte, differential.matte)


def test_a_moved_camera_blurs_too_and_a_still_one_changes_no_bit():
    def panned(time: float) -> tuple[Scene, Camera]:
        return moment(0.0)[0], replace(SIDE, position=np.array([time, 0.4, 3.0]))

    world, camera = moment(0.0)
    still = Mitsuba(32).render(world, camera, seed=1)
    blurred = Mitsuba(32).render(world, camera, seed=1, moments=panned, shutter=Shutter(-0.5, 0.5))
    assert (blurred.matte[4] > 0.02).sum() > 2 * (still.matte[4] > 0.02).sum()
    same = Mitsuba(32).render(world, camera, seed=1, moments=lambda time: (world, camera), shutter=Shutter(-0.5, 0.5))
    assert np.array_equal(same.radiance, still.radiance)


def test_a_motion_that_was_stopped_goes_on_with_the_same_bits(tmp_path):
    world, camera = moment(0.0)
    whole = Mitsuba(64).render(world, camera, seed=1, moments=moment, shutter=Shutter(-0.5, 0.5))
    watch = RenderSession(checkpoint=tmp_path / "state.npz")

    def stop(share: float) -> None:
        if share > 0.4:
            raise Interrupted(1, 2, 2, None)

    with pytest.raises(Interrupted):
        Mitsuba(64).render(
            world, camera, seed=1, progress=stop, watch=watch, moments=moment, shutter=Shutter(-0.5, 0.5)
        )
    resumed = Mitsuba(64).render(world, camera, seed=1, watch=watch, moments=moment, shutter=Shutter(-0.5, 0.5))
    assert np.array_equal(resumed.radiance, whole.radiance)


# --- denoising -------------------------------------------------------------------------------------------------------


def test_a_denoised_picture_is_nearer_to_the_truth_and_as_bright():
    camera = CAMERA.resized(48, 32)
    few, truth = Mitsuba(8).render(scene(), camera, seed=1), Mitsuba(96, passes=4).render(scene(), camera, seed=2)
    clean = denoised_render(few)
    noise, left = (np.abs(found.radiance - truth.radiance).mean() for found in (few, clean))
    assert left < 0.5 * noise
    np.testing.assert_allclose(clean.radiance.mean(), few.radiance.mean(), rtol=0.02)
    assert clean.radiance.min() >= 0
    assert clean.matte is few.matte
    # What glass shows guides it.
    blind = denoised_render(replace(few, guide_albedo=None, guide_normal=None))
    assert not np.array_equal(blind.radiance, clean.radiance)


def test_a_scalar_variant_names_what_it_loses_and_refuses_a_medium_between_bodies():
    from relume.scene.materials.media import Medium

    plain = Mitsuba(4, variant="scalar_rgb")
    shown = Scene(BLACK, (FLOOR,), (ball(replace(GLASS, name="lens")),), LAMPS[:1])
    camera = CAMERA.resized(6, 4)
    with pytest.warns(UserWarning, match="loses the light that points and suns send through 'lens'"):
        plain.render(shown, camera)
    with pytest.raises(UnsupportedScene, match="no medium between bodies") as caught:
        plain.render(replace(shown, medium=Medium((0.1, 0.1, 0.1))), camera)
    assert "\n" not in str(caught.value)
