"""What reflection maps and Whitted's method cannot show is refused, or reported, in one line."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import lights
from relume.errors import UnsupportedScene
from relume.renderers.irradiance_cache.irradiance_cache import IrradianceCache
from relume.renderers.mitsuba.scene import why_not
from relume.renderers.photon_map.photon_map import PhotonMap
from relume.renderers.prefiltered.materials import layers_of
from relume.renderers.prefiltered.prefiltered import Prefiltered
from relume.renderers.radiosity.radiosity import Radiosity
from relume.renderers.renderer import Renderer
from relume.renderers.unsupported import light_name, unsupported_features
from relume.renderers.whitted.kernel_data import view_of
from relume.renderers.whitted.materials import as_whitted
from relume.renderers.whitted.whitted import Whitted
from relume.scene.cameras.camera import Camera
from relume.scene.cameras.distortion import Distortion
from relume.scene.lights import AmbientLight, DistantLight, Light, Linear, PointLight, RectangleLight, SphereLight
from relume.scene.materials.abc_facets import MERL_FITS
from relume.scene.materials.materials import Diffuse, Material, Ward
from relume.scene.materials.measured import MeasuredBRDF
from relume.scene.materials.media import Medium
from relume.scene.materials.whitted import WhittedMaterial
from relume.scene.scene import Dome, Scene
from relume.scene.shapes.shapes import Sphere

CAMERA = Camera(6, 6, 40.0, np.array([0, 0, 6.0]), np.eye(3))
SCENE = Scene(lights.constant(4, 1.0), objects=(Sphere((0.0, 0.0, 0.0), 1.0, Diffuse((0.5, 0.5, 0.5))),))
LAMP = SphereLight((0.0, 3.0, 0.0), 0.1, (1.0, 1.0, 1.0))
POINT, AMBIENT = PointLight((0.0, 3.0, 0.0), (1.0, 1.0, 1.0)), AmbientLight((1.0, 1.0, 1.0))
FALLS = replace(POINT, falloff=Linear(9.0))
FOG = Medium((0.1, 0.1, 0.1))
BRASS = Sphere((0.0, 0.0, 0.0), 1.0, Ward((0.3, 0.3, 0.3), 0.1, 0.2, name="brass"))
FELT = replace(BRASS, material=MeasuredBRDF(np.ones((2, 2, 2, 3), np.float32), "felt"))
TEFLON = replace(BRASS, material=MERL_FITS["merl/teflon"])
BENT, WIDE = replace(CAMERA, distortion=Distortion(0.01)), replace(CAMERA, aperture=0.1, focus=3.0)


@pytest.mark.parametrize(
    ("renderer", "scene", "camera", "line"),
    [
        (Whitted(), replace(SCENE, distant=Dome(9.0)), CAMERA, "light map at infinity"),
        (Whitted(), replace(SCENE, lights=(LAMP,)), CAMERA, "one of the scene's is a sphere"),
        (Whitted(), replace(SCENE, objects=(BRASS,)), CAMERA, "cannot shade the Ward surface 'brass'"),
        (Whitted(), replace(SCENE, objects=(FELT,)), CAMERA, "cannot shade the measured surface 'felt'"),
        (Whitted(), SCENE, BENT, "lens distorts"),
        (Whitted(), SCENE, WIDE, "lens has an aperture; use rl.Mitsuba"),
        (Prefiltered(), replace(SCENE, distant=Dome(9.0)), CAMERA, "this scene's is on walls"),
        (
            Prefiltered(),
            replace(SCENE, lights=(POINT,)),
            CAMERA,
            r"lights of its own \(a point of light\); use rl.Whitted",
        ),
        (
            Prefiltered(),
            replace(SCENE, lights=(LAMP,)),
            CAMERA,
            r"lights of its own \(a sphere of light\); use rl.Mitsuba",
        ),
        (
            Prefiltered(),
            replace(SCENE, lights=(LAMP, AMBIENT)),
            CAMERA,
            "use rl.Mitsuba .*, and leave out ambient light",
        ),
        (
            Prefiltered(),
            replace(SCENE, lights=(POINT,), medium=FOG),
            CAMERA,
            "a medium fills this scene; use rl.Mitsuba",
        ),
        (Prefiltered(), replace(SCENE, objects=(BRASS,)), CAMERA, "cannot shade the Ward surface 'brass'"),
        (Prefiltered(), replace(SCENE, objects=(FELT,)), CAMERA, "cannot shade the measured surface 'felt'"),
        (Prefiltered(), replace(SCENE, objects=(TEFLON,)), CAMERA, "cannot shade the measured surface 'merl/teflon'"),
        (Prefiltered(), SCENE, WIDE, "lens has an aperture"),
    ],
)
def test_what_cannot_be_shown_is_refused_in_one_line(renderer, scene, camera, line):
    with pytest.raises(UnsupportedScene, match=line) as caught:
        renderer.render(scene, camera)
    assert "; use " in str(caught.value) and "\n" not in str(caught.value)


@pytest.mark.parametrize(
    "light",
    [
        POINT,
        FALLS,
        LAMP,
        AMBIENT,
        DistantLight((0, 1, 0), (1, 1, 1)),
        RectangleLight((0, 3, 0), (0, -1, 0), (1, 1), (1, 1, 1)),
    ],
    ids=lambda light: light_name(light),
)
@pytest.mark.parametrize(
    "renderer",
    [
        Prefiltered(),
        Radiosity(rays=8, refinements=0, unshot=0.5),
        IrradianceCache(rays=8),
        PhotonMap(photons=8, passes=1),
    ],
)
def test_the_renderer_that_a_refusal_of_a_light_names_takes_it(renderer: Renderer, light: Light):
    scene = replace(SCENE, light=lights.constant(4, 0.0), lights=(light,))
    try:
        renderer.render(scene, replace(CAMERA, width=2, height=2))
    except UnsupportedScene as refused:
        if "use rl.Whitted" in str(refused):
            Whitted().prepared(scene)
        else:
            assert "use rl.Mitsuba" in str(refused)
            assert why_not(scene) is None


def test_a_whitted_material_is_sent_to_whitted():
    shiny = Sphere((0.0, 0.0, 0.0), 1.0, WhittedMaterial((0.5, 0.5, 0.5), name="shiny"))
    for renderer in (Radiosity(), IrradianceCache(), PhotonMap()):
        with pytest.raises(UnsupportedScene, match=r"'shiny'.*use rl.Whitted"):
            renderer.render(replace(SCENE, objects=(shiny,)), CAMERA)


def test_whitted_looks_through_the_principal_point():
    assert view_of(replace(CAMERA, centre=(2.0, 5.0)))[13:15].tolist() == [2.0, 5.0]
    assert view_of(CAMERA)[13:15].tolist() == [3.0, 3.0]


FULL = Material(clearcoat=0.5, emission=(1.0, 0.0, 0.0), alpha=0.5, sheen_color=(0.1, 0.1, 0.1), name="cloth")


def test_what_of_a_material_is_not_shown_is_reported():
    assert unsupported_features(FULL) == ("emission", "alpha", "clearcoat", "sheen")
    glass = Material(transmission=1.0, dispersion=1.0, thin=True, attenuation_color=(0.5, 0.5, 0.5))
    assert unsupported_features(glass) == ("thinness", "dispersion")
    assert unsupported_features(Material((0.2, 0.2, 0.2), 0.5, 0.3, 0.5, 1.4)) == ()
    with pytest.warns(UserWarning, match="Whitted's model does not show emission, alpha, clearcoat, sheen of 'cloth'"):
        as_whitted(FULL)
    with pytest.warns(UserWarning, match="reflection maps do not show emission, alpha, clearcoat, sheen of 'cloth'"):
        layers_of(FULL)


def test_an_image_of_transmission_lets_light_through_where_it_says():
    clear = np.array([[0.0, 1.0]], np.float32)
    layers = layers_of(Material(transmission=clear, roughness=0.0))
    assert all(layer.has_image for layer in layers)
    uv = np.array([[0.25, 0.5], [0.75, 0.5]])
    below, through = (layer.colour(uv, np.arange(2)) for layer in layers[:2])
    np.testing.assert_allclose(below[:, 0], [1, 0])
    np.testing.assert_allclose(through[:, 0], [0, 1])
