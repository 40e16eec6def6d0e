"""Plots of a BRDF: what they are drawn from is what is rendered, and what cannot be drawn is refused."""

from __future__ import annotations

import numpy as np
import pytest

import relume as rl
from relume.errors import InvalidScene, UnreadableFile, UnsupportedScene
from relume.image.files import read_photograph
from relume.renderers.mitsuba.scattering import Scattering, scattering
from relume.report.materials.brdf_plot import INCIDENCES, _Length, _relative, brdf_figure, draw_brdf
from relume.scene.materials.abc_facets import MERL_FITS
from relume.scene.materials.materials import Diffuse, Material, Ward
from relume.scene.materials.presets import PRESETS
from relume.scene.materials.reflective import mirror
from relume.scene.materials.whitted import WhittedMaterial


def beam(degrees: float, azimuth: float = 0.0) -> np.ndarray:
    theta, phi = np.radians([degrees, azimuth])
    return np.array([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)])


def test_a_diffuse_surface_is_a_half_circle_that_shrinks_as_the_beam_becomes_shallow():
    angles = np.radians(np.arange(-80, 81, 10.0))
    views = np.stack([np.sin(angles), 0 * angles, np.cos(angles)], -1)
    part = scattering(Diffuse((0.5, 0.4, 0.3)), np.stack([beam(-each) for each in INCIDENCES]), views)
    for index, degrees in enumerate(INCIDENCES):
        expected = np.broadcast_to(np.array([0.5, 0.4, 0.3]) * np.cos(np.radians(degrees)), (len(angles), 3))
        np.testing.assert_allclose(_relative(part, index, angles), expected, rtol=1e-4)
    np.testing.assert_allclose(part.reflected, np.broadcast_to([0.5, 0.4, 0.3], (3, 3)), rtol=1e-4)
    assert part.transmitted.max() == 0 and part.smooth == ((), (), ())


def test_values_are_those_of_the_measured_surface():
    surface, light = MERL_FITS["merl/teflon"], beam(30, 40)
    views = np.stack([beam(50, 220), beam(10, 100), beam(120, 0)])
    found = scattering(surface, light[None], views).values[0]
    expected = surface.evaluate(np.broadcast_to(light, views.shape), views) * np.maximum(views[:, 2:], 0)
    np.testing.assert_allclose(found, expected, rtol=1e-3, atol=1e-7)


def test_smooth_glass_mirrors_and_bends_a_beam_as_fresnel_and_snell_say():
    # ior 1.517 at 60°: sin/1.517 is 34.81°; F by Fresnel's formulas 0.0916.
    part = scattering(PRESETS["glass"], beam(60)[None], beam(0)[None])
    rays = sorted(part.smooth[0], key=lambda ray: ray[0][2])
    (bent, through), (mirrored, back) = rays
    assert np.degrees(np.arcsin(np.hypot(bent[0], bent[1]))) == pytest.approx(34.81, abs=0.01) and bent[2] < 0
    np.testing.assert_allclose(mirrored, beam(60, 180), atol=1e-5)
    assert back == pytest.approx([0.0916] * 3, rel=2e-2)
    assert through + back == pytest.approx([1, 1, 1], abs=1e-3)
    np.testing.assert_allclose(part.reflected[0] + part.transmitted[0], 1, atol=2e-3)


@pytest.mark.parametrize("name", ["car_paint", "merl/brass", "cross_brushed_steel", "plastic"])
def test_no_albedo_is_above_1(name):
    lights = np.stack([beam(degrees) for degrees in (0, 60, 85)])
    found = scattering(rl.scene.material_preset(name), lights, lights[:1])
    assert 0 < found.reflected.min() and found.reflected.max() < 1.005


def test_scratches_are_drawn_across_and_along():
    surface = Ward((0.5, 0.5, 0.5), 0.05, 0.4)
    views = np.stack([beam(40, 0), beam(40, 90)])
    along, across = scattering(surface, beam(0)[None], views).values[0, :, 0]
    assert across > 100 * along
    assert len(brdf_figure(surface, "", samples=2).subfigs[0].axes) == 6


def test_highlights_are_drawn_by_the_cube_root():
    assert _Length(0.9)(0.5) == 0.5 and not _Length(0.9).bent
    assert _Length(1000.0)(8.0) == pytest.approx(2.0)
    assert 100.0 in _Length(1000.0).rings()


@pytest.mark.slow
def test_a_plot_is_a_picture_of_the_same_bytes(tmp_path):
    for name in ("one.png", "two.png"):
        told: list[float] = []
        brick = Material((0.5, 0.2, 0.1), roughness=0.3)
        draw_brdf(brick, tmp_path / name, title="brick", samples=2, progress=told.append)
        assert told == sorted(told) and len(told) >= 3 and told[-1] == 1
    assert (tmp_path / "one.png").read_bytes() == (tmp_path / "two.png").read_bytes()
    pixels = read_photograph(tmp_path / "one.png").pixels
    assert pixels.shape[1] == 1300
    # Something is drawn in each third of the upper half, in the material's red.
    red = (pixels[..., 0].astype(int) - pixels[..., 2]) > 60
    assert all(third[: len(pixels) // 2].any() for third in np.array_split(red, 3, axis=1))


SCENE = """
[camera]
position = [0, 0, 6]
target = [0, 0, 0]
[light]
colour = 1.0
[materials.tin]
kind = "ward"
reflectance = [0.4, 0.4, 0.4]
alpha_x = 0.1
alpha_y = 0.2
[[objects]]
sphere = { centre = [0, 0, 0], radius = 1 }
material = "tin"
"""


def test_a_material_is_found_by_name(tmp_path):
    scene = tmp_path / "scene.toml"
    scene.write_text(SCENE)
    for name, given in (("tin", scene), ("gold", None), ("merl/brass", scene)):
        draw_brdf(name, tmp_path / "a.png", scene=given, dry_run=True)
    assert not (tmp_path / "a.png").exists()
    with pytest.raises(ValueError, match=r"no preset 'lead'.*scene\.toml has tin"):
        draw_brdf("lead", tmp_path / "a.png", scene=scene)
    with pytest.raises(UnreadableFile, match="no such file"):
        draw_brdf(str(tmp_path / "none.binary"), tmp_path / "a.png")
    scene.write_text(SCENE.replace("0.2", '"none.png"'))
    with pytest.raises(InvalidScene, match=r"materials\.tin\.alpha_y: .*none\.png"):
        draw_brdf("tin", tmp_path / "a.png", scene=scene)


def test_what_has_no_brdf_and_no_picture_is_refused(tmp_path):
    for material in (mirror(name="old"), WhittedMaterial(name="old")):
        with pytest.raises(UnsupportedScene, match="'old' has no BRDF that could be drawn"):
            draw_brdf(material, tmp_path / "a.png")
    with pytest.raises(ValueError, match=r"drawn into \.png or \.svg, not \.exr"):
        draw_brdf(Material(), tmp_path / "a.exr")
    with pytest.raises(ValueError, match="samples is 1"):
        draw_brdf(Material(), tmp_path / "a.png", samples=1)


def test_a_length_of_nothing_is_drawn_too():
    dark = Scattering(np.zeros((3, 4, 3)), np.zeros((3, 3)), np.zeros((3, 3)), ((), (), ()))
    assert _relative(dark, 0, np.zeros(4)).max() == 0 and _Length(0.0)(0.0) == 0
