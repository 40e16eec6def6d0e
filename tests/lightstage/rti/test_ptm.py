"""Polynomial texture maps: the fit, and files as the format's specification and its viewers have them."""

import numpy as np
import pytest

from relume.lightstage.field.lights import StageLights
from relume.lightstage.relighting.voronoi_cells import even_directions
from relume.lightstage.rti.hemisphere_fit import before_camera
from relume.lightstage.rti.ptm import PolynomialTexture, fit_lrgb, fit_rgb, polynomial_terms, write_ptm
from relume.scene.cameras.camera import Camera
from written_by_stages import read_ptm

DOME = even_directions(60)
DOME = DOME[DOME[:, 2] > 0.1]


def some_rgb(rows: int = 5, columns: int = 4) -> PolynomialTexture:
    random = np.random.default_rng(6)
    coefficients = random.uniform(-0.3, 0.3, (rows, columns, 3, 6))
    coefficients[..., 5] += 0.6
    return PolynomialTexture(coefficients.astype(np.float32))


def some_lrgb() -> PolynomialTexture:
    colour = np.random.default_rng(7).uniform(0.2, 1, (5, 4, 3))
    colour[..., 1] = 1
    return PolynomialTexture(some_rgb().coefficients[:, :, :1], colour.astype(np.float32))


def shown(texture: PolynomialTexture) -> np.ndarray:
    return np.stack([texture.lit_from(towards) for towards in DOME])


def test_the_terms_are_those_of_the_paper():
    assert polynomial_terms(np.array([0.5, -0.25, 0.8])).tolist() == [0.25, 0.0625, -0.125, 0.5, -0.25, 1]


def test_a_light_on_the_right_and_one_above_take_their_own_terms():
    texture = PolynomialTexture(np.array([[[[1, 2, 4, 8, 16, 32]]]], np.float32) / 64, np.ones((1, 1, 3), np.float32))
    assert texture.lit_from([1, 0, 0])[0, 0].tolist() == [41 / 64] * 3  # a0 + a3 + a5
    assert texture.lit_from([0, 1, 0])[0, 0].tolist() == [50 / 64] * 3  # a1 + a4 + a5
    assert texture.lit_from([0, 0, 7])[0, 0].tolist() == [0.5] * 3  # a5


@pytest.mark.parametrize("weights", [None, np.linspace(1, 3, len(DOME))])
def test_exact_polynomials_come_back(weights):
    found = fit_rgb(shown(some_rgb()), DOME, weights, steadiness=0)
    np.testing.assert_allclose(found.coefficients, some_rgb().coefficients, atol=2e-6)


def test_shading_of_one_colour_comes_back_as_luminance_and_colour():
    found = fit_lrgb(shown(some_lrgb()), DOME, steadiness=0)
    assert found.colour is not None
    np.testing.assert_allclose(found.colour, np.asarray(some_lrgb().colour), atol=1e-6)
    np.testing.assert_allclose(found.coefficients, some_lrgb().coefficients, atol=3e-6)


def test_steadiness_costs_a_well_lit_dome_next_to_nothing():
    found = fit_rgb(shown(some_rgb()), DOME)
    assert 0 < np.abs(shown(found) - shown(some_rgb())).max() < 0.01


def test_steadiness_keeps_coefficients_small_where_lights_leave_them_open():
    # Lights on one ring: lu² + lv² is a constant there.
    angles = np.linspace(0, 2 * np.pi, 8, endpoint=False)
    ring = np.stack([0.6 * np.cos(angles), 0.6 * np.sin(angles), np.full(8, 0.8)], axis=1)
    pictures = np.full((8, 2, 2, 3), 0.5, np.float32)
    assert np.abs(fit_rgb(pictures, ring).coefficients).max() < 0.6


def test_a_pixel_that_is_always_black_stays_black():
    found = fit_lrgb(np.zeros((len(DOME), 2, 2, 3), np.float32), DOME)
    assert np.all(found.lit_from([0, 0, 1]) == 0) and found.colour is not None and np.all(found.colour == 1)


@pytest.mark.parametrize("texture", [some_rgb(), some_lrgb()])
def test_files_come_back_to_the_quantisation(tmp_path, texture):
    write_ptm(tmp_path / "a.ptm", texture)
    back = read_ptm(tmp_path / "a.ptm")
    spread = np.ptp(texture.coefficients, axis=(0, 1, 2)) + np.abs(texture.coefficients).max(axis=(0, 1, 2))
    assert np.all(np.abs(back.coefficients - texture.coefficients).max(axis=(0, 1, 2)) < 0.51 / 250 * spread + 1e-6)
    assert (back.colour is None) == (texture.colour is None)
    if texture.colour is not None and back.colour is not None:
        np.testing.assert_allclose(back.colour, texture.colour, atol=0.501 / 255)
    # A file that was read is written as it was.
    write_ptm(tmp_path / "b.ptm", back)
    np.testing.assert_allclose(read_ptm(tmp_path / "b.ptm").coefficients, back.coefficients, atol=3e-3)


