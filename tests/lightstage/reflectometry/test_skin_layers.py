"""Layers of skin by Monte Carlo, against the theory of a half-space and against themselves."""

from __future__ import annotations

import numpy as np
import pytest

from relume.lightstage.reflectometry.skin_layers import SkinLayer, layered_reflection, layers_like, skin


def chandrasekhar(albedo: float, cosines: np.ndarray) -> np.ndarray:
    """H(μ) of an even scatterer, by iteration (Chandrasekhar 1950, chapter V)."""
    nodes, weights = np.polynomial.legendre.leggauss(60)
    nodes, weights = (nodes + 1) / 2, weights / 2
    found = np.ones_like(nodes)
    root = np.sqrt(1 - albedo)
    for _ in range(400):
        # The form that converges: 1/H = √(1−ω) + ω/2 ∫ x H(x)/(μ+x) dx.
        found = 1 / (root + albedo / 2 * ((nodes * found * weights) / (nodes[:, None] + nodes)).sum(axis=1))
    return 1 / (root + albedo / 2 * ((nodes * found * weights) / (cosines[:, None] + nodes)).sum(axis=1))


@pytest.mark.parametrize("incidence", [0.0, 1.0])
def test_a_half_space_is_chandrasekhars(incidence):
    views = np.radians([-75, -40, 0, 30, 60])
    albedos = (0.5, 0.9)
    # One walk of scattering alone serves both.
    half_space = SkinLayer(1.0, tuple(1 / albedo - 1 for albedo in albedos), 0.0)
    found = layered_reflection([half_space], np.array([incidence]), views, ior=1.0, photons=20_000)[0]
    lit, seen = np.cos([incidence]), np.cos(views)
    for column, albedo in enumerate(albedos):
        # f = ω/4π · H(μ) H(μ0) / (μ + μ0).
        truth = albedo / (4 * np.pi) * chandrasekhar(albedo, lit) * chandrasekhar(albedo, seen) / (lit + seen)
        assert found[:, column] == pytest.approx(truth, rel=0.03)


def test_a_border_between_equal_layers_changes_nothing():
    one = [SkinLayer(2.0, (0.1,), 0.6)]
    two = [SkinLayer(2.0, (0.1,), 0.6, 0.7), *one]
    views = np.radians([-50, 0, 50])
    found = [layered_reflection(each, np.array([0.5]), views, photons=1000) for each in (one, two)]
    assert found[0] == pytest.approx(found[1], rel=1e-6)


def test_a_layer_on_top_darkens_by_what_it_absorbs():
    # A clear absorber over the body: light goes through it once in and once out, at 30° inside.
    aslant = np.arcsin(1.4 * np.sin(np.radians(30)))
    body = SkinLayer(20.0, (1.0,), 0.5)
    film = SkinLayer(1e-3, (2.0,), 0.0, 0.1)
    bare = layered_reflection([body], np.array([aslant]), np.array([-aslant]), photons=4000, ior=1.4)
    covered = layered_reflection([film, body], np.array([aslant]), np.array([-aslant]), photons=4000, ior=1.4)
    once = np.exp(-2 * 2.0 * 0.1 / np.cos(np.radians(30)))
    # What the interface reflects back inside crosses it twice more, so somewhat less comes out.
    assert 0.6 * once < (covered / bare).item() < once


def test_light_and_view_change_places():
    layers = skin([0.5, 2.0])
    there = layered_reflection(layers, np.radians([20.0]), np.radians([65.0]), photons=12_000)
    back = layered_reflection(layers, np.radians([65.0]), np.radians([20.0]), photons=12_000, seed=1)
    assert there == pytest.approx(back, rel=0.1)


def test_layers_are_found_for_albedos():
    albedos = np.array([0.45, 0.25, 0.12])
    layers = layers_like(albedos, photons=3000)
    assert layers[1].absorption[0] < layers[1].absorption[1] < layers[1].absorption[2]
    found = np.pi * layered_reflection(layers, np.zeros(1), np.zeros(1), photons=3000, seed=4)[0, 0]
    assert found == pytest.approx(albedos, rel=0.15)


def test_layers_end_with_one_that_does_not():
    for wrong in ([SkinLayer(1.0, (1.0,), 0.0, 1.0)], [], [SkinLayer(1, (1, 2), 0, 1), SkinLayer(1, (1,), 0)]):
        with pytest.raises(ValueError, match="infinite thickness"):
            layered_reflection(wrong, np.zeros(1), np.zeros(1))
