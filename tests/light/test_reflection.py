"""Reflection maps D and S (Miller & Hoffman 1984, §6): known lights, the sums written out, and what is refused."""

import numpy as np
import pytest

import naive
from lights import constant, lone, of_directions, spiky, spread
from relume.errors import OutputNotWritten
from relume.light.reflection.convolution import TOLERANCE, convolved, cut_up
from relume.light.reflection.files import ReflectionFiles, write_reflection_maps
from relume.light.reflection.lobes import VARNISH, Cosine, GGXLobe, Lambert, Mirror, Phong, SelfLuminous, WardLobe
from relume.light.reflection.reflection_map import Normalisation, reflection_map, reflection_maps, rows_for
from relume.sphere.directions import normalised
from relume.sphere.environment_map import EnvironmentMap
from relume.sphere.mappings.discs import Angular
from relume.sphere.mappings.mapping import LatLong, pixel_points

RADIOMETRIC, PAPER, SUM = Normalisation.RADIOMETRIC, Normalisation.PAPER, Normalisation.SUM
LOBES = {
    "lambert": Lambert(0.8),
    "self-luminous": SelfLuminous(0.5),
    "a hemisphere": Phong(0),
    "phong 1.5": Phong(1.5),
    "phong 5": Phong(5),
    "phong 50": Phong(50, 0.5),
    "phong 300": Phong(300),
    "phong 1000": Phong(1000),
    "ggx .05": GGXLobe(0.05),
    "ggx .3": GGXLobe(0.3, 0.5),
    "ward .05": WardLobe(0.05),
    "ward .2": WardLobe(0.2),
    "a step": Cosine(lambda x: (x > 0.9) * 1.0),
    "a polynomial": Cosine(lambda x: (1 + x) ** 2),
    "a far side": Cosine(lambda x: np.maximum(-x, 0) ** 3, 0.7, 0.5),
}
EVERY = pytest.mark.parametrize("lobe", LOBES.values(), ids=LOBES.keys())
SOME = pytest.mark.parametrize("lobe", [LOBES[n] for n in ("lambert", "phong 50", "ggx .3")], ids=["D", "S", "ggx"])


def entries(rows):
    return LatLong().directions(pixel_points(LatLong(), rows))


# --- known lights ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("normalisation", "value"), [(SUM, 3.141593), (RADIOMETRIC, 1.0), (PAPER, 0.25)])
def test_lamberts_map_of_constant_light_by_the_three_normalisations(normalisation, value):
    table = reflection_map(constant(512), Lambert(), normalisation=normalisation).table  # A1, A6
    np.testing.assert_allclose(table, value, rtol=1e-5)


@pytest.mark.parametrize(("normalisation", "value"), [(SUM, 0.7 * 12.566371), (RADIOMETRIC, 0.7), (PAPER, 0.7)])
def test_self_luminous_material_glows_with_the_mean_light(normalisation, value):
    table = reflection_map(constant(16, (1, 2, 0.5)), SelfLuminous(0.7), 9, normalisation).table
    np.testing.assert_allclose(table, np.broadcast_to(np.array([1, 2, 0.5]) * value, table.shape), rtol=1e-6)


@pytest.mark.parametrize(("n", "total"), [(1, np.pi), (50, 0.123200), (1000, 0.006277)])
def test_phongs_map_of_constant_light(n, total):
    # A7; of 512 rows, because at the poles a pixel's centre is not its middle: 1.4e-4 at 256 with n = 50, 3.4e-5 here.
    np.testing.assert_allclose(reflection_map(constant(512), Phong(n), 9, SUM).table, total, rtol=1e-4)


@EVERY
def test_the_normalisations_differ_by_their_named_divisors_and_nothing_else(lobe):
    light = spiky(8)
    sums = reflection_map(light, lobe, 6, SUM).table
    paper, radiometric = (reflection_map(light, lobe, 6, n) for n in (PAPER, RADIOMETRIC))
    np.testing.assert_allclose(paper.table, sums / (4 * np.pi), rtol=1e-6)
    np.testing.assert_allclose(radiometric.table, sums / (lobe.integral / lobe.k), rtol=1e-6)
    assert (paper.normalisation, radiometric.normalisation) == (PAPER, RADIOMETRIC)


