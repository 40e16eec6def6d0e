"""A sun that clipped: light made up, cut off, and recovered by a grey ball or a chart that stood in it."""

from dataclasses import replace

import numpy as np
import pytest

from lights import spread
from relume.errors import SunNotRecovered
from relume.image import files
from relume.image.radiance import BLACK, OUTSIDE, SATURATED, RadianceMap
from relume.light.suns.clipped_regions import ClippedPixels, SunDisc, clipped_pixels, plateau, sources
from relume.light.suns.clipped_sun import recover_sun
from relume.light.suns.matte_readings import ChartPatch, MatteReadings, measure_chart, measure_grey_ball, read_grey_ball
from relume.probe.ball.silhouette import outline_of_circle
from relume.probe.ball.unwrapping import CAMERA_FROM_PIXELS, BallView
from relume.sphere.directions import look_at, normalised
from relume.sphere.environment_files import as_environment, as_radiance_map
from relume.sphere.environment_map import EnvironmentMap
from relume.sphere.mappings.discs import Angular
from relume.sphere.mappings.mapping import LatLong, pixel_directions

X, Y, Z = np.eye(3)
SKY, SLOPE = np.array([0.5, 0.8, 1.5]), np.array([0.2, 0.3, 0.4])
"""Radiance SKY + SLOPE · y."""
SUN, LAMP = normalised([0.4, 0.6, 0.69]), normalised([-0.7, 0.3, 0.5])
LIGHTS = [(SUN, np.array([20.0, 18.0, 16.0])), (LAMP, np.array([3.0, 4.0, 6.0]))]
"""Directions and the irradiance on a surface that faces them: the sun's radiance would be 3e5, over half a degree."""


def made(lights=LIGHTS[:1], size=128, mapping=LatLong()):
    """A map of the sky with lights of a pixel each, and their directions, which are middles of pixels."""
    directions = pixel_directions(mapping, size)
    radiance = SKY + SLOPE * directions[..., 1:2]
    towards = []
    for direction, irradiance in lights:
        pixel = np.unravel_index(np.argmax(directions @ direction), directions.shape[:2])
        radiance[pixel] += irradiance / mapping.solid_angles(size)[pixel]
        towards.append((directions[pixel], irradiance))
    return EnvironmentMap(radiance.astype(np.float32), mapping), towards


def cut(light, level=3.0):
    mask = (light.radiance >= level).any(-1)
    return replace(light, radiance=np.minimum(light.radiance, level), clipped=(mask * SATURATED).astype(np.uint8))


def irradiance(normals, lights):
    """In closed form: ∫ (a + b y) max(0, n·ω) dω = π a + 2π/3 b n_y."""
    result = np.pi * SKY + 2 * np.pi / 3 * SLOPE * normals[..., 1:2]
    return result + sum(np.maximum(normals @ d, 0)[..., None] * e for d, e in lights)


def photographed(lights, albedo=0.18, camera=(0.2, 0.3, 1.0), side=240, noise=0.01):
    """A matte ball seen from `camera`, in black."""
    camera, focal_length, distance = np.array(camera), 5.0 * side, 12.0
    world_from_camera = look_at(camera, np.zeros(3))
    x = np.arange(side) + 0.5 - side / 2
    rays = np.stack(np.broadcast_arrays(x[None, :], -x[:, None], -focal_length), axis=-1)
    rays = normalised(rays) @ world_from_camera.T
    origin = distance * normalised(camera)
    half = rays @ origin
    inside = half**2 - (distance**2 - 1)
    normals = origin + (-half - np.sqrt(np.maximum(inside, 0)))[..., None] * rays
    radiance = albedo / np.pi * irradiance(normals, lights) * (inside > 0)[..., None]
    radiance *= 1 + noise * np.random.default_rng(5).normal(size=radiance.shape)
    outline = outline_of_circle(side / 2, side / 2, focal_length / np.sqrt(distance**2 - 1))
    picture = RadianceMap(radiance.astype(np.float32))
    # View frame of pixels: y down, z forward.
    return BallView(
        picture, focal_length, np.array([0, 0, 1.0]), distance, world_from_camera @ CAMERA_FROM_PIXELS, outline
    )


