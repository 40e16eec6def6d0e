"""`probe_film` against virtual films whose light is known: facets, alternating exposures, two films, 360° films."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("av")

from probe_films import FIVE, LAMPS, NORMALS, BallRig, Facet, filmed, place_light, truth, write_video
from relume.errors import BallNotFound, NotABracket, OutputNotWritten, RelumeError, UnreadableFile
from relume.image.files import read_radiance
from relume.image.radiance import OUTSIDE, SATURATED
from relume.light.light_sequence import LightSequence
from relume.probe.video.calibrating import BallFilm, SphericalFilm
from relume.probe.video.filming import FilmSettings, is_film, probe_film
from relume.probe.video.steadying import Steadying
from relume.sphere.environment_files import read_environment
from relume.sphere.mappings.mapping import LatLong, pixel_directions

ROWS = 64
SMALL = tuple(replace(each, x=0.72 * each.x, y=0.72 * each.y) for each in FIVE)
RIMS = tuple((each.x, each.y, 64.0) for each in SMALL)
FACETS = BallFilm(facets=5, rims=RIMS)
STOPS = np.array([each.stops for each in FIVE])
ONE = (Facet(88.3, 84.6, 0.0),)
ALONE = BallFilm(rims=((88.3, 84.6, 64.0),), follow_rims=False)
DIM = (LAMPS[0], ((0.85, 0.45, 0.3), 150.0, (10.0, 8.0, 5.0)), ((-0.4, 0.5, 0.75), 400.0, (9.0, 8.0, 6.0)), *LAMPS[3:])
"""Lamps over nine stops."""


@pytest.fixture(scope="module")
def rig() -> BallRig:
    return BallRig(SMALL, size=(460, 346), radius=64.0)


@pytest.fixture(scope="module")
def one() -> BallRig:
    return BallRig(ONE, size=(176, 170), radius=64.0)


@pytest.fixture(scope="module")
def moving(rig, tmp_path_factory) -> Path:
    """A place that turns by 5° a frame, in five facets."""
    frames = [filmed(rig.radiance(place_light(5.0 * k)), seed=k) for k in range(4)]
    return write_video(tmp_path_factory.mktemp("moving") / "facets.mkv", frames)


def irradiance(path: Path) -> np.ndarray:
    return read_environment(path).irradiance(NORMALS)


def off(path: Path, light) -> float:
    """The greatest departure of irradiance in 26 directions, as a share of what it is there."""
    true = truth(light, finer=4).irradiance(NORMALS)
    return float(np.abs(irradiance(path) / true - 1).max())


def test_five_facets_give_the_light_of_every_frame(moving, tmp_path):
    made = probe_film(moving, tmp_path / "maps", FACETS, FilmSettings(ROWS))
    assert [path.name for path in made.paths] == [f"map_00000{number}.exr" for number in (1, 2, 3, 4)]
    # A lamp four pixels wide is most of the light.
    assert max(off(path, place_light(5.0 * k)) for k, path in enumerate(made.paths)) < 0.03
    # The densities, found in the film, each within what its error says, and none by more than a hundredth.
    found = np.array([each.stops for each in made.calibration.exposures])
    np.testing.assert_allclose(found[:, 0], -STOPS, atol=0.03)
    assert np.all(np.abs(found[:, 0] + STOPS) < 4 * found[:, 1] + 0.02)
    # They are printed as `stops` takes them.
    printed = [float(line.split(" ±")[0]) for line in made.facts()["exposures, stops darker"]]
    np.testing.assert_allclose(printed, STOPS, atol=0.03)
    # The rims but the brightest one's are the film's too.
    assert np.abs(np.array(made.calibration.rims[0]) - np.array(RIMS)).max() < 0.25
    assert made.latency == 1 and made.clipped == 0
    assert ["taken for sRGB" in doubt.line for doubt in made.doubts] == [True]
    sequence = LightSequence.found(tmp_path / "maps", rate=float(made.calibration.rate))
    np.testing.assert_array_equal(sequence.at(1 / 24).radiance, read_environment(made.paths[1]).radiance)
    marks = read_radiance(made.paths[0]).clipped
    assert marks is not None and set(np.unique(marks)) == {0, OUTSIDE}


def test_rims_off_by_a_pixel_are_laid_on_one_another(moving, tmp_path):
    picked = tuple((x + dx, y + dy, r) for (x, y, r), (dx, dy) in zip(
        RIMS, [(0, 0), (1, -1), (-1, 0.5), (0.7, 1), (-1, -1)], strict=True))  # fmt: skip
    made = probe_film(moving, tmp_path / "maps", BallFilm(5, picked), FilmSettings(ROWS))
    assert np.abs(np.array(made.calibration.rims[0]) - np.array(RIMS)).max() < 0.25


def test_still_light_stays_still(rig, tmp_path):
    still = rig.radiance(place_light(10))
    film = write_video(tmp_path / "still.mkv", [filmed(still, seed=k) for k in range(5)])
    made = probe_film(film, tmp_path / "maps", FACETS, FilmSettings(ROWS))
    each = np.array([irradiance(path) for path in made.paths])
    assert np.abs(np.diff(each, axis=0) / each[:-1]).max() < 0.005


def test_facets_are_found_and_the_dark_ones_follow(rig, tmp_path):
    film = write_video(tmp_path / "found.mkv", [filmed(rig.radiance(place_light(5.0 * k)), seed=k) for k in (0, 1, 2)])
    made = probe_film(film, tmp_path / "maps", BallFilm(facets=5), FilmSettings(ROWS))
    found = np.array(made.calibration.rims[0])
    assert np.abs(found - np.array(RIMS)).max() < 1.0  # the ball's own rim, of which little is seen in so plain a place
    assert any("is seen in" in doubt.line for doubt in made.doubts)
    assert max(off(path, place_light(5.0 * k)) for k, path in enumerate(made.paths)) < 0.03


@pytest.mark.parametrize("stops, step", [((0, 4), 2.0), ((0, 6), 0.0)])
def test_alternating_exposures_are_merged_over_motion(one, tmp_path, stops, step):
    lights = [place_light(step * k, DIM) for k in range(6)]
    frames = [filmed(one.radiance(light) * 2.0 ** -stops[k % 2], seed=k) for k, light in enumerate(lights)]
    film = write_video(tmp_path / "alternating.mkv", frames)
    made = probe_film(film, tmp_path / "maps", ALONE, FilmSettings(ROWS))
    assert made.calibration.courses[0].period == 2 and made.latency == 2
    found = np.array([each.stops for each in made.calibration.exposures])
    np.testing.assert_allclose(found[:, 0], -np.array(stops), atol=0.02)
    assert max(off(path, light) for path, light in zip(made.paths, lights, strict=True)) < 0.03
    if not step:
        each = np.array([irradiance(path) for path in made.paths])
        assert np.abs(np.diff(each, axis=0) / each[:-1]).max() < 0.005


def spherical(light, size: int = 128) -> np.ndarray:
    """A 360° camera's frame, as exposures."""
    return light(pixel_directions(LatLong(), size))


