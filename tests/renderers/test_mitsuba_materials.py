"""Surfaces in Mitsuba: each samples what it claims, returns no more light than it gets, and scatters light from the
lamps as the camera sees it."""

import warnings
from dataclasses import replace

import numpy as np
import pytest

from relume.errors import UnsupportedScene
from relume.renderers.directional_albedo import NARROWEST, ggx_shares, nodes, sheen_shares
from relume.renderers.mitsuba.layered import layered
from relume.renderers.mitsuba.materials import bsdf, emission, interior, not_rendered
from relume.renderers.mitsuba.path_tracer import Mitsuba, _mitsuba
from relume.renderers.mitsuba.ward import ward
from relume.renderers.renderer import render
from relume.scene.cameras.camera import Camera
from relume.scene.materials.materials import Diffuse, Material, Ward
from relume.scene.scene import Scene
from relume.scene.shapes.shapes import Sphere
from relume.sphere.environment_map import EnvironmentMap
from solids import quad

WHITE = (1.0, 1.0, 1.0)
COUNT = 1 << 17
COSINES = (0.2, 0.8)
LOSSLESS = {
    "chalk": Material(),
    "plastic": Material(roughness=0.3),
    "dense": Material(ior=2.4, roughness=0.6),
    "without a step": Material(ior=1.0, roughness=0.5),
}
"""White dielectrics: what their gloss does not return, their base does."""
LOSSY = {
    "rough metal": Material(metallic=1.0, roughness=0.7),
    "brushed metal": Material(metallic=1.0, roughness=0.4, anisotropy=0.8, anisotropy_rotation=0.7),
    "coated": Material(roughness=0.6, clearcoat=1.0, clearcoat_roughness=0.3),
    "velvet": Material(sheen_color=(1.0, 0.5, 0.2), sheen_roughness=0.4),
    "all at once": Material(
        (0.9, 0.5, 0.2), metallic=0.5, roughness=0.5, clearcoat=0.5, clearcoat_roughness=0.5,
        sheen_color=(0.3, 0.6, 0.9), sheen_roughness=0.7, anisotropy=0.5, specular=0.7, specular_color=(3, 1, 0.5),
    ),
    "Ward's metal": Ward(WHITE, 0.15, 0.4),
    "Ward's paint": Ward((0.3, 0.2, 0.1), 0.3, 0.15, (0.7, 0.6, 0.5)),
}  # fmt: skip


def made(material):
    return ward(material) if isinstance(material, Ward) else layered(material)


def seen_from(mi, cosine, count=COUNT):
    import drjit as dr

    si = dr.zeros(mi.SurfaceInteraction3f, count)
    sine = float(np.sqrt(1 - cosine**2))
    si.wi = mi.Vector3f(0.6 * sine, 0.8 * sine, cosine)
    return si


def sampled(mi, surface, si):
    random = mi.PCG32(COUNT, initstate=7)
    one, two = random.next_float32(), mi.Point2f(random.next_float32(), random.next_float32())
    found, weight = surface.sample(mi.BSDFContext(), si, one, two)
    return np.array(found.wo).T, np.array(found.pdf), np.array(weight).T


def columns(array):
    """(N, 3), whichever way the vectors were turned into an array."""
    return array if array.shape[-1] == 3 else array.T


SOONER = ("chalk", "all at once", "Ward's paint")
LATER = [pytest.param(name, marks=pytest.mark.slow) for name in LOSSLESS | LOSSY if name not in SOONER]


