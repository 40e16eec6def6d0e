"""Surfaces in the paper's terms: what their constructors add up, and what is refused."""

import numpy as np
import pytest

from relume.light.reflection.brdf import GGX
from relume.light.reflection.lobes import Lambert, Mirror, Phong, WardLobe
from relume.light.reflection.weights import Complement, Even, Fresnel, Schlick
from relume.scene.materials.bumps import Wrinkles
from relume.scene.materials.reflective import Layer, Reflective, Towards, glass, glossy, mirror, retroreflector

COSINES = np.linspace(0, 1, 30)


def test_a_glossy_surface_is_line_9_of_the_paper():
    diffuse, specular = glossy((0.5, 0.2, 0.1)).layers
    assert (diffuse.lobe, diffuse.towards, diffuse.colour) == (Lambert(), Towards.NORMAL, (0.5, 0.2, 0.1))
    assert (specular.lobe, specular.towards, specular.colour) == (Phong(50), Towards.REFLECTED, (1.0, 1.0, 1.0))
    assert specular.weight == Schlick(0.04)


@pytest.mark.parametrize("weight", [Even(0.3), Schlick(0.04), Fresnel(1.5)])
def test_the_layer_below_gets_what_the_specular_one_leaves(weight):
    diffuse, specular = glossy(specular_weight=weight).layers
    assert diffuse.weight == Complement(weight)
    np.testing.assert_allclose(diffuse.weight(COSINES) + specular.weight(COSINES), 1)


def test_a_glossy_surface_takes_any_lobe_or_reflectance():
    for lobe in (WardLobe(0.2), GGX(0.3), Mirror()):
        assert glossy(specular=lobe).layers[1].lobe == lobe


def test_a_mirror_is_one_unblurred_layer():
    (layer,) = mirror((1.0, 0.8, 0.3)).layers
    assert (layer.lobe, layer.towards, layer.colour) == (Mirror(), Towards.REFLECTED, (1.0, 0.8, 0.3))
    np.testing.assert_allclose(layer.weight(COSINES), 1)


def test_a_retroreflector_is_looked_up_by_the_viewer():
    (layer,) = retroreflector((1.0, 0.9, 0.2), Phong(200)).layers
    assert (layer.lobe, layer.towards, layer.colour) == (Phong(200), Towards.VIEWER, (1.0, 0.9, 0.2))
    assert retroreflector().layers[0].lobe == Phong(50)


def test_glass_reflects_by_fresnel_and_refracts_the_rest():
    above, through = glass(1.33, (0.9, 1.0, 0.9)).layers
    assert (above.lobe, above.towards, above.colour) == (Mirror(), Towards.REFLECTED, (1.0, 1.0, 1.0))
    assert (through.lobe, through.towards, through.colour) == (Mirror(), Towards.REFRACTED, (0.9, 1.0, 0.9))
    assert through.ior == 1.33
    assert float(above.weight(np.array(1.0))) == pytest.approx(0.020059, abs=1e-6)  # A23
    np.testing.assert_allclose(above.weight(COSINES) + through.weight(COSINES), 1)


@pytest.mark.parametrize("make", [glossy, mirror, retroreflector, glass])
def test_a_surface_keeps_its_name_and_its_bumps(make):
    surface = make(bumps=Wrinkles(seed=2), name="rusty")
    assert isinstance(surface, Reflective)
    assert (surface.bumps, surface.name) == (Wrinkles(seed=2), "rusty")
    assert (make().bumps, make().name) == (None, "")


def test_a_layers_colour_may_be_an_image():
    image = np.full((4, 6, 3), 0.5, np.float32)
    assert Layer(Lambert(), colour=image).colour is image
    assert glossy(image).layers[0].colour is image


@pytest.mark.parametrize(
    "colour",
    [(0.5, 0.5), 0.5, (0.5, -0.1, 0.5), (0.5, np.nan, 0.5), np.ones((4, 3)), np.ones((4, 6, 4))],
    ids=["two", "one", "negative", "NaN", "a list of colours", "four channels"],
)
def test_a_colour_that_is_none_is_refused(colour):
    with pytest.raises(ValueError, match=r"colour of a layer .*three numbers of 0 or more, or an image of them"):
        Layer(Lambert(), colour=colour)


@pytest.mark.parametrize("ior", [0, -1.5, np.nan, np.inf])
def test_an_index_of_refraction_that_cannot_be_is_refused(ior):
    with pytest.raises(ValueError, match=rf"ior of a layer is {ior}; expected above 0, like 1\.5 for glass"):
        Layer(Mirror(), Towards.REFRACTED, ior=ior)
    with pytest.raises(ValueError, match="expected above 0"):
        glass(ior)
