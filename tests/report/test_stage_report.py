"""The page of a light stage: its doubts, its averages, and that it needs nothing from outside."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from parsed_page import Parsed
from relume.lightstage.field.field import Pictures, whole
from relume.lightstage.field.lights import StageLights
from relume.lightstage.relighting.voronoi_cells import even_directions
from relume.report.stage_report import doubts_of, levels_of, reduced, square_side, write_stage_report
from relume.sphere.environment_map import EnvironmentMap
from small_stages import chosen, grid_directions

LIGHTS = StageLights.towards(even_directions(60), tuple(f"lamp {i}" for i in range(60)))
NORMALS = np.stack([*np.meshgrid(np.linspace(-0.6, 0.6, 12), np.linspace(0.6, -0.6, 10)), np.zeros((10, 12))], axis=-1)
NORMALS[..., 2] = np.sqrt(1 - (NORMALS**2).sum(axis=-1))


def matte(lights: StageLights = LIGHTS) -> Pictures:
    """A matte bowl that every light reaches at least a little."""
    cosine = np.maximum(np.einsum("hwk,nk->nhw", NORMALS, lights.directions), 0) + 0.05
    return Pictures((cosine[..., None] * [0.3, 0.2, 0.1]).astype(np.float32), lights)


def test_a_good_stage_has_no_doubts() -> None:
    field = matte()
    assert doubts_of(field, levels_of(field)[0]) == ()


@pytest.mark.parametrize("strength", [20.0, 0.02])
def test_a_light_far_brighter_or_darker_than_those_around_is_named(strength: float) -> None:
    field = matte()
    field.values[17] *= strength
    (line,) = doubts_of(field, levels_of(field)[0])
    assert line.startswith("1 picture is 4 times brighter or darker") and line.endswith(": lamp 17")


def test_an_unlit_half_is_reported_with_its_middle_and_the_light_nearest_to_it() -> None:
    above = chosen(LIGHTS, np.flatnonzero(LIGHTS.directions[:, 1] > 0))
    field = matte(above)
    (line,) = doubts_of(field, levels_of(field)[0])
    assert len(above) == 30
    # Twice the breadth of a mean cell is 2 √(4π/30), 74°.
    nearest = np.degrees(np.arccos(np.clip(even_directions(20000) @ above.directions.T, -1, 1).max(axis=1)))
    said = f"{(nearest > 74.2).mean():.0%} of the sphere is further than 74° from any"
    assert line.startswith(f"lights do not stand all around: {said}; towards (")
    assert re.search(r"towards \(-?0(\.\d+)?, -1, -?0(\.\d+)?\) the nearest is lamp \d+, [89]\d° away$", line)


@pytest.mark.parametrize("count", [4, 6, 20, 300])
def test_even_lights_leave_no_gap(count: int) -> None:
    assert doubts_of(unread((1, 1), count), np.ones(count)) == ()


def test_a_grid_by_inclination_and_azimuth_leaves_no_gap() -> None:
    field = Pictures(np.ones((288, 1, 1, 3), np.float32), StageLights.towards(grid_directions(24, 12)))
    assert doubts_of(field, np.ones(288)) == ()


def test_four_lights_on_one_side_leave_the_other_in_a_gap_though_they_are_few() -> None:
    front = StageLights.towards(np.array([[1.0, 0, 1], [-1, 0, 1], [0, 1, 1], [0, -1, 1]]))
    (line,) = doubts_of(Pictures(np.ones((4, 1, 1, 3), np.float32), front), np.ones(4))
    assert "further than 80° from any" in line and line.endswith("° away")


def test_levels_are_means_and_even_light_weighs_by_solid_angles() -> None:
    field = matte()
    values = np.ones((60, 4, 5, 3), np.float32) * np.arange(1, 61, dtype=np.float32)[:, None, None, None]
    levels, even = levels_of(Pictures(values, field.lights))
    np.testing.assert_allclose(levels, np.arange(1, 61), rtol=1e-6)
    np.testing.assert_allclose(even, (np.arange(1, 61) * LIGHTS.solid_angles).sum(), rtol=1e-6)


def test_reduced_holds_the_means_of_squares_and_of_what_is_left_at_the_rims() -> None:
    values = np.arange(2 * 3 * 5 * 3, dtype=np.float32).reshape(2, 3, 5, 3)
    lights = StageLights.towards(np.array([[0, 0, 1.0], [0, 0, -1.0]]))
    small = whole(reduced(Pictures(values, lights), 2))
    assert small.shape == (2, 2, 3, 3)
    np.testing.assert_allclose(small[0, 0, 0], [9, 10, 11])  # of 0, 3, 15 and 18, and so on
    np.testing.assert_allclose(small[1, 0, 2], values[1, :2, 4].mean(axis=0))
    np.testing.assert_allclose(small[1, 1, 1], values[1, 2, 2:4].mean(axis=0))
    np.testing.assert_allclose(small[1, 1, 2], values[1, 2, 4])
    np.testing.assert_array_equal(whole(reduced(Pictures(values, lights), 1)), values)


@pytest.mark.parametrize(
    ("shape", "count", "side"),
    [((256, 256), 288, 1), ((1000, 700), 288, 4), ((3000, 4000), 30, 9), ((8, 9), 4, 1), ((3, 40000), 300, 84)],
)
def test_squares_are_no_larger_than_a_page_needs(shape: tuple[int, int], count: int, side: int) -> None:
    found = square_side(unread(shape, count))
    assert found == side

    def size(side: int) -> tuple[int, int]:
        rows, columns = -(-shape[0] // side), -(-shape[1] // side)
        return max(rows, columns), count * rows * columns * 12

    assert size(found)[0] <= 480 and size(found)[1] <= 256 << 20
    assert found == 1 or size(found - 1)[0] > 480 or size(found - 1)[1] > 256 << 20


def unread(shape: tuple[int, int], count: int) -> Pictures:
    """A field of this size that takes no memory."""
    return Pictures(np.broadcast_to(np.float32(1), (count, *shape, 3)), StageLights.towards(even_directions(count)))


def test_the_page_holds_all_it_shows_and_asks_nothing_of_the_net(tmp_path: Path) -> None:
    field = matte()
    field.values[17] *= 20
    sky = EnvironmentMap(np.ones((8, 16, 3), np.float32))
    with pytest.warns(UserWarning, match="brighter or darker") as warned:
        write_stage_report(field, tmp_path / "report.html", {"sky <1>.hdr": sky}, title="stage <b>&")
    text = (tmp_path / "report.html").read_text("utf-8")
    assert len(warned) == 1 and str(warned[0].message) in text
    assert "<h1>stage &lt;b&gt;&amp;</h1>" in text and "<b>" not in text and "sky &lt;1&gt;.hdr" in text
    for words in ("Turn the light", "Reflectance functions", "Where the lights stand", "Under even light", "12×10"):
        assert words in text
    tags = Parsed(text).tags
    elements = [tag for tag, _ in tags]
    assert elements.count("img") == 3 and elements.count("canvas") == 1
    asked = ("src", "href", "action", "data", "srcset")
    addresses = [value or "" for _, attributes in tags for name, value in attributes.items() if name in asked]
    assert all(address.startswith("data:image/png;base64,") for address in addresses)
    assert not {"link", "iframe", "object", "embed"} & set(elements)
    assert not re.search(r"https?://|fetch\(|XMLHttpRequest|@import", text)


def test_the_page_says_that_its_pixels_are_averages(tmp_path: Path) -> None:
    lights = StageLights.towards(even_directions(5))
    wide = Pictures(np.random.default_rng(3).random((5, 2, 962, 3), np.float32), lights)
    write_stage_report(wide, tmp_path / "report.html", {})
    assert "mean of 3×3 of the stage's" in (tmp_path / "report.html").read_text("utf-8").replace("&#x27;", "'")


def test_lights_behind_a_subject_are_dark_and_no_doubt() -> None:
    """Of 24 lights about a matte ball those behind it show less than a hundredth of what their neighbours show."""
    lights = StageLights.towards(even_directions(24))
    across = np.stack(np.meshgrid(np.linspace(-1, 1, 24), np.linspace(1, -1, 24)), axis=-1)
    inside = (across**2).sum(axis=-1, keepdims=True) < 1
    normals = np.concatenate([across, np.sqrt(np.maximum(1 - (across**2).sum(axis=-1, keepdims=True), 0))], axis=-1)
    values = np.maximum(np.einsum("hwk,nk->nhw", normals * inside, lights.directions), 0)[..., None].repeat(3, axis=-1)
    field = Pictures(values.astype(np.float32), lights)
    levels = levels_of(field)[0]
    assert levels.min() < 0.01 * np.median(levels)
    assert doubts_of(field, levels) == ()
