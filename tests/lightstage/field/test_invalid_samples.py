"""What says nothing is found: clipped codes, lights in the lens, a stage's bar, what a person drew; nothing else is."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from relume.errors import UnreadableFile
from relume.image import files
from relume.image.photograph import Photograph
from relume.lightstage.acquire.read_stage import read_stage
from relume.lightstage.field.bar_shadow import bar_shadow
from relume.lightstage.field.corrected import Corrected
from relume.lightstage.field.field import Pictures, whole
from relume.lightstage.field.invalid_samples import (
    PackedMask,
    direct_light,
    lens_flare_and_direct_light,
    user_mask,
)
from relume.lightstage.field.lights import StageLights
from relume.lightstage.relighting.voronoi_cells import even_directions
from relume.scene.cameras.camera import Camera
from relume.sphere.directions import normalised
from small_stages import grid_directions

HEAD = Path(__file__).resolve().parents[4] / "shared" / "stages" / "head"
HEIGHT, WIDTH = 60, 80
ROWS, COLUMNS = 8, 16
CAMERA = Camera.looking_at(np.array([0, 0, 4.0]), np.zeros(3), width=WIDTH, height=HEIGHT, focal_length=160.0)
LIGHTS = StageLights.towards(grid_directions(ROWS, COLUMNS, 0.5), grid=(ROWS, COLUMNS))
EVERYTHING = slice(0, len(LIGHTS)), slice(0, HEIGHT)


def disc() -> np.ndarray:
    """Where the subject is, (60, 80)."""
    y, x = np.mgrid[0:HEIGHT, 0:WIDTH] + 0.5
    return np.hypot(x - WIDTH / 2, y - HEIGHT / 2) < 24


def matte_ball() -> np.ndarray:
    """(128, 60, 80, 3) of a matte ball with a sharp highlight before black."""
    y, x = np.mgrid[0:HEIGHT, 0:WIDTH] + 0.5
    across, up = (x - WIDTH / 2) / 24, (HEIGHT / 2 - y) / 24
    normals = np.stack([across, up, np.sqrt(np.maximum(1 - across**2 - up**2, 0))], axis=-1)
    half = normalised(LIGHTS.directions + np.array([0, 0, 1.0]))
    diffuse = np.maximum(np.einsum("nc,yxc->nyx", LIGHTS.directions, normals), 0) * 0.2
    highlight = 30 * np.maximum(np.einsum("nc,yxc->nyx", half, normals), 0) ** 300
    grey = np.where(disc(), diffuse + highlight * (diffuse > 0), 0)
    return (grey[..., None] * [1.0, 0.8, 0.7]).astype(np.float32)


def test_a_light_straight_ahead_of_the_camera_covers_a_disc_of_its_size() -> None:
    lights = StageLights.towards(np.array([[0, 0, -1.0], [0, 0, 1], [0, 1, 0]]))
    found = direct_light(lights, CAMERA, angular_radius=0.05, margin=0.0).block(slice(0, 3), slice(0, HEIGHT))
    assert found[0].sum() == pytest.approx(np.pi * (160 * np.tan(0.05)) ** 2, rel=0.05)
    assert found[0, 30, 40] and not found[1:].any()


def test_a_near_light_is_seen_where_it_stands() -> None:
    lights = StageLights.towards(np.array([[0, 0, -1.0]]), positions=np.array([[1.0, 0.5, -4.0]]))
    found = direct_light(lights, CAMERA, angular_radius=0.02, margin=0.0).block(slice(0, 1), slice(0, HEIGHT))[0]
    rows, columns = np.nonzero(found)
    assert (columns.mean() + 0.5, rows.mean() + 0.5) == pytest.approx((40 + 160 / 8, 30 - 160 / 16), abs=0.3)


def planted_flare() -> tuple[np.ndarray, np.ndarray]:
    """The ball with one light in the picture, that shines past it, and where that adds more than a fiftieth."""
    values, towards = matte_ball(), normalised([0.2, 0.13, -1])
    light = int(np.argmax(LIGHTS.directions @ towards))
    angles = np.arccos(np.clip(CAMERA.rays() @ LIGHTS.directions[light], -1, 1))
    glow = 2 * np.exp(-angles / 0.03)
    values[light] += glow[..., None].astype(np.float32)
    values[light][(angles < 0.02) & ~disc()] = 1000
    hit = np.zeros(values.shape[:3], bool)
    hit[light] = glow > 0.02 * 0.2
    return values, hit


def test_a_flare_is_found_with_its_glow() -> None:
    values, hit = planted_flare()
    found = lens_flare_and_direct_light(Pictures(values, LIGHTS), CAMERA, angular_radius=0.02).block(*EVERYTHING)
    assert (found & hit).sum() >= 0.95 * hit.sum()
    assert (found & ~hit).sum() <= 0.01 * (~hit).sum()


def test_highlights_and_lights_behind_the_subject_are_no_flare() -> None:
    mask = lens_flare_and_direct_light(Pictures(matte_ball(), LIGHTS), CAMERA, angular_radius=0.02)
    assert not mask.block(*EVERYTHING).any()


def test_a_camera_of_another_size_is_refused() -> None:
    with pytest.raises(ValueError, match=r"expected the field's \(60, 80\)"):
        lens_flare_and_direct_light(Pictures(matte_ball(), LIGHTS), CAMERA.resized(40, 30), angular_radius=0.02)


def planted_bar(column: int = 1, across: float = 46.0) -> tuple[np.ndarray, np.ndarray]:
    """The ball with an upright bar of four pixels before it under the lights of one azimuth, from the third row on."""
    values = matte_ball()
    x = np.arange(WIDTH) + 0.5
    hit = np.zeros(values.shape[:3], bool)
    for row in range(2, ROWS):
        hit[row * COLUMNS + column] = np.abs(x - across) < 2
    clean = values.copy()
    values[hit] = 0.001
    return values, hit & (np.abs(values - clean).max(axis=-1) > 0.02)


@pytest.mark.parametrize(("column", "across"), [(0, 34.0), (1, 46.0), (15, 30.0)])
def test_a_bar_is_found_and_little_else(column: int, across: float) -> None:
    values, hit = planted_bar(column, across)
    found = bar_shadow(Pictures(values, LIGHTS)).block(*EVERYTHING)
    subject = np.broadcast_to(disc(), found.shape)
    assert (found & hit).sum() >= 0.95 * hit.sum()
    assert (found & ~hit & subject).sum() <= 0.01 * (~hit & subject).sum()


def test_a_subject_without_a_bar_keeps_all_its_values() -> None:
    assert not bar_shadow(Pictures(matte_ball(), LIGHTS)).block(*EVERYTHING).any()


def test_a_round_spot_is_no_bar() -> None:
    values = matte_ball()
    y, x = np.mgrid[0:HEIGHT, 0:WIDTH] + 0.5
    values[3 * COLUMNS + 1, np.hypot(x - 40, y - 30) < 6] = 0
    assert not bar_shadow(Pictures(values, LIGHTS)).block(*EVERYTHING).any()


def test_a_packed_mask_is_the_mask() -> None:
    masked = np.random.default_rng(1).random((5, 6, 13)) < 0.5
    packed = PackedMask.of(masked)
    assert packed.bits.nbytes == 5 * 6 * 2
    assert np.array_equal(packed.block(slice(1, 4), slice(2, 6)), masked[1:4, 2:6])


THREE = StageLights.towards(even_directions(3), ("a.exr", "b.exr", "c.exr"))


def write_mask(path: Path, masked: np.ndarray, white: int = 255) -> None:
    files.write(path, Photograph((masked[..., None] * np.array([white, white, white])).astype(np.uint8)))


def test_one_drawn_mask_is_of_all_lights(tmp_path: Path) -> None:
    drawn = np.zeros((6, 8), bool)
    drawn[2:4, 5] = True
    write_mask(tmp_path / "mask.png", drawn)
    mask = user_mask(tmp_path / "mask.png", THREE, (6, 8))
    assert np.array_equal(mask.block(slice(1, 3), slice(1, 4)), np.stack([drawn[1:4]] * 2))


def test_drawn_masks_are_of_the_lights_they_are_called_as(tmp_path: Path) -> None:
    drawn = np.zeros((6, 8), bool)
    drawn[0, 7] = True
    write_mask(tmp_path / "b.png", drawn)
    found = user_mask(tmp_path, THREE, (6, 8)).block(slice(0, 3), slice(0, 6))
    assert np.array_equal(found[1], drawn) and not found[[0, 2]].any()


def test_dark_grey_says_keep(tmp_path: Path) -> None:
    write_mask(tmp_path / "mask.png", np.ones((6, 8), bool), white=127)
    assert not user_mask(tmp_path / "mask.png", THREE, (6, 8)).block(slice(0, 3), slice(0, 6)).any()


def test_drawn_masks_that_do_not_fit_are_refused(tmp_path: Path) -> None:
    with pytest.raises(UnreadableFile, match="no masks in this folder"):
        user_mask(tmp_path, THREE, (6, 8))
    write_mask(tmp_path / "d.png", np.ones((6, 8), bool))
    with pytest.raises(UnreadableFile, match=r'no light is called "d"; the first is "a\.exr"'):
        user_mask(tmp_path, THREE, (6, 8))
    with pytest.raises(UnreadableFile, match="a mask of 8×6; expected 8×7"):
        user_mask(tmp_path / "d.png", THREE, (7, 8))


@pytest.mark.slow
@pytest.mark.skipif(not HEAD.is_dir(), reason="the rendered stage is not here")
def test_a_bar_and_a_flare_before_a_rendered_head_are_found_and_filled() -> None:
    stage = read_stage(HEAD)
    with pytest.warns(UserWarning, match="a rounding below 0"):
        clean = whole(stage)
    lights, camera = stage.lights, stage.camera
    assert camera is not None
    subject = files.read_radiance(HEAD / "truth" / "mask_head.exr").radiance[..., 0] > 0.5
    everything = slice(0, 288), slice(0, 256)
    taken, hit = clean.copy(), np.zeros(clean.shape[:3], bool)
    # The bar: upright, before the nose, under the lights of two azimuths from the equator down.
    for row in range(6, 12):
        for column, across in ((0, 143.0), (23, 113.0)):
            hit[row * 24 + column, :, int(across) - 4 : int(across) + 4] = True
    taken[hit] = 0.002
    hit &= np.abs(taken - clean).mean(axis=-1) > 0.006
    # The flare: two lights above the head, whose glow falls to a third every 1.2 degrees.
    glow = np.zeros_like(hit)
    for light in (131, 132):
        angles = np.arccos(np.clip(camera.rays() @ lights.directions[light], -1, 1))
        added = 3 * np.exp(-angles / np.radians(1.2))
        taken[light] += added[..., None].astype(np.float32)
        taken[light][(angles < np.radians(1)) & (clean.max(axis=(0, 3)) < 0.003)] = 1046
        glow[light] = added > 0.02 * 0.18
    field = Pictures(taken, lights)
    bar, flare = bar_shadow(field), lens_flare_and_direct_light(field, camera, angular_radius=np.radians(1))
    for planted, mask in ((hit, bar), (glow, flare)):
        found = mask.block(*everything)
        assert (found & planted).sum() >= 0.95 * planted.sum()
        assert (found & ~planted)[:, subject].mean() <= 0.01
    filled = whole(Corrected(field, masks=(bar, flare)))

    def relit_error(values: np.ndarray) -> float:
        """Under the even light of the whole sphere, over the subject."""
        truth, relit = (np.tensordot(lights.solid_angles, v[:, subject], 1) for v in (clean, values))
        return float(np.abs(relit - truth).sum() / truth.sum())

    assert relit_error(taken) > 0.005
    assert relit_error(filled) < 0.001