@pytest.mark.parametrize("n", [1, 50, 1000])
def test_phongs_map_by_the_papers_constant_and_the_radiometric_one(n):
    light = constant(256)
    paper, radiometric = (reflection_map(light, Phong(n), 9, norm).table for norm in (PAPER, RADIOMETRIC))
    np.testing.assert_allclose(paper, 1 / (2 * (n + 1)), rtol=2e-4)  # A7
    np.testing.assert_allclose(radiometric, 1, rtol=2e-4)


@pytest.mark.parametrize("towards", [[0, 1, 0], [1, 0, 0], [1, 2, -0.5]], ids=["up", "right", "askew"])
def test_a_half_lit_sphere_of_light_gives_lamberts_known_values(towards):
    towards = normalised(towards)
    size = 256
    light = of_directions(lambda d: (d @ towards > 1e-9) + 0.5 * (np.abs(d @ towards) <= 1e-9), size)
    across = normalised(np.cross(towards, [0.3, 0.1, 1]))
    angles = np.radians([0, 60, 90, 120, 180])[:, None]
    normals = np.cos(angles) * towards + np.sin(angles) * across
    found = reflection_map(light, Lambert(), 180, SUM).lookup(normals)
    # A2; the edge of the light runs through pixels: up to half a pixel's light at grazing angles.
    irradiance = np.array([3.141593, 2.356194, 1.570796, 0.785398, 0])
    np.testing.assert_allclose(found, np.repeat(irradiance[:, None], 3, axis=1), atol=2e-3 * np.pi)


def test_light_that_grows_upwards_gives_lamberts_known_values():
    d = reflection_map(of_directions(lambda d: 1 + d[..., 1], 256), Lambert(), 180, SUM)
    found = d.lookup(np.array([[0.0, 1, 0], [1, 0, 0], [0, 0, -1], [0, -1, 0]]))[:, 0]
    assert found == pytest.approx([5.235988, 3.141593, 3.141593, 1.047198], rel=2e-4)  # A3


@pytest.mark.parametrize(("degree", "factor"), [(1, 2.094395), (2, 0.785398), (3, 0), (4, -0.130900), (6, 0.049087)])
def test_lambert_damps_a_harmonic_of_the_light_by_its_factor(degree, factor):
    legendre = np.polynomial.Legendre.basis(degree)
    axis = normalised([1, 2, -0.5])
    table = reflection_map(of_directions(lambda d: 1 + legendre(d @ axis), 256), Lambert(), 18, SUM).table
    expected = np.pi + factor * legendre(entries(18) @ axis)  # A4
    np.testing.assert_allclose(table[..., 0], expected, atol=3e-5 * np.pi)


@pytest.mark.parametrize("lobe", [Phong(10), Phong(200), GGXLobe(0.3), WardLobe(0.2)])
def test_a_lobe_damps_a_harmonic_of_the_light_by_its_zonal_coefficient(lobe):
    theta = np.pi * (np.arange(200_000) + 0.5) / 200_000
    legendre, axis = np.polynomial.Legendre.basis(3), normalised([1, 2, -0.5])
    factor = 2 * np.pi * (lobe(np.cos(theta)) * legendre(np.cos(theta))) @ np.sin(theta) * np.pi / 200_000
    table = reflection_map(of_directions(lambda d: 1 + legendre(d @ axis), 256), lobe, 18, SUM).table
    expected = lobe.integral + factor * legendre(entries(18) @ axis)
    np.testing.assert_allclose(table[..., 0], expected, atol=2e-3 * lobe.integral)


@pytest.mark.parametrize("n", [1, 50, 1000])
def test_on_the_edge_of_a_half_lit_sphere_a_highlight_is_half_as_bright(n):
    # A8. The edge is where pixels meet, so that each is lit or dark.
    light = of_directions(lambda d: (d[..., 0] > 0) * 1.0, 256)
    edge = normalised(np.stack([np.zeros(9), np.linspace(-2, 2, 9), np.full(9, -1.0)], -1))
    found = reflection_map(light, Phong(n), 128).lookup(edge)
    np.testing.assert_allclose(found, 0.5, rtol=2e-3)


# --- the sums written out --------------------------------------------------------------------------------------------


