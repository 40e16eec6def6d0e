"""An actor before a lit backdrop: the true matte comes back, and so does the picture before another backdrop."""

import numpy as np
import pytest

from relume.cli import main
from relume.image import files
from relume.image.radiance import RadianceMap
from relume.lightstage.matting.actor_matte import (
    MatteLevels,
    composite_actor,
    composite_actor_frames,
    difference_matte,
    infrared_matte,
)

ROWS, COLUMNS = 48, 64
Y, X = np.mgrid[:ROWS, :COLUMNS].astype(np.float64)
WALL = 0.5 + 0.3 * X / COLUMNS
"""The infrared backdrop, brighter to the right."""
EMPTY = np.stack([0.3 + 0.2 * Y / ROWS, 0.3 + 0 * Y, 0.2 + 0 * Y], axis=-1)
PLACE = np.stack([0.1 + 0.8 * X / COLUMNS, 0.6 - 0.4 * Y / ROWS, 0.4 + 0.2 * np.sin(X)], axis=-1).astype(np.float32)
SKIN = np.array([0.9, 0.6, 0.45])


def disc(centre: float, softness: float = 4.0) -> np.ndarray:
    """The true cover of a round actor with a soft edge."""
    return np.clip((14 - np.hypot(X - centre, Y - 24)) / softness + 0.5, 0, 1)


def shown(cover: np.ndarray, behind: np.ndarray) -> np.ndarray:
    return cover[..., None] * SKIN + (1 - cover[..., None]) * behind


def test_an_infrared_matte_is_the_cover_and_the_composite_the_truth():
    cover = disc(30)
    infrared = (1 - cover) * WALL + cover * 0.04
    matte = infrared_matte(infrared, WALL, 0.04, MatteLevels(0.0, 1.0))
    np.testing.assert_allclose(matte, cover, atol=1e-6)
    made = composite_actor(shown(cover, EMPTY), matte, EMPTY, PLACE)
    np.testing.assert_allclose(made, shown(cover, PLACE), atol=1e-6)
    assert np.array_equal(made[cover == 0], PLACE[cover == 0])


def test_levels_keep_noise_out_of_what_is_empty_and_of_what_is_solid():
    cover = disc(30)
    noise = np.random.default_rng(3).normal(0, 0.004, cover.shape)
    matte = infrared_matte((1 - cover) * WALL + noise, WALL)
    assert (matte[cover == 0] == 0).all() and (matte[cover == 1] == 1).all()
    # At the edge the stretch costs a twentieth at most, and noise a hundredth.
    assert np.abs(matte - cover).max() < 0.07


def test_a_difference_matte_finds_the_actor_to_a_pixel_at_the_edge():
    cover = disc(30, softness=1.0)
    noise = np.random.default_rng(4).normal(0, 0.004, (*cover.shape, 3))
    matte = difference_matte(shown(cover, EMPTY) + noise, EMPTY)
    assert (matte[cover == 1] == 1).mean() > 0.99 and (matte[disc(30, 1.0) == 0] > 0).mean() < 0.04
    hollow = difference_matte(EMPTY, EMPTY)
    assert hollow.dtype == np.float32 and not hollow.any()


def test_a_film_is_composited_frame_by_frame_before_one_backdrop_or_its_own():
    covers = [disc(centre) for centre in (20, 30, 40)]
    mattes = [infrared_matte((1 - cover) * WALL, WALL, levels=MatteLevels(0, 1)) for cover in covers]
    frames = [shown(cover, EMPTY) for cover in covers]
    still = list(composite_actor_frames(frames, mattes, EMPTY, PLACE))
    assert len(still) == 3
    moving = list(composite_actor_frames(iter(frames), iter(mattes), [EMPTY] * 3, [PLACE, PLACE * 2, PLACE]))
    for number, cover in enumerate(covers):
        np.testing.assert_allclose(still[number], shown(cover, PLACE), atol=1e-6)
        np.testing.assert_allclose(moving[number], shown(cover, PLACE * (2 if number == 1 else 1)), atol=1e-6)


