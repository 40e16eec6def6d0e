"""Points on a camera's lattice cleaned and meshed, and fused with normals: a ball before a wall, known exactly."""

from __future__ import annotations

import numpy as np
import pytest

from relume.lightstage.geometry.fusion import corrected_normals, fused_points
from relume.lightstage.geometry.meshing import cleaned, lattice_mesh, surface_normals
from relume.lightstage.geometry.triangulation import ScannedPoints
from relume.scene.cameras.camera import Camera

CAMERA = Camera.looking_at(np.array([0, 0, 1.0]), np.zeros(3), width=120, height=90, focal_length=300.0)
RADIUS = 0.1
NOISE = 2e-4


def scene() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Points and normals (H, W, 3) of a ball at the origin before the wall z = −0.3, and where the ball is."""
    rays = CAMERA.rays()
    along = -rays[..., 2]
    inside = along**2 - 1 + RADIUS**2
    ball = inside > 0
    distance = np.where(ball, along - np.sqrt(np.maximum(inside, 0)), 1.3 / along)
    points = CAMERA.position + distance[..., None] * rays
    return points, np.where(ball[..., None], points / RADIUS, [0.0, 0, 1]), ball


def scanned(points: np.ndarray, noise: float = 0.0, seed: int = 0) -> ScannedPoints:
    """The points, moved along their rays by noise."""
    rays = CAMERA.rays()
    moved = points + noise * np.random.default_rng(seed).standard_normal(points.shape[:2])[..., None] * rays
    covariance = NOISE**2 * rays[..., :, None] * rays[..., None, :]
    return ScannedPoints(moved, covariance, np.full(points.shape[:2], 1e-5))


def test_a_clean_surface_stays_whole_and_a_jump_is_not_closed():
    points, _, ball = scene()
    kept = cleaned(scanned(points), CAMERA)
    assert kept.mean() > 0.98
    pixels, faces = lattice_mesh(points, kept, CAMERA)
    on_ball = ball[pixels[:, 0], pixels[:, 1]][faces]
    assert np.all(on_ball.all(axis=1) == on_ball.any(axis=1))
    # A square of pixels is two triangles; the rim of the ball has lost its own.
    assert 1.85 * kept.sum() < len(faces) < 2 * kept.sum()


def test_faces_turn_to_the_camera():
    points, normals, _ = scene()
    kept = cleaned(scanned(points), CAMERA)
    pixels, faces = lattice_mesh(points, kept, CAMERA)
    corner = points[pixels[:, 0], pixels[:, 1]][faces]
    outward = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    assert np.all(np.einsum("nk,nk->n", outward, normals[pixels[:, 0], pixels[:, 1]][faces[:, 0]]) > 0)


def test_strays_islands_and_wide_gaps_are_dropped():
    points, _, _ = scene()
    stray = scanned(points)
    stray.points[40, 60] += [0, 0, 0.05]
    stray.points[10:14, 10:14] += [0, 0, 0.2]
    stray.gap[70:72, 100:102] = 1e-3
    kept = cleaned(stray, CAMERA)
    assert not kept[40, 60] and not kept[10:14, 10:14].any() and not kept[70:72, 100:102].any()
    assert kept[39, 61] and kept[20, 20] and kept[70, 98]


def test_noise_alone_is_no_surface():
    points, _, _ = scene()
    with pytest.raises(ValueError, match="contradict each other"):
        cleaned(scanned(points, 0.2), CAMERA)


def test_normals_are_those_of_the_ball_and_the_wall():
    points, normals, ball = scene()
    found = surface_normals(points, CAMERA)
    inner = ball & (normals[..., 2] > 0.5)
    assert np.einsum("nk,nk->n", found[inner], normals[inner]).min() > np.cos(np.radians(1.0))
    assert np.allclose(found[5:10, 5:10], [0, 0, 1], atol=1e-9)


def bent(normals: np.ndarray) -> np.ndarray:
    """Normals turned about the vertical by up to 10° from left to right, and noisy by 1°."""
    angle = np.radians(10) * np.broadcast_to(np.linspace(-1, 1, CAMERA.width), normals.shape[:2])
    x, y, z = np.moveaxis(normals, -1, 0)
    turned = np.stack([x * np.cos(angle) + z * np.sin(angle), y, z * np.cos(angle) - x * np.sin(angle)], axis=-1)
    found = turned + np.radians(1) * np.random.default_rng(5).standard_normal(normals.shape)
    return found / np.linalg.norm(found, axis=-1, keepdims=True)


def test_fused_points_are_as_fine_as_normals_and_as_right_as_points():
    points, normals, ball = scene()
    noisy = scanned(points, NOISE)
    kept = cleaned(noisy, CAMERA)
    seen = np.where(kept[..., None], noisy.points, np.nan)
    turned = corrected_normals(bent(normals), seen, CAMERA)
    fused = fused_points(noisy, kept, turned, CAMERA)
    inner = ball & kept & (normals[..., 2] > 0.6)

    def departure(found: np.ndarray) -> float:
        return float(np.sqrt(np.mean(np.einsum("nk,nk->n", found[inner] - points[inner], normals[inner]) ** 2)))

    def turn(found: np.ndarray) -> float:
        cosine = np.einsum("nk,nk->n", found[inner], normals[inner])
        return float(np.degrees(np.sqrt(np.nanmean(np.arccos(np.clip(cosine, -1, 1)) ** 2))))

    # Noise of 0.2 mm along the rays; the given normals are bent by some degrees, the points' are noisy.
    assert departure(noisy.points) > 1.5e-4 and departure(fused) < 0.3 * departure(noisy.points)
    assert turn(surface_normals(fused, CAMERA)) < 0.4 * turn(surface_normals(seen, CAMERA))
    assert turn(turned) < turn(bent(normals))


def test_without_normals_the_points_own_stay():
    points, normals, _ = scene()
    none = np.zeros_like(normals)
    assert np.allclose(corrected_normals(none, points, CAMERA), surface_normals(points, CAMERA), equal_nan=True)
