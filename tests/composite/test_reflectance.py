"""Un-lighting: photographs rendered from known surfaces give them back."""

from dataclasses import replace

import numpy as np
import pytest

from relume.composite.surface import by_rows, reflectance
from relume.composite.surface.clean_pixels import filled_in, trustworthy
from relume.composite.surface.gloss import Gloss, glossy
from relume.composite.surface.projection import box_mesh
from relume.composite.surface.recovery import ConstantAlbedo, KnownMaterial, RecoveredLocal, Recovery
from relume.composite.surface.reflectance import _Work, recover_reflectance
from relume.image import bands, resizing
from relume.image.radiance import SATURATED, RadianceMap
from relume.renderers.mitsuba.path_tracer import Mitsuba
from relume.renderers.raytrace.raycast import RayCaster
from relume.scene.cameras.camera import Camera, reprojected, undistorted
from relume.scene.cameras.distortion import Distortion
from relume.scene.materials.materials import Diffuse
from relume.scene.scene import Box, Scene
from relume.scene.shapes.shapes import Mesh, Plane
from relume.sphere.environment_map import EnvironmentMap
from relume.sphere.mappings.mapping import LatLong, pixel_directions

CAMERA = Camera.looking_at(np.array([0.1, 0.6, 1.2]), np.zeros(3), width=96, height=64, focal_length=90.0)
QUICK = Mitsuba(samples=64, depth=6)
ROUGH = Mitsuba(samples=16, depth=2)
"""For a lone plane, that sees none of itself, where a few per cent of noise do not matter."""
BARE = Plane(Diffuse((0.5, 0.5, 0.5)), (1.7, 1.0))


def light(strength: float = 1.0) -> EnvironmentMap:
    up = pixel_directions(LatLong(), 32)[..., 1:2]
    return EnvironmentMap((strength * np.array([1.0, 0.9, 0.7]) * (1 + 0.6 * up)).astype(np.float32))


