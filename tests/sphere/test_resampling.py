"""Light moved between all mappings: energy, places and constants kept, nothing aliased, marks carried."""

from functools import lru_cache, partial

import numpy as np
import pytest

import relume.sphere.resampling.resampling as engine
from lights import WHOLE, lone
from relume.image.bands import in_threads
from relume.image.files import read_radiance
from relume.image.radiance import OUTSIDE, SATURATED
from relume.sphere.directions import normalised, rotation_about
from relume.sphere.environment_files import as_environment
from relume.sphere.environment_map import EnvironmentMap
from relume.sphere.mappings.cubes import CubeCross, Strip
from relume.sphere.mappings.discs import Angular, Fisheye, Hemispheres, MirrorBall
from relume.sphere.mappings.kernels import solid_angle
from relume.sphere.mappings.layouts import layout
from relume.sphere.mappings.mapping import LatLong, pixel_directions, pixel_points
from relume.sphere.mappings.perspective import perspective_view
from relume.sphere.mappings.squares import Octahedral
from relume.sphere.resampling import splatting as pushing

ROWS = {"cross": 96, "cross-vertical": 128, "strip": 32}
PAIRS = pytest.mark.parametrize(
    ("source", "target"), [(a, b) for a in WHOLE for b in WHOLE if a != b], ids=lambda m: m.name
)
EVERY = pytest.mark.parametrize("mapping", WHOLE, ids=lambda m: m.name)
ASKEW = rotation_about([1, 2, -0.5], 2.2)
SUN = normalised([0.5, 0.62, -0.31])


def rows(mapping, scale=1):
    return ROWS.get(mapping.name, 64) * scale


@lru_cache
def middles(mapping, size):
    """The mean direction of each pixel, by 8 × 8 cells, or 4 × 4 of small ones: (rows, columns, 3), shorter than 1."""
    cells = 8 if size < 256 else 4
    height, width = mapping.shape(size)
    towards = np.nan_to_num(mapping.directions(mapping.shown(pixel_points(mapping, size, cells))))
    weighted = towards * mapping.solid_angles(size * cells)[..., None]
    summed = weighted.reshape(height, cells, width, cells, 3).sum((1, 3))
    return summed / np.maximum(mapping.solid_angles(size), 1e-300)[..., None]


def of_directions(function, mapping=LatLong(), size=None):
    size = size or rows(mapping)
    values = np.where(mapping.solid_angles(size) > 0, function(middles(mapping, size)), 0)
    return EnvironmentMap(np.repeat(values[..., None], 3, axis=-1).astype(np.float32), mapping)


def noise(mapping, size=None, seed=3):
    random = np.random.default_rng(seed).random((*mapping.shape(size or rows(mapping)), 3), np.float32)
    return EnvironmentMap(random, mapping)


def with_a_sun(mapping=LatLong(), size=None, towards=SUN):
    """Noise of mean ½ and one pixel that gives most of the light."""
    light = noise(mapping, size)
    u, v = mapping.image_points(towards)
    height, width = mapping.shape(light.size)
    light.radiance[int(v * height), int(u * width)] = 5e4, 4e4, 3e4
    return light


def moment(light):
    flux = light.radiance.astype(np.float64) * light.mapping.solid_angles(light.size)[..., None]
    return np.einsum("hwk,hwc->ck", middles(light.mapping, light.size), flux)


def averaged(light, mapping, size, rotation, cells=16):
    """The slow twin: every target pixel's mean of 16 × 16 look-ups, by solid angle."""
    points = pixel_points(mapping, size, cells)
    towards = mapping.directions(points) @ rotation
    shown = ~np.isnan(towards[..., 0])
    weight = np.where(shown, mapping.solid_angles(size * cells), 0)[..., None]
    found = light.lookup(np.where(shown[..., None], towards, [0.0, 0.0, 1.0])) * weight
    height, width = mapping.shape(size)
    summed, whole = (a.reshape(height, cells, width, cells, -1).sum((1, 3)) for a in (found, weight))
    return summed / np.maximum(whole, 1e-300)


# --- kernels and mappings agree --------------------------------------------------------------------------------------


@EVERY
def test_kernels_know_the_solid_angles_of_the_mappings(mapping):
    size = rows(mapping)
    planes, table = layout(mapping, size).planes, mapping.solid_angles(size)
    numbers = planes.kind, planes.across, planes.down, planes.rows, planes.columns
    for origin in planes.origins:
        top, left = divmod(int(origin), planes.stride)
        for row in range(0, planes.rows, 5):
            found = [solid_angle(*numbers, row, column) for column in range(planes.columns)]
            # Where the rim of a hemisphere cuts a pixel, 16 nodes are sure of it to 1e-3 only.
            expected = table[top + row, left : left + planes.columns]
            np.testing.assert_allclose(found, expected, rtol=2e-5, atol=2e-5 * table.max())


