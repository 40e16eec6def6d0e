"""Lights, Whitted's materials, polygons and patches as values: what they say, and what they refuse."""

from __future__ import annotations

import re
import warnings
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from relume.errors import UnreadableFile
from relume.scene.lights import AmbientLight, DistantLight, Linear, PointLight, SquareLaw, Unattenuated
from relume.scene.materials.materials import Diffuse
from relume.scene.materials.whitted import Checks, WhittedMaterial
from relume.scene.shapes.shapes import Patches, Polygon, read_patches

GREY = Diffuse((0.5, 0.5, 0.5))


def test_light_falls_with_distance_as_its_law_says():
    distances = np.array([0.5, 1.0, 2.0, 10.0])
    assert Unattenuated().at(distances).tolist() == [1, 1, 1, 1]
    assert SquareLaw().at(distances).tolist() == pytest.approx([4, 1, 0.25, 0.01])
    assert Linear(4.0).at(distances).tolist() == pytest.approx([0.875, 0.75, 0.5, 0])
    assert PointLight((0, 0, 0), (1, 1, 1)).falloff == SquareLaw()


def test_checks_are_cubes_and_a_material_is_black_unless_it_says_otherwise():
    assert Checks() == Checks((1.0, 1.0, 1.0), (0.0, 0.0, 0.0), 1.0)
    nothing = WhittedMaterial()
    assert (nothing.diffuse, nothing.specular, nothing.transmission) == ((0, 0, 0), (0, 0, 0), (0, 0, 0))
    assert (nothing.exponent, nothing.ior, nothing.fresnel, nothing.coated) == (50, 1.5, False, False)
    assert nothing.most() == 0


@pytest.mark.parametrize(
    ("most", "material"),
    [
        (0.9, lambda: WhittedMaterial((0.3, 0.5, 0.1), specular=(0.2, 0.2, 0.2), transmission=(0.1, 0.2, 0.6))),
        (0.7, lambda: WhittedMaterial(Checks((0.1, 0.2, 0.1), (0.3, 0.1, 0.1)), specular=(0.2, 0.5, 0.4))),
        (0.8, lambda: WhittedMaterial(np.array([[[0.1, 0.6, 0.1]]]), transmission=(0.2, 0.2, 0.2))),
        (1.0, lambda: WhittedMaterial(specular=(1, 1, 1), transmission=(1, 1, 1), fresnel=True)),
        (0.9, lambda: WhittedMaterial((0.9, 0.9, 0.9), specular=(0.8, 0.8, 0.8), coated=True)),
    ],
)
def test_a_material_says_the_most_that_a_channel_sends_out(most: float, material: Callable[[], WhittedMaterial]):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert material().most() == pytest.approx(most)


def test_a_material_that_creates_energy_is_reported():
    with pytest.warns(UserWarning, match=r"'neon' creates energy: its coefficients add up to 1\.3"):
        WhittedMaterial((0.2, 0.7, 0.1), specular=(0.6, 0.6, 0.6), name="neon")


def test_a_polygon_has_an_area_and_a_normal():
    # An L of four squares, as seen from +X.
    corners = np.array([[1, 0, 0], [1, 0, -2], [1, 1, -2], [1, 1, -1], [1, 3, -1], [1, 3, 0]], float)
    np.testing.assert_allclose(Polygon(corners, GREY).area_vector, [4, 0, 0], atol=1e-12)
    np.testing.assert_allclose(Polygon(corners[::-1], GREY).area_vector, [-4, 0, 0], atol=1e-12)


def patch() -> np.ndarray:
    x, y = np.meshgrid(np.arange(4.0), np.arange(4.0), indexing="ij")
    return np.stack([x, y, np.zeros((4, 4))], axis=-1)[None]