@pytest.mark.parametrize("name", [*SOONER, *LATER])
def test_a_surface_samples_what_it_claims_and_returns_no_more_than_it_gets(mi, name):
    material = (LOSSLESS | LOSSY)[name]
    surface = made(material)
    context = mi.BSDFContext()
    for cosine in COSINES:
        si = seen_from(mi, cosine)
        wo, density, weight = sampled(mi, surface, si)
        wo, weight = columns(wo), columns(weight)
        kept = density > 0
        returned = weight.mean(0)
        assert returned.max() <= 1.01
        if name in LOSSLESS:
            # The tables between their nodes: 0.003.
            assert returned == pytest.approx([1, 1, 1], abs=4e-3)
        # The weight of a sample is its value by its density.
        ways = mi.Vector3f(*(np.ascontiguousarray(axis) for axis in wo.T))
        value, again = surface.eval_pdf(context, si, ways)
        value = columns(np.array(value))
        np.testing.assert_allclose(np.array(again)[kept], density[kept], rtol=1e-3)
        np.testing.assert_allclose(value[kept], (weight * density[:, None])[kept], rtol=2e-3, atol=1e-6)
        # Densities are those of the samples: shares in 8 by 16 cells of equal solid angle.
        fine = 24
        up = (np.arange(8 * fine) + 0.5) / (8 * fine)
        around = (np.arange(16 * fine) + 0.5) / (16 * fine) * 2 * np.pi - np.pi
        z, angle = (grid.ravel().astype(np.float32) for grid in np.meshgrid(up, around, indexing="ij"))
        sine = np.sqrt(1 - z**2)
        cells = surface.pdf(
            context, seen_from(mi, cosine, z.size), mi.Vector3f(sine * np.cos(angle), sine * np.sin(angle), z)
        )
        expected = np.array(cells).reshape(8, fine, 16, fine).mean((1, 3)) * 2 * np.pi / 128
        rows = np.clip((wo[:, 2] * 8).astype(int), 0, 7)[kept]
        sides = np.clip(((np.arctan2(wo[:, 1], wo[:, 0]) + np.pi) / (2 * np.pi) * 16).astype(int), 0, 15)[kept]
        counts = np.bincount(rows * 16 + sides, minlength=128).reshape(8, 16) / COUNT
        error = np.sqrt(expected / COUNT)
        # 128 cells, 2 views and 11 surfaces: 5 standard errors; quadrature of narrow lobes on top.
        assert np.all(np.abs(counts - expected) <= 5 * error + 2e-4 + 0.01 * expected)


@pytest.mark.parametrize("name", ["all at once", "Ward's paint"])
def test_light_from_the_lamps_is_scattered_as_the_camera_sees_it(mi, name):
    surface = made((LOSSLESS | LOSSY)[name])
    generator = np.random.default_rng(3)
    one, two = (generator.normal(size=(3, 4096)) for _ in range(2))
    one, two = (np.abs(v) * [[1], [1], [1]] / np.linalg.norm(v, axis=0) for v in (one, two))
    one[:2] *= generator.choice([-1, 1], (2, 4096))
    ways = [mi.Vector3f(*v.astype(np.float32)) for v in (one, two)]
    values = []
    # From the camera along `one`, and to it: the other way is the light's.
    for here, there, cosine, mode in (
        (ways[0], ways[1], two[2], mi.TransportMode.Radiance),
        (ways[1], ways[0], one[2], mi.TransportMode.Importance),
    ):
        si = seen_from(mi, 0.5, 4096)
        si.wi = here
        values.append(columns(np.array(surface.eval(mi.BSDFContext(mode), si, there))) / cosine[:, None])
    np.testing.assert_allclose(values[0], values[1], rtol=2e-3, atol=1e-5)


@pytest.mark.parametrize("cosine", [0.1, 0.9])
def test_what_is_under_a_gloss_has_what_the_viewer_does_not_see_of_it(mi, cosine):
    # Seen at 60° a smooth gloss of ior 1.5 returns 0.0892 (A23): a white base has 0.9108/π, wherever the light is.
    si = seen_from(mi, 0.5, 1)
    sine = float(np.sqrt(1 - cosine**2))
    value = np.array(layered(Material(roughness=0.02)).eval(mi.BSDFContext(), si, mi.Vector3f(sine, 0, cosine)))
    assert value.ravel() / cosine == pytest.approx([0.9108 / np.pi] * 3, rel=3e-3)


@pytest.mark.parametrize(("alpha", "share"), [(0.3, 0.87736), (0.5, 0.68785), (0.8, 0.42700), (1.0, 0.306853)])
def test_a_white_ggx_lobe_returns_what_the_integral_says(alpha, share):
    # A18, seen along the normal; F₀ = F₉₀ = 1.
    table = ggx_shares(1.5)[:, -1, :2].sum(axis=-1)
    assert np.interp(np.sqrt(alpha), nodes()[1], table) == pytest.approx(share, abs=1.5e-3)


