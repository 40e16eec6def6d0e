"""Measured surfaces: the angles of their tables, the files they come from, and the published fits."""

from __future__ import annotations

import struct

import numpy as np
import pytest

from measured_tables import directions_of, middles, tabulated, write_merl
from relume.errors import UnreadableFile
from relume.renderers.half_vectors import directional_albedo, fitted_lobe
from relume.scene.materials.abc_facets import MERL_FITS, ABCFacets
from relume.scene.materials.measured import MERL_SHAPE, MeasuredBRDF, half_and_difference, read_merl
from relume.scene.materials.presets import material_preset


def towards(theta: float, phi: float) -> np.ndarray:
    theta, phi = np.radians([theta, phi])
    return np.array([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)])


@pytest.mark.parametrize(
    ("one", "other", "expected"),
    [
        # The mirror direction: h is the normal. Back where it came from: θd is 0.
        ((30, 0), (30, 180), (0, 30, 0)),
        ((50, 20), (50, 20), (50, 0, 0)),
        # In the plane of incidence h is half-way; its ω₁ lies ahead of h, or behind it, which is the same.
        ((70, 0), (10, 0), (40, 30, 0)),
        ((10, 0), (70, 0), (40, 30, 0)),
        # Both as far to one side as to the other: φd is a right angle.
        ((60, 45), (60, -45), (50.7685, 37.7612, 90)),
    ],
)
def test_angles_are_those_of_the_half_vector(one, other, expected):
    theta_h, theta_d, phi_d = np.degrees(half_and_difference(towards(*one), towards(*other)))
    assert [theta_h, theta_d] == pytest.approx(expected[:2], abs=1e-3)
    if theta_d > 1:
        assert min(abs(phi_d - expected[2]), 180 - abs(phi_d - expected[2])) < 1e-3


def test_angles_and_directions_are_inverse_and_do_not_turn_with_the_surface():
    generator = np.random.default_rng(4)
    angles = generator.uniform(0.01, [1.5, 1.5, 3.1], (500, 3)).T
    pair = directions_of(*angles)
    np.testing.assert_allclose(half_and_difference(*pair), angles, atol=1e-9)
    np.testing.assert_allclose(half_and_difference(*pair[::-1]), angles, atol=1e-9)
    turn = np.array([[0.6, -0.8, 0], [0.8, 0.6, 0], [0, 0, 1]])
    np.testing.assert_allclose(half_and_difference(*(each @ turn.T for each in pair)), angles, atol=1e-9)


def test_an_entry_is_the_middle_of_its_bin_and_between_two_there_is_their_mean():
    values = np.zeros((4, 3, 6, 3), np.float32)
    values[1, 0, 2], values[2, 0, 2] = 2.0, 4.0
    table = MeasuredBRDF(values)
    theta_h, theta_d, phi_d = (each.ravel() for each in middles((4, 3, 6)))
    # θh = 90°·((1 + ½)/4)², ((2 + ½)/4)².
    assert np.degrees(theta_h[1:3]) == pytest.approx([12.65625, 35.15625])
    at = np.array([theta_h[1], np.pi / 2 * (2 / 4) ** 2, theta_h[2]])
    found = table.evaluate(*directions_of(at, np.full(3, theta_d[0]), np.full(3, phi_d[2])))
    np.testing.assert_allclose(found[:, 0], [2, 3, 4], rtol=1e-6)
    # φd comes round: half-way between the last entry and the first.
    values = np.zeros((2, 2, 6, 3), np.float32)
    values[:, :, 5], values[:, :, 0] = 6.0, 2.0
    (value,) = MeasuredBRDF(values).evaluate(*directions_of(np.array([0.3]), np.array([0.3]), np.array([0.0])))
    assert value == pytest.approx([4, 4, 4])


def test_nothing_is_reflected_below_the_surface():
    table = MeasuredBRDF(np.ones((2, 2, 2, 3), np.float32))
    up, down = towards(20, 0), towards(110, 0)
    assert table.evaluate(up, up).tolist() == [1, 1, 1]
    assert table.evaluate(up, down).tolist() == table.evaluate(down, up).tolist() == [0, 0, 0]


