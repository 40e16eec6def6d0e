"""Points between rays of a camera and a projector, whose places are exact or noisy."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from relume.lightstage.geometry.decoding import ProjectorPlaces
from relume.lightstage.geometry.rig import ScannerRig, read_rig, write_rig
from relume.lightstage.geometry.triangulation import triangulated
from relume.scene.cameras.camera import Camera
from relume.scene.cameras.distortion import Distortion
from relume.sphere.directions import rotation_from_vector
from structured_light import rig

RIG = rig(40, 30, distance=0.8, target=np.array([0.1, 0.2, -0.3]), slant=0.4)


def surface() -> np.ndarray:
    """Points (30, 40, 3) at distances of 0.75 to 0.85 m along the camera's rays."""
    distance = 0.8 + 0.05 * np.sin(np.arange(40) / 5)[None, :, None] * np.cos(np.arange(30) / 4)[:, None, None]
    return RIG.camera.position + distance * RIG.camera.rays()


def places(points: np.ndarray, deviation: float = 0.05) -> ProjectorPlaces:
    shown = RIG.projector.project(points)
    whole = np.ones(points.shape[:2])
    return ProjectorPlaces(shown, np.full(shown.shape, deviation), whole, whole > 0)


def test_exact_places_give_the_points():
    found = triangulated(places(surface()), RIG)
    assert np.abs(found.points - surface()).max() < 1e-9 and found.gap.max() < 1e-9


def test_the_covariance_is_that_of_noisy_places():
    exact, generator = places(surface()), np.random.default_rng(3)
    tried = [
        triangulated(replace(exact, places=exact.places + 0.05 * generator.standard_normal(exact.places.shape)), RIG)
        for _ in range(60)
    ]
    off = np.stack([each.points for each in tried]) - surface()
    seen = np.einsum("n...i,n...j->...ij", off, off).mean(axis=(0, 1)) / 60
    said = tried[0].covariance.mean(axis=(0, 1))
    assert np.abs(seen - said).max() < 0.05 * np.abs(said).max()
    # Along the camera's rays a pixel of the projector, 1.15 mm, is 1.15 mm / sin 23°; the mid-point is as far off.
    assert 1e3 * np.sqrt(said[2, 2]) == pytest.approx(0.05 * 1.15 / np.sin(0.4), rel=0.15)


def test_a_shift_of_the_rig_opens_a_gap():
    moved = replace(RIG, projector=replace(RIG.projector, position=RIG.projector.position + np.array([0, 0.002, 0])))
    found = triangulated(places(surface()), moved)
    assert np.median(found.gap) == pytest.approx(0.002, rel=0.05)


def test_unknown_places_and_points_behind_are_none():
    some = places(surface())
    some.places[3, 4] = np.nan
    behind = RIG.camera.position - (surface()[5, 6] - RIG.camera.position)
    some.places[5, 6] = RIG.projector.project(behind) if np.isfinite(RIG.projector.project(behind)).all() else np.nan
    found = triangulated(some, RIG)
    assert not found.known[3, 4] and not found.known[5, 6] and found.known.sum() == 30 * 40 - 2


def test_what_does_not_belong_together_is_refused():
    small = replace(RIG, camera=RIG.camera.resized(20, 15))
    with pytest.raises(ValueError, match=r"40×30 pixels, but the rig's camera takes 20×15"):
        triangulated(places(surface()), small)
    with pytest.raises(ValueError, match="at one place"):
        triangulated(places(surface()), ScannerRig(RIG.camera, RIG.camera))


def test_a_rig_is_the_same_from_its_file_and_in_another_frame(tmp_path):
    bent = replace(RIG.camera, distortion=Distortion(0.02, -0.1), centre=(19.0, 16.0))
    write_rig(tmp_path / "rig.json", ScannerRig(bent, RIG.projector, (0.12, 0.08)))
    read = read_rig(tmp_path / "rig.json")
    assert read.camera.distortion == Distortion(0.02, -0.1) and read.residual == (0.12, 0.08)
    assert np.array_equal(read.projector.rays(), RIG.projector.rays())
    assert np.allclose(read.camera.rays(), bent.rays())
    # In a frame where the camera stands elsewhere the points are carried along.
    turn = rotation_from_vector(np.array([0.3, -0.2, 0.5]))
    stands = Camera(40, 30, 50.0, np.array([1.0, 2.0, 3.0]), turn @ RIG.camera.rotation)
    carried = triangulated(places(surface()), RIG.placed(stands)).points
    assert np.allclose(carried, (surface() - RIG.camera.position) @ turn.T + [1, 2, 3])


def test_a_rig_file_that_is_none_is_told(tmp_path):
    for text, line in (("{", "not a rig"), ("{}", "the key 'camera' is missing"), ("[]", "not a rig")):
        (tmp_path / "rig.json").write_text(text)
        with pytest.raises(Exception, match=line):
            read_rig(tmp_path / "rig.json")
    with pytest.raises(Exception, match="no such file; give the rig's file"):
        read_rig(tmp_path / "none.json")