# Neither 32 columns nor 72 divide the map's 30: of 36 rows all that holds of 16 is seen.
@pytest.mark.parametrize(
    "rows", [5, pytest.param(16, marks=pytest.mark.slow), 36], ids=["5 rows", "16 rows", "36 rows"]
)
@EVERY
def test_a_table_is_the_sum_over_all_pixels(lobe, rows):
    # Of 10, 32 and 72 columns only the first divide the map's 30. No pixel lies on an entry's horizon, where steps are.
    light = cut_up(spiky(15), lobe.width)
    # Of larger tables one column in so many, at all places within those of the map.
    every = {5: 1, 16: 3, 36: 14}[rows]
    slow = naive.reflection_sums(light.radiance, lobe, rows, every)
    table, bound = convolved(light, lobe, rows)
    error = np.abs(table[:, ::every] / slow - 1).max()
    assert error <= max(bound, 1e-10)
    assert bound <= TOLERANCE <= 1e-4
    found = reflection_map(light, lobe, rows, SUM)
    assert found.error_bound == bound
    np.testing.assert_allclose(found.table[:, ::every], slow, rtol=bound + 1e-6)


@EVERY
def test_a_sun_of_a_million_in_the_dark_leaves_the_dark_side_as_it_is(lobe):
    for row, column in ((5, 9), (0, 31)):
        light = lone(16, row, column, 1e6, dark=1.0)
        slow = naive.reflection_sums(light.radiance, lobe, 9)
        table, bound = convolved(light, lobe, 9)
        assert np.abs(table / slow - 1).max() <= max(bound, 1e-9)
        assert bound <= TOLERANCE


def test_smooth_lobes_go_by_harmonics_and_others_by_their_exact_sums():
    light = spiky(16)
    assert 0 < convolved(light, Phong(50), 9)[1] <= TOLERANCE
    assert convolved(light, Phong(1.5), 9)[1] == 0
    assert convolved(light, Lambert(), 9)[1] == 0


@pytest.mark.parametrize("name", ["lambert", "phong 5", "phong 1000", "ggx .3", "a polynomial", "a far side"])
def test_a_light_alone_in_the_black_is_never_less_than_nothing(name):
    # At grazing angles sums cancel to a little more or less than 0, which no light may be.
    lobe = LOBES[name]
    for row in (0, 3, 7, 15):
        light = cut_up(lone(16, row, 5), lobe.width)
        table = reflection_map(light, lobe, 8, SUM).table
        slow = naive.reflection_sums(light.radiance, lobe, 8)
        assert table.min() >= 0
        np.testing.assert_allclose(table, slow, atol=1e-7 * slow.max())


def test_no_light_reflects_none():
    for lobe in (*LOBES.values(), Mirror(), Phong(varnish=VARNISH)):
        assert not reflection_map(constant(8, 0.0), lobe, 6).table.any()


@pytest.mark.parametrize("size", [1, 2, 3, 33])
@SOME
def test_tables_of_a_map_of_any_size(lobe, size):
    light = cut_up(spiky(size), lobe.width)
    for rows in (1, 2, 7):
        slow = naive.reflection_sums(light.radiance, lobe, rows)
        np.testing.assert_allclose(reflection_map(light, lobe, rows, SUM).table, slow, rtol=1e-4, atol=1e-12)


# --- mirrors and varnish ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize("normalisation", list(Normalisation))
def test_a_perfect_mirrors_map_is_the_illumination_map(normalisation):
    light = spiky(16)
    s = reflection_map(light, Mirror(), normalisation=normalisation)
    assert np.array_equal(s.table, light.radiance)
    np.testing.assert_allclose(reflection_map(light, Mirror(0.5)).table, light.radiance / 2, rtol=1e-7)


def test_a_mirrors_table_of_another_size_keeps_the_lights_energy():
    light = spiky(16)
    s = reflection_map(light, Mirror(), 24)
    assert s.light.size == 24
    np.testing.assert_allclose(s.light.total(), light.total(), rtol=1e-3)


@pytest.mark.parametrize("normalisation", [Normalisation.RADIOMETRIC, Normalisation.PAPER])
def test_varnish_adds_half_of_the_illumination_map_to_phongs(normalisation):
    light = spiky(16)
    varnished = reflection_map(light, Phong(20, 0.6, VARNISH), 16, normalisation)
    bare = reflection_map(light, Phong(20, 0.6), 16, normalisation)
    np.testing.assert_allclose(varnished.table, bare.table + 0.5 * light.radiance, rtol=1e-6)