@pytest.mark.parametrize(
    ("make", "line"),
    [
        (lambda: Linear(0), "reach of linear attenuation is 0"),
        (lambda: Linear(np.inf), "reach of linear attenuation is inf"),
        (lambda: PointLight((0, np.nan, 0), (1, 1, 1)), "position of a point light is (0, nan, 0)"),
        (lambda: PointLight((0, 0, 0), (1, -1, 1)), "intensity of a point light is (1, -1, 1)"),
        (lambda: DistantLight((0, 0, 0), (1, 1, 1)), "expected one that points somewhere"),
        (lambda: DistantLight((0, 1, 0), (1, 1, np.inf)), "irradiance of a distant light"),
        (lambda: AmbientLight((-1, 0, 0)), "radiance of ambient light"),
        (lambda: Checks(size=0), "size of checks is 0"),
        (lambda: Checks((-1, 0, 0)), "first colour of checks is [-1, 0, 0]"),
        (lambda: WhittedMaterial((0, 0, -1)), "diffuse of material '' is [0, 0, -1]"),
        (lambda: WhittedMaterial(np.zeros((2, 2))), "diffuse of material '' has shape (2, 2)"),
        (lambda: WhittedMaterial(specular=(np.nan, 0, 0)), "specular of material ''"),
        (lambda: WhittedMaterial(ior=0), "ior of material '' is 0"),
        (lambda: WhittedMaterial(exponent=0), "exponent of material '' is 0"),
        (lambda: WhittedMaterial(roughness=-1), "roughness of material '' is -1"),
        (lambda: Polygon(np.zeros((2, 3)), GREY), "'polygon' has 2 vertices; expected three or more"),
        (lambda: Polygon(np.array([[0, 0, 0], [1, 0, 0], [3, 0, 0]], float), GREY), "'polygon' has no area"),
        (
            lambda: Polygon(np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0.1], [0, 1, 0]], float), GREY, "tent"),
            "vertices of 'tent' are up to",
        ),
        (lambda: Polygon(np.full((3, 3), np.inf), GREY), "some vertices of 'polygon' are not finite"),
        (lambda: Patches(np.zeros((4, 4, 3)), GREY), "control points of 'patches' are (4, 4, 3)"),
        (lambda: Patches(np.full((1, 4, 4, 3), np.nan), GREY), "some control points of 'patches' are not finite"),
        (lambda: Patches(np.concatenate([patch(), np.ones((1, 4, 4, 3))]), GREY), "patch 1 of 'patches' is a single"),
    ],
)
def test_what_cannot_be_is_refused_with_what_is_expected(make: Callable[[], object], line: str):
    with pytest.raises(ValueError, match=re.escape(line)):
        make()


def test_a_file_of_patches_is_read_point_by_point(tmp_path: Path):
    numbers = np.arange(96.0).reshape(2, 16, 3)
    lines = ["2"]
    for points in numbers:
        lines += ["3 3", *(" ".join(map(str, point)) for point in points)]
    (tmp_path / "two.bpt").write_text("\n".join(lines))
    control = read_patches(tmp_path / "two.bpt")
    assert control.shape == (2, 4, 4, 3)
    # Sixteen points each, and all of them once.
    assert sorted(map(tuple, control[1].reshape(16, 3))) == sorted(map(tuple, numbers[1]))
    assert control[0, 0, 0].tolist() == [0, 1, 2]
    assert control[1, 3, 3].tolist() == [93, 94, 95]


def test_newells_teapot_is_whole(shared: Path):
    control = read_patches(shared / "data/meshes/teapot_patches/teapot.bpt")
    assert control.shape == (32, 4, 4, 3)
    points = control.reshape(-1, 3)
    np.testing.assert_allclose(points.min(axis=0), [-3, -2, 0], atol=1e-6)
    np.testing.assert_allclose(points.max(axis=0), [3.525, 2, 3.15], atol=1e-6)
    # The other way of writing degrees, four for the number of points.
    other = read_patches(shared / "data/meshes/teapot_patches/teapot_yzcs.bpt")
    np.testing.assert_allclose(other, control, atol=1e-6)


@pytest.mark.parametrize(
    ("text", "line"),
    [
        (None, "no such file of patches"),
        ("", "not a list of bicubic patches"),
        ("1\n3 3\n0 0 0", "not a list of bicubic patches"),
        ("1\n3 3\n" + "0 0 x\n" * 16, "not a list of bicubic patches"),
        ("0", "holds no patches"),
        ("1\n2 2\n" + "0 0 1\n" * 16, "others than bicubic ones"),
        ("1\n3 3\n" + "0 0 nan\n" * 16, "not finite"),
    ],
)
def test_a_file_that_holds_no_patches_is_reported(tmp_path: Path, text: str | None, line: str):
    if text is not None:
        (tmp_path / "a.bpt").write_text(text)
    with pytest.raises(UnreadableFile, match=line) as caught:
        read_patches(tmp_path / "a.bpt")
    assert str(caught.value).startswith(f"{tmp_path / 'a.bpt'}: ") and "\n" not in str(caught.value)