def test_a_file_is_read_in_merls_order_and_scale(tmp_path):
    # Red, green, blue one behind the other; φd fastest; 1/1500, 1.15/1500, 1.66/1500.
    raw = np.zeros((3, *MERL_SHAPE))
    raw[:, 3, 7, 11] = 1500.0
    path = tmp_path / "made-up.binary"
    path.write_bytes(struct.pack("<3i", *MERL_SHAPE) + raw.tobytes())
    read = read_merl(path)
    assert read.name == "made-up"
    assert read.values[3, 7, 11].tolist() == pytest.approx([1.0, 1.15, 1.66])
    assert read.values.sum() == pytest.approx(3.81)
    offset = 12 + 8 * (11 + 180 * (7 + 90 * 3))
    assert struct.unpack("<d", path.read_bytes()[offset : offset + 8]) == (1500.0,)


def test_what_was_not_measured_is_filled_from_smaller_angles(tmp_path):
    values = np.full((*MERL_SHAPE, 3), 0.5)
    values[60, 40:, 5] = -1.0
    values[60, 39, 5] = 0.25
    values[70, :, 9] = -1.0
    values[69, :, 9] = 0.125
    read = read_merl(write_merl(tmp_path / "holes.binary", values)).values
    assert read[60, 89, 5, 1] == read[60, 40, 5, 1] == 0.25
    assert np.all(read[70, :, 9] == 0.125) and read[71, 0, 9, 0] == 0.5


def header(*sizes: int) -> bytes:
    return struct.pack(f"<{len(sizes)}i", *sizes)


@pytest.mark.parametrize(
    ("content", "line"),
    [
        (None, "no such file"),
        (b"", "begins with nothing"),
        (header(90, 90, 90) + b"\0" * 40, "begins with 90×90×90, not with 90×90×180"),
        (header(*MERL_SHAPE) + b"\0" * 80, "is 92 bytes long; a MERL BRDF file has 34992012"),
        (header(*MERL_SHAPE) + b"\0" * 34992000, "holds no value above 0"),
        (header(*MERL_SHAPE) + b"\xff" * 34992000, "holds values that are no numbers"),
    ],
)
def test_what_is_no_such_file_is_refused_in_one_line(tmp_path, content, line):
    path = tmp_path / "bad.binary"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(UnreadableFile, match=line) as caught:
        read_merl(path)
    assert str(path) in str(caught.value) and "\n" not in str(caught.value)


@pytest.mark.parametrize("values", [np.ones((4, 4, 4)), np.ones((4, 4, 1, 3)), -np.ones((2, 2, 2, 3))])
def test_a_table_of_the_wrong_shape_or_below_0_is_refused(values):
    with pytest.raises(ValueError, match="of material 'odd'"):
        MeasuredBRDF(values.astype(np.float32), "odd")


# --- the fits --------------------------------------------------------------------------------------------------------

BRASS = MERL_FITS["merl/brass"]


def test_the_abc_model_is_the_papers_formula():
    # θh = 0, light from 60° and its mirror direction, ior 1.5: F = 0.0892 (A23), G = 1, D = A.
    model = ABCFacets((0.1, 0.2, 0.3), (2.0, 2.0, 2.0), 100.0, 1.2, 1.5)
    (value,) = model.evaluate(towards(60, 0)[None], towards(60, 180)[None])
    assert value == pytest.approx((np.array([0.1, 0.2, 0.3]) + 0.0892 * 2 / 0.25) / np.pi, rel=1e-3)
    # Back along 60°: F = 0.04, D = 2/(1 + 100·½)^1.2, and grooves hide half of it: G = 2·½·½/1.
    (value,) = model.evaluate(towards(60, 0)[None], towards(60, 0)[None])
    assert value[0] == pytest.approx((0.1 + 0.04 * 2 * 51**-1.2 * 0.5 / 0.25) / np.pi, rel=1e-6)


def test_surfaces_are_reciprocal():
    generator = np.random.default_rng(2)
    pair = generator.normal(size=(2, 200, 3))
    pair[..., 2] = np.abs(pair[..., 2])
    one, other = pair / np.linalg.norm(pair, axis=-1, keepdims=True)
    for surface in (BRASS, tabulated(BRASS, (30, 20, 24))):
        np.testing.assert_allclose(surface.evaluate(one, other), surface.evaluate(other, one), rtol=1e-9)


@pytest.mark.parametrize("name", sorted(MERL_FITS))
def test_no_fit_returns_more_than_it_gets(name):
    albedo = directional_albedo(MERL_FITS[name], np.array([0.005, 0.05, 0.5, 1.0]))
    assert albedo.min() > 0 and albedo.max() < 1


