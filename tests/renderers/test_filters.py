"""How pixels read maps (Miller & Hoffman 1984, §8): against the mean of a thousand look-ups inside each of them."""

import numpy as np
import pytest

from lights import constant, lone, of_directions, spiky, spread, sunny
from quads import around, filtered, supersampled
from relume.light.reflection.lobes import Lambert, Mirror, Phong
from relume.renderers.prefiltered.filters import Filter, Mip, Plain, Preintegrated, Quadrilateral, Spans, Subdivision
from relume.renderers.prefiltered.prefiltered import Prefiltered, Shading
from relume.renderers.prefiltered.shading_inputs import Samples, term
from relume.scene.cameras.camera import Camera
from relume.scene.materials.reflective import Layer, Reflective, Towards, mirror
from relume.scene.scene import Scene
from relume.scene.shapes.shapes import Sphere
from relume.sphere.directions import normalised, rotation_about
from relume.sphere.environment_map import EnvironmentMap

ANTIALIASING = [Subdivision(), Quadrilateral(), Preintegrated(), Mip()]
ALL = [Plain(), *ANTIALIASING]
EVERY = pytest.mark.parametrize("filter", ALL, ids=lambda f: type(f).__name__)
EVERY_ANTIALIASING = pytest.mark.parametrize("filter", ANTIALIASING, ids=lambda f: type(f).__name__)
SPANNING = pytest.mark.parametrize("filter", ANTIALIASING[:3], ids=lambda f: type(f).__name__)
"""Those of the paper, which take what lies within the pixel and no more."""

POLES = [[0, 1, 0], [0, -1, 0]]


def smooth(size):
    """Light that changes slowly, differs from every side and has no symmetry."""
    return of_directions(lambda d: 2 + d @ [0.5, 1, 0.3] + (d @ [0.6, 0, 0.8]) ** 3, size)


def relative_error(found, truth):
    return float(np.abs(found - truth).mean() / truth.mean())


# --- what every filter leaves as it is -------------------------------------------------------------------------------


@EVERY
@pytest.mark.parametrize("rows", [16, 36, 45, 1])
def test_constant_light_stays_constant_however_much_a_pixel_spans(filter, rows):
    light = constant(rows, (1, 2, 0.5))
    for width in (1e-4, 0.03, 0.3, 1.5, 2.8):
        for middles in (spread(60), POLES, normalised([[0, 0.02, 1], [1e-3, 0.9999, 1e-3]])):
            seen = filtered(filter, light, around(middles, width, 0.4 * width, 0.5))
            np.testing.assert_allclose(seen, np.broadcast_to([1, 2, 0.5], seen.shape), rtol=1e-6)


@EVERY
def test_pixels_much_smaller_than_an_entry_are_looked_up_at_their_middle(filter):
    light, middles = spiky(16), spread(500)
    quads = around(middles, 1e-3)
    # An entry is 0.2 rad wide and its neighbour may be a thousand times brighter.
    np.testing.assert_allclose(
        filtered(filter, light, quads), light.lookup(middles), rtol=0.02, atol=0.01 * light.radiance.max()
    )


@EVERY
def test_on_smooth_surfaces_all_filters_agree_within_a_per_cent(filter):
    # A pixel of a thousandth of a radian, as of a ball that fills a picture, in a map of entries of 0.025.
    for light in (smooth(128), sunny(128)):
        quads = around(spread(800), 1e-3)
        plain = filtered(Plain(), light, quads)
        assert relative_error(filtered(filter, light, quads), plain) < 0.01


def test_plain_look_up_reads_one_place_whatever_the_pixel_spans():
    light, middles = spiky(32), spread(300)
    for width in (1e-3, 1.0):
        seen = filtered(Plain(), light, around(middles, width), middles=middles)
        # 4e-7 rad of the arctangent, of entries of 0.1 rad.
        np.testing.assert_allclose(seen, light.lookup(middles), rtol=1e-4, atol=1e-5 * light.radiance.max())