def test_the_bytes_of_a_luminance_file_are_those_of_the_specification(tmp_path):
    # Two rows: above a constant of 200 codes, below one of 102 that grows to the right by 51.
    coefficients = np.array([[[[0, 0, 0, 0, 0, 200]]], [[[0, 0, 0, 51, 0, 102]]]], np.float32) / 255
    colour = np.array([[[1, 0, 0]], [[0, 1, 0.2]]], np.float32)
    write_ptm(tmp_path / "a.ptm", PolynomialTexture(coefficients, colour))
    content = (tmp_path / "a.ptm").read_bytes()
    header = b"PTM_1.2\nPTM_FORMAT_LRGB\n1\n2\n1 1 1 0.2 1 0.7843137\n0 0 0 0 0 0\n"
    assert content[: len(header)] == header
    # From the lowest row up: six bytes a pixel, then the colours.
    lower, upper = [0, 0, 0, 255, 0, 130], [0, 0, 0, 0, 0, 255]
    assert list(content[len(header) :]) == [*lower, *upper, 0, 255, 51, 255, 0, 0]


def test_the_bytes_of_a_colour_file_are_a_plane_a_channel(tmp_path):
    coefficients = np.zeros((1, 2, 3, 6), np.float32)
    coefficients[0, :, :, 5] = np.array([[10, 20, 30], [40, 50, 255]]) / 255
    write_ptm(tmp_path / "a.ptm", PolynomialTexture(coefficients))
    content = (tmp_path / "a.ptm").read_bytes()
    assert content.startswith(b"PTM_1.2\nPTM_FORMAT_RGB\n2\n1\n1 1 1 1 1 1\n0 0 0 0 0 0\n") and len(content) > 36
    codes = np.frombuffer(content[-36:], np.uint8).reshape(3, 2, 6)
    assert codes[:, :, 5].tolist() == [[10, 40], [20, 50], [30, 255]] and codes[:, :, :5].max() == 0


def test_a_file_is_read_by_its_scales_and_biases(tmp_path):
    header = b"PTM_1.2\r\nPTM_FORMAT_RGB\r\n1 1\r\n2 1 1 1 1 0.5\r\n128 0 0 0 0 10\r\n"
    (tmp_path / "a.ptm").write_bytes(header + bytes([130, 0, 0, 0, 0, 210, 128, 0, 0, 0, 0, 110, 126, 0, 0, 0, 0, 10]))
    found = read_ptm(tmp_path / "a.ptm").coefficients[0, 0] * 255
    np.testing.assert_allclose(found, [[4, 0, 0, 0, 0, 100], [0, 0, 0, 0, 0, 50], [-4, 0, 0, 0, 0, 0]], atol=1e-5)


def test_wrong_calls_are_refused(tmp_path):
    with pytest.raises(ValueError, match="needs 6 or more"):
        fit_rgb(np.zeros((5, 2, 2, 3), np.float32), DOME[:5])
    with pytest.raises(ValueError, match="not finite"):
        write_ptm(tmp_path / "a.ptm", PolynomialTexture(np.full((1, 1, 3, 6), np.nan, np.float32)))
    assert list(tmp_path.iterdir()) == []


def test_the_lights_before_a_camera_are_reported_in_its_frame():
    # A camera on +X: what is at its right, −Z in the world, is RTI's x.
    camera = Camera.looking_at(np.array([5.0, 0, 0]), np.zeros(3), width=4, height=4, focal_length=4.0)
    lights = StageLights.towards(np.array([[1.0, 0, 0], [-1, 0, 0], [1, 0, -1], [1, 1, 0], [0, 0, 1]]))
    chosen, directions = before_camera(lights, camera)
    half = np.sqrt(0.5)
    assert chosen.tolist() == [0, 2, 3]
    np.testing.assert_allclose(directions, [[0, 0, 1], [half, 0, half], [0, half, half]], atol=1e-12)
    assert before_camera(lights, None)[0].tolist() == [4]
    with pytest.raises(ValueError, match="no light stands on the camera's side"):
        before_camera(StageLights.towards(np.array([[0, 0, -1.0]])), None)