def chart(*patches, unit="relative"):
    """Readings of flat patches (radiance, reflectance, normal) of ten pixels, side by side."""
    squares = [np.broadcast_to(np.float32(radiance), (10, 10, 3)) for radiance, *_ in patches]
    places = [ChartPatch((10.0 * k + 5, 5.0, 4.0), patch[1], patch[2]) for k, patch in enumerate(patches)]
    return measure_chart(RadianceMap(np.concatenate([*squares, squares[0]], axis=1), unit=unit), places)


def worst(light, lights):
    """The largest relative error of irradiance in any direction."""
    normals = np.concatenate([spread(40), np.eye(3), -np.eye(3), [d for d, _ in lights]])
    return float(np.abs(light.irradiance(normals) / irradiance(normals, lights) - 1).max())


@pytest.mark.parametrize("level", [3.0, 100.0, 10_000.0])
def test_a_sun_cut_at_any_level_is_recovered(level):
    truth, lights = made()
    clipped = cut(truth, level)
    found = recover_sun(clipped, read_grey_ball(photographed(lights), 0.18))
    assert worst(clipped, lights) > 0.2
    assert worst(found.light, lights) < 0.01
    (sun,) = found.sources
    assert sun.direction == pytest.approx(lights[0][0], abs=1e-9)
    assert sun.irradiance == pytest.approx(lights[0][1] + sun.solid_angle * (SKY + SLOPE * SUN[1]), rel=5e-3)
    assert np.all(np.abs(sun.irradiance - lights[0][1]) < 5 * sun.uncertainty + 0.01)
    assert sun.factor == pytest.approx(sun.irradiance / sun.held)
    assert found.residual < 0.02
    assert found.agreement == pytest.approx(1, abs=0.01)


@pytest.mark.parametrize("mapping", [LatLong(), Angular()], ids=lambda m: m.name)
def test_a_sun_and_a_lamp_are_kept_apart(mapping):
    truth, lights = made(LIGHTS, mapping=mapping)
    found = recover_sun(cut(truth), read_grey_ball(photographed(lights), 0.18))
    assert worst(found.light, lights) < 0.01
    assert len(found.sources) == 2
    for source, (direction, expected) in zip(found.sources, lights, strict=True):
        assert source.direction == pytest.approx(direction, abs=1e-9)
        assert source.irradiance == pytest.approx(expected, rel=0.02)


def test_the_recovered_pixels_are_no_longer_marked():
    truth, lights = made()
    clipped = cut(truth)
    marks = np.asarray(clipped.clipped).copy()
    marks[100, 100] = OUTSIDE
    found = recover_sun(replace(clipped, clipped=marks), read_grey_ball(photographed(lights), 0.18)).light
    assert np.unique(np.asarray(found.clipped)).tolist() == [0, OUTSIDE]
    np.testing.assert_array_equal((found.radiance != clipped.radiance).any(-1), marks == SATURATED)


def test_a_chart_of_known_reflectance_does_as_well():
    truth, lights = made()
    towards_sun, up = lights[0][0], Y
    white = 0.9 / np.pi * irradiance(towards_sun, lights), 0.9, tuple(towards_sun)
    found = recover_sun(cut(truth), chart(white))
    assert worst(found.light, lights) < 2e-3
    assert np.isnan(found.agreement)
    assert "sun_recovered_agreement" not in found.attributes
    reddish = np.array([0.5, 0.3, 0.2])
    red = reddish / np.pi * irradiance(up, lights), tuple(reddish), tuple(up)
    found = recover_sun(cut(truth), chart(white, red))
    assert worst(found.light, lights) < 2e-3
    assert found.attributes["sun_recovered"] == "from 2 patches of a chart"