# --- against a thousand look-ups -------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("width", "allowed"),
    [
        # Subdivision, quadrilateral, pre-integrated, MIP: for the first 0.3, 2.3, 1.0 and 1.6 %. Plain: 1.2, 15, 37 %.
        (0.05, [0.005, 0.035, 0.015, 0.025]),
        (0.3, [0.002, 0.012, 0.035, 0.17]),
        (1.0, [0.02, 0.08, 0.10, 0.19]),
    ],
)
def test_pixels_of_a_sunset_are_the_mean_of_what_they_span(width, allowed):
    light, quads = sunny(128), around(spread(400), width, 0.6 * width, 0.4)
    truth = supersampled(light, quads, 32)
    errors = [relative_error(filtered(filter, light, quads), truth) for filter in ANTIALIASING]
    assert np.all(np.array(errors) < allowed), errors
    if width > 0.1:
        assert relative_error(filtered(Plain(), light, quads), truth) > 1.9 * max(errors) / 1.75


@pytest.fixture(scope="module")
def many() -> list[tuple[np.ndarray, float]]:
    """Many pixels of three sizes, and the mean light in them."""
    sizes = [around(spread(600, seed=2), width, width, 0.4) for width in (0.1, 0.3, 1.0)]
    return [(quads, float(supersampled(spiky(64), quads).mean())) for quads in sizes]


@EVERY_ANTIALIASING
def test_the_light_of_many_pixels_is_neither_more_nor_less_than_there_is(filter, many):
    light = spiky(64)
    for quads, truth in many:
        assert filtered(filter, light, quads).mean() == pytest.approx(truth, rel=0.02)


@EVERY_ANTIALIASING
def test_a_pixel_that_spans_the_map_sees_its_mean(filter):
    # Corners at 70° round a direction: a third of the sphere, over either pole or neither.
    light = spiky(64)
    for middle in ([0, 1, 0], [0, -1, 0], [1, 0, 0], [0, 0, 1], [0.4, 0.2, -0.8]):
        quads = around(middle, 2.2)
        seen, truth = filtered(filter, light, quads), supersampled(light, quads, 128)
        np.testing.assert_allclose(seen, truth, rtol=0.15)  # noise from entry to entry is as large as its mean
        np.testing.assert_allclose(seen, np.broadcast_to(light.total() / (4 * np.pi), (1, 3)), rtol=0.15)


@SPANNING
def test_a_lone_light_inside_a_pixel_is_shared_out_over_it_and_one_outside_is_not_seen(filter):
    light = lone(64, 20, 40, 1e4)
    # Where row 20 and column 40 of a lat-long map point.
    polar, longitude = np.pi * 20.5 / 64, 2 * np.pi * 40.5 / 128 - np.pi
    towards = np.array([np.sin(polar) * np.sin(longitude), np.cos(polar), -np.sin(polar) * np.cos(longitude)])
    quads = around(normalised(towards + 0.02 * spread(200)), 0.2)
    inside, truth = filtered(filter, light, quads), supersampled(light, quads)
    assert inside.min() > 0.5 * truth.mean()
    assert inside.mean() == pytest.approx(truth.mean(), rel=0.03)
    away = normalised(towards + 0.5 * np.cross(towards, [0, 1, 0]))
    assert not filtered(filter, light, around(away, 0.4)).any()


@SPANNING
def test_the_order_of_a_pixels_corners_does_not_matter(filter):
    light, quads = smooth(32), around(spread(200), 0.4, 0.3, 0.2)
    seen = filtered(filter, light, quads)
    for other in (np.roll(quads, 1, axis=1), quads[:, ::-1]):
        np.testing.assert_allclose(filtered(filter, light, other), seen, rtol=2e-3)


# --- the seam and the poles ------------------------------------------------------------------------------------------


@EVERY
@pytest.mark.parametrize("columns", [1, 17, 64])
def test_the_seam_is_nowhere_in_particular(filter, columns):
    light = spiky(64)
    # A pyramid's largest entries are a quarter turn wide.
    columns = 64 if isinstance(filter, Mip) else columns
    # On both sides of the seam, towards +Z, and on it.
    middles = normalised(np.array([0, 0, 1]) + 0.3 * spread(300))
    rolled = EnvironmentMap(np.roll(light.radiance, columns, axis=1))
    turn = rotation_about([0, 1, 0], -2 * np.pi * columns / 128)
    for width in (0.02, 0.2, 0.8):
        quads = around(middles, width, 0.5 * width, 0.9)
        seen, turned = filtered(filter, light, quads), filtered(filter, rolled, quads @ turn.T)
        # A row or an entry at the rim of a quadrilateral may fall to either side by rounding.
        assert relative_error(turned, seen) < 2e-3
        assert np.median(np.abs(turned - seen) / seen) < 1e-4


