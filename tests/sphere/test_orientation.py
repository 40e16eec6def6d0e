"""Presets for other programs: each program's own formula, as its source or document has it, meets our light aright."""

import numpy as np
import pytest

from lights import spread
from other_programs import mitsuba_reading
from relume.image import files
from relume.renderers.mitsuba.scene import sensor
from relume.scene.cameras.camera import Camera
from relume.sphere.directions import normalised
from relume.sphere.environment_files import as_radiance_map
from relume.sphere.environment_map import EnvironmentMap
from relume.sphere.mappings.mapping import LatLong, pixel_directions
from relume.sphere.mappings.orientation import ORIENTATIONS, Orientation, orient_back, orient_for, orientation_named
from relume.sphere.mappings.orientation_chart import GROUND, INK, LABELS, orientation_chart

AXES = np.array([label.towards for label in LABELS.values()])
COLOURS = np.array([label.colour for label in LABELS.values()])


# What each program does with a direction of its own world: a point (u right, v down) of the file.


def three(direction):
    """three.js, common.glsl.js, equirectUv; its v counts from the bottom of the image."""
    x, y, z = direction
    return np.arctan2(z, x) / (2 * np.pi) + 0.5, 1 - (np.arcsin(np.clip(y, -1, 1)) / np.pi + 0.5)


def gltf(direction):
    """KhronosGroup/glTF PR 1761: centre +X, top +Y, "moving left is a positive rotation about the Y axis"."""
    x, y, z = direction
    about_y = np.arctan2(-z, x)  # takes +X to −Z
    return 0.5 - about_y / (2 * np.pi), np.arccos(np.clip(y, -1, 1)) / np.pi


def blender(direction):
    """Cycles, direction_to_equirectangular, range (−2π, π, −π, π): its v counts from the bottom."""
    x, y, z = direction
    return (np.arctan2(y, x) - np.pi) / (-2 * np.pi), 1 - (np.arccos(np.clip(z, -1, 1)) - np.pi) / -np.pi


def openexr(direction):
    """OpenEXR, as UsdLux quotes it: left edge longitude +π, top latitude +π/2; longitude 0 is +Z, π/2 is +X."""
    x, y, z = direction
    return (np.pi - np.arctan2(x, z)) / (2 * np.pi), (np.pi / 2 - np.arcsin(np.clip(y, -1, 1))) / np.pi


def mitsuba(direction):
    """Mitsuba 3, envmap.cpp: u = atan2(x, −z)/2π, v = acos(y)/π."""
    x, y, z = direction
    return np.arctan2(x, -z) / (2 * np.pi), np.arccos(np.clip(y, -1, 1)) / np.pi


def radiance(direction):
    """The expressions in the .rad files that we write, in pictures twice as wide as high, v from the bottom."""
    x, y, z = direction
    return (1 + np.arctan2(x, y) / np.pi) / 2, 1 - (1 - np.arccos(np.clip(z, -1, 1)) / np.pi)


def y_up(direction):
    return direction


def z_up(direction):
    x, y, z = direction
    return x, -z, y


PROGRAMS = {
    "blender": (z_up, blender),
    "usd": (y_up, openexr),
    "gltf": (y_up, gltf),
    "three": (y_up, three),
    "mitsuba": (y_up, mitsuba),
    "arnold": (y_up, openexr),
    "radiance": (z_up, radiance),
}
EACH = pytest.mark.parametrize("name", PROGRAMS)


def pbrt_square_to_sphere(point):
    """pbrt-v4, EqualAreaSquareToSphere, line by line."""
    u, v = 2 * point[0] - 1, 2 * point[1] - 1
    up, vp = abs(u), abs(v)
    signed_distance = 1 - (up + vp)
    r = 1 - abs(signed_distance)
    phi = (1 if r == 0 else (vp - up) / r + 1) * np.pi / 4
    z = np.copysign(1 - r * r, signed_distance)
    cos_phi, sin_phi = np.copysign(np.cos(phi), u), np.copysign(np.sin(phi), v)
    return np.array([cos_phi * r * np.sqrt(2 - r * r), sin_phi * r * np.sqrt(2 - r * r), z])


def circle_difference(a, b):
    return np.abs((np.asarray(a) - np.asarray(b) + 0.5) % 1 - 0.5)


def test_every_preset_is_held_against_its_program():
    assert set(ORIENTATIONS) == {*PROGRAMS, "pbrt"}