def test_the_wrong_albedo_is_reported_with_its_factor():
    truth, lights = made()
    ball = photographed(lights)
    for albedo in (0.20, 0.36):
        with pytest.warns(
            UserWarning, match=f"readings are 0\\.{9 if albedo == 0.20 else 5}.* times what the map gives"
        ):
            found = recover_sun(cut(truth), read_grey_ball(ball, albedo))
        assert found.agreement == pytest.approx(0.18 / albedo, rel=0.01)


def test_a_ball_that_is_darker_than_the_map_makes_it_is_refused():
    truth, lights = made()
    with pytest.raises(SunNotRecovered, match=r"albedo 0\.9 reflects 0\.\d+ of what the map lights it with"):
        recover_sun(cut(truth), read_grey_ball(photographed(lights), 0.9))


def test_a_ball_that_faces_another_way_fits_badly():
    truth, lights = made()
    ball = photographed(lights)
    with pytest.warns(UserWarning, match="check that both face the same way"):
        recover_sun(cut(truth), read_grey_ball(ball.turned(look_at(-X, np.zeros(3))), 0.18))


def test_a_ball_seen_from_its_dark_side_is_refused():
    truth, lights = made()
    with pytest.raises(SunNotRecovered, match=r"no side that the clipped light .* the nearest is \d+° from"):
        recover_sun(cut(truth), read_grey_ball(photographed(lights, camera=-SUN), 0.18))
    away = MatteReadings(-SUN[None], np.ones((1, 3)), np.zeros((1, 3)), "one patch of a chart")
    with pytest.raises(SunNotRecovered, match="photograph it from the side of the sun"):
        recover_sun(cut(truth), away)


def test_more_sources_than_patches_are_refused():
    truth, lights = made(LIGHTS)
    normal = normalised(SUN + LAMP)
    with pytest.raises(SunNotRecovered, match="2 sources clipped, which one patch of a chart cannot separate"):
        recover_sun(cut(truth), chart((irradiance(normal, lights) / np.pi, 1.0, tuple(normal))))


def test_a_source_behind_the_ball_stays_as_it_is_and_is_reported():
    behind = normalised([0.1, 0.2, -1])
    truth, lights = made([*LIGHTS[:1], (behind, np.array([2.0, 2.0, 2.0]))])
    with pytest.warns(UserWarning, match="1 of 2 clipped sources light no side"):
        found = recover_sun(cut(truth), read_grey_ball(photographed(lights), 0.18))
    assert len(found.sources) == 1
    assert (found.light.clipped == SATURATED).sum() == 1


def test_nothing_is_added_where_nothing_is_missing():
    truth, lights = made(size=64)
    marked = replace(truth, clipped=((truth.radiance > 50).any(-1) * SATURATED).astype(np.uint8))
    found = recover_sun(marked, read_grey_ball(photographed(lights, noise=0), 0.18))
    assert found.sources[0].factor == pytest.approx(np.ones(3), abs=5e-3)


# Where the light is put


def bloomed(size=256):
    """A sun whose surroundings clipped with it, over 3°."""
    truth, lights = made(size=size)
    chords = np.linalg.norm(pixel_directions(LatLong(), size) - lights[0][0], axis=-1)
    radiance = truth.radiance.copy()
    radiance[chords < np.radians(1.5)] = np.maximum(radiance[chords < np.radians(1.5)], 4)
    return replace(truth, radiance=radiance), lights


