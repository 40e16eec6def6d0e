"""Balls of materials by coarse reflection maps: closed forms, and how near they are to path-traced balls."""

from __future__ import annotations

import numpy as np
import pytest

import relume as rl
from relume.light.reflection.lobes import Flattened, GGXLobe
from relume.renderers.half_vectors import directional_albedo
from relume.renderers.prefiltered.material_balls import facet_shares, left_out, material_radiance
from relume.renderers.prefiltered.materials import ANGLES, facet_albedos
from relume.scene.materials.abc_facets import MERL_FITS
from relume.scene.materials.materials import Diffuse, Material

SIZE = 24


def window() -> rl.EnvironmentMap:
    """A grey room with a bright window and a blue floor."""
    light = np.full((64, 128, 3), 0.3, np.float32)
    light[40:] = [0.1, 0.2, 0.4]
    light[12:24, 70:90] = [12, 11, 9]
    return rl.EnvironmentMap(light)


def test_under_constant_light_a_white_matt_ball_and_a_mirror_are_as_bright_as_the_light():
    even = rl.EnvironmentMap(np.full((32, 64, 3), 2.0, np.float32))
    materials = (Diffuse((1.0, 1.0, 1.0)), rl.scene.PRESETS["mirror"], Diffuse((0.2, 0.5, 0.8)))
    radiance, matte = material_radiance(even, materials, SIZE, np.eye(3))
    inside = matte > 0
    np.testing.assert_allclose(radiance[0][inside], 2.0, rtol=2e-3)
    # F0 is 0.95 along the normal and 1 at the rim.
    assert radiance[1][inside].min() == pytest.approx(1.9, rel=2e-3) and radiance[1][inside].max() < 2.0 + 1e-3
    np.testing.assert_allclose(radiance[2][SIZE // 2, SIZE // 2], [0.4, 1.0, 1.6], rtol=2e-3)
    assert matte.sum() == pytest.approx(np.pi * (SIZE / 2) ** 2, rel=0.02)


def test_a_clear_thin_ball_gives_constant_light_back_whole():
    even = rl.EnvironmentMap(np.ones((32, 64, 3), np.float32))
    radiance, _ = material_radiance(even, (rl.scene.PRESETS["thin_glass"],), SIZE, np.eye(3))
    # Of what the back wall mirrors forward a second part is mirrored again: R² of 0.08² is left out.
    np.testing.assert_allclose(radiance[0][SIZE // 2, SIZE // 2], 1.0, atol=0.012)


@pytest.mark.parametrize("alpha", [0.0064, 0.0225, 0.04])
def test_a_flattened_lobe_and_its_mirror_reflect_all_of_constant_light(alpha: float):
    lobe = Flattened(GGXLobe(alpha), np.pi / 128)
    assert lobe.integral + lobe.mirror == pytest.approx(1) and 0 < lobe.mirror < 1
    # The tail is GGX's own.
    assert lobe(np.cos(np.array([0.1]))) == GGXLobe(alpha)(np.cos(np.array([0.1])))


@pytest.mark.parametrize("alpha", [0.0064, 0.04, 0.16, 0.81])
def test_facets_reflect_what_the_integral_over_the_hemisphere_says(alpha: float):
    cosine = np.cos(np.linspace(0, np.pi / 2, ANGLES))
    white, rim = facet_shares(np.sqrt(alpha), cosine, 1.0)
    whole, edge = facet_albedos(alpha)
    # To 78°: beyond it a small ball has no whole pixel.
    np.testing.assert_allclose(white[:29], whole[:29], rtol=0.02)
    np.testing.assert_allclose(rim[:29], edge[:29], atol=0.002)


def test_a_camera_that_is_turned_to_the_left_sees_what_lies_there():
    left = np.array([[0, 0, 1], [0, 1, 0], [-1, 0, 0]], float)  # a quarter turn about +Y: from −Z to −X
    light, materials = window(), (Diffuse((1.0, 1.0, 1.0)), rl.scene.PRESETS["titanium"])
    seen, matte = material_radiance(light, materials, SIZE, left)
    # The same as if what lies at −X, a quarter across, lay at −Z, in the middle.
    moved = rl.EnvironmentMap(np.roll(light.radiance, 32, axis=1))
    expected, _ = material_radiance(moved, materials, SIZE, np.eye(3))
    np.testing.assert_allclose(seen[:, matte > 0], expected[:, matte > 0], rtol=2e-3, atol=2e-3)
    unturned, _ = material_radiance(light, materials, SIZE, np.eye(3))
    assert np.abs(unturned[0] - expected[0]).max() > 0.1


def test_what_a_ball_does_not_show_is_said():
    presets = rl.scene.PRESETS
    assert left_out(presets["velvet"]) == ("sheen",) and left_out(presets["gold"]) == ()
    assert left_out(presets["brushed_steel"]) == ("its direction of brushing",)
    assert left_out(presets["milk"]) == ("what fills the body",) and left_out(presets["bottle_glass"]) == ()
    assert left_out(Material(anisotropy=0.5)) == ("anisotropy",)
    assert left_out(MERL_FITS["merl/teflon"]) == ("its highlights",)


def test_a_measured_surface_is_a_matt_ball_of_its_albedo():
    light = rl.EnvironmentMap(np.full((32, 64, 3), 2.0, np.float32))
    (ball,), _ = material_radiance(light, (MERL_FITS["merl/teflon"],), 9, np.eye(3))
    np.testing.assert_allclose(
        ball[4, 4], 2 * directional_albedo(MERL_FITS["merl/teflon"], np.array([0.7]))[0], rtol=1e-3
    )


# How near balls are to path-traced ones: mean and median of |difference| over the ball, as shares of what is there.
NEAR = {
    "concrete": (0.04, 0.03),
    "plastic": (0.02, 0.02),
    "gold": (0.02, 0.02),
    "iron": (0.03, 0.02),
    "car_paint": (0.02, 0.04),
    "glass": (0.02, 0.08),
}


@pytest.mark.parametrize("name", NEAR)
def test_a_ball_is_near_the_path_traced_one(name: str):
    light, radius, away = window(), 0.05, 40.0
    material, (energy, apart) = rl.scene.PRESETS[name], NEAR[name]
    ball, matte = material_radiance(light, (material,), SIZE, np.eye(3))
    camera = rl.Camera.looking_at(
        np.array([0, 0, away * radius]), np.zeros(3), width=SIZE, height=SIZE,
        focal_length=SIZE / 2 * np.sqrt(away**2 - 1),
    )  # fmt: skip
    scene = rl.Scene(light, (), (rl.Sphere((0, 0, 0), radius, material),))
    traced = rl.render(scene, camera, rl.Mitsuba(samples=512)).radiance
    inside = matte > 0.98
    mine, true = ball[0][inside], traced[inside]
    assert mine.mean() == pytest.approx(true.mean(), rel=energy)
    assert np.median(np.abs(mine - true).sum(-1) / true.sum(-1)) < apart