def test_a_live_picture_of_a_360_degree_film_waits_for_nothing(tmp_path):
    lights = [place_light(1.5 * k, DIM) for k in range(6)]
    frames = [filmed(spherical(light) * 2.0 ** -(4 * (k % 2)), seed=k) for k, light in enumerate(lights)]
    film = write_video(tmp_path / "around.mkv", frames)
    made = probe_film(film, tmp_path / "maps", SphericalFilm(), FilmSettings(ROWS, steadying=Steadying(1, 0)))
    assert made.latency == 0
    assert max(off(path, light) for path, light in zip(made.paths, lights, strict=True)) < 0.03


def test_two_films_that_ran_together_are_one_bracket(tmp_path):
    lights = [place_light(3.0 * k, DIM) for k in range(3)]
    films = [
        write_video(
            tmp_path / f"{name}.mkv", [filmed(spherical(light) * gain, seed=k) for k, light in enumerate(lights)]
        )
        for name, gain in (("dark", 1 / 16), ("bright", 1.0))
    ]
    made = probe_film(films, tmp_path / "maps", SphericalFilm(), FilmSettings(ROWS, keep_variance=True))
    np.testing.assert_allclose([each.stops[0] for each in made.calibration.exposures], [-4, 0], atol=0.02)
    assert max(off(path, light) for path, light in zip(made.paths, lights, strict=True)) < 0.03
    variance = read_radiance(made.paths[0]).variance
    assert variance is not None and np.all(variance > 0)


def test_a_lamp_that_saturates_all_is_told_with_its_share(tmp_path):
    lights = [place_light(0, LAMPS)] * 3
    film = write_video(tmp_path / "lamp.mkv", [filmed(spherical(light), seed=k) for k, light in enumerate(lights)])
    made = probe_film(film, tmp_path / "maps", SphericalFilm(), FilmSettings(ROWS))
    assert made.clipped_frames == 3 and 0.1 < made.clipped < 1
    assert any("saturate even the darkest exposure in 3 of 3 frames" in doubt.line for doubt in made.doubts)
    picture = read_radiance(made.paths[0])
    assert picture.clipped is not None
    # A lower bound, and no more than that: white of the one exposure.
    assert np.all(picture.radiance[picture.clipped == SATURATED] <= 1.001)


def flat(value: float, noise: float = 0.7) -> np.ndarray:
    return filmed(np.full((120, 160, 3), value), noise)