def test_what_does_not_fit_is_refused_at_its_frame():
    cover = disc(30)
    frame = shown(cover, EMPTY)
    with pytest.raises(ValueError, match="no matte 2, where others go on"):
        list(composite_actor_frames([frame] * 2, [cover], EMPTY, PLACE))
    with pytest.raises(ValueError, match="no frame 2"):
        list(composite_actor_frames([frame], [cover], EMPTY, [PLACE] * 2))
    with pytest.raises(ValueError, match="is its backdrop lit"):
        infrared_matte(WALL, 0 * WALL)
    with pytest.raises(ValueError, match="two grey pictures"):
        infrared_matte(WALL, WALL[1:])
    with pytest.raises(ValueError, match="the empty stage is black"):
        difference_matte(frame, 0 * EMPTY)
    with pytest.raises(ValueError, match="matte is"):
        composite_actor(frame, cover[1:], EMPTY, PLACE)
    with pytest.raises(ValueError, match="0 ≤ low < high"):
        MatteLevels(0.5, 0.4)


@pytest.mark.parametrize("by", ["differences", "infrared"])
def test_the_command_puts_a_film_before_a_place(tmp_path, capsys, by):
    for folder in ("film", "infrared"):
        (tmp_path / folder).mkdir()
    covers = [disc(centre, softness=0.01) for centre in (20, 36)]
    grey = np.repeat(WALL[..., None], 3, axis=-1)
    for number, cover in enumerate(covers):
        for folder, picture in (("film", shown(cover, EMPTY)), ("infrared", (1 - cover)[..., None] * grey)):
            files.write(tmp_path / folder / f"f{number}.exr", RadianceMap(picture.astype(np.float32)))
    for name, picture in (("empty", EMPTY), ("place", PLACE), ("ir", grey)):
        files.write(tmp_path / f"{name}.exr", RadianceMap(picture.astype(np.float32)))
    command = ["stage", "actor", *(str(tmp_path / "film"), "--empty", str(tmp_path / "empty.exr"))]
    command += ["--over", str(tmp_path / "place.exr"), "-o", str(tmp_path / "out")]
    if by == "infrared":
        command += ["--infrared", str(tmp_path / "infrared"), "--infrared-empty", str(tmp_path / "ir.exr")]
    assert main(command) == 0
    for number, cover in enumerate(covers):
        made = files.read_radiance(tmp_path / "out" / f"frame_{number + 1:04d}.exr").radiance
        # Differences are sure to a pixel at the edge.
        wrong = np.abs(made - shown(cover, PLACE)).max(axis=-1) > 0.01
        assert wrong.mean() < (0.01 if by == "differences" else 1e-9)
    # A backdrop of another size is refused before the folder is made.
    files.write(tmp_path / "small.exr", RadianceMap(PLACE[1:]))
    capsys.readouterr()
    small = [word.replace("place.exr", "small.exr").replace("/out", "/never") for word in command]
    assert main(small) == 2 and not (tmp_path / "never").exists()
    assert "small.exr: 64×47 pixels, but the frames in" in capsys.readouterr().err
    # So is what the first frame shows to be wrong.
    dark = "ir.exr" if by == "infrared" else "empty.exr"
    files.write(tmp_path / dark, RadianceMap(np.zeros_like(PLACE)))
    assert main([word.replace("/out", "/never") for word in command]) == 2 and not (tmp_path / "never").exists()
    assert "empty stage is" in capsys.readouterr().err
    files.write(tmp_path / "infrared" / "f2.exr", RadianceMap(grey.astype(np.float32)))
    if by == "infrared":
        capsys.readouterr()
        assert main([*command[:-6], "-o", str(tmp_path / "other"), *command[-4:]]) == 2
        assert "3 pictures for the 2 frames" in capsys.readouterr().err and not (tmp_path / "other").exists()