def striped() -> Mesh:
    """The table with stripes of two albedos, as a mesh with its own texture."""
    image = np.where(((np.arange(128) // 16) % 2 == 0)[None, :, None], [0.6, 0.4, 0.2], [0.3, 0.25, 0.15])
    x, z = 0.85, 0.5
    vertices = np.array([[-x, 0, z], [x, 0, z], [x, 0, -z], [-x, 0, -z]], np.float32)
    uv = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], np.float32)
    faces = np.array([[0, 1, 2], [0, 2, 3]], np.int32)
    picture = np.broadcast_to(image, (4, 128, 3)).astype(np.float32)
    return Mesh(vertices, faces, Diffuse(np.ascontiguousarray(picture)), None, uv)


def photograph(scene: Scene, samples: int = 128) -> RadianceMap:
    return RadianceMap(Mitsuba(samples=samples, depth=6).render(scene, CAMERA, seed=77).radiance)


def expected_stripes(camera: Camera = CAMERA) -> tuple[np.ndarray, np.ndarray]:
    """The albedo at pixel centres and where it is even for two pixels round about."""
    rays = camera.rays()
    points = camera.position + (-camera.position[1] / rays[..., 1])[..., None] * rays
    column = (points[..., 0] / 1.7 + 0.5) * 128 / 16
    on = (np.abs(points[..., 0]) < 0.75) & (np.abs(points[..., 2]) < 0.3) & (rays[..., 1] < 0)
    truth = np.where((np.floor(column) % 2 == 0)[..., None], [0.6, 0.4, 0.2], [0.3, 0.25, 0.15])
    return truth, on & (np.abs(column - np.round(column)) > 0.3)


@pytest.fixture(scope="module")
def room() -> Scene:
    return Scene(light(), (BARE,), distant=Box((-2, -0.5, -2), (2, 2, 2)), probe=(0.0, 0.05, 0.0))


@pytest.fixture(scope="module")
def stripes(room: Scene) -> tuple[RadianceMap, RecoveredLocal]:
    plate = photograph(room.with_local([striped()]))
    return plate, recover_reflectance(plate, CAMERA, room, [Recovery()], renderer=QUICK)


def test_a_patterned_plane_gives_its_pattern_back(stripes):
    truth, sure = expected_stripes()
    _, found = stripes
    assert sure.sum() > 500
    error = np.abs(found.albedo - truth)[sure] / truth[sure]
    assert np.median(error) < 0.02 and np.percentile(error, 95) < 0.08
    assert np.abs((found.albedo[sure] / truth[sure]).mean(0) - 1).max() < 0.01
    assert found.iterations == 1 and found.notes == ()
    surface = found.surfaces[0]
    assert surface.gloss is None and len(surface.shapes) == 2
    assert surface.reflectance is not None and 0.3 < surface.reflectance[0] < 0.6


def test_the_model_without_objects_is_the_photograph(stripes, room):
    plate, found = stripes
    _, sure = expected_stripes()
    assert found.without[sure] == pytest.approx(plate.radiance[sure], rel=1e-4)
    # Rendered anew from the shapes, not only computed: within the renderer's noise and the texture's pixels.
    again = Mitsuba(samples=64, depth=6).render(room.with_local(found.shapes), CAMERA, seed=3).radiance
    ratio = again[sure] / plate.radiance[sure]
    assert np.abs(ratio.mean(0) - 1).max() < 0.01
    assert np.percentile(np.abs(ratio - 1), 95) < 0.12


def test_a_lens_that_bends_gives_the_same_pattern_back(room):
    near = Camera.looking_at(np.array([0.05, 0.45, 0.5]), np.zeros(3), width=96, height=64, focal_length=60.0)
    bent = replace(near, distortion=Distortion(-0.2, 0.02))
    straight = undistorted(bent)
    seen = Mitsuba(samples=128, depth=6).render(room.with_local([striped()]), straight, seed=77).radiance
    plate = RadianceMap(np.nan_to_num(reprojected(seen, straight, bent)))
    found = recover_reflectance(plate, bent, room, [Recovery()], renderer=QUICK)
    truth, sure = expected_stripes(bent)
    assert sure.sum() > 500
    # A pinhole in its place would have stripes beside their pixels.
    assert np.abs((found.albedo[sure] / truth[sure]).mean(0) - 1).max() < 0.02
    assert np.median(np.abs(found.albedo - truth)[sure] / truth[sure]) < 0.03
    flat, _ = expected_stripes(near)
    assert np.mean(np.abs(flat - truth)[sure].max(-1) > 0.05) > 0.02


# slow: of a smaller picture [3000] the same break goes red.
@pytest.mark.parametrize("pixels", [pytest.param(reflectance.FINE, marks=pytest.mark.slow), 3000])
def test_surfaces_that_light_one_another_are_iterated_until_the_light_stays(monkeypatch, pixels):
    """A bright red wall on the table reddens it: dividing once would give the table its colour.

    pixels : of the model's renders, at most; of a plate twice as large they show a smaller one
    """
    monkeypatch.setattr(reflectance, "FINE", pixels)
    wall = box_mesh((-0.6, 0.0, -0.45), (0.6, 0.5, -0.4), Diffuse((0.5, 0.5, 0.5)), "wall")
    table, paint = Diffuse((0.7, 0.7, 0.7)), Diffuse((0.85, 0.1, 0.1))
    room = Scene(light())
    scene = room.with_local([BARE, wall])
    truth = room.with_local([replace(BARE, material=table), replace(wall, material=paint)])
    plate = photograph(truth)
    found = recover_reflectance(plate, CAMERA, scene, [Recovery(), Recovery(ConstantAlbedo())], renderer=QUICK)
    assert 2 <= found.iterations < 8 and found.change < 0.005
    assert found.surfaces[0].reflectance == pytest.approx((0.7, 0.7, 0.7), rel=0.02)
    assert found.surfaces[1].reflectance == pytest.approx((0.85, 0.1, 0.1), rel=0.03)
    assert len(found.surfaces[1].shapes) == 2 and not isinstance(found.surfaces[1].shapes[0].material, np.ndarray)
    # What one of them receives does not bleed into the other where it hides it.
    rays = CAMERA.rays()
    parts = RayCaster.of([BARE, wall]).nearest(CAMERA.position, rays.reshape(-1, 3)).shape.reshape(64, 96)
    # The table alone shows the plate's own pixels; the wall is one colour.
    assert np.array_equal(found.textured, parts == 0)
    for part in (0, 1):
        sure = trustworthy(parts == part, None)
        error = np.abs(found.without[sure] / plate.radiance[sure] - 1)
        assert np.percentile(error, 90) < 0.1


def test_a_given_surface_stays_and_what_is_clipped_is_filled_from_beside(room):
    truth = replace(BARE, material=Diffuse((0.4, 0.3, 0.2)))
    plate = photograph(room.with_local([truth]), 32)
    clipped = np.zeros((64, 96), np.uint8)
    clipped[30:40, 40:50] = SATURATED
    radiance = plate.radiance.copy()
    radiance[clipped > 0] = 99.0
    found = recover_reflectance(RadianceMap(radiance, None, clipped), CAMERA, room, [Recovery()], renderer=ROUGH)
    assert found.albedo[clipped > 0] == pytest.approx(np.broadcast_to([0.4, 0.3, 0.2], (100, 3)), rel=0.05)
    kept = recover_reflectance(plate, CAMERA, room.with_local([truth]), [Recovery(KnownMaterial())], renderer=ROUGH)
    assert kept.shapes == (truth,) and kept.surfaces[0].reflectance is None


def test_an_albedo_above_one_is_reported_with_its_place(room):
    truth = replace(BARE, material=Diffuse((0.8, 0.5, 0.5)))
    plate = photograph(room.with_local([truth]), 32)
    dim = replace(room, light=light(0.5))
    with pytest.warns(
        UserWarning, match=r"albedo of local surface 1 .* above 1, up to 1\.[5-9]\d, in \d+ pixels .*x \d"
    ):
        found = recover_reflectance(plate, CAMERA, dim, [Recovery()], renderer=ROUGH)
    measured = found.surfaces[0].measured
    assert measured is not None and measured[0] == pytest.approx(1.6, rel=0.03)
    assert found.albedo.max() <= 1


def test_a_few_pixels_of_another_thing_are_noted_and_not_warned_of(stripes, room):
    """Some 4 % of the table show something that shines on it."""
    plate, _ = stripes
    radiance = plate.radiance.copy()
    radiance[30:40, 40:52] = 20
    (note,) = recover_reflectance(RadianceMap(radiance), CAMERA, room, [Recovery()], renderer=ROUGH).notes
    assert "local surface 1 ('plane') comes out above 1, up to" in note
    assert "in 120 pixels (4." in note and "within x 40–51, y 30–39" in note


@pytest.mark.slow
def test_what_is_darker_than_the_gloss_is_noted_where_it_is_little_and_warned_of_where_it_is_much(room):
    table = glossy((0.4, 0.3, 0.2), Gloss(0.04, 0.6))
    radiance = photograph(room.with_local([replace(BARE, material=table)]), 64).radiance.copy()
    radiance[30:40, 40:52] = 0
    wanted = [Recovery(gloss=Gloss(0.04, 0.6))]
    found = recover_reflectance(RadianceMap(radiance), CAMERA, room, wanted, renderer=QUICK)
    (note,) = found.notes
    assert "local surface 1 ('plane') comes out below 0, in 120 pixels (4." in note
    assert "within x 40–51, y 30–39" in note and "something stands there, or is reflected there" in note
    assert np.all(found.albedo[32:38, 42:50] == 0)
    radiance[30:50, 30:66] = 0
    with pytest.warns(UserWarning, match="comes out below 0, in 720 pixels"):
        recover_reflectance(RadianceMap(radiance), CAMERA, room, wanted, renderer=QUICK)


def test_no_light_no_view_and_wrong_numbers_are_refused(room):
    plate = RadianceMap(np.ones((64, 96, 3), np.float32))
    below = pixel_directions(LatLong(), 32)[..., 1:2] < -0.1
    from_below = EnvironmentMap(np.where(below, [1.0, 1.0, 1.0], 0).astype(np.float32))
    with pytest.raises(ValueError, match="no light arrives at local surface 1"):
        recover_reflectance(plate, CAMERA, replace(room, light=from_below), [Recovery()], renderer=ROUGH)
    away = Camera.looking_at(np.array([0.0, 0.6, 0.0]), np.array([0, 2.0, 1.0]), width=96, height=64, focal_length=90.0)
    with pytest.raises(ValueError, match="the camera sees 0 measured pixels"):
        recover_reflectance(plate, away, room, [Recovery()], renderer=ROUGH)
    with pytest.raises(ValueError, match="0 choices for 1 local surfaces"):
        recover_reflectance(plate, CAMERA, room, [], renderer=ROUGH)


def test_pixels_at_outlines_are_not_trusted_and_are_filled_from_their_own_surface():
    shown = np.zeros((20, 30), bool)
    shown[5:, :15] = True
    sure = trustworthy(shown, None)
    assert sure[7:, :13].all() and sure.sum() == 13 * 13
    parts = np.where(shown, 0, 1)
    values = np.where((parts == 0)[..., None], [0.2, 0.4, 0.6], [0.9, 0.8, 0.7]).astype(np.float32)
    known = sure | trustworthy(~shown, None)
    spoiled = np.where(known[..., None], values, 5.0).astype(np.float32)
    assert filled_in(spoiled, known, parts) == pytest.approx(values, abs=1e-5)


def test_a_surface_too_thin_for_the_small_render_gets_the_light_beside_it() -> None:
    work = object.__new__(_Work)
    work.smaller, work.apart = True, True
    work.parts = np.zeros((8, 12), np.int32)
    work.whole = np.zeros((80, 120), np.int32)
    work.whole[:, 55] = 1
    light = work.enlarged(np.full((8, 12, 3), 2.0, np.float32), np.ones((8, 12), bool))
    np.testing.assert_allclose(light[:], 2.0, rtol=1e-5)


@pytest.mark.parametrize("constant", [False, True])
def test_a_large_plate_by_rows_has_the_bits_of_one_at_once(monkeypatch, constant):
    """Two surfaces, whose light is iterated, at a plate larger than its renders; of the same renders."""
    wall = box_mesh((0.1, 0.0, -0.4), (0.7, 0.4, -0.3), Diffuse((0.6, 0.1, 0.1)), name="wall")
    scene = Scene(light(), (BARE, wall), distant=Box((-2, -0.5, -2), (2, 2, 2)), probe=(0.0, 0.05, 0.0))
    plate = photograph(scene, 16)
    wanted = [Recovery(ConstantAlbedo() if constant else Recovery().albedo, Gloss(0.04, 0.6)), Recovery()]
    monkeypatch.setattr(reflectance, "FINE", 3000)
    found = []
    for pixels in (bands.BAND, 96 * 7):
        for module in (bands, by_rows, reflectance, resizing):
            monkeypatch.setattr(module, "BAND", pixels)
        found.append(recover_reflectance(plate, CAMERA, scene, wanted, renderer=ROUGH))
    one, two = found
    assert one.iterations == two.iterations > 1 and one.change == two.change > 0
    for name in ("albedo", "without", "irradiance", "textured"):
        np.testing.assert_array_equal(getattr(one, name), getattr(two, name), err_msg=name)


def test_a_change_by_rows_is_that_of_the_whole(monkeypatch):
    random = np.random.default_rng(1)
    after, before = (random.random((300, 41, 3)).astype(np.float32) for _ in range(2))
    chosen = random.random((300, 41)) < 0.7
    monkeypatch.setattr(by_rows, "BAND", 41 * 7)
    moved = np.abs(after - before)[chosen].mean(0) / before[chosen].mean(0)
    assert by_rows.change_as_share(after, before, chosen) == moved.max()
