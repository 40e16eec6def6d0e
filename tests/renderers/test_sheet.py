"""The balls of the contact sheet: each shows what physics says, and the sheet what the balls show."""

from __future__ import annotations

import numpy as np
import pytest

import lights
from relume.image.colour import luminance
from relume.light.reflection.lobes import Phong
from relume.light.reflection.reflection_map import reflection_map
from relume.renderers.prefiltered import contact_sheet as sheet
from relume.renderers.prefiltered.contact_sheet import SURFACES, Ball, balls
from relume.report.materials.reflection_sheet import contact_sheet, exposed_for
from relume.report.plots import MIDDLE_GREY
from relume.sphere.environment_map import EnvironmentMap
from relume.sphere.mappings.discs import Angular
from relume.virtual_camera.film.film import Film

SIZE = 24


@pytest.fixture(scope="module")
def light() -> EnvironmentMap:
    return lights.of_directions(lambda d: 1 + 0.6 * d[..., 0] + 0.3 * d[..., 1] + 0.05 * d[..., 2], 64)


@pytest.fixture(scope="module")
def made(light: EnvironmentMap) -> dict[str, Ball]:
    """Each ball by its caption; red goes up to the right, and less up to the top."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sheet, "_AZIMUTHS", 1)  # enough for so smooth a light, and six times as fast
        return {ball.caption: ball for ball in balls(light, SIZE)}


def at(ball: Ball, x: float, y: float) -> float:
    """The radiance at a point of the disc, −1 to 1 to the right and up."""
    return float(ball.radiance[int((1 - y) / 2 * SIZE), int((1 + x) / 2 * SIZE), 0])


def test_every_surface_is_there_and_covers_a_disc(made: dict[str, Ball]) -> None:
    assert len(made) == len(SURFACES) >= 16
    for ball in made.values():
        assert ball.radiance.shape == (SIZE, SIZE, 3) and np.isfinite(ball.radiance).all()
        assert ball.matte.sum() == pytest.approx(np.pi / 4 * SIZE**2, rel=3e-3)
        assert ball.matte[0, 0] == 0 and ball.matte[SIZE // 2, SIZE // 2] == 1
        assert not ball.radiance[0, 0].any()


def test_the_mirror_shows_the_map_by_the_law_of_reflection(light: EnvironmentMap, made: dict[str, Ball]) -> None:
    for i, j in ((12, 4), (5, 15), (18, 18), (12, 12)):
        x, y = (2 * j + 1) / SIZE - 1, 1 - (2 * i + 1) / SIZE
        n = np.array([x, y, np.sqrt(1 - x * x - y * y)])
        seen = light.lookup(2 * n[2] * n - np.array([0, 0, 1.0]))
        np.testing.assert_allclose(made["mirror"].radiance[i, j], seen, rtol=0.02)


def test_bright_sides_are_where_the_light_is(made: dict[str, Ball]) -> None:
    for name in ("Lambert", "Phong, n = 10", "mirror", "GGX, α = 0.3", "Ward, α = 0.2", "gold, roughness 0.4"):
        assert at(made[name], 0.6, 0) > 1.2 * at(made[name], -0.6, 0), name
        assert at(made[name], 0, 0.6) > 1.1 * at(made[name], 0, -0.6), name
    # A ball refracts what is behind it upside down and with its sides exchanged.
    assert at(made["refraction, index 1.5"], 0.6, 0) < at(made["refraction, index 1.5"], -0.6, 0)
    assert at(made["refraction, index 1.5"], 0, 0.6) < at(made["refraction, index 1.5"], 0, -0.6)


def test_the_self_luminous_and_the_retro_reflecting_ball_are_even(light: EnvironmentMap, made: dict[str, Ball]) -> None:
    inside = made["mirror"].matte == 1
    np.testing.assert_allclose(made["self-luminous"].radiance[inside], 1, rtol=1e-3)
    behind = reflection_map(light, Phong(50)).lookup(np.array([0, 0, 1.0]))
    retro = made["retro-reflector, n = 50"].radiance[inside]
    np.testing.assert_allclose(retro, np.broadcast_to(behind, retro.shape), rtol=2e-3)


def test_wrinkles_wrinkle(made: dict[str, Ball]) -> None:
    apart = np.abs(made["wrinkled mirror"].radiance - made["mirror"].radiance)[made["mirror"].matte == 1]
    assert apart.mean() > 0.02


def test_fewer_than_two_pixels_are_refused(light: EnvironmentMap) -> None:
    with pytest.raises(ValueError, match="1 pixels wide"):
        balls(light, 1)


def test_the_sheet_exposes_the_lambert_ball_for_middle_grey_and_shows_the_map(
    light: EnvironmentMap, made: dict[str, Ball]
) -> None:
    film, lambert = exposed_for(made["Lambert"]), made["Lambert"]
    mean = (luminance(lambert.radiance) * lambert.matte).sum() / lambert.matte.sum()
    assert film.exposure * mean == pytest.approx(MIDDLE_GREY)
    dark = Ball("dark", "", np.zeros((4, 4, 3), np.float32), np.ones((4, 4), np.float32))
    assert exposed_for(dark).exposure == Film().exposure
    page = contact_sheet(list(made.values()), light, film, "light").pixels
    assert page.dtype == np.uint8 and page.shape[2] == 3
    # The map's brightest side is its right half, and letters are on the page.
    rows = slice(60, 110)
    assert page[rows, 150:220].mean() > page[rows, 50:110].mean()
    assert np.ptp(page[:, 240:].astype(int)) > 100


def test_light_of_any_mapping_gives_the_same_balls(light: EnvironmentMap, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sheet, "SURFACES", SURFACES[1:2])
    monkeypatch.setattr(sheet, "_MOST_ROWS", 32)
    (straight,), (turned,) = balls(light, 8), balls(light.remapped(Angular(), 96), 8)
    np.testing.assert_allclose(straight.radiance, turned.radiance, rtol=0.01)
    coarse = sheet.coarse(light, 32)
    assert coarse.size == 32
    np.testing.assert_allclose(coarse.total(), light.total(), rtol=1e-6)
    assert sheet.coarse(lights.constant(33), 32).size == 32
    shares: list[float] = []
    balls(light, 4, progress=shares.append)
    assert shares == [1.0]
