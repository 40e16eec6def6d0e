"""Un-lighting with several photographs: surfaces of known reflectance, under known lights, from several sides."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from relume.composite.surface.recovery import EstimatedGloss, Recovery
from relume.composite.surface.several_plates import LitView, recover_from_views
from relume.image.radiance import SATURATED, RadianceMap
from relume.renderers.mitsuba.path_tracer import Mitsuba
from relume.renderers.raytrace.raycast import RayCaster
from relume.scene.cameras.camera import Camera
from relume.scene.lights import PointLight
from relume.scene.materials.materials import Diffuse
from relume.scene.scene import Scene
from relume.scene.shapes.shapes import Mesh, Plane
from relume.sphere.environment_map import EnvironmentMap

GREY = Diffuse((0.5, 0.5, 0.5))
TABLE = Plane(GREY, (4.0, 4.0))
BLACK = EnvironmentMap(np.zeros((4, 8, 3), np.float32))
LAMPS = [((1.5, 2.0, 0.5), (20.0, 18.0, 15.0)), ((-1.2, 1.5, -0.8), (9.0, 10.0, 12.0))]
EYES = [(0.2, 1.5, 1.6), (-1.4, 1.6, 0.9)]
QUICK = Mitsuba(samples=4, depth=2)


def camera(eye: tuple[float, float, float]) -> Camera:
    return Camera.looking_at(np.array(eye), np.zeros(3), width=96, height=64, focal_length=100.0)


def ground(view: Camera) -> np.ndarray:
    rays, eye = view.rays(), np.array(view.position)
    return eye - rays * (eye[1] / rays[..., 1])[..., None]


def painted(points: np.ndarray) -> np.ndarray:
    """The table's reflectance: smooth, of three colours."""
    x, z = points[..., 0], points[..., 2]
    return np.stack([0.4 + 0.2 * np.sin(2 * x), 0.3 + 0.1 * np.cos(2 * z), 0.25 + 0.1 * np.sin(x + z)], axis=-1)


def arriving(points: np.ndarray, number: int) -> np.ndarray:
    """Irradiance on the table under a lamp, by the square law."""
    position, intensity = LAMPS[number]
    way = np.array(position) - points
    return way[..., 1:2] / np.linalg.norm(way, axis=-1, keepdims=True) ** 3 * intensity


def taken(number: int, eye: int, noise: float = 0.0) -> LitView:
    view = camera(EYES[eye])
    points = ground(view)
    radiance = painted(points) * arriving(points, number) / np.pi
    off = noise * np.random.default_rng(number).normal(size=radiance.shape)
    variance = np.full_like(radiance, noise**2) if noise else None
    position, intensity = LAMPS[number]
    scene = Scene(BLACK, (TABLE,), (), (PointLight(position, intensity),))
    return LitView(RadianceMap((radiance + off).astype(np.float32), variance), view, scene)


def test_a_table_under_two_lamps_from_two_sides_has_its_own_reflectance():
    found = recover_from_views([taken(0, 0), taken(1, 1)], renderer=QUICK)
    truth = painted(ground(camera(EYES[0])))
    both = found.views == 2
    assert both.mean() > 0.4
    # Interpolation between the second photograph's pixels, and the smoothed light, are all that is left.
    wrong = np.abs(found.local.albedo - truth)[both]
    assert wrong.mean() < 1e-3 and np.quantile(wrong, 0.99) < 4e-3
    assert found.notes == () and found.gloss == (None,)


def test_a_view_on_which_something_brighter_stands_before_the_table_counts_too():
    # A panel a hand's breadth from the lamp gets 100 times the table's light, and hides a part of it from one view.
    lamp, strength = np.array([1.5, 2.0, 0.5]), np.array([20.0, 18.0, 15.0])
    corners = np.array([[1.7, y, z] for y, z in ((1.7, -0.1), (1.7, 1.1), (2.3, 1.1), (2.3, -0.1))], np.float32)
    panel = Mesh(corners, np.array([[0, 1, 2], [0, 2, 3]], np.int32), GREY)
    light = (PointLight((1.5, 2.0, 0.5), (20.0, 18.0, 15.0)),)
    scene = Scene(BLACK, (Plane(GREY, (40.0, 40.0)), panel), (), light)
    caster = RayCaster.of(scene.local)

    def seen(eye: tuple[float, float, float]) -> LitView:
        view = Camera.looking_at(np.array(eye), np.array([1.3, 0.8, 0.5]), width=96, height=64, focal_length=65)
        hits = caster.nearest(view.position, view.rays().reshape(-1, 3))
        points = view.position + hits.distance[:, None] * view.rays().reshape(-1, 3)
        way = points - lamp
        distance = np.linalg.norm(way, axis=-1, keepdims=True)
        cosine = np.where(hits.shape == 1, abs(way[:, 0]), -way[:, 1])[:, None] / distance
        shade = caster.occluded(lamp, way / distance, 0.999 * distance[:, 0])
        arrives = np.where(shade[:, None], 0, cosine * strength / distance**2)
        albedo = np.where(hits.shape[:, None] == 1, 0.01, painted(points))
        radiance = (albedo * arrives / np.pi).reshape(64, 96, 3).astype(np.float32)
        return LitView(RadianceMap(radiance), view, scene)

    views = [seen((-0.5, 3.5, 1.5)), seen((-0.5, 4.0, 0.5))]
    found = recover_from_views(views, renderer=QUICK)
    table = found.views == 2
    assert table.mean() > 0.5
    wrong = np.abs(found.local.albedo - painted(ground(views[0].camera)))[table]
    assert np.median(wrong) < 3e-3


