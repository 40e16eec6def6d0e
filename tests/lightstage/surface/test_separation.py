"""Separation by colour: the paper's equations, and surfaces whose two parts are known."""

from __future__ import annotations

import numpy as np
import pytest

from angles import degrees_between
from relume.lightstage.field.field import Pictures, whole
from relume.lightstage.field.lights import StageLights
from relume.lightstage.relighting.voronoi_cells import even_directions
from relume.lightstage.surface.chromaticity import (
    amounts,
    fitted_ramp,
    median_chromaticity,
    ramp,
    ramped,
    unit_chromaticity,
)
from relume.lightstage.surface.separation import Separation, facing, separate
from relume.sphere.directions import normalised

SIZE = 16
LIGHTS = StageLights.towards(even_directions(240))
WHITE = np.full(3, 3**-0.5, np.float32)
BODY = unit_chromaticity(np.array([0.6, 0.37, 0.27], np.float32))
VIEW = np.array([0.0, 0.0, 1.0])


def ball() -> np.ndarray:
    """Normals (SIZE², 3) of the front of a ball, its rim left out."""
    x = np.linspace(-0.75, 0.75, SIZE)
    across, down = np.meshgrid(x, -x)
    length = np.maximum(1, np.hypot(across, down) / 0.8)
    across, down = across / length, down / length
    return np.stack([across, down, np.sqrt(1 - across**2 - down**2)], axis=-1).reshape(-1, 3)


NORMALS = ball()


def highlights(strength: float = 0.6) -> np.ndarray:
    """White lobes (N, P) about the mirror angle."""
    half = normalised(LIGHTS.directions + VIEW)
    above = LIGHTS.directions @ NORMALS.T > 0
    return strength * above * np.maximum(half @ NORMALS.T, 0) ** 80


def subject(alpha: tuple[float, float], specular: np.ndarray, body: np.ndarray = BODY) -> Pictures:
    """A ball whose diffuse chromaticity ramps by α, with this specular part."""
    shading = 0.3 * np.maximum(LIGHTS.directions @ NORMALS.T, 0)
    shift = ramp(np.array(alpha), facing(LIGHTS.directions, NORMALS, np.broadcast_to(VIEW, NORMALS.shape)))
    diffuse = shading[..., None] * ramped(body, WHITE, shift)
    values = diffuse + specular[..., None] * WHITE
    return Pictures(values.reshape(len(LIGHTS), SIZE, SIZE, 3).astype(np.float32), LIGHTS)


@pytest.fixture(scope="module")
def shiny() -> Separation:
    return separate(subject((0.2, -0.15), highlights()))


def test_the_ramp_is_equation_7() -> None:
    assert ramp(np.array([0.5, -0.2]), np.array(0.25)) == pytest.approx(0.5 * 0.25 - 0.2 * 0.75)
    assert ramp(np.array([0.5, -0.2]), np.array([1.0, 0.0])) == pytest.approx([0.5, -0.2])


def test_the_chromaticity_is_equation_6() -> None:
    body, light = np.array([1.0, 0, 0]), np.array([0, 1.0, 0])
    np.testing.assert_allclose(ramped(body, light, np.array(1.0)), np.array([2, -1, 0]) / np.sqrt(5))
    np.testing.assert_allclose(ramped(body, light, np.array(-0.5)), np.array([1, 1, 0]) / np.sqrt(2))


def test_amounts_invert_the_matrix_of_body_light_and_their_cross_product() -> None:
    body, light = normalised(BODY), normalised(WHITE)
    matrix = np.stack([body, light, np.cross(body, light)], axis=1)
    value = np.array([0.3, 0.5, 0.1])
    found = np.array(amounts(value, body, light))
    np.testing.assert_allclose(found, np.linalg.solve(matrix, value), rtol=1e-6)
    np.testing.assert_allclose(amounts(2 * body + 3 * light, body, light), [2, 3, 0], atol=1e-6)


def test_the_median_chromaticity_is_that_of_the_chosen_values() -> None:
    values = np.array([[9, 9, 9], [0.6, 0.3, 0.1], [1.2, 0.6, 0.2], [6, 3, 1]], np.float32)[:, None]
    chosen = np.array([False, True, True, True])[:, None]
    np.testing.assert_allclose(median_chromaticity(values, chosen)[0], np.array([6, 3, 1]) / np.sqrt(46), rtol=1e-4)
    assert not median_chromaticity(values, np.zeros_like(chosen)).any()


def test_a_body_of_one_primary_alone_has_its_chromaticity() -> None:
    values = np.tile(np.array([0.5, 0, 0], np.float32), (3, 1, 1))
    np.testing.assert_allclose(median_chromaticity(values, np.ones((3, 1), bool))[0], [1, 0, 0], atol=1e-3)


def test_the_two_parts_add_up_to_the_field(shiny: Separation) -> None:
    values = whole(shiny.field)
    total = whole(shiny.diffuse) + whole(shiny.specular)
    np.testing.assert_allclose(total, values, rtol=0, atol=np.finfo(np.float32).eps * values.max())