def test_what_is_missing_is_spread_over_the_clipped_pixels_or_put_into_the_suns_disc():
    truth, lights = bloomed()
    clipped, readings = cut(truth, 4), read_grey_ball(photographed(lights), 0.18)
    spread_out, disc = (recover_sun(clipped, readings, shape=shape).light for shape in (ClippedPixels(), SunDisc()))
    held = clipped.clipped == SATURATED
    factors = spread_out.radiance[held] / clipped.radiance[held]
    assert factors == pytest.approx(np.tile(factors[0], (held.sum(), 1)), rel=1e-5)
    raised = (disc.radiance != clipped.radiance).any(-1)
    assert 1 <= raised.sum() <= 4 < held.sum()
    assert worst(disc, lights) < 0.01
    assert disc.total() == pytest.approx(spread_out.total(), rel=2e-3)
    wide = recover_sun(clipped, readings, shape=SunDisc(np.radians(5))).light
    chords = np.linalg.norm(pixel_directions(LatLong(), 256) - lights[0][0], axis=-1)
    raised = (wide.radiance != clipped.radiance).any(-1)
    assert np.all(chords[raised] < np.radians(2.8)) and np.all(raised[chords < np.radians(2.2)])


def test_a_wide_clipped_source_is_reported():
    truth, lights = made()
    chords = np.linalg.norm(pixel_directions(LatLong(), 128) - lights[0][0], axis=-1)
    hazy = replace(
        truth, radiance=np.where(chords[..., None] < np.radians(4), np.maximum(truth.radiance, 4), truth.radiance)
    )
    with pytest.warns(UserWarning, match="reach over 8°, and where among them the light was is not known"):
        recover_sun(cut(hazy, 4), read_grey_ball(photographed(lights), 0.18))


def test_clipped_pixels_are_gathered_by_where_they_are_also_across_the_seam():
    mask = np.zeros((32, 64), bool)
    mask[10, [0, 63]] = True  # one lamp on the seam
    mask[20, 30:33] = True
    light = EnvironmentMap(np.repeat(1 + 4 * mask[..., None].astype(np.float32), 3, axis=-1))
    directions = pixel_directions(LatLong(), 32)
    found = sources(light, directions, mask, np.radians(15))
    assert sorted(len(each) for each in found) == [2, 3]
    assert len(found[0]) == 3, "the strongest first"


def test_what_clipped_is_shown_by_the_mask_a_level_or_a_plateau():
    truth, _ = made(LIGHTS, size=32)
    clipped = cut(truth, 3)
    assert clipped_pixels(clipped).sum() == 2
    assert clipped_pixels(clipped, 1.5).sum() > 2
    flat = replace(bloomed(128)[0], clipped=None)
    flat = replace(flat, radiance=np.minimum(flat.radiance, 4))
    np.testing.assert_array_equal(plateau(flat), (flat.radiance == 4).any(-1))
    np.testing.assert_array_equal(clipped_pixels(flat), plateau(flat))
    with pytest.raises(SunNotRecovered, match="no plateau"):
        plateau(truth)
    with pytest.raises(SunNotRecovered, match="nothing clipped"):
        clipped_pixels(truth, 1e9)
    with pytest.raises(SunNotRecovered, match="is marked as saturated"):
        clipped_pixels(replace(truth, clipped=np.zeros((32, 64), np.uint8)))


# What is read


def test_readings_of_a_ball_are_the_irradiance_on_its_sides():
    _, lights = made()
    readings = read_grey_ball(photographed(lights, albedo=0.5, noise=0), 0.5)
    assert readings.normals.shape == readings.irradiance.shape and len(readings.normals) > 500
    # Cells at the terminator hold both sides of it.
    bend = np.abs(readings.normals @ lights[0][0]) < 0.05
    expected = irradiance(readings.normals, lights)
    np.testing.assert_allclose(readings.irradiance[~bend], expected[~bend], rtol=3e-3)
    assert np.all(readings.normals @ normalised([0.2, 0.3, 1.0]) > 0.2)