def test_varnish_over_nothing_is_half_a_mirror():
    light = spiky(8)
    np.testing.assert_allclose(reflection_map(light, Phong(20, 0, VARNISH)).table, light.radiance / 2, rtol=1e-7)


# --- what every table keeps ------------------------------------------------------------------------------------------


@EVERY
def test_reflection_adds_up(lobe):
    one, other = spiky(12, seed=1), spiky(12, seed=2)
    both = EnvironmentMap(one.radiance + 3 * other.radiance)
    tables = [reflection_map(light, lobe, 10, SUM).table.astype(float) for light in (one, other, both)]
    np.testing.assert_allclose(tables[2], tables[0] + 3 * tables[1], rtol=2e-4)


@EVERY
def test_turning_the_light_by_whole_columns_turns_the_table(lobe):
    light = spiky(8)
    turned = EnvironmentMap(np.roll(light.radiance, 4, axis=1))
    for rows, columns in ((8, 4), (12, 6)):
        table = reflection_map(light, lobe, rows).table
        np.testing.assert_allclose(reflection_map(turned, lobe, rows).table, np.roll(table, columns, 1), rtol=2e-4)


@EVERY
def test_light_mirrored_left_to_right_and_upside_down_mirrors_the_table(lobe):
    light = spiky(9)
    table = reflection_map(light, lobe, 7).table
    flipped = reflection_map(EnvironmentMap(light.radiance[::-1, ::-1].copy()), lobe, 7).table
    np.testing.assert_allclose(flipped, table[::-1, ::-1], rtol=2e-4)


def test_the_channels_do_not_mix():
    light = spiky(8)
    for lobe in (Lambert(), Phong(5), GGXLobe(0.3)):
        swapped = reflection_map(EnvironmentMap(light.radiance[..., ::-1].copy()), lobe, 6).table
        np.testing.assert_allclose(swapped[..., ::-1], reflection_map(light, lobe, 6).table, rtol=2e-4)


@EVERY
def test_the_same_light_gives_the_same_table_to_the_bit(lobe):
    light = spiky(40)
    assert np.array_equal(reflection_map(light, lobe, 9).table, reflection_map(light, lobe, 9).table)


@pytest.mark.parametrize("unit", ["cd/m²", "relative"])
def test_the_unit_is_the_lights(unit):
    light = EnvironmentMap(spiky(8).radiance, unit=unit)
    for lobe in (Lambert(), Phong(), Mirror()):
        assert reflection_map(light, lobe).light.unit == unit


@SOME
def test_light_in_an_angular_map_gives_the_same_table(lobe):
    def smooth(d):
        return 2 + d @ np.array([0.8, 0.5, -1.0])

    table = reflection_map(of_directions(smooth, 64, Angular()), lobe, 12).table
    np.testing.assert_allclose(table, reflection_map(of_directions(smooth, 64), lobe, 12).table, rtol=5e-3)


@SOME
def test_look_up_goes_on_over_the_seam_and_the_poles(lobe):
    table = reflection_map(spiky(8), lobe, 9)
    around = np.linspace(0, 2 * np.pi, 4001)
    peak = table.table.max()
    for start, other in (([0, 0, 1], [0, 1, 0]), ([0, 0, 1], [1, 0.001, 0])):
        circle = np.cos(around)[:, None] * normalised(start) + np.sin(around)[:, None] * normalised(other)
        # Values below the peak change by at most two peaks an entry, and an entry is π/9 wide.
        assert np.abs(np.diff(table.lookup(circle), axis=0)).max() < 2 * peak * 9 / np.pi * 2 * np.pi / 4000


def test_look_up_of_an_entrys_direction_is_the_entry():
    s = reflection_map(spiky(8), Phong(20), 9)
    np.testing.assert_allclose(s.lookup(entries(9)), s.table, rtol=1e-5)


