"""A performance under strobes: a textured ball that moves as is known, every lamp at every moment against the truth."""

from collections.abc import Callable

import numpy as np
import pytest

import relume as rl
from relume.errors import InvalidStage
from relume.image import files
from relume.image.files.video import Movie
from relume.image.radiance import RadianceMap
from relume.lightstage.field.field import whole
from relume.lightstage.field.lights import StageLights
from relume.lightstage.strobes.frame_motion import flow_from
from relume.lightstage.strobes.strobe_film import StrobeCycle, StrobeFilm, read_strobes, relit_strobes

SIZE, RADIUS = 96, 30.0
LAMPS = StageLights.towards(
    np.array([[0, 0, 1], [1, 0, 1], [-1, 0, 1], [0, 1, 1], [0, -1, 1], [1, 1, 1.0]]), tuple("abcdef")
)


def steady(time: float) -> tuple[float, float]:
    """Pixels right and down."""
    return 0.6 * time - 6, 0.3 * time - 3


def swinging(time: float) -> tuple[float, float]:
    return 8 * np.sin(2 * np.pi * time / 40), 0.0


def ball(direction: np.ndarray, at: tuple[float, float]) -> np.ndarray:
    """A matte ball with a pattern, under one lamp of irradiance 1, before an even grey wall."""
    y, x = np.mgrid[:SIZE, :SIZE] - (SIZE - 1) / 2
    x, y = (x - at[0]) / RADIUS, -(y - at[1]) / RADIUS
    z = np.sqrt(np.maximum(1 - x**2 - y**2, 0))
    albedo = 0.5 + 0.2 * np.sin(9 * x + 2 * y) + 0.2 * np.sin(8 * y - 3 * x)
    shade = albedo / np.pi * np.maximum(x * direction[0] + y * direction[1] + z * direction[2], 0)
    edge = np.clip((1 - np.sqrt(x**2 + y**2)) * RADIUS + 0.5, 0, 1)
    return np.repeat((edge * shade + (1 - edge) * 0.02)[..., None], 3, axis=-1).astype(np.float32)


def filmed(course: Callable[[float], tuple[float, float]], cycle: StrobeCycle, periods: int = 4) -> StrobeFilm:
    frames = []
    for number in range(cycle.start + periods * cycle.period):
        place = (number - cycle.start) % cycle.period
        shown = [ball(each, course(number)) for each in LAMPS.directions]
        lamp = None if place in cycle.tracking else cycle.lamp_places.index(place)
        frames.append(sum(shown) if lamp is None else shown[lamp])
    return StrobeFilm(lambda number: frames[number], len(frames), cycle)


def errors(film: StrobeFilm, course: Callable[[float], tuple[float, float]], time: int) -> tuple[float, float]:
    """The rms error as a share of the rms, aligned, and with each lamp's nearest frame as it is."""
    truth = np.stack([ball(each, course(time)) for each in LAMPS.directions])
    aligned = whole(film.field(time))
    nearest = []
    for place in film.cycle.lamp_places:
        own = np.arange(film.cycle.start + place, film.frame_count, film.cycle.period)
        nearest.append(film.frame(int(own[np.argmin(np.abs(own - time))])))
    power = np.sqrt(np.mean(truth**2))
    missed = (np.sqrt(np.mean((each - truth) ** 2)) / power for each in (aligned, np.stack(nearest)))
    first, second = missed
    return float(first), float(second)


def test_flow_finds_a_known_shift():
    one, two = ball(LAMPS.directions[0], (0, 0)), ball(LAMPS.directions[0], (3, -2))
    flow = flow_from(one, two)[30:66, 30:66]
    np.testing.assert_allclose(flow.reshape(-1, 2).mean(axis=0), [3, -2], atol=0.1)


def test_every_lamp_is_there_at_every_moment_of_a_steady_motion():
    film = filmed(steady, StrobeCycle(LAMPS))
    assert film.times == range(5, 19)
    # What is not moved is off by an eighth: 3 frames of 0.67 pixels at most.
    aligned, still = errors(film, steady, 12)
    assert still > 0.14 and aligned < 0.023