@EVERY_ANTIALIASING
@pytest.mark.parametrize("pole", POLES, ids=["zenith", "nadir"])
def test_pixels_over_a_pole_see_what_is_round_it(filter, pole):
    light = smooth(64)
    for lean in (0.0, 0.03, 0.1, 0.3):
        for width in (0.05, 0.2, 0.5):
            middles = normalised(np.array(pole) + lean * np.array([[1, 0, 0], [0, 0, 1], [-0.6, 0, -0.8]]))
            quads = around(middles, width, width, 0.3)
            seen, truth = filtered(filter, light, quads), supersampled(light, quads)
            # A cap about the pole stands for a pixel round it, a rectangle of longitudes for one beside it.
            np.testing.assert_allclose(seen, truth, rtol=1e-3 if isinstance(filter, Subdivision) else 0.1)


@SPANNING
@pytest.mark.parametrize("pole", POLES, ids=["zenith", "nadir"])
def test_the_cap_about_a_pole_ends_where_the_pixel_does(filter, pole):
    # All light comes from a belt 0.4 to 0.5 from the pole: pixels that reach 0.3 from it see none.
    light = of_directions(
        lambda d: (np.abs(np.arccos(np.clip(d @ np.array(pole, float), -1, 1)) - 0.45) < 0.05) * 1.0, 64
    )
    assert not filtered(filter, light, around(pole, 0.4)).any()
    wide = around(pole, 0.9)
    np.testing.assert_allclose(filtered(filter, light, wide), supersampled(light, wide), rtol=0.4)


@SPANNING
def test_long_thin_pixels_that_wind_about_a_pole_stay_finite(filter):
    light = spiky(32)
    for width in (1e-6, 0.01, 3.0):
        seen = filtered(filter, light, around(normalised([[0, 1, 1e-7], [1e-8, -1, 0], [0, 1, 0.2]]), width, 3.0, 0.3))
        assert np.all(np.isfinite(seen))
        assert seen.min() > 0


@EVERY
def test_corners_that_all_point_alike_are_a_look_up(filter):
    light, middles = spiky(32), spread(100)
    quads = np.repeat(middles[:, None], 4, axis=1)
    np.testing.assert_allclose(
        filtered(filter, light, quads), light.lookup(middles), rtol=1e-4, atol=1e-5 * light.radiance.max()
    )


# --- silhouettes -----------------------------------------------------------------------------------------------------


@EVERY_ANTIALIASING
@pytest.mark.parametrize("own", [(1, 1, 0, 0), (0, 1, 1, 0), (1, 0, 1, 1), (0, 0, 0, 1)])
def test_a_corner_on_another_surface_lies_opposite_its_opposite(filter, own):
    # What the foreign corners say must not matter: they point at a sun.
    light, towards = sunny(64), normalised([0.7, 0.3, -0.65])
    middles = spread(300, seed=5)
    middles = middles[(middles @ towards < 0.6) & (np.abs(middles[:, 1]) < 0.8)]
    quads, keep = around(middles, 0.15, 0.1, 0.3), np.broadcast_to(np.array(own, bool), (len(middles), 4))
    whole = filtered(filter, light, quads)
    strayed = np.where(keep[..., None], quads, towards)
    seen = filtered(filter, light, strayed, middles=middles, own=keep)
    if sum(own) < 2:
        # Two corners known, or one: the others at the middle make a smaller pixel in its place.
        assert seen.max() < 1.5 * whole.max()
        assert relative_error(seen, whole) < 0.1
    else:
        assert relative_error(seen, whole) < 0.01


