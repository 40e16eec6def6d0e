"""A relit subject from new viewpoints: balls whose pictures are known, and the head of the virtual stage."""

from __future__ import annotations

import json
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from relume.composite.surface.projection import triangles_of_shape
from relume.image.files import read_radiance
from relume.image.radiance import OUTSIDE
from relume.lightstage.field.field import Pictures
from relume.lightstage.field.lights import StageLights
from relume.lightstage.novel_view.new_views import measured_view, without_debt
from relume.lightstage.novel_view.projection import Subject, outline, sampled, without_background
from relume.lightstage.novel_view.source_views import Blending, SourceView
from relume.lightstage.relighting.voronoi_cells import even_directions
from relume.lightstage.surface.separation import separate
from relume.lightstage.surface.torrance_sparrow import grooved_reflection, half_vector
from relume.scene.cameras.camera import Camera
from relume.scene.materials.materials import Material
from relume.scene.shapes.meshes import read_meshes
from relume.scene.shapes.shapes import Mesh, Sphere
from small_stages import SeparatedPictures

LIGHTS = StageLights.towards(even_directions(60))
SIZE = 56
ALBEDO = np.array([0.6, 0.4, 0.3])
SUN = np.array([0.3, 0.5, 0.8])
STAGE = Path(__file__).resolve().parents[4] / "shared" / "stages" / "head"


def ball(centre: tuple[float, float, float] = (0, 0, 0), radius: float = 0.5) -> Mesh:
    return triangles_of_shape(Sphere(centre, radius, Material((0.5, 0.5, 0.5))))


def camera(degrees: float, size: int = SIZE) -> Camera:
    """3 m away, turned about +Y from +Z to +X; the ball fills two thirds of the picture."""
    angle = np.radians(degrees)
    place = 3 * np.array([np.sin(angle), 0, np.cos(angle)])
    return Camera.looking_at(place, np.zeros(3), width=size, height=size, focal_length=2 * size)


@cache
def taken(degrees: float, size: int = SIZE, gloss: float = 0.0, background: float = 0.0) -> SeparatedPictures:
    """The ball's two parts from there; each pixel the mean of 2 × 2 rays, the background in the diffuse one."""
    at = camera(degrees, size)
    steps = (np.arange(2 * size) + 0.5) / 2
    sight = Subject.of(ball()).seen(at, np.stack(np.broadcast_arrays(steps[None, :], steps[:, None]), -1))
    met = sight.met
    normals, views = sight.points[met] / 0.5, sight.views[met]
    count = len(LIGHTS)
    diffuse, specular = (np.zeros((count, size, size, 3), np.float32) for _ in range(2))
    for index, light in enumerate(LIGHTS.directions):
        fine = np.zeros((2, 2 * size, 2 * size, 3))
        fine[0] = background
        facing = normals @ light
        texture = 1 + 0.3 * np.sin(9 * sight.points[met][:, :1])
        fine[0][met] = ALBEDO * texture / np.pi * np.maximum(facing, 0)[:, None]
        if gloss:
            lean = np.arccos(np.clip(np.sum(half_vector(views, light) * normals, -1), -1, 1))
            lobe = np.exp(-((lean / 0.25) ** 2)) * grooved_reflection(views, light, normals) * (facing > 0)
            fine[1][met] = gloss * lobe[:, None]
        diffuse[index], specular[index] = fine.reshape(2, size, 2, size, 2, 3).mean((2, 4))
    return SeparatedPictures(Pictures(diffuse, LIGHTS, at), Pictures(specular, LIGHTS, at))


def source(degrees: float, size: int = SIZE, gloss: float = 0.0, background: float = 0.0) -> SourceView:
    parts = taken(degrees, size, gloss, background)
    whole = Pictures(parts.diffuse.values + parts.specular.values, LIGHTS, parts.diffuse.camera)
    return SourceView(whole, parts, name=f"camera {degrees:g}")