def test_tracking_frames_follow_a_motion_that_swings():
    cycle = StrobeCycle(LAMPS, tracking=(0, 4), start=2)
    film = filmed(swinging, cycle)
    own = filmed(swinging, StrobeCycle(LAMPS, start=2))
    assert cycle.period == 8 and cycle.lamp_places == [1, 2, 3, 5, 6, 7]
    for time in (12, 13, 15, 17, 18):
        aligned, still = errors(film, swinging, time)
        assert aligned < 0.021 and still > 0.09
    # Even motion over a whole period misses the swing's turn, near frame 10, and follows where it runs on.
    assert errors(own, swinging, 13)[0] > 0.06
    aligned, still = errors(own, swinging, 18)
    assert aligned < 0.033 and still > 0.23


def test_a_frame_s_own_lamp_is_its_own_pixels_and_relit_frames_are_steady():
    film = filmed(steady, StrobeCycle(LAMPS))
    assert np.array_equal(whole(film.field(8))[2], film.frame(8))
    nearest = rl.lightstage.RelightSettings(nearest=True)
    lamp = rl.lightstage.StageLighting(lamps=(rl.scene.DistantLight((0, 0, 1), (1.0, 1.0, 1.0)),))
    pictures = list(relit_strobes(film, lamp, nearest))
    assert len(pictures) == len(film.times)
    for time, picture in zip(film.times, pictures, strict=True):
        truth = ball(LAMPS.directions[0], steady(time))
        assert np.sqrt(np.mean((picture.radiance - truth) ** 2) / np.mean(truth**2)) < 0.05
    levels = np.array([picture.radiance.mean() for picture in pictures])
    assert np.ptp(levels) < 0.004 * levels.mean()
    with pytest.raises(ValueError, match="3 lights for the 14 frames"):
        list(relit_strobes(film, [lamp] * 3, nearest))


def test_a_folder_of_frames_is_a_film_and_is_relit_into_files(tmp_path):
    film = filmed(steady, StrobeCycle(LAMPS), periods=2)
    for number in range(film.frame_count):
        files.write(tmp_path / f"f{number}.exr", RadianceMap(film.frame(number)))
    read = read_strobes(tmp_path, StrobeCycle(LAMPS))
    assert np.array_equal(read.frame(10), film.frame(10)) and read.times == range(5, 7)
    lamp = rl.lightstage.StageLighting(lamps=(rl.scene.DistantLight((0, 0, 1), (1.0, 1.0, 1.0)),))
    assert rl.lightstage.relight_strobes(read, lamp, tmp_path / "out", rl.lightstage.RelightSettings(nearest=True)) == 2
    assert sorted(path.name for path in (tmp_path / "out").glob("*.exr")) == ["frame_0001.exr", "frame_0002.exr"]


def test_films_that_do_not_fit_their_cycle_are_refused():
    film = filmed(steady, StrobeCycle(LAMPS), periods=3)
    with pytest.raises(InvalidStage, match=r"17 frames from frame 1 on, 2\.83 periods of 6"):
        StrobeFilm(film.frame, 18, StrobeCycle(LAMPS, start=1))
    with pytest.raises(InvalidStage, match="frame 8 is dark, where the lamp 'c' should flash"):
        StrobeFilm(lambda number: film.frame(number) * (number != 8), 18, StrobeCycle(LAMPS))
    five = StageLights.towards(LAMPS.directions[:5], tuple("abcde"))
    with pytest.raises(InvalidStage, match="frame 5 is no tracking frame"):
        StrobeFilm(film.frame, 18, StrobeCycle(five, tracking=(5,)))
    with pytest.raises(ValueError, match="tracking frames \\[7\\] in a period of 7"):
        StrobeCycle(LAMPS, tracking=(7,))
    with pytest.raises(ValueError, match="no field at frame 3: all lamps are known from 5 to 12"):
        film.field(3)


def test_a_video_of_strobes_is_read_as_srgb(tmp_path):
    pytest.importorskip("av")
    with Movie(tmp_path / "film.mp4", 30) as movie:
        for number in range(12):
            movie.add(np.full((32, 48, 3), 60 + 30 * (number % 6), np.uint8))
    film = read_strobes(tmp_path / "film.mp4", StrobeCycle(LAMPS))
    values = whole(film.field(6))[:, 16, 24, 1]
    # sRGB codes 60 to 210 as light, a code or two off for the video's compression.
    np.testing.assert_allclose(values, [0.0452, 0.1022, 0.1878, 0.3050, 0.4564, 0.6445], rtol=0.06)
    with pytest.raises(InvalidStage, match="12 frames from frame 0"):
        read_strobes(tmp_path / "film.mp4", StrobeCycle(LAMPS, tracking=(0,)))