@EACH
def test_a_program_looks_for_a_direction_where_the_preset_says(name):
    axes, point = PROGRAMS[name]
    for direction in spread(200, 4):
        u, v = point(axes(direction))
        expected = ORIENTATIONS[name].image_points(direction)
        assert circle_difference(u, expected[0]) < 1e-9
        assert v == pytest.approx(expected[1], abs=1e-7)


@EACH
def test_points_and_directions_of_a_preset_are_each_others_inverse(name):
    preset = ORIENTATIONS[name]
    directions = spread(100, 4)
    np.testing.assert_allclose(preset.directions(preset.image_points(directions)), directions, atol=1e-12)


def test_pbrt_shows_the_points_of_its_square_where_the_preset_says():
    points = np.random.default_rng(6).random((300, 2))
    # `Scale -1 1 1` before LookAt leaves the world's numbers as they are.
    expected = np.array([pbrt_square_to_sphere(point) for point in points])
    np.testing.assert_allclose(ORIENTATIONS["pbrt"].directions(points), expected, atol=1e-12)
    np.testing.assert_allclose(ORIENTATIONS["pbrt"].image_points(expected), points, atol=1e-9)


@pytest.mark.parametrize(
    ("name", "middle", "right"),
    [
        ("blender", (1, 0, 0), (0, 0, 1)),
        ("three", (1, 0, 0), (0, 0, 1)),
        ("gltf", (1, 0, 0), (0, 0, 1)),
        ("usd", (0, 0, 1), (-1, 0, 0)),
        ("mitsuba", (0, 0, 1), (-1, 0, 0)),
        ("arnold", (0, 0, 1), (-1, 0, 0)),
        ("radiance", (0, 0, -1), (1, 0, 0)),
    ],
)
def test_the_middle_of_a_file_and_what_lies_a_quarter_to_its_right(name, middle, right):
    found = ORIENTATIONS[name].directions(np.array([[0.5, 0.5], [0.75, 0.5], [0.5, 0.0]]))
    np.testing.assert_allclose(found, [middle, right, (0, 1, 0)], atol=1e-12)


@EACH
def test_the_labelled_probe_laid_out_for_a_program_shows_each_axis_where_the_program_looks(name):
    axes, point = PROGRAMS[name]
    laid_out = orient_for(orientation_chart(64), ORIENTATIONS[name]).radiance
    for direction, colour in zip(AXES, COLOURS, strict=True):
        u, v = point(axes(direction))
        row, column = min(int(v * 64), 63), int(u * 128) % 128
        np.testing.assert_allclose(laid_out[row, column], colour, atol=1e-6)


def test_the_labelled_probe_laid_out_for_pbrt_shows_each_axis_where_pbrt_looks():
    size = 64
    laid_out = orient_for(orientation_chart(size), ORIENTATIONS["pbrt"])
    assert laid_out.mapping.name == "equalarea"
    rows, columns = np.indices((size, size))
    shown = np.array(
        [
            pbrt_square_to_sphere(((column + 0.5) / size, (row + 0.5) / size))
            for row, column in zip(rows.ravel(), columns.ravel(), strict=True)
        ]
    )
    for direction, colour in zip(AXES, COLOURS, strict=True):
        nearest = (shown @ direction).argmax()
        np.testing.assert_allclose(laid_out.radiance.reshape(-1, 3)[nearest], colour, atol=0.02)


def test_whole_columns_are_moved_without_touching_a_pixel():
    random = np.random.default_rng(1)
    clipped = random.integers(0, 2, (8, 16)).astype(np.uint8)
    light = EnvironmentMap(random.random((8, 16, 3)).astype(np.float32), unit="cd/m²", clipped=clipped)
    for name, columns in (("radiance", 0), ("blender", -4), ("usd", 8)):
        laid_out = orient_for(light, ORIENTATIONS[name])
        np.testing.assert_array_equal(laid_out.radiance, np.roll(light.radiance, columns, axis=1))
        np.testing.assert_array_equal(laid_out.clipped, np.roll(clipped, columns, axis=1))
        assert laid_out.unit == "cd/m²"


def smooth(size=64):
    directions = pixel_directions(LatLong(), size)
    return EnvironmentMap((2 + directions @ [[1, 0.2, 0], [0, 1, 0.3], [0.5, 0, 1]]).astype(np.float32))


@pytest.mark.parametrize("name", ORIENTATIONS)
def test_restored_undoes_oriented(name):
    light = smooth()
    back = orient_back(orient_for(light, ORIENTATIONS[name]), ORIENTATIONS[name])
    assert back.mapping == LatLong()
    if name == "pbrt":
        np.testing.assert_allclose(back.radiance, light.radiance, rtol=0.03)
    else:
        np.testing.assert_array_equal(back.radiance, light.radiance)