def sunlight() -> np.ndarray:
    """(N, 3): a broad sun, a little sky."""
    width = np.maximum(LIGHTS.directions @ (SUN / np.linalg.norm(SUN)), 0) ** 12
    return np.outer(width, [3.0, 2.5, 2.0]) + np.array([0.02, 0.03, 0.05])


def relit(parts: SeparatedPictures) -> np.ndarray:
    return np.einsum("nhwc,nc->hwc", parts.diffuse.values + parts.specular.values, sunlight())


def relative_error(found: np.ndarray, truth: np.ndarray, where: np.ndarray) -> float:
    return float(np.abs(found - truth)[where].sum() / truth[where].sum())


def test_from_where_the_source_stood_its_own_picture_is_seen() -> None:
    given = source(0, gloss=3.0)
    found = measured_view(given, sunlight(), camera(0), ball())
    truth = relit(taken(0, gloss=3.0))
    inside = outline(Subject.of(ball()), camera(0)).share > 0.999
    assert relative_error(found.picture.radiance, truth, inside) < 0.01
    assert np.all(found.alpha[inside] == 1) and found.unseen.max() <= 0.25


def test_highlights_move_with_the_view() -> None:
    irradiances = sunlight()
    truth = relit(taken(30, gloss=3.0))
    errors = []
    for parts in (True, False):
        given = source(0, gloss=3.0)
        if not parts:
            given = SourceView(given.field)
        found = measured_view(given, irradiances, camera(30), ball())
        errors.append(relative_error(found.picture.radiance, truth, found.alpha > 0.99))
    assert errors[0] < 0.04
    assert errors[1] > 2 * errors[0]


def test_a_separation_that_took_too_much_leaves_no_colour_below_nothing() -> None:
    total = np.random.default_rng(5).uniform(0, 1, (4, 6, 3)).astype(np.float32)
    taken_out = np.repeat(0.9 * total.max(axis=-1, keepdims=True), 3, axis=-1)
    assert (total - taken_out).min() < -0.1
    diffuse, specular = without_debt(total - taken_out, taken_out)
    assert diffuse.min() > -1e-6 and specular.min() >= 0
    assert np.allclose(diffuse + specular, total, atol=1e-6)
    # Of values that are below 0 themselves, as noise makes them, nothing was taken.
    assert np.array_equal(without_debt(-total, 0 * total)[0], -total)
    assert np.array_equal(without_debt(total, taken_out)[1], taken_out)