def test_a_lamp_of_little_blue_counts_by_each_channel():
    # A candle: its blue is a hundredth of its red, and says of the table's blue what its red says of the red.
    first, other = taken(0, 0), taken(1, 1)
    candle = np.array([1.0, 0.3, 0.01])
    warm = []
    for view in (first, other):
        (light,) = view.scene.lights
        assert isinstance(light, PointLight)
        dimmed = replace(light, intensity=tuple(float(v) for v in candle * light.intensity))
        plate = replace(view.plate, radiance=(view.plate.radiance * candle).astype(np.float32))
        warm.append(replace(view, plate=plate, scene=replace(view.scene, lights=(dimmed,))))
    found = recover_from_views(warm, renderer=QUICK)
    both = found.views == 2
    assert both.mean() > 0.4
    wrong = np.abs(found.local.albedo - painted(ground(camera(EYES[0]))))[both]
    # The median: smoothed light of so little blue is off at the picture's border.
    assert np.all(np.median(wrong, axis=0) < 2e-3)


def test_one_reflectance_has_less_noise_than_either_photograph():
    views = [taken(0, 0, 0.03), taken(1, 0, 0.03)]
    found = recover_from_views(views, renderer=QUICK)
    truth, both = painted(ground(camera(EYES[0]))), found.views == 2
    wrong = float(np.std((found.local.albedo - truth)[both]))
    for view, number in zip(views, (0, 1), strict=True):
        own = np.pi * view.plate.radiance / arriving(ground(view.camera), number)
        assert wrong < 0.95 * float(np.std((own - truth)[both]))
    # What is said of the error is what it is.
    assert wrong == pytest.approx(float(np.sqrt(np.mean(found.error[both] ** 2))), rel=0.25)


def test_what_one_photograph_has_clipped_comes_from_the_other():
    first = taken(0, 0)
    marks = np.zeros(first.plate.radiance.shape[:2], np.uint8)
    marks[20:40, 30:60] = SATURATED
    radiance = np.where(marks[..., None] > 0, 99.0, first.plate.radiance).astype(np.float32)
    views = [replace(first, plate=RadianceMap(radiance, None, marks)), taken(1, 0)]
    found = recover_from_views(views, renderer=QUICK)
    hole = marks > 0
    assert np.all(found.views[hole] == 1)
    np.testing.assert_allclose(found.local.albedo[hole], painted(ground(camera(EYES[0])))[hole], atol=4e-3)
    assert np.all(np.isfinite(found.error[hole]))


def test_photographs_that_do_not_agree_are_noted():
    wrong = taken(1, 0)
    wrong = replace(wrong, plate=RadianceMap((1.8 * wrong.plate.radiance).astype(np.float32)))
    found = recover_from_views([taken(0, 0), wrong], renderer=QUICK)
    assert len(found.notes) == 1 and "do not agree about" in found.notes[0] and "local surface 1" in found.notes[0]


@pytest.mark.parametrize(
    ("views", "words"),
    [
        ([taken(0, 0)], "1 photographs; a reflectance from several needs two or more"),
        (
            [taken(0, 0), replace(taken(1, 0), scene=taken(1, 0).scene.with_local(()))],
            "photograph 2 has 0 local surfaces",
        ),
        (
            [taken(0, 0), replace(taken(1, 0), plate=replace(taken(1, 0).plate, unit="cd/m²"))],
            "photograph 2 is in cd/m², its light in relative",
        ),
    ],
)
def test_refusals(views: list[LitView], words: str):
    with pytest.raises(ValueError, match=words):
        recover_from_views(views, renderer=QUICK)


def test_a_gloss_that_few_see_is_not_determined():
    aside = replace(taken(1, 0), camera=replace(camera(EYES[0]), position=np.array([30.0, 1.0, 30.0])))
    with pytest.raises(ValueError, match="the camera sees 0 measured pixels"):
        recover_from_views([taken(0, 0), aside], [Recovery(gloss=EstimatedGloss())], renderer=QUICK)