@PAIRS
def test_smooth_light_is_the_same_light_in_every_mapping(source, target):
    def smooth(towards):
        return 2 + towards @ np.array([0.5, 0.7, -0.3]) + 0.4 * towards[..., 0] * towards[..., 1]

    size = rows(target)
    moved = of_directions(smooth, source).remapped(target, size)
    expected = of_directions(smooth, target)
    angles = target.solid_angles(size)
    error = np.abs(moved.radiance - expected.radiance)[..., 0]
    # Where a pixel is as narrow as most; a ball's rim and what is resampled from it are several degrees wide.
    assert np.median(error[angles > 0]) < 3e-3
    assert np.sum(error * angles) / (4 * np.pi) < 6e-3


@EVERY
def test_a_sun_is_found_where_the_mapping_says(mapping):
    size = rows(mapping, 2)
    moved = with_a_sun(size=128).remapped(mapping, size, ASKEW)
    found = np.argwhere(moved.radiance[..., 0] == moved.radiance[..., 0].max())[0]
    height, width = mapping.shape(size)
    u, v = (np.array(found[::-1]) + 0.5) / [width, height]
    assert mapping.directions(mapping.shown(np.array([u, v]))) @ ASKEW @ SUN > np.cos(np.radians(4))


def test_a_quarter_turn_and_a_mapping_put_a_lamp_into_the_pixels_worked_out_by_hand():
    radiance = np.zeros((32, 64, 3), np.float32)
    radiance[16, 32] = 1  # just right of and below −Z
    light = EnvironmentMap(radiance)
    # Right-handed about +Y takes −Z to −X: in an angular map that is half a radius left of the middle.
    turned = light.remapped(Angular(), 64, rotation_about([0, 1, 0], np.pi / 2))
    assert np.unravel_index(turned.radiance[..., 0].argmax(), (64, 64)) in [(31, 16), (32, 16), (32, 15), (31, 15)]
    strip = light.remapped(Strip(), 16, rotation_about([1, 0, 0], np.pi / 2))
    assert strip.radiance[..., 0].argmax() % 96 // 16 == 2  # about +X −Z goes to +Y, the third face


# --- what is kept ----------------------------------------------------------------------------------------------------


@PAIRS
def test_total_and_first_moment_are_kept_with_a_sun(source, target):
    light = with_a_sun(source)
    moved = light.remapped(target, rows(target), ASKEW)
    assert moved.total() == pytest.approx(light.total(), rel=3e-5)
    shift = np.linalg.norm(moment(moved) - moment(light) @ ASKEW.T, axis=1)
    # Turned askew the sun comes to the rim of a hemisphere, where a pixel of 64 rows is 14° wide.
    assert np.all(shift < (2e-2 if isinstance(target, Hemispheres) else 3e-3) * light.total())


@PAIRS
def test_constant_light_stays_constant(source, target):
    value = np.array([0.3, 1.7, 1e-5], np.float32)
    light = EnvironmentMap(np.broadcast_to(value, (*source.shape(rows(source)), 3)).copy(), source, "cd/m²")
    moved = light.remapped(target, rows(target), ASKEW)
    shown = target.solid_angles(rows(target)) > 0
    np.testing.assert_allclose(moved.radiance[shown], np.broadcast_to(value, (shown.sum(), 3)), rtol=4e-7)
    assert np.all(moved.radiance[~shown] == 0)
    assert moved.unit == "cd/m²"


@EVERY
def test_constant_light_stays_constant_in_another_size(mapping):
    light = EnvironmentMap(np.full((*mapping.shape(rows(mapping)), 3), 1.7, np.float32), mapping)
    moved = light.remapped(mapping, 2 * rows(mapping))
    shown = mapping.solid_angles(2 * rows(mapping)) > 0
    np.testing.assert_allclose(moved.radiance[shown], 1.7, rtol=4e-7)