def test_two_cameras_together_see_more_and_blend_without_a_seam() -> None:
    left, right = source(-40), source(40)
    brighter = SourceView(
        Pictures(right.field.block(slice(0, len(LIGHTS)), slice(0, SIZE)) * np.float32(1.5), LIGHTS, camera(40))
    )
    both = measured_view([SourceView(left.field), brighter], sunlight(), camera(0), ball())
    alone = measured_view(SourceView(left.field), sunlight(), camera(0), ball())
    truth = relit(taken(0))
    assert both.alpha.sum() > 1.05 * alone.alpha.sum()
    assert both.unseen.sum() < 0.1 * alone.unseen.sum()
    # A half more on the right goes over into the left's within the overlap, never from one pixel to the next.
    ratio = (both.picture.radiance / np.maximum(truth, 1e-6)).mean(-1)[SIZE // 2]
    inner = ratio[SIZE // 2 - 15 : SIZE // 2 + 15]
    assert abs(inner[:3].mean() - 1) < 0.08 and abs(inner[-3:].mean() - 1.5) < 0.08
    assert np.abs(np.diff(inner)).max() < 0.08


def test_of_two_equal_cameras_the_nearer_one_counts_more() -> None:
    normals = np.array([[0.0, 0.0, 1.0]])
    ahead = np.array([[0.0, 0.0, 1.0]])
    near, far = (np.array([[np.sin(angle), 0, np.cos(angle)]]) for angle in np.radians([10, 40]))
    weigh = Blending(facing=0).weights
    ones, deep = np.ones(1), np.full(1, 100.0)
    # e^(−½ (10/20)²) and e^(−½ (40/20)²)
    assert weigh(normals, near, ahead, ones, deep) == pytest.approx(0.8824969, rel=1e-6)
    assert weigh(normals, far, ahead, ones, deep) == pytest.approx(0.1353353, rel=1e-6)
    assert weigh(normals, near, ahead, ones, np.zeros(1)) < 1e-3
    assert weigh(normals, near, ahead, np.zeros(1), deep) == 0


def test_what_no_camera_saw_is_a_hole_and_is_reported() -> None:
    with pytest.warns(UserWarning, match=r"no camera saw \d+% of what the new view shows"):
        found = measured_view(SourceView(source(0).field), sunlight(), camera(90), ball())
    shown = Subject.of(ball()).seen(camera(90)).met
    assert np.all(found.alpha + found.unseen <= 1)
    assert np.all((found.alpha + found.unseen)[shown] > 0)
    # From the side half of the ball was seen: that towards the source, which is left (+Z).
    middle = found.alpha[SIZE // 2]
    assert middle[SIZE // 2 - 12] == 1 and middle[SIZE // 2 + 12] == 0
    hole = found.alpha == 0
    assert np.all(found.picture.radiance[hole] == 0)
    assert found.picture.clipped is not None
    assert np.all(found.picture.clipped[hole] == OUTSIDE) and np.all(found.picture.clipped[~hole] == 0)


def test_a_bright_background_does_not_bleed_into_the_subject() -> None:
    given = taken(0, background=2.0).diffuse
    found = measured_view(SourceView(given), sunlight(), camera(12), ball())
    truth = relit(taken(12))
    whole = found.alpha > 0.99
    assert relative_error(found.picture.radiance, truth, whole) < 0.02
    rim = whole & (outline(Subject.of(ball()), camera(12)).share > 0.999)
    assert np.max(found.picture.radiance[rim] / truth.max()) < 1.1


def test_the_share_of_the_background_is_taken_out_of_a_pixel() -> None:
    edges = outline(Subject.of(ball()), camera(0))
    own, behind = np.array([0.3, 0.2, 0.1]), np.array([0.01, 0.02, 0.04])
    share = edges.share[..., None]
    clean, after = without_background(share * own + (1 - share) * behind, edges)
    partly = after.usable & (edges.share < 0.9)
    assert partly.sum() > 20
    assert np.allclose(clean[partly], own, atol=0.002)
    _, after = without_background(share * own + (1 - share) * 100 * behind, edges)
    assert not np.any(after.usable & (edges.share < 0.9))
    assert np.array_equal(after.usable[edges.share == 1], edges.usable[edges.share == 1])


def test_what_stands_in_front_hides_and_does_not_colour_what_is_behind() -> None:
    meshes = [ball(), ball((0, 0, 1.2), 0.15)]
    subject = Subject.of(meshes)
    edges = outline(subject, camera(0))
    flags = (edges.sight.shape == 1).astype(np.float64)[..., None]
    seen = subject.seen(camera(30))
    behind = seen.shape == 0
    points, normals = seen.points[behind], seen.facets[behind]
    visible = subject.visible(points, normals, camera(0))
    # The point of the large ball that lies on the line from the camera through the small one.
    hidden = np.linalg.norm(points[:, :2], axis=-1) < 0.1
    assert hidden.sum() > 20 and not visible[hidden & (points[:, 2] > 0)].any()
    assert visible.mean() > 0.4
    values, certainty = sampled(flags, edges, points[visible], seen.shape[behind][visible])
    assert np.all(values == 0) and np.mean(certainty > 0) > 0.97


def test_a_mesh_that_does_not_match_the_camera_is_refused() -> None:
    field = source(0).field
    irradiances = sunlight()
    with pytest.raises(ValueError, match="the mesh does not match the source camera: the picture is dark in"):
        measured_view(SourceView(field), irradiances, camera(10), ball((0.5, 0, 0)))
    with pytest.warns(UserWarning, match="the mesh hardly matches the source camera: the picture is dark in"):
        measured_view(SourceView(field), irradiances, camera(10), ball((0.17, 0, 0)))
    overhead = Camera.looking_at(np.array([0, 0, 12.0]), np.zeros(3), width=8, height=8, focal_length=16)
    with pytest.raises(ValueError, match="sees the mesh in 0 of"):
        measured_view(SourceView(field), irradiances, overhead, ball((0, 0, 6)))
    with pytest.raises(ValueError, match="the new camera sees nothing of the mesh"):
        away = Camera.looking_at(np.array([0, 0, 3.0]), np.array([0, 0, 9.0]), width=8, height=8, focal_length=16)
        measured_view(SourceView(field), irradiances, away, ball())
    with pytest.raises(ValueError, match="no mesh is given"):
        measured_view(SourceView(field), irradiances, camera(10), [])


def test_wrong_calls_are_reported_in_a_line() -> None:
    field = source(0).field
    with pytest.raises(ValueError, match=r"irradiances are \(3, 3\); expected 60 × 3"):
        measured_view(SourceView(field), np.ones((3, 3)), camera(10), ball())
    with pytest.raises(ValueError, match="no source is given"):
        measured_view([], sunlight(), camera(10), ball())
    with pytest.raises(ValueError, match="irradiances for 1 sources, but there are 2"):
        measured_view([SourceView(field), SourceView(field)], [sunlight()], camera(10), ball())
    with pytest.raises(ValueError, match="give the field a camera"):
        SourceView(Pictures(np.ones((60, 4, 4, 3), np.float32), LIGHTS))
    with pytest.raises(ValueError, match=r"the map alpha is \(2, 2\); expected \(56, 56, 2\)"):
        SourceView(field, alpha=np.zeros((2, 2)))


@pytest.mark.slow
@pytest.mark.skipif(not STAGE.is_dir(), reason="the virtual stage's pictures are not here")
@pytest.mark.parametrize(("name", "most"), [("point_0", 0.07), ("point_1", 0.12)])
def test_the_head_is_seen_from_a_second_camera_as_it_is(name: str, most: float) -> None:
    """On the skin and the matte ball where both cameras see them; asked is 12 %."""
    said = json.loads((STAGE / "stage.json").read_text())
    lights = StageLights.towards(np.array([each["direction"] for each in said["lights"]]), grid=(12, 24))
    first, second = (
        Camera.looking_at(
            said[key]["position"],
            said[key]["look_at"],
            width=256,
            height=256,
            focal_length=128 / np.tan(np.radians(said[key]["hfov_deg"] / 2)),
        )
        for key in ("camera_front", "camera_right")
    )
    values = np.stack([read_radiance(STAGE / each["file"]).radiance for each in said["lights"]])
    field = Pictures(values, lights, first)
    meshes = read_meshes(STAGE / "objects" / "subject.glb")
    direction = next(each["direction"] for each in said["truth_points"] if each["truth"] == name)
    # Smooth weights of the lights about it, which sum to about 1.
    apart = np.arccos(np.clip(lights.directions @ lights.directions.T, -1, 1))
    towards = np.arccos(np.clip(lights.directions @ np.array(direction), -1, 1))
    weights = np.linalg.solve(np.exp(-apart / 0.5), np.exp(-towards / 0.5))
    parts = separate(field)
    found = measured_view(
        SourceView(field, parts, alpha=parts.alpha), np.repeat(weights[:, None], 3, 1), second, meshes
    )
    truth = read_radiance(STAGE / "truth" / f"{name}_right.exr").radiance
    subject = Subject.of(meshes)
    sight = subject.seen(second)
    skin = np.isin(sight.shape, [i for i, mesh in enumerate(meshes) if mesh.name in ("head", "ball_matte")])
    both = np.zeros(skin.shape, bool)
    both[skin] = subject.visible(sight.points[skin], sight.facets[skin], first)
    assert both.sum() > 14000
    assert relative_error(found.picture.radiance, truth, both) < most