@EVERY_ANTIALIASING
def test_a_pixel_all_of_whose_corners_are_on_other_surfaces_is_looked_up_at_its_middle(filter):
    light, middles = spiky(32), spread(100)
    strayed = np.broadcast_to(normalised([0.7, 0.3, -0.65]), (100, 4, 3))
    seen = filtered(filter, light, strayed, middles=middles, own=np.zeros((100, 4), bool))
    np.testing.assert_allclose(seen, light.lookup(middles), rtol=1e-4, atol=1e-5 * light.radiance.max())


# --- each method's own promise ---------------------------------------------------------------------------------------


def test_without_subdivision_a_pixel_is_the_mean_of_its_corners():
    light, quads = spiky(32), around(spread(200), 1.2, 0.8, 0.4)
    corners = light.lookup(quads).mean(1)
    np.testing.assert_allclose(
        filtered(Subdivision(depth=0), light, quads), corners, rtol=1e-4, atol=1e-5 * corners.max()
    )


def test_deeper_subdivision_is_nearer_to_the_truth():
    light, quads = spiky(64), around(spread(300), 0.8, 0.6, 0.4)
    truth = supersampled(light, quads, 64)
    errors = [relative_error(filtered(Subdivision(depth), light, quads), truth) for depth in (0, 4, 8, 12)]
    assert np.all(np.diff(errors) < 0), errors
    assert errors[-1] < 0.02


@pytest.mark.parametrize("depth", [-1, 31])
def test_a_depth_that_cannot_be_is_refused(depth):
    with pytest.raises(ValueError, match=f"depth of the subdivision is {depth}; expected 0 to 30"):
        Subdivision(depth)


def test_the_mean_over_a_quadrilateral_is_that_of_the_entries_inside_it():
    light, quads = spiky(64), around(normalised(spread(60) * [1, 0.3, 1]), 0.6, 0.4, 0.7)
    height, width = light.radiance.shape[:2]
    polar, longitude = np.pi * (np.arange(height) + 0.5) / height, 2 * np.pi * (np.arange(width) + 0.5) / width - np.pi
    seen = filtered(Quadrilateral(), light, quads)
    for pixel, quad in zip(seen, quads, strict=True):
        # Edges are straight in the map; a point is inside if it lies on one side of all four.
        u, v = np.arctan2(quad[:, 0], -quad[:, 2]), np.arccos(quad[:, 1])
        away = np.remainder(longitude[None, :] - u[0] + np.pi, 2 * np.pi) - np.pi
        u = np.remainder(u - u[0] + np.pi, 2 * np.pi) - np.pi
        sides = [
            (u[b] - u[a]) * (polar[:, None] - v[a]) - (v[b] - v[a]) * (away - u[a])
            for a, b in ((0, 1), (1, 2), (2, 3), (3, 0))
        ]
        inside = np.all(np.array(sides) >= 0, axis=0) | np.all(np.array(sides) <= 0, axis=0)
        weights = inside * np.sin(polar)[:, None]
        expected = np.einsum("hwc,hw->c", light.radiance, weights) / weights.sum()
        np.testing.assert_allclose(pixel, expected, rtol=1e-4)


def rectangle(rows, top, bottom, left, right):
    """A pixel whose corners stand at entries' edges, given in entries of a map with so many rows."""
    v, u = np.pi * np.array([top, top, bottom, bottom]) / rows, np.pi * np.array([left, right, right, left]) / rows
    return np.stack([np.sin(v) * np.sin(u - np.pi), np.cos(v), -np.sin(v) * np.cos(u - np.pi)], -1)[None]


@pytest.mark.parametrize(("left", "right"), [(10, 14), (60, 67), (-5, 3)], ids=["inside", "over the seam", "before it"])
def test_differences_of_running_sums_are_the_mean_over_the_entries(left, right):
    light, areas = spiky(32), np.diff(np.sin(np.pi * (0.5 - np.arange(33) / 32)))
    rows, columns = np.arange(9, 15), np.arange(left, right) % 64
    entries, weights = light.radiance[np.ix_(rows, columns)], areas[rows][:, None, None]
    expected = (entries * weights).sum((0, 1)) / (weights.sum() * len(columns))
    seen = filtered(Preintegrated(), light, rectangle(32, 9, 15, left, right))
    np.testing.assert_allclose(seen[0], expected, rtol=1e-4)