def test_the_specular_part_is_not_negative_and_has_the_lights_colour(shiny: Separation) -> None:
    specular = whole(shiny.specular)
    assert specular.min() >= 0
    np.testing.assert_array_equal(specular[..., 0], specular[..., 1])
    np.testing.assert_array_equal(specular[..., 0], specular[..., 2])


def test_highlights_are_found_though_the_bodys_colour_ramps(shiny: Separation) -> None:
    truth = highlights() * WHITE[0]
    found = whole(shiny.specular)[..., 0].reshape(truth.shape)
    assert np.abs(found - truth).sum() / truth.sum() < 0.06


def test_normals_and_ramp_of_a_ball_are_its_own(shiny: Separation) -> None:
    assert np.median(degrees_between(shiny.normal.reshape(-1, 3), NORMALS)) < 0.3
    # d0 is a chromaticity of the ramp itself, so only the ends of the ramp can be compared.
    ends = [ramped(shiny.chromaticity.reshape(-1, 3), WHITE, shiny.alpha.reshape(-1, 2)[:, i]) for i in (0, 1)]
    for found, alpha in zip(ends, (0.2, -0.15), strict=True):
        truth = ramped(BODY, WHITE, np.array(alpha))
        angles = degrees_between(found, truth)
        assert np.median(angles) < 0.6, "the ends themselves are 6° apart"


def test_the_ramp_search_finds_known_parameters() -> None:
    cosines = np.linspace(0, 1, 200)[:, None].astype(np.float32)
    body = BODY[None]
    for alpha in ((0.3, -0.2), (-0.45, 0.8)):
        values = ramped(body, WHITE, ramp(np.array(alpha), cosines))
        found = fitted_ramp(values, np.ones_like(cosines), cosines, body, WHITE)
        np.testing.assert_allclose(found[0], alpha, atol=0.02)


def test_grey_things_are_called_diffuse_as_a_whole_and_said_to_be_inseparable() -> None:
    found = separate(subject((0.0, 0.0), highlights(), WHITE))
    assert not found.separable.any()
    assert not whole(found.specular).any()
    np.testing.assert_array_equal(whole(found.diffuse), whole(found.field))


def test_black_pixels_have_no_normal_no_chromaticity_and_no_nan() -> None:
    values = whole(subject((0.0, 0.0), highlights()))
    values[:, 3] = 0
    found = separate(Pictures(values, LIGHTS))
    for map_ in (found.normal, found.chromaticity, found.alpha):
        assert not map_[3].any() and np.isfinite(map_).all()
    assert found.normal[4].any() and not found.separable[3].any()


@pytest.mark.parametrize("unit", [2.0**-14, 2.0**14])
def test_the_unit_of_the_lights_irradiance_changes_no_map(shiny: Separation, unit: float) -> None:
    other = separate(Pictures((unit * whole(shiny.field)).astype(np.float32), LIGHTS))
    np.testing.assert_array_equal(other.separable, shiny.separable)
    np.testing.assert_allclose(other.normal, shiny.normal, atol=1e-4)
    np.testing.assert_allclose(other.chromaticity, shiny.chromaticity, atol=1e-4)
    np.testing.assert_allclose(whole(other.specular), unit * whole(shiny.specular), atol=1e-4 * unit)


def test_pixels_far_below_the_level_of_the_rest_are_noise() -> None:
    values = whole(subject((0.0, 0.0), highlights()))
    values[:, 3] *= np.float32(1e-3)
    values[:, 5] *= np.float32(0.03)
    found = separate(Pictures(values, LIGHTS))
    assert not found.normal[3].any() and not found.separable[3].any() and not found.chromaticity[3].any()
    assert found.normal[5].any(axis=-1).all() and found.separable[5].all()


def test_blocks_are_parts_of_the_whole(shiny: Separation) -> None:
    every = whole(shiny.specular)
    np.testing.assert_array_equal(shiny.specular.block(slice(50, 53), slice(4, 9)), every[50:53, 4:9])
    np.testing.assert_array_equal(
        shiny.diffuse.block(slice(0, 240), slice(15, 16)), (whole(shiny.field) - every)[:, 15:16]
    )


def test_coloured_lights_have_highlights_of_their_colour() -> None:
    light = (1.0, 0.8, 0.5)
    chromaticity = normalised(light)
    shading = 0.3 * np.maximum(LIGHTS.directions @ NORMALS.T, 0)
    values = shading[..., None] * BODY + highlights()[..., None] * chromaticity
    field = Pictures(values.reshape(240, SIZE, SIZE, 3).astype(np.float32), LIGHTS)
    found = whole(separate(field, light).specular).reshape(values.shape)
    truth = highlights()[..., None] * chromaticity
    assert np.abs(found - truth).sum() / truth.sum() < 0.06


def test_a_light_without_a_colour_and_three_lights_are_refused_in_one_line() -> None:
    with pytest.raises(ValueError, match="three numbers above 0"):
        separate(subject((0.0, 0.0), highlights()), (1, 0, 1))
    few = Pictures(np.ones((3, 2, 2, 3), np.float32), StageLights.towards(np.eye(3)))
    with pytest.raises(ValueError, match="four or more"):
        separate(few)
