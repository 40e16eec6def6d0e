"""Borders of the local scene at which the objects still change the picture: by changes of known shape, and a render."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from relume.composite import borders
from relume.composite.borders import changed_borders
from relume.composite.surface.projection import box_mesh
from relume.image.radiance import RadianceMap
from relume.renderers.mitsuba.differential import Differential
from relume.renderers.results import Change
from relume.scene.cameras.camera import Camera
from relume.scene.materials.materials import Diffuse
from relume.scene.scene import Scene
from relume.scene.shapes.shapes import Mesh, Plane, Sphere
from relume.sphere.environment_map import EnvironmentMap
from solids import sphere

GREY = Diffuse((0.5, 0.5, 0.5))
CAMERA = Camera.looking_at(np.array([0.0, 3.0, 0.001]), np.zeros(3), width=320, height=240, focal_length=220.0)
FOOT = np.array([-0.45, 0.0, 0.1])
THING = sphere(GREY, centre=(-0.45, 0.0, 0.1), radius=0.01, fine=1)


def table(left: float = 1.0, right: float = 1.0) -> Mesh:
    corners = np.array([[-left, 0, 1.4], [right, 0, 1.4], [right, 0, -1.4], [-left, 0, -1.4]], np.float32)
    return Mesh(corners, np.array([[0, 1, 2], [0, 2, 3]], np.int32), GREY, name="table")


def points() -> np.ndarray:
    """Where the pixels' rays meet the ground, (H, W, 3)."""
    y, x = np.mgrid[: CAMERA.height, : CAMERA.width] + 0.5
    rays = CAMERA.rays_through(np.stack([x, y], axis=-1))
    eye = np.array(CAMERA.position)
    return eye - rays * (eye[1] / rays[..., 1])[..., None]


def field(strength: float, power: float, left: float = 1.0) -> Change:
    """A shadow that falls by a power of the distance from the object's foot, on the table alone."""
    where = points()
    distance = np.maximum(np.linalg.norm(where - FOOT, axis=-1), 0.1)
    on_it = (where[..., 0] > -left) & (where[..., 0] < 1.0) & (np.abs(where[..., 2]) < 1.4)
    shadow = np.where(on_it, -strength / distance**power, 0.0)
    difference = np.repeat(shadow[..., None], 3, axis=-1).astype(np.float32)
    none = np.zeros_like(difference)
    covered = (distance <= 0.1).astype(np.float32)
    return Change(none, difference, covered, none[..., 0], none, none, none, none)


def plate(noise: float) -> RadianceMap:
    even = np.ones((CAMERA.height, CAMERA.width, 3), np.float32)
    return RadianceMap(even, np.full_like(even, noise**2))


def test_the_border_and_its_change_are_named():
    found = changed_borders(field(0.006, 3.0), plate(0.01), CAMERA, [table()], [THING])
    assert [each.side for each in found] == ["left"]
    (left,) = found
    # Nearest at 0.55 m: 0.006 / 0.55³ = 3.6 %; the middle of the places is 0.1 m aside.
    assert left.change == pytest.approx(-0.006 / 0.559**3, rel=0.05) and left.noise == pytest.approx(0.01, rel=0.01)
    assert left.wider is not None
    line = left.line()
    assert (
        line.startswith("the change at the left border of local surface 1 ('table') is 3.") and "m wider there" in line
    )
    assert "\n" not in line


