"""The sun taken out of a map: where it is, how much it gives, and that nothing is lost."""

import numpy as np
import pytest

from angles import degrees_between
from lights import constant, lone, spread, sunny
from relume.errors import SunNotFound
from relume.image.files import read_radiance
from relume.image.radiance import SATURATED
from relume.light.suns.extraction import extract_sun
from relume.sphere.directions import normalised
from relume.sphere.environment_files import as_environment
from relume.sphere.environment_map import EnvironmentMap
from relume.sphere.mappings.mapping import LatLong, Mapping, pixel_points
from relume.sphere.mappings.names import mapping_named

LUMINANCE = np.array([0.2126, 0.7152, 0.0722])
TOWARDS = {
    "high": normalised([0.3, 0.8, -0.5]),
    "on the seam": normalised([0.001, 0.4, 1.0]),
    "overhead": np.array([0.0, 1.0, 0.0]),
    "at the back of the probe": normalised([0.02, 0.01, 1.0]),
}


def sky(d: np.ndarray) -> np.ndarray:
    """A blue sky that brightens towards the horizon, over brown ground."""
    height = d[..., 1:2]
    return np.where(height > 0, np.array([0.3, 0.5, 1.0]) * (1.2 - height), np.array([0.15, 0.12, 0.08]))


def under_sun(towards, degrees=2.0, value=500.0, size=128, mapping: Mapping = LatLong(), subdivision=4):
    """The sky with one disc of this angular radius, each pixel the mean of its parts."""
    points = pixel_points(mapping, size, subdivision)
    d = np.nan_to_num(mapping.directions(mapping.shown(points)))
    disc = (d @ towards > np.cos(np.radians(degrees)))[..., None]
    fine = sky(d) + disc * value * np.array([1.0, 0.9, 0.7])
    rows, columns = mapping.shape(size)
    return EnvironmentMap(
        fine.reshape(rows, subdivision, columns, subdivision, 3).mean((1, 3)).astype(np.float32), mapping
    )


def cap(degrees):
    return 2 * np.pi * (1 - np.cos(np.radians(degrees)))


@pytest.mark.parametrize("towards", TOWARDS.values(), ids=TOWARDS.keys())
def test_a_disc_over_a_sky_is_found_wherever_it_stands(towards):
    light = under_sun(towards)
    (sun,), rest = (found := extract_sun(light)).suns, found.rest
    assert degrees_between(sun.direction, towards) < 0.1
    # What is taken is the disc and no sky.
    disc = light.total() - under_sun(towards, value=0.0).total()
    np.testing.assert_allclose(sun.irradiance, disc, rtol=1e-3)
    if towards is TOWARDS["high"]:
        np.testing.assert_allclose(disc, 500 * cap(2) * np.array([1.0, 0.9, 0.7]), rtol=0.01)
        assert np.degrees(sun.angular_radius) == pytest.approx(2, rel=0.01)
    assert np.degrees(sun.angular_radius) == pytest.approx(2, rel=0.15)
    assert not sun.clipped and not sun.flat
    np.testing.assert_allclose(sun.irradiance + rest.total(), light.total(), rtol=1e-12)


IN_MAPPINGS = [
    (name, place)
    for name in ["angular", "ball", "octahedral", "equalarea", "hemispheres", "cross", "strip"]
    for place in TOWARDS
    # Round the rim of a hemisphere pixels are so long that a disc fills none.
    if (name, place) != ("hemispheres", "overhead")
]


@pytest.mark.parametrize(("name", "place"), IN_MAPPINGS)
def test_it_is_found_in_every_mapping_and_the_rest_keeps_it(name, place):
    mapping, towards = mapping_named(name), TOWARDS[place]
    size = {"cross": 96, "strip": 32}.get(name, 64)
    light, without = (under_sun(towards, 4, v, size, mapping) for v in (500.0, 0.0))
    found = extract_sun(light, widest=np.radians(8))  # a pixel of the angular map alone is 5.6° wide
    (sun,) = found.suns
    assert found.rest.mapping == mapping
    assert degrees_between(sun.direction, towards) < 1
    np.testing.assert_allclose(sun.irradiance, light.total() - without.total(), rtol=0.02)
    np.testing.assert_allclose(sun.irradiance + found.rest.total(), light.total(), rtol=1e-12)
    assert sun.share == pytest.approx(float(sun.irradiance @ LUMINANCE) / float(light.total() @ LUMINANCE))


