"""What a light does to the pixels of a mesh, against the same in NumPy and in closed form."""

from __future__ import annotations

import numpy as np

import solids
from relume.lightstage.direct_light.shading_kernel import GRAZING, REFLECTANCE, add_light
from relume.lightstage.direct_light.surface import Geometry, Reached, direct_light, samples_of
from relume.scene.cameras.camera import Camera
from relume.scene.materials.materials import Diffuse
from relume.sphere.directions import normalised

CAMERA = Camera.looking_at(np.array([0.0, 0.0, 4.0]), np.zeros(3), width=30, height=24, focal_length=40.0)
BALL = Geometry.of([solids.sphere(Diffuse((0.5, 0.5, 0.5)))])


def test_gloss_is_that_of_the_slow_twin() -> None:
    random = np.random.default_rng(1)
    normals, eye = (normalised(random.normal(size=(500, 3))).astype(np.float32) for _ in range(2))
    light, alpha = normalised(random.normal(size=3)).astype(np.float32), 0.26
    incident, lit = normals @ light, np.flatnonzero(normals @ light > 0)[::2]
    pixels, found = random.integers(0, 40, 500), np.zeros((2, 40), np.float32)
    add_light(found, pixels, normals, eye, light, incident, lit, np.float32(alpha))

    n, v, cosine = (each[lit].astype(np.float64) for each in (normals, eye, incident))
    half = normalised(v + light)
    outgoing = np.maximum(np.einsum("kc,kc->k", n, v), GRAZING)
    slope = np.einsum("kc,kc->k", n, half) ** 2 * (alpha**2 - 1) + 1
    masked = outgoing * np.sqrt(alpha**2 + (1 - alpha**2) * cosine**2)
    shadowed = cosine * np.sqrt(alpha**2 + (1 - alpha**2) * outgoing**2)
    fresnel = REFLECTANCE + (1 - REFLECTANCE) * (1 - np.einsum("kc,kc->k", v, half)) ** 5
    gloss = alpha**2 / (np.pi * slope**2) * 2 * cosine * outgoing / (masked + shadowed) * fresnel / (4 * outgoing)
    for row, values in zip(found, (cosine, gloss), strict=True):
        np.testing.assert_allclose(row, np.bincount(pixels[lit], values, 40), rtol=1e-4)


def test_a_ball_is_lit_by_the_cosine_on_the_side_of_the_light() -> None:
    samples = samples_of(BALL, CAMERA, np.arange(24), 2)
    towards = normalised(np.array([1.0, 0.5, 0.3]))
    irradiance, gloss = direct_light(BALL, samples, 30 * 24, towards, 0.0, 0.2)
    expected = np.zeros(30 * 24)
    for sample in samples:
        np.add.at(expected, sample.pixels, np.maximum(sample.normals @ towards, 0) / len(samples))
    assert 0.1 < np.mean(expected > 0) < 0.5
    # Where facets turn away from the light before the smooth normal does, there is shadow.
    assert np.abs(irradiance - expected).max() < 0.03
    assert gloss.max() > 0.01
    assert not gloss[expected == 0].any()


def test_the_width_of_gloss_alone_changes_gloss_alone() -> None:
    samples = samples_of(BALL, CAMERA, np.arange(24), 1)
    reached = Reached.of(BALL, samples, normalised(np.array([0.2, 0.3, 1.0])), 0.01)
    narrow, wide = reached.shone(30 * 24, 0.1), reached.shone(30 * 24, 0.4)
    np.testing.assert_array_equal(narrow[0], wide[0])
    assert narrow[1].max() > 3 * wide[1].max()