def test_a_smooth_lobe_returns_fresnels_reflectance():
    # ior 1.5 at 60°: 0.0892 (A23); at the normal 0.04.
    table = ggx_shares(1.5)[0]
    returned = 0.04 * table[:, 0] + table[:, 1]
    assert returned[-1] == pytest.approx(0.04, abs=1e-4)
    assert np.interp(0.5, nodes()[0], returned) == pytest.approx(0.0892, abs=2e-3)
    assert NARROWEST == 1e-3


def test_sheen_returns_no_more_than_it_gets():
    assert sheen_shares()[..., 0].max() <= 1 + 1e-6
    assert sheen_shares()[..., 1].max() > 4


# --- through a whole render ------------------------------------------------------------------------------------------

CONSTANT = EnvironmentMap(np.ones((8, 16, 3), np.float32))
CAMERA = Camera(8, 8, 40.0, np.array([0, 0, 6.0]), np.eye(3))


def seen(material, light=CONSTANT, samples=64):
    ball = Sphere((0.0, 0.0, 0.0), 1.0, material)
    return render(Scene(light, objects=(ball,)), CAMERA, Mitsuba(samples=samples), seed=2).radiance


def test_what_shines_shows_its_radiance_and_lights_what_is_near():
    dark = EnvironmentMap(np.full((8, 16, 3), 1e-6, np.float32))
    black = Material((0, 0, 0), roughness=1.0, specular=0.0, emission=(3.0, 2.0, 0.5))
    np.testing.assert_allclose(seen(black, dark)[3:5, 3:5], np.broadcast_to([3, 2, 0.5], (2, 2, 3)), rtol=1e-3)


def test_a_mask_lets_light_straight_through_its_holes():
    bright = np.full((8, 16, 3), 5, np.float32)
    through = seen(Diffuse((0, 0, 0)), EnvironmentMap(bright))
    assert through.max() == 0
    holes = seen(Material((0, 0, 0), specular=0.0, alpha=0.25), EnvironmentMap(bright), 256)
    # Past the front and the back: 0.75² of 5.
    assert holes[2:6, 2:6].mean() == pytest.approx(5 * 0.75**2, rel=0.05)


def test_a_thin_sheet_does_not_bend_light_and_a_ball_of_glass_turns_it_over():
    radiance = np.zeros((16, 32, 3), np.float32)
    radiance[:, 16:] = 1
    sheet, solid = (
        seen(Material(roughness=0.0, transmission=1.0, thin=thin), EnvironmentMap(radiance))[3:5]
        for thin in (True, False)
    )
    assert sheet[:, 2].max() < 0.4 < 0.6 < sheet[:, 5].min()
    assert solid[:, 5].max() < 0.4 < 0.6 < solid[:, 2].min()


@pytest.mark.parametrize(("axis", "sign"), [(0, 1), (0, -1), (1, 1), (1, -1)])
def test_a_normal_map_leans_towards_the_right_and_the_upper_side_of_the_picture(axis, sign):
    # A square that faces the camera, and light from one side only: it is brighter leaning there.
    light = np.zeros((16, 32, 3), np.float32)
    rows, columns_lit = {
        (0, 1): (slice(4, 12), slice(20, 28)),
        (0, -1): (slice(4, 12), slice(4, 12)),
        (1, 1): (slice(0, 4), slice(None)),
        (1, -1): (slice(12, 16), slice(None)),
    }[axis, sign]
    light[rows, columns_lit] = 1
    shades = []
    for lean in (0.5 * sign, -0.5 * sign):
        normal = np.zeros((1, 1, 3), np.float32)
        normal[..., axis], normal[..., 2] = lean, np.sqrt(0.75)
        corners = [[-2, -2, 0], [2, -2, 0], [2, 2, 0], [-2, 2, 0]]
        square = quad(corners, Material(specular=0.0, normal=normal), textured=True)
        picture = render(Scene(EnvironmentMap(light), objects=(square,)), CAMERA, Mitsuba(samples=64), seed=1)
        shades.append(picture.radiance.mean())
    assert shades[0] > 1.5 * shades[1]


