"""The parts of a panorama, each against what it is by definition."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from angles import degrees_turned
from panoramas import patchwork, photograph
from relume.capture.response.camera_profile import CameraProfile
from relume.image.files import read_photograph, write
from relume.image.photograph import Photograph
from relume.image.radiance import BLACK, SATURATED, RadianceMap
from relume.image.response import Response
from relume.probe.clipped_light import linear
from relume.probe.panorama.bundle_adjustment import levelling
from relume.probe.panorama.coverage import continued, shrunk, view_in_map
from relume.probe.panorama.matching import features_of, fitted_rotation, match, most_agreed_rotation
from relume.probe.panorama.seams import sphere_graph
from relume.probe.panorama.view_files import read_sources
from relume.probe.panorama.views import PanoramaView, angles_of, focal_length_of, orientation
from relume.sphere.directions import normalised, rotation_from_vector
from relume.sphere.mappings.mapping import LatLong, pixel_points

BLANK = RadianceMap(np.ones((60, 80, 3), np.float32))


def test_yaw_goes_right_pitch_up_and_roll_clockwise():
    np.testing.assert_allclose(orientation(np.radians(90))[:, 2], [-1, 0, 0], atol=1e-12)  # looks along +X
    np.testing.assert_allclose(orientation(0, np.radians(90))[:, 2], [0, -1, 0], atol=1e-12)  # looks up
    np.testing.assert_allclose(orientation(0, 0, np.radians(30))[:, 0], [np.sqrt(0.75), -0.5, 0], atol=1e-12)
    angles = np.radians([123.0, -37.0, 11.0])
    np.testing.assert_allclose(angles_of(orientation(*angles)), angles, atol=1e-12)
    assert angles_of(orientation(np.radians(40), np.radians(90)))[:1] == pytest.approx((np.radians(40),))


def test_ninety_degrees_across_are_half_the_width():
    assert focal_length_of(np.radians(90), 640) == pytest.approx(320)
    with pytest.raises(ValueError, match="less than 180"):
        focal_length_of(np.pi, 640)


@pytest.mark.parametrize("distortion", [0.0, -0.08, 0.1])
def test_rays_and_points_undo_each_other(distortion: float):
    view = PanoramaView(BLANK, 50.0, orientation(1.0, 0.3, -0.2), distortion=distortion)
    points = np.stack(np.meshgrid(np.linspace(0, 80, 9), np.linspace(0, 60, 7)), axis=-1)
    np.testing.assert_allclose(view.points(view.rays(points) @ view.placed.T), points, atol=1e-9)
    assert np.all(np.isnan(view.points(-view.axis)))


def test_the_kernel_sees_what_a_look_up_sees():
    generator = np.random.default_rng(0)
    picture = RadianceMap(generator.random((60, 80, 3)).astype(np.float32))
    clipped = np.zeros((60, 80), np.uint8)
    clipped[:20], clipped[50:] = 1, 3
    view = PanoramaView(
        RadianceMap(picture.radiance, None, clipped), 50.0, orientation(2.9, 0.9, 0.4), distortion=-0.05
    )
    rows, cells = 24, 3
    shown = view_in_map(view, rows, 4, rows, cells)
    points = pixel_points(LatLong(), rows, cells)
    ring = np.sin(np.pi * points[..., 1])
    place = view.points(LatLong().directions(points))
    total, whole = np.zeros((rows, 2 * rows, 6)), np.zeros((rows, 2 * rows))
    for (row, column), weight in np.ndenumerate(ring):
        pixel = (row // cells, column // cells)
        whole[pixel] += weight
        x, y = place[row, column]
        if not (0 <= x <= 80 and 0 <= y <= 60):
            continue
        fx, fy = min(max(x - 0.5, 0), 79), min(max(y - 0.5, 0), 59)
        left, top = min(int(fx), 78), min(int(fy), 58)
        shares = {
            (top, left): (1 - fx + left) * (1 - fy + top),
            (top, left + 1): (fx - left) * (1 - fy + top),
            (top + 1, left): (1 - fx + left) * (fy - top),
            (top + 1, left + 1): (fx - left) * (fy - top),
        }
        if any(clipped[p] == 3 for p in shares):
            continue
        value = np.sum([share * picture.radiance[p] for p, share in shares.items()], axis=0)
        bound = sum(share * (clipped[p] == 1) for p, share in shares.items())
        total[pixel] += weight * np.array([*value, bound, 1, min(x, 80 - x, y, 60 - y)])
    covered = total[..., 4].copy()
    expected = total / np.where(covered > 0, covered, 1)[..., None]
    expected[..., 4] = covered / whole
    assert covered.max() > 0
    np.testing.assert_allclose(shown, expected[4:], atol=2e-5)


def test_a_shrunk_view_looks_the_same_way():
    view = PanoramaView(RadianceMap(np.random.default_rng(0).random((60, 80, 3)).astype(np.float32)), 50.0, np.eye(3))
    small = shrunk(view, 12.5)
    assert small.picture.size == (20, 15) and small.focal_length == 12.5
    np.testing.assert_allclose(small.picture.radiance[0, 0], view.picture.radiance[:4, :4].mean((0, 1)), rtol=1e-5)
    assert shrunk(view, 40.0) is view


def test_a_view_is_continued_as_steeply_as_it_ends():
    x, y = np.meshgrid(np.arange(80.0), np.arange(60.0))

    def picture(x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return np.repeat(np.exp(0.02 * x - 0.01 * y)[..., None], 3, axis=-1).astype(np.float32)

    clipped = np.zeros((60, 80), np.uint8)
    clipped[:, 79] = 1
    view = PanoramaView(RadianceMap(picture(x, y), None, clipped), 50.0, np.eye(3))
    wide = continued(view, 2)
    assert wide.picture.size == (84, 64) and wide.focal_length == 50 and continued(view, 0) is view
    np.testing.assert_array_equal(wide.picture.radiance[2:-2, 2:-2], view.picture.radiance)
    x, y = np.meshgrid(np.arange(-2.0, 80), np.arange(0.0, 62))
    np.testing.assert_allclose(wide.picture.radiance[2:, :-2], picture(x, y), rtol=1e-5)
    # Never brighter than what was seen.
    assert wide.picture.radiance.max() == view.picture.radiance.max()
    assert wide.picture.clipped is not None and wide.picture.clipped[2:-2, 81].all()


def test_features_lie_where_the_world_has_them():
    world = patchwork(384)
    turns = [orientation(0), orientation(np.radians(35), np.radians(10), np.radians(20))]
    views = [PanoramaView(photograph(world, turn), 160.0, turn) for turn in turns]
    features = [features_of(view) for view in views]
    pairs = match(features[0], features[1], 0.75)
    ends = [
        view.rays(f.points[pairs[:, i]]) @ view.placed.T
        for i, (view, f) in enumerate(zip(views, features, strict=True))
    ]
    apart = np.degrees(np.linalg.norm(ends[0] - ends[1], axis=-1))
    right = apart < 1
    assert right.sum() > 40 and right.mean() > 0.7
    assert np.median(apart[right]) < 0.12  # a third of a pixel
    # No part of it is the same for all: a quarter of a pixel beside would be 0.09°.
    shift = (views[0].points(ends[1][right]) - views[0].points(ends[0][right])).mean(0)
    assert np.abs(shift).max() < 0.12


def test_the_turn_that_most_agree_with_is_found_among_wrong_matches():
    generator = np.random.default_rng(3)
    b = normalised(generator.normal(size=(100, 3)) * [0.4, 0.4, 0.1] + [0, 0, -1])
    turn = rotation_from_vector(np.array([0.2, -0.5, 0.1]))
    a = b @ turn.T
    a[:50] = normalised(generator.normal(size=(50, 3)))
    found, agreeing = most_agreed_rotation(a, b, 0.01, generator)
    assert degrees_turned(found, turn) < 1e-6
    assert agreeing[50:].all() and agreeing[:50].sum() <= 1
    np.testing.assert_allclose(fitted_rotation(a[50:], b[50:]), turn, atol=1e-12)


def test_views_are_levelled_by_the_plane_of_their_right_axes():
    level = [
        orientation(np.radians(yaw), np.radians(pitch)) for yaw, pitch in ((0, 10), (60, 25), (150, -30), (250, 5))
    ]
    skew = rotation_from_vector(np.array([0.3, 0.8, -0.2]))
    turn = levelling([skew @ rotation for rotation in level])
    np.testing.assert_allclose(turn @ skew, np.eye(3), atol=1e-12)
    # Of a column of views only the cameras' own up can say.
    column = [skew @ orientation(0, np.radians(pitch)) for pitch in (-20, 20)]
    np.testing.assert_allclose(levelling(column) @ skew, np.eye(3), atol=1e-12)


def test_the_graph_of_the_sphere_has_every_edge_both_ways_and_crosses_the_poles():
    start, end, length = sphere_graph(16)
    edges = dict(zip(zip(start.tolist(), end.tolist(), strict=True), length, strict=True))
    assert all(edges[b, a] == pytest.approx(value) for (a, b), value in edges.items())
    assert (0, 16) in edges and (0, 31) in edges and (0, 0) not in edges
    assert edges[0, 16] == pytest.approx(np.pi / 16)
    assert length.max() < 2 * np.pi / 16


def test_a_photograph_is_read_by_the_rule_for_all_single_ones(tmp_path: Path) -> None:
    # 250/255 of 16 bits is 64250: what is below it was measured.
    codes = np.array([[0, 1, 30000, 64240, 64250, 65535]], np.uint16)
    write(tmp_path / "view.png", Photograph(np.repeat(codes[..., None], 3, axis=-1)))
    line = np.linspace(0, 1, 256)
    squared = Response(np.repeat(2 * np.log(np.maximum(line, 1e-6))[None], 3, axis=0), np.zeros((3, 256)))
    for response in (None, squared):
        (source,) = read_sources([tmp_path / "view.png"], profile=response and CameraProfile("", response))
        expected = linear(read_photograph(tmp_path / "view.png"), response)
        assert source.picture.clipped is not None and expected.clipped is not None
        assert source.picture.clipped.tolist() == [[BLACK, 0, 0, 0, SATURATED, SATURATED]]
        assert np.array_equal(source.picture.clipped, expected.clipped)
        assert np.array_equal(source.picture.radiance, expected.radiance)
        assert source.assumed == (response is None)
    # A curve of 256 values serves 16 bits: √ of the light.
    assert abs(source.picture.radiance[0, 2, 0] / (30000 / 65535) ** 2 - 1) < 1e-4