def jumping(k: int) -> np.ndarray:
    return filmed(spherical(place_light(0, DIM)) * (1.4 if k > 2 else 1.0), seed=k)


@pytest.mark.parametrize(
    "frames, kind, error, words",
    [
        ([flat(0.2, 0)] * 3, BallFilm(facets=5), BallNotFound, "0 of 5 facets show a ball's rim"),
        (
            [jumping(k) for k in range(6)],
            SphericalFilm(),
            NotABracket,
            "from frame 3 to 4 everything becomes 1.40 times",
        ),
        ([flat(0.2)] * 3, SphericalFilm(), UnreadableFile, "160×120 pixels; an equirectangular film is twice as wide"),
        ([], SphericalFilm(), UnreadableFile, "without frames|cannot be read as a video|holds no pictures"),
    ],
)
def test_a_bad_film_is_refused_in_one_line_and_nothing_is_written(frames, kind, error, words, tmp_path):
    film = tmp_path / "film.mkv"
    if frames:
        write_video(film, frames)
    else:
        write_empty(film)
    with pytest.raises(error, match=words) as caught:
        probe_film(film, tmp_path / "maps", kind, FilmSettings(ROWS))
    assert "\n" not in str(caught.value)
    assert list(tmp_path.iterdir()) == [film]


def write_empty(path: Path) -> None:
    """A video with a header and no frame."""
    write_video(path, [flat(0.2)])
    path.write_bytes(path.read_bytes()[:700])


def test_light_that_jumps_by_itself_is_taken_where_that_is_said(tmp_path):
    film = write_video(tmp_path / "film.mkv", [jumping(k) for k in range(6)])
    made = probe_film(film, tmp_path / "maps", SphericalFilm(), FilmSettings(ROWS, steady_exposure=False))
    # Frame for frame: the frame beside the jump does not lean to the other side.
    before, after = irradiance(made.paths[2]), irradiance(made.paths[3])
    assert np.median(after / before) == pytest.approx(1.4, rel=0.04)


@pytest.mark.parametrize(
    "count, rate, words", [(4, 24, "4 frames, but a.mkv has 3"), (3, 25, "25 frames a second, but")]
)
def test_films_that_did_not_run_together_are_refused(tmp_path, count, rate, words):
    films = [
        write_video(tmp_path / "a.mkv", [flat(0.2)] * 3),
        write_video(tmp_path / "b.mkv", [flat(0.1)] * count, rate=rate),
    ]
    with pytest.raises(NotABracket, match=words):
        probe_film(films, tmp_path / "maps", SphericalFilm())
    assert not (tmp_path / "maps").exists()


def test_a_film_whose_end_is_missing_is_doubted_once(tmp_path):
    noise = np.random.default_rng(2).integers(60, 200, (2 * ROWS, 4 * ROWS, 3), np.uint8)
    film = write_video(tmp_path / "film.avi", [noise] * 6)
    film.write_bytes(film.read_bytes()[: int(0.55 * film.stat().st_size)])
    made = probe_film(film, tmp_path / "maps", SphericalFilm(), FilmSettings(ROWS))
    told = [doubt for doubt in made.doubts if "ends early" in doubt.line]
    assert [doubt.line for doubt in told] == [f"{film} ends early: {len(made.paths)} of 6 frames; copy it again"]
    assert told[0].wrong and len(made.paths) < 6


@pytest.mark.parametrize("name", ["maps.exr", "maps.HDR"])
def test_many_maps_are_not_written_under_the_name_of_one(moving, tmp_path, name):
    with pytest.raises(ValueError, match=r"a film gives many maps.*name a folder or a \.zarr"):
        probe_film(moving, tmp_path / name, FACETS)
    assert not (tmp_path / name).exists()


def test_a_folder_that_holds_something_is_left_alone(moving, tmp_path):
    (tmp_path / "map_000009.exr").write_bytes(b"mine")
    with pytest.raises(OutputNotWritten, match="holds files already"):
        probe_film(moving, tmp_path, FACETS)


@pytest.mark.parametrize(
    "wrong, words",
    [
        (lambda: FilmSettings(stops=(0.0, 3.0)), "2 stops for 5 facets"),
        (lambda: FilmSettings(period=9), "the period is 9"),
        (lambda: FilmSettings(size=4), "at least 8 rows"),
        (lambda: Steadying(before=-1), "0 to 30"),
        (lambda: BallFilm(5, RIMS[:2]), "2 rims for 5 facets"),
    ],
)
def test_settings_that_cannot_be_are_refused(moving, tmp_path, wrong, words):
    with pytest.raises((ValueError, RelumeError), match=words):
        probe_film(moving, tmp_path / "maps", FACETS, wrong())


def test_films_are_known_by_their_names():
    assert is_film("a/b.MP4") and is_film("b.mov") and not is_film("b.jpg")
