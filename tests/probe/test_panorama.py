"""Panoramas: views of a known world, and what comes back of the world, the camera's turns and its faults."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.ndimage import maximum_filter

import lights
from angles import degrees_between, degrees_turned
from panoramas import all_round, patchwork, photograph
from relume.capture.lens.vignetting import Vignetting
from relume.errors import NotAPanorama
from relume.image.radiance import OUTSIDE, SATURATED, RadianceMap
from relume.probe.panorama.balance import Balancing, balance
from relume.probe.panorama.files_to_map import panorama_from_files
from relume.probe.panorama.seams import fill
from relume.probe.panorama.stitching import Panorama, stitch_panorama
from relume.probe.panorama.views import FACES, PanoramaView, orientation
from relume.sphere.directions import normalised
from relume.sphere.mappings.mapping import LatLong, pixel_points

WORLD = patchwork()
ROTATIONS = all_round()
GAINS = np.exp(0.25 * np.random.default_rng(5).normal(size=len(ROTATIONS)))
FOCAL_LENGTH, SIZE = 128.0, (256, 208)
FALLOFF = (-0.3, 0.05, -0.05)
NORMALS = normalised(np.random.default_rng(1).normal(size=(60, 3)))


def views_of(said: bool, *, focal_error: float = 0.0, distortion: float = 0.0) -> list[PanoramaView]:
    return [
        PanoramaView(
            photograph(
                WORLD, turn, focal_length=FOCAL_LENGTH, size=SIZE, gain=gain, vignetting=FALLOFF, noise=0.01,
                distortion=distortion, seed=index,
            ),
            FOCAL_LENGTH * (1 + focal_error),
            turn if said else None,
            f"view {index}",
        )
        for index, (turn, gain) in enumerate(zip(ROTATIONS, GAINS, strict=True))
    ]  # fmt: skip


def face_views(world=WORLD, focal_length: int = 100, gains: dict[str, float] | None = None) -> list[PanoramaView]:
    """The six faces of a cube, each given with where it looked."""
    views = []
    for name, angles in FACES.items():
        turn, side = orientation(*np.radians(angles)), 2 * focal_length
        gain = (gains or {}).get(name, 1.0)
        picture = photograph(world, turn, focal_length=focal_length, size=(side, side), gain=gain)
        views.append(PanoramaView(picture, focal_length, turn, name))
    return views


def ahead(*yaws: float, given: bool = True) -> list[PanoramaView]:
    """Views on the horizon, turned to the right by degrees, named a, b, …"""
    turns = [orientation(np.radians(yaw)) for yaw in yaws]
    pictures = [photograph(WORLD, turn) for turn in turns]
    return [
        PanoramaView(picture, 160, turn if given else None, name)
        for picture, turn, name in zip(pictures, turns, "abcde", strict=False)
    ]


def off_world(result: Panorama, turns: list[np.ndarray]) -> np.ndarray:
    """The found world from the true one."""
    total = sum(found.placed @ true.T for found, true in zip(result.views, turns, strict=True))
    u, _, vt = np.linalg.svd(total)
    return u @ vt


@cache
def true_irradiance() -> np.ndarray:
    return WORLD.irradiance(NORMALS)


def irradiance_error(result: Panorama, world_turn: np.ndarray) -> float:
    """Largest relative error over all directions; the scale, which nothing says, is taken out."""
    true, found = true_irradiance(), result.light.irradiance(NORMALS @ world_turn.T)
    ratio = found / true
    return float(np.abs(ratio / ratio.mean() - 1).max())


def gain_error(result: Panorama) -> float:
    product = result.gains[:, 0] * GAINS
    return float(np.abs(product / np.exp(np.log(product).mean()) - 1).max())


def test_views_of_given_orientation_give_the_world_back_with_gains_and_vignetting():
    result = stitch_panorama(views_of(True))
    assert irradiance_error(result, np.eye(3)) < 0.01
    assert gain_error(result) < 0.01
    np.testing.assert_allclose(result.vignetting.falloff(SIZE), Vignetting(FALLOFF).falloff(SIZE), atol=0.01)
    assert result.unseen == 0 and result.saturated == 0 and result.light.clipped is None
    assert result.warnings == () and result.error is None
    assert result.light.size == 400  # 128 π, to a multiple of 16


def test_a_ring_of_views_is_matched_from_a_field_given_wrongly():
    turns = [orientation(*np.radians((30 * i, 3 * (-1) ** i, 2 * (-1) ** (i // 2)))) for i in range(12)]
    pictures = [photograph(WORLD, turn, focal_length=160, size=(224, 160), cells=2) for turn in turns]
    views = [PanoramaView(picture, 165, None, f"{i}") for i, picture in enumerate(pictures)]
    result = stitch_panorama(views, size=64, balancing=None)
    turn = off_world(result, turns)
    worst = max(degrees_turned(turn @ true, view.placed) for true, view in zip(turns, result.views, strict=True))
    assert worst < 0.1
    assert result.views[0].focal_length == pytest.approx(160, rel=2e-3)
    assert result.error is not None and 0 < np.degrees(result.error) < 0.3
    # Level to what the hand's rolls leave, and the first view ahead.
    assert degrees_between(turn[1], (0, 1, 0)) < 1
    assert abs(result.views[0].axis[0]) < 1e-9 and result.views[0].axis[2] < 0


@pytest.mark.slow
def test_matched_views_find_turns_focal_length_distortion_and_the_world():
    result = stitch_panorama(views_of(False, focal_error=0.05, distortion=-0.03))
    turn = off_world(result, ROTATIONS)
    worst = max(degrees_turned(turn @ true, view.placed) for true, view in zip(ROTATIONS, result.views, strict=True))
    assert worst < 0.1
    assert result.views[0].focal_length == pytest.approx(FOCAL_LENGTH, rel=2e-3)
    assert result.views[0].distortion == pytest.approx(-0.03, abs=2e-3)
    assert gain_error(result) < 0.01
    assert irradiance_error(result, turn) < 0.01
    # The hand was loose by 4°, so the mean of its faults is about one.
    assert degrees_between(turn[1], (0, 1, 0)) < 2.5


def test_no_seam_is_seen_in_a_smooth_sky():
    # A step of a third of a per cent is not seen at any exposure.
    def sky(directions: np.ndarray) -> np.ndarray:
        return np.exp(directions @ np.array([1.0, 0.7, -0.5]) + 0.5 * np.sin(4 * directions[..., 0]))

    world = lights.of_directions(sky, 256)
    views = []
    for index, (turn, gain) in enumerate(zip(ROTATIONS, GAINS, strict=True)):
        picture = photograph(world, turn, focal_length=FOCAL_LENGTH, size=SIZE, gain=gain, vignetting=FALLOFF)
        views.append(PanoramaView(picture, FOCAL_LENGTH, turn, f"{index}"))
    result = stitch_panorama(views)
    ratio = np.log(result.light.radiance[..., 0] / sky(LatLong().directions(pixel_points(LatLong(), 400))))
    assert np.ptp(ratio) < 0.02
    steps = np.concatenate([np.abs(np.diff(ratio, axis=axis)).ravel() for axis in (0, 1)])
    assert steps.max() < 0.0035


def test_six_faces_of_a_cube_are_evened_at_their_edges():
    gains = dict(zip(FACES, (1.0, 1.2, 0.85, 1.1, 0.95, 1.05), strict=True))
    result = stitch_panorama(face_views(gains=gains), size=256)
    product = result.gains[:, 0] * list(gains.values())
    assert np.abs(product / product.mean() - 1).max() < 0.04
    assert result.unseen == 0
    assert irradiance_error(result, np.eye(3)) < 0.03


def textured_faces(gains: dict[str, float] | None = None) -> list[PanoramaView]:
    """Faces of a world that grows brighter to one side, with clutter that is finer than what rims compare."""

    def radiance(directions: np.ndarray) -> np.ndarray:
        fine = 0.05 * np.sin(40 * directions).sum(-1)
        return np.exp(directions @ np.array([1.2, 0.9, -0.7]) + fine)

    return face_views(lights.of_directions(radiance, 256), 75, gains)


def test_exact_faces_that_only_touch_are_not_balanced():
    views = textured_faces()
    result = stitch_panorama(views, size=128)
    assert np.all(result.gains == 1) and result.notes == ()
    np.testing.assert_array_equal(
        result.light.radiance, stitch_panorama(views, size=128, balancing=None).light.radiance
    )


def test_rims_show_the_gain_of_one_face_and_leave_the_others():
    found = balance(textured_faces({"back": 1.1}))
    gains = dict(zip(FACES, found.gains[:, 0], strict=True))
    assert gains.pop("back") == pytest.approx(1 / 1.1, rel=0.01)
    np.testing.assert_allclose(list(gains.values()), 1, atol=0.005)
    assert len(found.remarks) == 1 and "views only touch" in found.remarks[0] and "back" in found.remarks[0]


def test_views_whose_given_orientation_is_wrong_are_doubted_balanced_or_not():
    views = ahead(0, 40)
    wrong = [views[0], replace(views[1], rotation=orientation(np.radians(25)))]
    for balancing in (None, Balancing()):
        assert stitch_panorama(views, size=64, balancing=balancing).warnings == ()
        (line,) = stitch_panorama(wrong, size=64, balancing=balancing).warnings
        assert "check their orientation (yaw to the right, pitch up, roll clockwise)" in line


def test_faces_that_agree_are_taken_as_they_are():
    result = stitch_panorama(face_views(), size=256, balancing=None)
    np.testing.assert_allclose(result.light.irradiance(NORMALS), true_irradiance(), rtol=0.01)


def test_what_no_view_sees_is_marked_reported_and_filled_smoothly():
    views = [view for view in face_views() if view.name != "down"]
    result = stitch_panorama(views, size=128, balancing=None)
    # Pixels on the edge are seen in part, so up to a pixel's width of 1.4° all round is missing.
    assert 4 * np.pi / 6 * 0.97 < result.unseen <= 4 * np.pi / 6
    clipped = result.light.clipped
    assert clipped is not None and clipped[-1].min() == OUTSIDE and clipped[:64].max() == 0
    hole = result.light.radiance[clipped == OUTSIDE]
    seen = result.light.radiance[clipped == 0]
    assert seen.min() < hole.min() and hole.max() < seen.max() and hole.min() > 0
    steps = np.abs(np.diff(np.log(result.light.radiance[-16:]), axis=1)).max()
    assert steps < 0.1


def test_fill_is_harmonic_and_lets_constant_light_be():
    radiance, hole = np.full((48, 96, 3), 2.5, np.float32), np.zeros((48, 96), bool)
    hole[30:, 10:60] = True
    radiance[hole] = 0
    np.testing.assert_allclose(fill(radiance, hole), 2.5, rtol=1e-5)


def test_a_clipped_pixel_never_wins_over_a_measured_one():
    turn = np.eye(3)
    short = PanoramaView(photograph(WORLD, turn), 160, turn, "short")
    white = PanoramaView(photograph(WORLD, turn, white=1.5), 160, turn, "white")
    alone = stitch_panorama([short, short], size=128, balancing=None).light
    both = stitch_panorama([white, short], size=128, balancing=None)
    assert white.picture.clipped is not None and white.picture.clipped.mean() > 0.1
    np.testing.assert_allclose(both.light.radiance, alone.radiance, rtol=1e-5)
    assert both.saturated == 0


def test_what_is_clipped_in_every_view_is_a_bound_and_reported():
    turn = np.eye(3)
    white = PanoramaView(photograph(WORLD, turn, white=1.5), 160, turn, "white")
    result = stitch_panorama([white, white], size=128, balancing=None)
    clipped = result.light.clipped
    assert clipped is not None
    bounded = clipped == SATURATED
    assert bounded.any() and result.light.radiance[bounded].max() <= 1.5
    assert result.saturated == pytest.approx(float(LatLong().solid_angles(128)[bounded].sum()))
    # Nothing is bounded that has no light above white in or beside it.
    truth = WORLD.lookup(LatLong().directions(pixel_points(LatLong(), 128)))
    brightest = maximum_filter(truth.max(-1), 5, mode="wrap")
    assert brightest[bounded].min() > 1.4


def test_of_two_bounds_the_higher_is_kept():
    turn = np.eye(3)
    low, high = (
        PanoramaView(
            RadianceMap(np.full((60, 80, 3), v, np.float32), None, np.ones((60, 80), np.uint8)), 60, turn, str(v)
        )
        for v in (1.0, 3.0)
    )
    result = stitch_panorama([low, high], size=64, balancing=None)
    assert result.light.clipped is not None
    assert np.all(result.light.radiance[result.light.clipped == SATURATED] == 3)


def test_what_moved_is_taken_from_one_view():
    turns = [orientation(*np.radians((yaw, 0, 0))) for yaw in (-19, 17)]
    pictures = [RadianceMap(np.ones((200, 240, 3), np.float32)) for _ in turns]
    # Somebody stood nearly in the middle of the overlap while the second view was taken.
    rays = PanoramaView(pictures[1], 150, turns[1])
    directions = LatLong().directions(pixel_points(LatLong(), 256))
    x, y = np.meshgrid(np.arange(240) + 0.5, np.arange(200) + 0.5)
    towards = rays.rays(np.stack([x, y], -1)) @ turns[1].T
    person = (np.abs(np.arctan2(towards[..., 0], -towards[..., 2])) < 0.07) & (np.abs(towards[..., 1]) < 0.3)
    pictures[1].radiance[person] = 0.1
    views = [
        PanoramaView(picture, 150, turn, f"{i}") for i, (picture, turn) in enumerate(zip(pictures, turns, strict=True))
    ]
    result = stitch_panorama(views, size=256)
    middle = (np.abs(np.arctan2(directions[..., 0], -directions[..., 2])) < 0.06) & (np.abs(directions[..., 1]) < 0.27)
    inside = result.light.radiance[middle]
    # Whole or not at all: no ghost.
    assert np.ptp(inside) < 0.05


def test_a_lamp_at_a_rim_has_no_halo():
    # The lamp is in the first view alone, beside the rim of the second.
    turns = [orientation(*np.radians((yaw, 0, 0))) for yaw in (0, 50)]
    pictures = [RadianceMap(np.ones((200, 200, 3), np.float32)) for _ in turns]
    first = PanoramaView(pictures[0], 150, turns[0])
    second = PanoramaView(pictures[1], 150, turns[1])
    lamp = orientation(np.radians(15.5), 0)[:, 2] * -1
    x, y = np.meshgrid(np.arange(200) + 0.5, np.arange(200) + 0.5)
    near = (first.rays(np.stack([x, y], -1)) @ lamp) > np.cos(np.radians(0.8))
    pictures[0].radiance[near] = 5000
    result = stitch_panorama([first, second], size=240)
    directions = LatLong().directions(pixel_points(LatLong(), 240))
    angle = np.degrees(np.arccos(np.clip(directions @ lamp, -1, 1)))
    seen = np.ones(angle.shape, bool) if result.light.clipped is None else result.light.clipped == 0
    beside = result.light.radiance[(angle > 2.5) & seen]
    np.testing.assert_allclose(beside / np.median(beside), 1, rtol=0.01)


def test_colours_are_balanced_on_request():
    views = ahead(0, 40)
    tinted = replace(views[1].picture, radiance=views[1].picture.radiance * np.array([1.2, 1.0, 0.8], np.float32))
    views[1] = replace(views[1], picture=tinted)
    found = balance(views, Balancing(colours=True)).gains
    np.testing.assert_allclose(found[0] / found[1], [1.2, 1.0, 0.8], rtol=0.01)
    grey = balance(views).gains
    assert np.all(grey[:, 0] == grey[:, 2])


def test_views_that_do_not_overlap_are_named():
    views = ahead(0, 35, 180, given=False)
    with pytest.raises(NotAPanorama, match=r"^c: too little in common with a, b to find the orientation") as caught:
        stitch_panorama(views)
    assert "\n" not in str(caught.value)


def ring_and_sky(said: bool) -> tuple[list[PanoramaView], list[np.ndarray]]:
    """Six matched views about the horizon, and one of a sky without features."""
    turns = [orientation(np.radians(40 * i)) for i in range(5)] + [orientation(np.radians(100), np.radians(80))]
    views = [
        PanoramaView(photograph(WORLD, turn, focal_length=128, size=(224, 160)), 128, None, f"{i}")
        for i, turn in enumerate(turns)
    ]
    blank = RadianceMap(np.ones((160, 224, 3), np.float32))
    views[5] = PanoramaView(blank, 128, turns[5] if said else None, "sky")
    return views, turns


def test_a_sky_without_features_is_left_out_and_reported():
    views, turns = ring_and_sky(False)
    result = stitch_panorama([views[5], *views[:5]], size=64, balancing=None)
    assert [view.name for view in result.views] == ["0", "1", "2", "3", "4"]
    (line, *_) = result.warnings
    assert line.startswith("sky: left out, too little in common") and "--orientations" in line
    between = degrees_turned(result.views[0].placed.T @ result.views[4].placed, turns[0].T @ turns[4])
    assert between < 0.5 and result.gains.shape == (5, 3)


def test_a_table_of_the_sky_alone_is_enough():
    views, turns = ring_and_sky(True)
    result = stitch_panorama(views, size=64, balancing=None)
    assert len(result.views) == 6 and "left out" not in "".join(result.warnings)
    assert max(degrees_turned(v.placed, turn) for v, turn in zip(result.views, turns, strict=True)) < 0.5
    assert len(result.notes) == 1 and "their yaw counts from 0" in result.notes[0]


def test_two_groups_of_similar_size_are_refused():
    views = ahead(0, 35, 70, 200, 235, given=False)
    with pytest.raises(NotAPanorama, match=r"^d, e: too little in common with the others"):
        stitch_panorama(views)


def test_what_is_no_panorama_is_refused_in_a_line():
    good = PanoramaView(RadianceMap(np.ones((8, 8, 3), np.float32)), 4, np.eye(3), "good")
    for value in (np.nan, -1.0):
        broken = RadianceMap(np.full((8, 8, 3), value, np.float32))
        with pytest.raises(NotAPanorama, match=r"^bad: holds negative or non-finite radiance"):
            stitch_panorama([good, replace(good, picture=broken, name="bad")])
    with pytest.raises(NotAPanorama, match=r"^good: a panorama needs two views"):
        stitch_panorama([good])
    with pytest.raises(NotAPanorama, match=r"^no view: a panorama needs two views"):
        panorama_from_files([])
    calibrated = RadianceMap(np.ones((8, 8, 3), np.float32), unit="cd/m²")
    with pytest.raises(NotAPanorama, match=r"in cd/m²"):
        stitch_panorama([good, replace(good, picture=calibrated)])
    with pytest.raises(ValueError, match="at least 16 rows"):
        stitch_panorama([good, good], size=3)