@pytest.mark.parametrize("lobe", [Lambert(), Phong(5), Phong(50), Phong(200), GGXLobe(0.2), WardLobe(0.1)])
def test_the_table_is_fine_enough_for_bilinear_look_up(lobe):
    light = lone(64, 25, 22)
    s = reflection_map(light, lobe, normalisation=SUM)
    directions = np.concatenate([spread(2000), normalised(spread(2000) * 0.3 + naive_direction(light))])
    truth = lobe(np.clip(directions @ naive_direction(light), -1, 1)) * light.total()[0]
    # By a single light the table is the lobe itself, and ROWS_PER_WIDTH promises about 0.2 % of its peak. The paper's
    # 36 rows for Lambert cut the corner at the terminator: a quarter of an entry's π/36.
    assert np.abs(s.lookup(directions)[:, 0] - truth).max() < (0.022 if lobe.name == "lambert" else 3e-3) * truth.max()


def naive_direction(light):
    row, column, _ = np.unravel_index(light.radiance.argmax(), light.radiance.shape)
    return entries(light.size)[row, column]


@pytest.mark.parametrize(
    ("lobe", "rows"),
    [(Lambert(), 36), (Mirror(), 100), (Phong(20, varnish=0.5), 100), (Phong(50), 256), (SelfLuminous(), 16)],
)
def test_the_rows_of_a_table_unless_asked(lobe, rows):
    assert rows_for(lobe, 100) == rows
    assert reflection_map(spiky(100), lobe).table.shape == (rows, 2 * rows, 3)


def test_the_two_maps_of_the_paper():
    light = spiky(16)
    d, s = reflection_maps(light)
    assert d.table.shape == (36, 72, 3)  # §6.1
    assert (d.lobe, s.lobe) == (Lambert(), Phong(50))
    assert np.array_equal(s.table, reflection_map(light, Phong(50)).table)
    assert isinstance(reflection_maps(light, WardLobe(0.2))[1].lobe, WardLobe)


# --- what is refused -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("rows", [0, -3])
@pytest.mark.parametrize("lobe", [Lambert(), Phong(), Mirror()])
def test_a_table_without_rows_is_refused(lobe, rows):
    with pytest.raises(ValueError, match=rf"a table of {rows} rows; expected 1 or more, like 36 for Lambert"):
        reflection_map(constant(8), lobe, rows)


def test_a_map_without_rows_is_refused():
    with pytest.raises(ValueError, match=r"shape \(0, 0, 3\); a map has at least one row"):
        EnvironmentMap(np.zeros((0, 0, 3), np.float32))


@pytest.mark.slow
def test_a_whole_map_agrees_with_the_sums_written_out():
    light = spiky(64)
    for lobe in LOBES.values():
        slow = naive.reflection_sums(cut_up(light, lobe.width).radiance, lobe, 36)
        found = reflection_map(light, lobe, 36, SUM)
        np.testing.assert_allclose(found.table, slow, rtol=1e-4)


@pytest.mark.parametrize("n", [1000, 5000, 50000])
def test_constant_light_stays_itself_under_lobes_narrower_than_the_maps_pixels(n):
    np.testing.assert_allclose(reflection_map(constant(32), Phong(n), 16).table, 1, rtol=3e-3)


@pytest.mark.parametrize("n", [1e7, 1e9])
def test_a_lobe_narrower_than_any_pixel_is_a_mirror_and_that_is_reported(n):
    light = spiky(16)
    with pytest.warns(UserWarning, match="taken for a mirror"):
        narrow = reflection_map(light, Phong(n), 16)
    np.testing.assert_allclose(narrow.table, light.radiance, rtol=1e-6)


def test_a_varnish_is_not_added_to_sums():
    with pytest.raises(ValueError, match="adds a mirror's radiance to sums"):
        reflection_map(constant(8), Phong(50, varnish=0.5), 8, Normalisation.SUM)


def test_the_folder_of_the_files_is_made_and_one_that_cannot_be_is_named(tmp_path):
    wanted = ReflectionFiles({"diffuse": Lambert()}, rows=4)
    made = write_reflection_maps(constant(8), tmp_path / "new" / "maps", wanted)
    assert all(path.is_file() for path in made.paths) and len(made.paths) == 2
    (tmp_path / "file").write_text("")
    with pytest.raises(OutputNotWritten, match=r"file: cannot be made a folder .*; choose another$"):
        write_reflection_maps(constant(8), tmp_path / "file", wanted)