# --- what is not rendered --------------------------------------------------------------------------------------------

GLASS = Material(roughness=0.0, transmission=1.0)


@pytest.mark.parametrize(
    ("material", "media", "scalar", "said"),
    [
        (replace(GLASS, dispersion=1.0), True, False, "dispersion"),
        (replace(GLASS, dispersion=1.0), True, True, "dispersion (the scalar variant has none)"),
        (replace(GLASS, dispersion=1.0, roughness=0.3), True, False, "dispersion of what is rough"),
        (replace(GLASS, dispersion=1.0, scattering_distance=(1, 1, 1)), True, False, "or scatters inside"),
        (replace(GLASS, clearcoat=1.0), True, False, "clearcoat over what light goes through"),
        (replace(GLASS, attenuation_color=(0, 1, 1), attenuation_distance=1.0), False, False, "volume attenuation"),
        (replace(GLASS, scattering_distance=(1, 1, 1)), False, False, "subsurface scattering (drawn diffuse)"),
        (Material(clearcoat=1.0), False, True, "clearcoat (the scalar variant has none)"),
    ],
)
def test_what_is_left_out_is_said(material, media, scalar, said):
    assert any(said in words for words in not_rendered(material, media=media, scalar=scalar))


def test_what_is_rendered_whole_is_not_spoken_of():
    full = replace(GLASS, scattering_distance=(1, 1, 1))
    assert not_rendered(full, media=True, scalar=False) == ()
    assert not_rendered(LOSSY["all at once"], media=False, scalar=False) == ()
    assert not_rendered(Material(), media=False, scalar=True) == ()
    assert not_rendered(replace(GLASS, dispersion=1.0), media=True, scalar=False, dispersion=True) == ()
    assert not_rendered(replace(GLASS, dispersion=1.0, thin=True), media=True, scalar=False) == ()


def test_the_scalar_variant_refuses_ward_and_warns_of_layers():
    with _mitsuba("scalar_rgb", None) as mi:
        with pytest.raises(UnsupportedScene, match="cannot shade the Ward surface 'brass'"):
            bsdf(mi, Ward(WHITE, 0.1, 0.2, name="brass"))
        with pytest.warns(UserWarning, match="not rendered of material 'car': clearcoat"):
            mi.load_dict(bsdf(mi, Material(clearcoat=1.0, name="car")))
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            mi.load_dict(bsdf(mi, Material(roughness=0.5)))


def test_a_scattering_body_without_media_is_diffuse_of_its_colour(mi):
    body = Material(
        roughness=0.5, transmission=1.0, scattering_distance=(1e-3, 1e-3, 1e-3), scattering_albedo=(1.0, 0.9, 0.5),
        name="wax",
    )  # fmt: skip
    with pytest.warns(UserWarning, match="not rendered of material 'wax': subsurface"):
        surface = mi.load_dict(bsdf(mi, body))
    si = seen_from(mi, 0.5, 1)
    colour = np.array(surface.eval_diffuse_reflectance(si)).ravel()
    assert body.medium is not None
    np.testing.assert_allclose(colour, body.medium.diffuse_reflectance(), rtol=1e-5)


def test_media_and_emitters_are_mitsubas_own(mi):
    body = replace(GLASS, attenuation_color=(0.1, 0.5, 0.9), attenuation_distance=0.01, scattering_distance=(1, 2, 3))
    words = interior(body)
    assert words is not None and body.medium is not None
    densities = np.asarray(words["sigma_t"]["value"]) * words["scale"]
    np.testing.assert_allclose(densities, body.medium.extinction)
    assert mi.load_dict(words).class_name() == "HomogeneousMedium"
    assert interior(Material()) is None and interior(Diffuse(WHITE)) is None
    assert emission(mi, Material()) is None and emission(mi, Diffuse(WHITE)) is None