@pytest.mark.parametrize("towards", [TOWARDS["high"], TOWARDS["on the seam"], TOWARDS["overhead"]])
def test_its_place_is_filled_with_what_surrounds_it(towards):
    light, without = under_sun(towards), under_sun(towards, value=0.0)
    rest = extract_sun(light).rest
    changed = np.any(rest.radiance != light.radiance, axis=-1)
    assert 10 < changed.sum()
    np.testing.assert_allclose(rest.radiance[changed], without.radiance[changed], rtol=0.1)
    np.testing.assert_array_equal(rest.radiance[~changed], light.radiance[~changed])


def test_a_sun_on_the_horizon_leaves_the_horizon():
    towards = normalised([0.5, 0.0, -0.8])
    rest = extract_sun(under_sun(towards, 3)).rest
    above, below = (rest.lookup(normalised(towards + np.array([0, shift, 0]))) for shift in (0.035, -0.035))
    # The step is a little smoothed within the patch, by no more than half.
    step = sky(np.array([0, 0.03, -1])) - sky(np.array([0, -0.03, -1]))
    assert np.all(above - below > 0.5 * step) and np.all(above - below < step)


def test_a_sun_at_the_seam_is_filled_from_both_sides_of_it():
    radiance = np.full((32, 64, 3), 3.0, np.float32)
    radiance[:, 32:] = 1.0  # behind, to the left of the seam 3 and to its right 1
    radiance[15:17, 0] = 1e4
    rest = extract_sun(EnvironmentMap(radiance)).rest.radiance
    # The nearest pixels: three of 3, three of 1.
    assert np.all((rest[15:17, 0] > 1.8) & (rest[15:17, 0] < 2.7))


def test_no_channel_of_the_fill_is_a_source_itself():
    # Compression rings round a lamp: dark pixels with one bright channel.
    light = lone(32, 10, 20, 1e4, dark=1.0)
    light.radiance[9, 19:22] = 0, 0, 50
    rest = extract_sun(light).rest.radiance
    assert rest[10, 20].max() < 16.5


def test_surfaces_are_lit_as_before():
    # Surfaces at whose horizon half of a disc stands miss most: 2a/3π of what it gives, with a = 2°.
    light, normals = under_sun(TOWARDS["high"]), spread(400)
    found = extract_sun(light)
    lit = found.lights().irradiance_on(normals) + found.rest.irradiance(normals)
    difference = np.abs(lit - light.irradiance(normals)) / found.suns[0].irradiance
    assert difference.max() < 2 * np.radians(2.1) / (3 * np.pi)


def test_a_single_pixel_is_its_own_size():
    light = lone(64, 20, 77, value=1e5, dark=1.0)
    (sun,) = extract_sun(light).suns
    assert degrees_between(sun.direction, LatLong().directions(np.array([77.5 / 128, 20.5 / 64]))) < 1e-5
    area = 2 * np.pi / 128 * (np.cos(20 * np.pi / 64) - np.cos(21 * np.pi / 64))
    assert cap(np.degrees(sun.angular_radius)) == pytest.approx(area, rel=1e-9)
    np.testing.assert_allclose(sun.irradiance, (1e5 - 1) * area, rtol=1e-6)


def test_several_lamps_are_counted_and_the_strongest_comes_first():
    light = under_sun(TOWARDS["high"], 1.5)
    second = under_sun(normalised([-0.7, 0.3, 0.4]), 1.5, 2000.0)
    third = under_sun(normalised([0.7, -0.3, 0.4]), 1.5, 200.0)
    all_three = EnvironmentMap(np.maximum(np.maximum(light.radiance, second.radiance), third.radiance))
    suns = extract_sun(all_three, 5).suns
    assert degrees_between(suns[0].direction, normalised([-0.7, 0.3, 0.4])) < 0.1
    np.testing.assert_allclose([sun.irradiance[0] / cap(1.5) for sun in suns], [2000, 500, 200], rtol=0.02)
    two = extract_sun(all_three, 2)
    assert len(two.suns) == 2
    assert two.rest.radiance.max() > 150  # the third is left
    lights = two.lights()
    np.testing.assert_array_equal(lights.irradiance, [sun.irradiance for sun in two.suns])
    assert lights.angular_radii is not None and np.degrees(lights.angular_radii) == pytest.approx([1.5, 1.5], rel=0.05)