@EVERY
def test_no_lone_pixel_is_lost_wherever_it_is(mapping):
    size = rows(mapping) // 2
    # A sliver of a disc whose middle lies beyond the rim is not looked up: it keeps what stands out only.
    places = np.argwhere(~np.isnan(mapping.directions(pixel_points(mapping, size))[..., 0]))
    for row, column in places[:: len(places) // 4]:
        radiance = np.zeros((*mapping.shape(size), 3), np.float32)
        radiance[row, column] = 8, 4, 2
        light = EnvironmentMap(radiance, mapping)
        for other in (LatLong(), MirrorBall(), Strip()):
            moved = light.remapped(other, rows(other), ASKEW)
            assert moved.total() == pytest.approx(light.total(), rel=2e-3)
            assert moved.radiance.min() >= 0


def test_eight_turns_of_45_degrees_keep_the_light():
    light = with_a_sun(size=128)
    turned, turn = light, rotation_about([1, 0.3, 0.2], np.pi / 4)
    for _ in range(8):
        turned = turned.remapped(LatLong(), 128, turn)
    assert turned.total() == pytest.approx(light.total(), rel=1e-5)
    assert np.all(np.linalg.norm(moment(turned) - moment(light), axis=1) < 1e-3 * light.total())


def test_what_stands_out_and_what_does_not_go_the_same_way(monkeypatch):
    light = of_directions(lambda d: 0.1 + np.exp(60 * (d @ SUN - 1)), size=64)
    plain = light.remapped(Angular(), 64, ASKEW)
    monkeypatch.setattr(engine, "STANDS_OUT", 2.0)
    monkeypatch.setattr(pushing, "KEPT", 0.0)
    pushed = light.remapped(Angular(), 64, ASKEW)
    assert not np.array_equal(plain.radiance, pushed.radiance)
    # Two filters of about the same width: the peak of 1.1 may differ by some per cent, the light as a whole not.
    difference = (plain.radiance - pushed.radiance) * Angular().solid_angles(64)[..., None]
    assert np.abs(plain.radiance - pushed.radiance).max() < 0.08
    assert np.abs(difference).sum() < 0.02 * light.total().sum()


def test_what_is_taken_out_near_a_pole_is_averaged_as_if_the_whole_map_had_been_copied():
    source = layout(LatLong(), 64)
    light = noise(LatLong(), 64).radiance.reshape(-1, 3).copy()
    suns = np.array([[0, 0, 5], [0, 3, 100], [0, 30, 9], [0, 60, 1], [0, 63, 127]])
    light[suns[:, 1] * 128 + suns[:, 2]] = 1000
    before, most, flux = light.copy(), np.full(3, 4.0, np.float32), np.ones((5, 3))
    deep = engine._deep(source)
    assert 3 < deep < 30
    whole, *_ = pushing.taken_out(source, light, most, suns, flux, 0)
    part, places, _ = pushing.taken_out(source, light, most, suns, flux, deep)
    np.testing.assert_array_equal(light, before, err_msg="the map that was given")
    np.testing.assert_array_equal(part[deep * 128 : -deep * 128], whole[deep * 128 : -deep * 128])
    assert whole.max() < 300 and len(places) == 5
    caps = engine._caps(light, part, places, deep, source)
    np.testing.assert_array_equal(caps, engine._caps(whole, whole, places[:0], deep, source))


@pytest.mark.parametrize("degrees", [12, 5])
@pytest.mark.parametrize("mapping", [Angular(), Strip(), Octahedral()], ids=lambda m: m.name)
def test_a_smooth_highlight_shows_no_moire(mapping, degrees):
    # 500 times its surroundings and as bright as a sky round the sun: pushed pixel by pixel, it would be off by 3–15 %.
    def glow(directions):
        return 0.1 + 50 * np.exp((directions @ SUN - 1) / np.radians(degrees) ** 2)

    size = 4 * rows(mapping) if mapping.name == "angular" else 2 * rows(mapping)
    found = of_directions(glow, size=256).remapped(mapping, size).radiance[..., 0]
    seen = mapping.solid_angles(size) > 1e-9
    error = np.abs(found - glow(pixel_directions(mapping, size)))[seen]
    assert np.percentile(error, 99.9) < 0.02 * 50


def test_pushed_light_does_not_speckle_a_pole():
    light = lone(64, 0, 0, value=1e4, dark=1.0)
    turned = light.remapped(Angular(), 96).remapped(LatLong(), 64).radiance
    # The sun stands beside the pole, so the row is not even, but no pixel differs from the next.
    assert np.abs(np.diff(turned[0, :, 0])).max() < 0.05 * turned[0, :, 0].max()
    assert turned.min() >= 0


# --- filtering -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("mapping", [Angular(), MirrorBall(), Strip(), Octahedral(), LatLong()], ids=lambda m: m.name)
def test_a_shrinking_map_is_averaged_over_areas_as_by_its_slow_twin(mapping):
    light = noise(LatLong(), 128)
    size = max(rows(mapping) // 4, 8)
    expected = averaged(light, mapping, size, ASKEW)
    found = light.remapped(mapping, size, ASKEW).radiance
    once = averaged(light, mapping, size, ASKEW, cells=1)
    whole = mapping.solid_angles(size) > 0.5 * np.median(mapping.solid_angles(size))
    error, without = (np.sqrt(np.mean((a - expected)[whole] ** 2)) for a in (found, once))
    assert error < 0.03  # of noise whose deviation is 0.29
    assert error < without / 6


def test_a_pattern_too_fine_for_the_target_leaves_no_pattern_behind():
    columns = np.arange(512)
    stripes = np.broadcast_to((columns % 2 * 1.0)[None, :, None], (256, 512, 3)).astype(np.float32)
    moved = EnvironmentMap(stripes).remapped(Angular(), 64)
    # Farther out an angular map's pixels are so narrow across their radius that they do show single stripes.
    inside = np.hypot(*np.moveaxis(pixel_points(Angular(), 64) - 0.5, -1, 0)) < 0.38
    assert np.abs(moved.radiance[inside] - 0.5).max() < 0.12
    assert np.std(moved.radiance[inside]) < 0.02


def test_a_growing_map_shows_no_edges_of_pixels():
    light = noise(LatLong(), 16)
    moved = light.remapped(LatLong(), 160, rotation_about([0, 1, 0], 0.01))
    steps = np.abs(np.diff(moved.radiance[40:120], axis=1)).max()
    assert steps < 0.15  # a bilinear slope of at most 1 a pixel is 0.1 a step; a pixel's edge would be up to 1


# --- threads, marks, parts -------------------------------------------------------------------------------------------


def test_the_result_does_not_depend_on_the_number_of_threads(monkeypatch):
    light = with_a_sun()
    several = light.remapped(CubeCross(), 192, ASKEW).radiance
    monkeypatch.setattr(engine, "in_threads", partial(in_threads, threads=1))
    assert np.array_equal(light.remapped(CubeCross(), 192, ASKEW).radiance, several)


def test_light_that_is_not_turned_is_the_very_light_and_whole_pixels_are_rolled():
    light = EnvironmentMap(noise(LatLong()).radiance, clipped=np.eye(64, 128, dtype=np.uint8))
    assert light.remapped(LatLong(), 64) is light
    turned = light.remapped(LatLong(), 64, rotation_about([0, 1, 0], 2 * np.pi * 5 / 128))
    assert np.array_equal(turned.radiance, np.roll(light.radiance, -5, axis=1))
    assert turned.clipped is not None
    assert np.array_equal(turned.clipped, np.roll(np.eye(64, 128, dtype=np.uint8), -5, axis=1))
    # A little more than that takes the long way to nearly the same.
    smooth = of_directions(lambda d: 2 + d @ SUN)
    rolled, turned = (smooth.remapped(LatLong(), 64, rotation_about([0, 1, 0], a + 0.09817477)) for a in (0, 1e-5))
    np.testing.assert_allclose(turned.radiance, rolled.radiance, rtol=5e-3)


@EVERY
def test_marks_travel_and_one_saturated_pixel_is_not_lost(mapping):
    marks = np.zeros((128, 256), np.uint8)
    marks[40, 70] = SATURATED
    marks[80:] = OUTSIDE
    light = EnvironmentMap(noise(LatLong(), 128).radiance, clipped=marks)
    size = max(rows(mapping) // 2, 16)
    moved = light.remapped(mapping, size)
    assert moved.clipped is not None
    towards = LatLong().directions(np.array([70.5 / 256, 40.5 / 128]))
    height, width = mapping.shape(size)
    u, v = mapping.image_points(towards)
    assert moved.clipped[int(v * height), int(u * width)] == SATURATED
    assert np.sum(moved.clipped == SATURATED) <= 9
    low = np.nan_to_num(mapping.directions(pixel_points(mapping, size)))[..., 1]
    full = mapping.solid_angles(size) > 0.5 * np.median(mapping.solid_angles(size))
    assert np.all(moved.clipped[full & (low < -0.6)] == OUTSIDE)
    assert np.all(moved.clipped[full & (low > 0.3)] != OUTSIDE)


def test_what_a_fisheye_does_not_show_is_black_and_marked():
    light = EnvironmentMap(np.full((64, 64, 3), 2, np.float32) * (Fisheye().solid_angles(64) > 0)[..., None], Fisheye())
    moved = light.remapped(LatLong(), 64)
    front = LatLong().directions(pixel_points(LatLong(), 64))[..., 2] < 0
    assert moved.clipped is not None
    assert np.all(moved.radiance[front] == 2)
    assert np.all(moved.radiance[~front] == 0)
    assert np.array_equal(moved.clipped == OUTSIDE, ~front)
    assert moved.total() == pytest.approx([4 * np.pi] * 3, rel=1e-3)
    back = moved.remapped(Fisheye(), 64)
    inside = np.hypot(*np.moveaxis(pixel_points(Fisheye(), 64) - 0.5, -1, 0)) < 0.48
    assert np.abs(back.radiance[inside] - 2).max() < 1e-6


def test_a_mapping_of_another_kind_is_refused():
    class Cylinder(LatLong):
        pass

    class Other:
        name = "other"
        shape, solid_angles = LatLong().shape, LatLong().solid_angles

    assert layout(Cylinder(), 8).planes.rows == 8
    with pytest.raises(ValueError, match="cannot be resampled"):
        layout(Other(), 8)  # pyright: ignore[reportArgumentType]


SUNRISE, GRACE = "hdri/spruit_sunrise/spruit_sunrise_1k.hdr", "probes/grace_latlong/grace_latlong.exr"
BALL_MISSES = pytest.mark.xfail(
    reason="irradiance changes by 1.05e-3 to 1.4e-3 from three mappings to the ball: seen, its cause not established"
)
GRACE_MISSES = pytest.mark.xfail(
    reason="irradiance changes by 1.11e-3 from a vertical cross to hemispheres: seen, its cause not established"
)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("path", "to_balls"),
    [
        (SUNRISE, False),
        pytest.param(SUNRISE, True, marks=BALL_MISSES),
        pytest.param(GRACE, False, marks=GRACE_MISSES),
        (GRACE, True),
    ],
    ids=["sun", "sun to ball", "grace", "grace to ball"],
)
def test_real_maps_at_512_rows_keep_total_moment_and_irradiance_to_a_thousandth(shared, path, to_balls):
    whole = as_environment(read_radiance(shared / "data" / path))
    normals = normalised(np.random.default_rng(0).normal(size=(200, 3)))
    lights = {m.name: whole.remapped(m, 510 if m.name == "cross" else 512) for m in WHOLE}

    def facts(light):
        weight = middles(light.mapping, light.size) * light.mapping.solid_angles(light.size)[..., None]
        # In float64: sums of a million float32 products are off by as much as is asked for here.
        weight, green = weight.reshape(-1, 3), light.radiance[..., 1].reshape(-1).astype(np.float64)
        irradiance = np.concatenate([green @ np.maximum(weight @ some.T, 0) for some in np.split(normals, 50)])
        return light.total()[1], green @ weight, irradiance

    before = {name: facts(light) for name, light in lights.items()}
    for source in lights.values():
        for target in WHOLE:
            if target.name != source.mapping.name and isinstance(target, MirrorBall) == to_balls:
                moved = facts(source.remapped(target, lights[target.name].size))
                total, moments, irradiance = before[source.mapping.name]
                assert moved[0] == pytest.approx(total, rel=1e-5)
                assert np.linalg.norm(moved[1] - moments) < 1e-3 * total
                assert np.abs(moved[2] - irradiance).max() < 1e-3 * irradiance.max()


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("left", [np.nan, 3e38, 0.0])
def test_what_memory_held_before_changes_no_view(monkeypatch, left: float):
    """Suns behind the camera and beside it fall on no plane of a view: no number is made of them, and no pixel."""
    light = of_directions(lambda towards: 1.0 + 0.0 * towards[..., 0])
    for row, column in ((30, 62), (30, 1), (3, 20), (32, 80), (60, 100)):
        light.radiance[row, column] = 1e5
    expected = perspective_view(light, np.eye(3), np.radians(50), (60, 40)).radiance
    empty = np.empty

    def filled(shape, dtype=float, **more):
        made = empty(shape, dtype, **more)
        made.fill(left if np.issubdtype(made.dtype, np.floating) else 0)
        return made

    monkeypatch.setattr(np, "empty", filled)
    np.testing.assert_array_equal(perspective_view(light, np.eye(3), np.radians(50), (60, 40)).radiance, expected)


def test_pixels_without_a_solid_angle_still_have_a_middle():
    """A pixel of which only the very rim of a whole ball's disc is seen: 0 / 0 was no place at all."""
    planes = layout(Angular(), 64).planes
    rim = np.array([[31, 63], [63, 32], [0, 31], [54, 54], [55, 54], [63, 63], [0, 0]])
    for middle in pushing._middles(planes, rim):
        assert np.all(np.isfinite(middle))
    flat = planes._replace(across=np.float32(0))  # sin(0 r) is 0 everywhere
    for middle in pushing._middles(flat, rim):
        assert np.all(np.abs(middle) <= 1)