def test_running_sums_keep_a_thousandth_beside_a_sun_of_a_million():
    # §8.3: "enough precision to accurately store the highest value times the number of pixels in the map".
    radiance = np.full((512, 1024, 3), 1e-3, np.float32)
    radiance[100:103, 200:203] = 1e6
    quads = around(normalised(spread(400) * [1, 1, 0.2] - [0, 0.6, 0]), 0.03)
    quads = quads[quads[:, 0, 1] < 0]  # below the horizon, where there is no sun
    table, filter = EnvironmentMap(radiance), Preintegrated()
    assert np.all(quads[..., 1] < 0.2)
    np.testing.assert_allclose(filtered(filter, table, quads), 1e-3, rtol=1e-5)

    class Single(Preintegrated):
        """The same sums in single precision."""

        def prepared(self, table):
            sums = super().prepared(table)
            return sums._replace(sums=sums.sums.astype(np.float32).astype(np.float64))

    assert np.abs(filtered(Single(), table, quads) / 1e-3 - 1).max() > 1  # not one digit is left


@pytest.mark.parametrize("rows", [36, 45, 50, 37, 3])
def test_pyramids_of_any_size_hold_the_light_at_every_level(rows):
    light = spiky(rows)
    pyramid = Mip().prepared(light.radiance)
    mean = light.total() / (4 * np.pi)
    assert pyramid.rows[-1] in (1, 2)
    for begin, size in zip(pyramid.begins, pyramid.rows, strict=True):
        padded = pyramid.values[begin : begin + (size + 2) * (2 * size + 2) * 4].reshape(size + 2, -1, 4)
        level = EnvironmentMap(padded[1:-1, 1:-1, :3].copy())
        np.testing.assert_allclose(level.total() / (4 * np.pi), mean, rtol=0.02)
    if rows > 3:
        assert filtered(Mip(), light, around(spread(50), 2.5)).mean(0) == pytest.approx(mean, rel=0.1)


def test_a_pyramids_levels_are_the_means_of_four_entries():
    light, areas = spiky(8), np.diff(np.sin(np.pi * (0.5 - np.arange(9) / 8)))[:, None, None]
    pyramid = Mip().prepared(light.radiance)
    sums = (light.radiance * areas).reshape(4, 2, 8, 2, 3).sum((1, 3))
    expected = sums / (2 * areas.reshape(4, 2, 1, 1).sum(1))
    level = pyramid.values[pyramid.begins[1] : pyramid.begins[1] + 6 * 10 * 4].reshape(6, 10, 4)[1:-1, 1:-1, :3]
    np.testing.assert_allclose(level, expected, rtol=1e-6)


# --- a picture -------------------------------------------------------------------------------------------------------

LAMPS = normalised([[0.3, 0.6, 0.7], [-0.5, 0.2, 0.6], [0.1, -0.4, 0.9], [0.8, 0.3, -0.1]])


@pytest.fixture(scope="module")
def lamps():
    """Four small lamps in a dim room: four pixels of the ball's hundred reflect half of its light."""
    return of_directions(lambda d: 0.05 + 100.0 * np.any(d @ LAMPS.T > np.cos(0.03), axis=-1), 256)


def ball(filter: Filter, light: EnvironmentMap, shift: np.ndarray, fine: int = 1) -> np.ndarray:
    """A mirror ball eight pixels wide, moved by part of a pixel, each pixel the mean of fine² plain ones."""
    camera = Camera(12 * fine, 12 * fine, 40.0 * fine, np.array([0, 0, 10.0]), np.eye(3))
    shape = Sphere((shift[0] / 4, shift[1] / 4, 0.0), 1.0, mirror())
    seen = Prefiltered(filter, background=False).render(Scene(light, objects=(shape,)), camera)
    return seen.radiance.reshape(12, fine, 12, fine, 3).mean((1, 3))