# --- what is no sun --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("light", [constant(32), constant(32, 0.0), sunny(64, 0.0)], ids=["even", "black", "overcast"])
def test_where_nothing_stands_out_that_is_said(light):
    with pytest.raises(SunNotFound, match="no sun stands out: nothing is 16 times brighter than the rest"):
        extract_sun(light)


def test_a_window_is_not_taken_for_a_sun():
    with pytest.raises(SunNotFound, match=r"the brightest source is 3[0-4]° wide, no parallel light"):
        extract_sun(under_sun(TOWARDS["high"], 16))
    assert len(extract_sun(under_sun(TOWARDS["high"], 16), widest=np.radians(20)).suns) == 1


def test_a_glint_is_not_taken_for_a_sun():
    with pytest.raises(SunNotFound, match="gives too little light"):
        extract_sun(under_sun(TOWARDS["high"], 0.6, 30.0))


def test_a_clipped_sun_is_shown_by_the_mask_or_by_its_plateau():
    light = under_sun(TOWARDS["high"], 3, size=64)
    assert not extract_sun(light).suns[0].clipped and not extract_sun(light).suns[0].flat
    clipped = np.zeros(light.radiance.shape[:2], np.uint8)
    clipped[np.unravel_index(np.argmax(light.radiance[..., 0]), clipped.shape)] = SATURATED
    marked = extract_sun(EnvironmentMap(light.radiance, clipped=clipped))
    assert marked.suns[0].clipped and not marked.suns[0].flat
    assert marked.rest.clipped is not None and not marked.rest.clipped.any()
    flat = EnvironmentMap(np.minimum(light.radiance, np.float32(100)))
    assert extract_sun(flat).suns[0].flat and not extract_sun(flat).suns[0].clipped
    assert np.degrees(extract_sun(flat).suns[0].angular_radius) > 2.5


@pytest.mark.parametrize("words", [{"count": 0}, {"contrast": 1.0}, {"widest": 0.0}, {"contrast": np.nan}])
def test_what_cannot_be_is_refused(words):
    with pytest.raises(ValueError, match="expected 1 or more suns, more than 1 time, a positive angle"):
        extract_sun(constant(8), **words)


# --- photographed light ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "height", "right", "share"),
    [
        ("spruit_sunrise/spruit_sunrise_1k", 8.0, 35.8, 0.79),
        ("three/quarry_01_1k", 10.0, 36.0, 0.524),
        ("three/venice_sunset_1k", 3.3, 36.0, 0.024),
    ],
)
def test_a_photographed_sun_is_half_a_degree_wide(name, height, right, share, shared):
    light = as_environment(read_radiance(shared / f"data/hdri/{name}.hdr"))
    found = extract_sun(light)
    (sun,) = found.suns
    x, y, z = sun.direction
    assert np.degrees(np.arcsin(y)) == pytest.approx(height, abs=0.3)
    assert np.degrees(np.arctan2(x, -z)) == pytest.approx(right, abs=0.3)
    assert np.degrees(2 * sun.angular_radius) == pytest.approx(0.53, abs=0.06)  # as the sun is
    assert sun.share == pytest.approx(share, rel=0.02)
    np.testing.assert_allclose(sun.irradiance + found.rest.total(), light.total(), rtol=1e-12)


def test_a_lamp_of_one_lux_gives_what_its_file_holds(shared):
    (sun,) = extract_sun(as_environment(read_radiance(shared / "data/hdri/three/spot1Lux.hdr"))).suns
    assert sun.share == pytest.approx(1)
    assert sun.irradiance == pytest.approx([0.959] * 3, rel=2e-3)  # its README