# Red of Ngan, Durand and Matusik's Cook–Torrance fits (2005): kd, ks, F₀ and m.
COOK_TORRANCE = {
    "alum-bronze": (0.0886, 0.118, 0.203, 0.0367),
    "brass": (0.0475, 0.124, 0.596, 0.00668),
    "gold-paint": (0.176, 0.159, 0.409, 0.214),
    "nickel": (0.0342, 0.16, 0.733, 0.0424),
    "red-plastic": (0.271, 0.193, 0.085, 0.262),
    "silver-metallic-paint": (0.0652, 0.238, 0.661, 0.195),
    "teflon": (0.308, 0.319, 0.0203, 0.139),
    "yellow-matte-plastic": (0.291, 0.116, 0.056, 0.0489),
}


class CookTorrance:
    """kd/π + ks·D·F·G/(π cos θ₁ cos θ₂) with Beckmann's D of unit projected area (Cook and Torrance 1982)."""

    def __init__(self, diffuse: float, specular: float, normal: float, slope: float) -> None:
        self.numbers = diffuse, specular, normal, slope

    def evaluate(self, one: np.ndarray, other: np.ndarray) -> np.ndarray:
        diffuse, specular, normal, slope = self.numbers
        half = (one + other) / np.linalg.norm(one + other, axis=-1, keepdims=True)
        up, facing = half[..., 2], (one * half).sum(-1)
        facets = np.exp(-(1 - up**2) / up**2 / slope**2) / (np.pi * slope**2 * up**4)
        fresnel = normal + (1 - normal) * (1 - facing) ** 5
        masked = np.minimum(1, 2 * up * np.minimum(one[..., 2], other[..., 2]) / facing)
        gloss = specular * facets * fresnel * masked / (one[..., 2] * other[..., 2])
        return np.repeat(((diffuse + gloss) / np.pi)[..., None], 3, axis=-1)


@pytest.mark.parametrize("name", sorted(COOK_TORRANCE))
def test_two_published_fits_of_a_surface_agree(name):
    cosine = np.cos(np.radians([30.0]))
    ours = directional_albedo(MERL_FITS[f"merl/{name}"], cosine)[0, 0]
    theirs = directional_albedo(CookTorrance(*COOK_TORRANCE[name]), cosine)[0, 0]
    assert ours == pytest.approx(theirs, rel=0.25)


def test_a_diffuse_table_has_its_albedo_at_every_angle():
    table = MeasuredBRDF(np.full((20, 20, 20, 3), 0.5 / np.pi, np.float32))
    np.testing.assert_allclose(directional_albedo(table, np.array([0.05, 0.3, 1.0])), 0.5, rtol=2e-3)


def test_the_lobe_is_where_the_highlight_is():
    lobe = fitted_lobe(BRASS)
    assert lobe.chances.sum() == pytest.approx(1)
    # Most half vectors of polished brass lie within 10° of the normal; of Teflon half of them lie beyond.
    near = lobe.edges[1:] < 1 - np.cos(np.radians(10))
    assert lobe.chances[near].sum() > 0.8 > 0.5 > fitted_lobe(MERL_FITS["merl/teflon"]).chances[near].sum()


def test_presets_are_found_by_merls_names():
    assert material_preset("merl/teflon") is MERL_FITS["merl/teflon"]
    assert MERL_FITS["merl/teflon"].diffuse == (0.321152, 0.313597, 0.305526)
    assert len(MERL_FITS) == 63
    with pytest.raises(ValueError, match="no preset 'merl/tefal'; of MERL's surfaces there are merl/alum-bronze"):
        material_preset("merl/tefal")


@pytest.mark.parametrize(
    ("change", "line"),
    [
        ({"diffuse": (2.0, 0.0, 0.0)}, "diffuse of material 'x'"),
        ({"strength": (-1.0, 0.0, 0.0)}, "strength of material 'x'"),
        ({"b": 0.0}, "b of material 'x'"),
        ({"ior": 0.5}, "ior of material 'x'"),
    ],
)
def test_numbers_that_are_no_surface_are_refused(change, line):
    given = {"diffuse": (0.1,) * 3, "strength": (1.0,) * 3, "b": 10.0, "c": 1.0, "ior": 1.5, "name": "x"} | change
    with pytest.raises(ValueError, match=line):
        ABCFacets(**given)