def test_highlights_of_a_small_ball_break_up_without_antialiasing_and_hold_with_each(lamps):
    shifts = np.random.default_rng(1).random((16, 2)) - 0.5
    truth = np.mean([ball(Plain(), lamps, shift, 32).sum() for shift in shifts[:3]])
    flux = {type(f): np.array([ball(f, lamps, shift).sum() for shift in shifts]) / truth for f in ALL}
    # Without, the lamps are lost between the pixels, or for one shift in ten are caught, and the ball flashes.
    assert flux[Plain].mean() < 0.6
    assert flux[Plain].std() > 0.2
    for filter, mean, scatter in ((Subdivision, 0.03, 0.03), (Quadrilateral, 0.03, 0.03), (Preintegrated, 0.03, 0.07)):
        assert abs(flux[filter].mean() - 1) < mean
        assert flux[filter].std() < scatter
    assert abs(flux[Mip].mean() - 1) < 0.08
    assert flux[Mip].std() < 0.08


@EVERY_ANTIALIASING
def test_pixels_of_a_small_ball_are_nearer_to_a_thousand_samples_than_plain_ones(filter, lamps):
    truth = ball(Plain(), lamps, np.array([0.2, -0.3]), 32)
    plain, seen = (ball(f, lamps, np.array([0.2, -0.3])) for f in (Plain(), filter))
    # MIP blurs to the longer side of what a pixel spans, and so spreads lamps over their neighbours.
    assert np.square(seen - truth).mean() < 0.6 * np.square(plain - truth).mean()
    if not isinstance(filter, Mip):
        assert np.abs(seen - truth).mean() < 0.5 * np.abs(plain - truth).mean()


@EVERY
def test_the_number_of_threads_does_not_change_a_bit(filter):
    light, quads = spiky(32), around(spread(40_000), 0.2, 0.1, 0.4)
    one = filtered(filter, light, quads, threads=1)
    for threads in (2, 3, None):
        assert np.array_equal(filtered(filter, light, quads, threads=threads), one)


@EVERY
def test_pixels_that_are_not_chosen_stay_as_they_are(filter):
    light, quads = constant(16), around(spread(10), 0.1)
    corners, middles = quads.reshape(-1, 3).astype(np.float32), normalised(quads.mean(1)).astype(np.float32)
    samples = Samples(
        middles, middles, np.zeros(10, np.int32), np.arange(40, dtype=np.int32).reshape(10, 4),
        corners, corners, np.zeros(40, np.int32),
    )  # fmt: skip
    seen = np.full((10, 4), 7, np.float32)
    half = term(Layer(Mirror()), np.full((1, 3), 0.5), np.zeros((1, 3)))
    filter.add(seen, np.array([2, 9], np.int32), Spans(samples, 1), half, filter.prepared(light.radiance))
    expected = np.full((10, 3), 7.0)
    expected[[2, 9]] = 7.5
    np.testing.assert_allclose(seen[:, :3], expected, rtol=1e-6)


def test_neighbours_and_samples_apart_are_looked_up_alike_term_by_term_or_at_once():
    light, quads = spiky(32), around(spread(3000), 0.2)
    corners, middles = quads.reshape(-1, 3).astype(np.float32), normalised(quads.mean(1)).astype(np.float32)
    samples = Samples(
        middles, np.roll(middles, 1, axis=0), np.zeros(3000, np.int32),
        np.arange(12_000, dtype=np.int32).reshape(-1, 4), corners, corners, np.zeros(12_000, np.int32),
    )  # fmt: skip
    plain, spans = Plain(), Spans(samples, 2)
    table, whole = plain.prepared(light.radiance), np.arange(3000, dtype=np.int32)
    black, layer = np.zeros((1, 3)), Layer(Lambert(), Towards.NORMAL)
    diffuse, shiny = term(layer, np.full((1, 3), 0.5), black), term(Layer(Mirror()), np.ones((1, 3)), black)
    together, apart, once = np.zeros((3, 3000, 4), np.float32)
    for each in (diffuse, shiny):
        plain.add(together, whole, spans, each, table)
        for first in range(3):
            plain.add(apart, whole[first::3].copy(), spans, each, table)
    plain.add_all(once, spans, [(whole, diffuse, table), (whole, shiny, table)])
    expected = 0.5 * light.lookup(middles)
    mirrored = 2 * np.sum(middles * samples.to_eye, axis=1, keepdims=True) * middles - samples.to_eye
    expected = expected + light.lookup(normalised(mirrored))
    np.testing.assert_allclose(together[:, :3], expected, rtol=1e-3, atol=1e-4 * light.radiance.max())
    np.testing.assert_array_equal(apart, together)
    np.testing.assert_array_equal(once, together)