def test_noise_becomes_a_deviation_and_clipped_pixels_are_left_out():
    _, lights = made()
    view = photographed(lights, noise=0)
    shape = view.picture.radiance.shape
    clipped = np.zeros(shape[:2], np.uint8)
    clipped[:, :120], clipped[:80], clipped[160:] = SATURATED, BLACK, OUTSIDE
    radiance = np.where(clipped[..., None] > 0, np.float32(99), view.picture.radiance)
    noisy = RadianceMap(radiance, np.full(shape, 0.01, np.float32), clipped)
    readings = read_grey_ball(replace(view, picture=noisy), 0.18)
    right = look_at([0.2, 0.3, 1.0], np.zeros(3))[:, 0]
    assert np.all(readings.normals @ right > -0.1)
    assert readings.irradiance == pytest.approx(irradiance(readings.normals, lights), rel=0.1)
    # Cells of 3 × 3 pixels of deviation 0.1.
    assert np.median(readings.deviation) == pytest.approx(0.1 / 3 * np.pi / 0.18, rel=1e-5)


@pytest.mark.long
def test_a_photographed_matte_ball_is_found_as_a_mirrored_one_is():
    truth, lights = made()
    view = photographed(lights, side=320)
    found = measure_grey_ball(view.picture, 0.18, camera=12 * normalised([0.2, 0.3, 1.0]), radius=1.0, name="grey")
    assert worst(recover_sun(cut(truth), found).light, lights) < 0.01


def test_the_file_says_how_the_sun_was_recovered(tmp_path):
    truth, lights = made(LIGHTS)
    found = recover_sun(cut(truth), read_grey_ball(photographed(lights), 0.18))
    picture = as_radiance_map(found.light)
    files.write(tmp_path / "map.exr", replace(picture, attributes={**picture.attributes, **found.attributes}))
    again = files.read_radiance(tmp_path / "map.exr")
    assert again.attributes["sun_recovered"] == "from a grey ball of albedo 0.18"
    numbers = [[float(v) for v in part.split(",")] for part in again.attributes["sun_recovered_irradiance"].split(";")]
    assert numbers == pytest.approx(np.array([each.irradiance for each in found.sources]), rel=1e-5)
    assert float(again.attributes["sun_recovered_residual"]) == pytest.approx(found.residual, rel=1e-3)
    np.testing.assert_array_equal(as_environment(again).radiance, found.light.radiance)


@pytest.mark.parametrize("albedo", [0, 1.1, (0.1, 0.2), -0.2])
def test_a_reflectance_that_cannot_be_is_refused(albedo):
    with pytest.raises(ValueError, match="above 0 and at most 1"):
        chart(((1, 1, 1), albedo, (0, 1, 0)))


def test_a_wrong_call_is_reported():
    white = (1, 1, 1), 0.5, (0, 1, 0)
    with pytest.raises(ValueError, match="no patch"):
        measure_chart(RadianceMap(np.ones((4, 4, 3), np.float32)), [])
    with pytest.raises(ValueError, match=r"faces \[\[0\.0, 0\.0, 0\.0\]\]; a normal is a direction"):
        chart(((1, 1, 1), 0.5, (0, 0, 0)))
    with pytest.raises(ValueError, match=r"expected \(N, 3\)"):
        MatteReadings(np.zeros((2, 3)), np.zeros((1, 3)), np.zeros((2, 3)), "a ball")
    light, lights = made(size=16)
    black = MatteReadings(np.eye(3)[:2], np.zeros((2, 3)), np.zeros((2, 3)), "2 patches of a chart")
    with pytest.raises(SunNotRecovered, match="2 patches of a chart: black all over"):
        recover_sun(light, black)
    with pytest.raises(ValueError, match='readings are "cd/m²" and the map "relative"'):
        recover_sun(light, chart(white, unit="cd/m²"))
    view = photographed(lights, side=40)
    blind = replace(view.picture, clipped=np.full((40, 40), SATURATED, np.uint8))
    with pytest.raises(ValueError, match="every pixel of the grey ball is clipped"):
        read_grey_ball(replace(view, picture=blind), 0.18)