@pytest.mark.parametrize("name", ["usd", "pbrt"])
def test_another_size_keeps_the_light(name):
    laid_out = orient_for(smooth(), ORIENTATIONS[name], 32)
    assert laid_out.size == 32
    np.testing.assert_allclose(laid_out.total(), smooth().total(), rtol=1e-4)


def test_mitsuba_shows_every_axis_where_it_is_and_as_we_do(tmp_path):
    """The file as anybody would load it: an envmap with nothing but a file name."""
    probe = orientation_chart(256)
    files.write(tmp_path / "probe.exr", as_radiance_map(orient_for(probe, ORIENTATIONS["mitsuba"])))
    with mitsuba_reading("scalar_rgb") as mi:
        envmap = {"type": "envmap", "filename": str(tmp_path / "probe.exr")}
        world, path = mi.load_dict({"type": "scene", "light": envmap}), mi.load_dict({"type": "path"})
        for label in LABELS.values():
            camera = Camera(31, 31, 31.0, np.zeros(3), np.stack([label.right, label.up, -label.towards], axis=1))
            found = np.array(mi.render(world, sensor=mi.load_dict(sensor(mi, camera)), integrator=path, spp=16))
            np.testing.assert_allclose(found[15, 15], label.colour, atol=0.01)
            ours = probe.lookup(camera.rays()).reshape(found.shape)
            straight, mirrored, turned = (
                np.abs(picture - ours).mean() for picture in (found, found[:, ::-1], found[::-1, ::-1])
            )
            # Mitsuba's rows stand half a pixel off at the poles, which blurs nothing but letters there.
            assert straight < 0.015 and mirrored > 3 * straight and turned > 3 * straight


def test_a_preset_that_there_is_not_is_named_with_those_there_are():
    with pytest.raises(ValueError, match='no orientation for "maya"; there are blender, usd'):
        orientation_named("maya")
    assert orientation_named("three") is ORIENTATIONS["three"]


def test_a_map_in_another_mapping_is_none_of_a_program():
    with pytest.raises(ValueError, match="a latlong map; pbrt reads equalarea maps only"):
        orient_back(smooth(), ORIENTATIONS["pbrt"])


def test_a_mirrored_map_is_flipped():
    preset = Orientation("outside", LatLong(), np.eye(3), True, "", "")
    laid_out = orient_for(orientation_chart(32), preset)
    np.testing.assert_array_equal(laid_out.radiance, orientation_chart(32).radiance[:, ::-1])
    np.testing.assert_allclose(preset.directions(np.array([0.75, 0.5])), [-1, 0, 0], atol=1e-12)
    np.testing.assert_array_equal(orient_back(laid_out, preset).radiance, orientation_chart(32).radiance)


# The labelled probe itself


def test_the_probe_shows_six_colours_and_no_two_alike():
    probe = orientation_chart(128)
    np.testing.assert_allclose(probe.lookup(AXES), COLOURS, atol=0.01)
    assert len({tuple(colour) for colour in COLOURS}) == 6
    assert probe.radiance.shape == (128, 256, 3) and probe.radiance.max() <= 1 and probe.radiance.min() >= INK - 1e-6
    np.testing.assert_allclose(probe.lookup(normalised([1, 1, 0.35])), GROUND, atol=0.15)


@pytest.mark.parametrize("name", LABELS)
def test_a_label_reads_sign_before_letter_for_who_stands_inside(name):
    label = LABELS[name]
    np.testing.assert_allclose(np.cross(label.right, label.up), -label.towards)
    probe = orientation_chart(256)

    def ink(x, y):
        found = probe.lookup(normalised(label.towards + x * label.right + y * label.up))
        return bool(np.abs(found - INK).max() < 0.02)

    minus, plus = ink(-0.3, 0) and ink(-0.18, 0), ink(-0.24, 0.09) and ink(-0.24, -0.09)
    assert minus and plus == (name[0] == "+")
    # Of the letter's square: the corners and the middles of its sides, from the upper left on, row by row.
    places = [(x, y) for y in (0.13, 0.0, -0.13) for x in (0.09, 0.22, 0.35)]
    drawn = "".join("#" if ink(x, y) else "." for x, y in places)
    assert drawn == {"X": "#.#.#.#.#", "Y": "#.#.#..#.", "Z": "###.#.###"}[name[1]]
    assert not ink(0, 0)