def test_a_picture_of_several_materials_at_once_is_the_sum_of_their_terms():
    light, count = spiky(32), 3000
    random = np.random.default_rng(2)
    normal, to_eye = (normalised(random.normal(size=(count, 3))).astype(np.float32) for _ in range(2))
    # Blocks of one material, of none, of two mixed; the third material is nowhere and the fourth is the first again.
    surface = np.repeat([0, -1, 1, 3], 750).astype(np.int32)
    surface[600:900] = random.integers(0, 2, 300)
    nothing = np.zeros((0, 3), np.float32)
    corners = np.zeros((count, 4), np.int32), nothing, nothing, np.zeros(0, np.int32)
    samples = Samples(normal, to_eye, surface, *corners)
    satin = Reflective((Layer(Lambert(), Towards.NORMAL, colour=(0.5, 0.4, 0.3)), Layer(Phong(20))))
    shiny, nowhere = mirror(), Reflective((Layer(Phong(7)),))
    shading = Shading.of([satin, shiny, nowhere, satin], light, Plain(), 2)
    found = shading.light(samples, np.zeros((count, 2)))
    expected, spans = np.zeros((count, 4), np.float32), Spans(samples, 1)
    for index, layers in enumerate(shading.layers):
        for layer, table in layers:
            colours = np.reshape(layer.layer.colour, (1, 3)), np.ones((1, 3))
            chosen = np.flatnonzero(surface == index).astype(np.int32)
            Plain().add(expected, chosen, spans, term(layer.layer, *colours), table)
    assert np.all(found[surface < 0] == 0) and np.all(found[surface >= 0] > 0)
    np.testing.assert_array_equal(found, expected[:, :3])


@pytest.mark.parametrize("filter", [Plain(), Mip()])
@pytest.mark.parametrize("materials", [(), (Reflective(()),)])
def test_a_picture_without_any_term_is_black(materials, filter):
    nothing, vectors = np.zeros((0, 3), np.float32), np.zeros((3, 3), np.float32)
    corners = np.zeros((3, 4), np.int32), nothing, nothing, np.zeros(0, np.int32)
    samples = Samples(vectors, vectors, np.full(3, len(materials) - 1, np.int32), *corners)
    found = Shading.of(materials, constant(32), filter).light(samples, np.zeros((3, 2)))
    np.testing.assert_array_equal(found, np.zeros((3, 3)))


def test_a_normal_that_is_no_number_is_seen_and_harms_no_neighbour():
    light, quads = spiky(32), around(spread(40), 0.2)
    broken = quads.mean(1)
    broken[7] = np.nan
    seen = filtered(Plain(), light, quads, middles=broken)
    assert np.isnan(seen[7]).all()
    np.testing.assert_allclose(np.delete(seen, 7, 0), np.delete(filtered(Plain(), light, quads), 7, 0), rtol=1e-3)


@pytest.mark.parametrize("filter", [Subdivision(), Quadrilateral(), Preintegrated()], ids=lambda f: type(f).__name__)
def test_slivers_keep_their_light(filter):
    # A cylinder's pixel reflects a long and thin piece, thinner than an entry, in which hardly a middle lies.
    light, middles = spiky(64), spread(400)
    along = normalised(np.cross(middles, [0.3, 0.9, 0.2]))
    across = np.cross(middles, along)
    sides = ((-1, -1), (1, -1), (1, 1), (-1, 1))
    quads = normalised(np.stack([middles + 0.4 * i * along + 0.004 * j * across for i, j in sides], axis=1))
    truth = supersampled(light, quads)
    seen = filtered(filter, light, quads)
    assert seen.mean() == pytest.approx(truth.mean(), rel=0.02)
    if not isinstance(filter, Preintegrated):  # whose rectangles are as wide as a slanting sliver is long
        assert np.abs(seen - truth).mean() < 0.1 * truth.mean()