def test_pixels_that_were_not_measured_say_nothing_of_the_noise(monkeypatch):
    monkeypatch.setattr(borders, "ACROSS", CAMERA.width // 2)  # means of four pixels
    noisy = plate(0.01)
    assert noisy.variance is not None
    noisy.variance[np.random.default_rng(0).random(noisy.variance.shape[:2]) < 0.3] = np.inf
    (left,) = changed_borders(field(0.006, 3.0), noisy, CAMERA, [table()], [THING])
    assert left.noise == pytest.approx(0.01, rel=0.01)


@pytest.mark.parametrize("power", [2.0, 3.0, 4.0])
def test_a_surface_made_as_much_wider_has_no_such_border(power):
    strength = 0.03 * 0.55**power
    (left,) = changed_borders(field(strength, power), plate(0.01), CAMERA, [table()], [THING])[:1]
    assert left.side == "left" and left.wider is not None
    # It dies away to the noise where strength / r^power is 1 %.
    needed = (strength / 0.01) ** (1 / power) - 0.55
    assert 0.7 * needed < left.wider < 1.8 * needed
    again = changed_borders(
        field(strength, power, 1 + left.wider), plate(0.01), CAMERA, [table(1 + left.wider)], [THING]
    )
    assert "left" not in [each.side for each in again]


def test_what_lies_below_the_noise_is_not_named():
    assert changed_borders(field(0.006, 3.0), plate(0.08), CAMERA, [table()], [THING]) == ()
    assert changed_borders(field(0.0005, 3.0), plate(0.0001), CAMERA, [table()], [THING]) == ()


def test_white_and_black_pixels_hide_nothing_and_refuse_nothing():
    """A plate wider than borders are followed at: its pixels without a measured value leave the others' noise."""
    wide = CAMERA.resized(960, 720)
    change = field(0.006, 3.0)
    tripled = {
        name: np.repeat(np.repeat(plane, 3, 0), 3, 1)
        for name, plane in vars(change).items()
        if isinstance(plane, np.ndarray)
    }
    larger = replace(change, **tripled)
    variance = np.full((720, 960, 3), 0.01**2, np.float32)
    variance[::7, ::5] = np.inf
    clipped = RadianceMap(np.ones((720, 960, 3), np.float32), variance)
    (left,) = changed_borders(larger, clipped, wide, [table()], [THING])
    (same,) = changed_borders(change, plate(0.01), CAMERA, [table()], [THING])
    assert (left.side, left.change) == ("left", pytest.approx(same.change, rel=0.1))
    assert left.noise == pytest.approx(0.01, rel=1e-3)
    # Where nothing was measured nothing can be said.
    clipped = RadianceMap(np.ones((720, 960, 3), np.float32), np.full((720, 960, 3), np.inf, np.float32))
    assert changed_borders(larger, clipped, wide, [table()], [THING]) == ()


def test_noise_is_measured_where_no_variance_is_known():
    noisy = 1 + 0.1 * np.random.default_rng(0).normal(size=(CAMERA.height, CAMERA.width, 3)).astype(np.float32)
    assert changed_borders(field(0.006, 3.0), RadianceMap(noisy), CAMERA, [table()], [THING]) == ()
    even = RadianceMap(np.ones_like(noisy))
    assert changed_borders(field(0.006, 3.0), even, CAMERA, [table()], [THING])[0].side == "left"


def test_surfaces_without_a_border_have_none():
    shapes = [Plane(GREY), Sphere((0.0, 0.0, 0.0), 0.9, GREY), box_mesh((-1, -0.2, -1.4), (1, 0, 1.4), GREY)]
    for shape in shapes:
        assert changed_borders(field(0.02, 3.0), plate(0.005), CAMERA, [shape], [THING]) == ()
    # Nor where the floor below goes on beyond the table's edge.
    assert changed_borders(field(0.02, 3.0), plate(0.005), CAMERA, [table(), Plane(GREY, height=-0.5)], [THING]) == ()


def test_a_change_that_does_not_fall_has_no_number():
    flat = field(0.05, 0.0)
    found = changed_borders(flat, plate(0.01), CAMERA, [table()], [THING])
    assert {each.side for each in found} == {"left", "right", "upper", "lower"}
    assert all(each.wider is None and "much wider" in each.line() for each in found)


def test_a_rendered_shadow_that_is_cut_off_is_found_and_ends_on_a_wider_table():
    light = EnvironmentMap(np.ones((8, 16, 3), np.float32))
    ball = sphere(Diffuse((0.1, 0.1, 0.1)), centre=(-0.6, 0.15, 0.0), radius=0.15)
    even = RadianceMap(np.full((CAMERA.height, CAMERA.width, 3), 0.5, np.float32))

    def borders(surface: Mesh):
        change = Differential(samples=16, depth=2).change(Scene(light, (surface,), (ball,)), CAMERA, seed=1)
        return changed_borders(change, even, CAMERA, [surface], [ball])

    found = borders(table())
    # A black ball of radius r takes (h / d)(r / d)² of an even light from a floor at the distance d of its middle.
    assert found[0].change == pytest.approx(-(0.15**3) / np.hypot(0.4, 0.15) ** 3 * 0.95, rel=0.15)
    assert found[0].side == "left" and found[0].change < -0.02 and found[0].wider is not None
    assert "left" not in [each.side for each in borders(table(1 + 1.1 * found[0].wider))]
