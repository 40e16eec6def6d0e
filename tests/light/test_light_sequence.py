"""Light that changes with time: which maps, in which order, what lies between them, and what is refused."""

from pathlib import Path

import numpy as np
import pytest

from relume.errors import UnreadableFile
from relume.image.files import write
from relume.image.radiance import OUTSIDE, SATURATED
from relume.light.light_sequence import LightSequence
from relume.sphere.environment_files import as_radiance_map
from relume.sphere.environment_map import EnvironmentMap


def put(path: Path, value: float, rows: int = 4, unit: str = "relative", clipped: np.ndarray | None = None) -> Path:
    light = EnvironmentMap(np.full((rows, 2 * rows, 3), value, np.float32), unit=unit, clipped=clipped)
    write(path, as_radiance_map(light))
    return path


@pytest.fixture
def probe(tmp_path: Path) -> Path:
    """Maps 8 to 11 of 1, 3, 2 and 8, whose names a computer would sort otherwise."""
    (tmp_path / "probe").mkdir()
    for number, value in zip((8, 9, 10, 11), (1.0, 3.0, 2.0, 8.0), strict=True):
        put(tmp_path / "probe" / f"p{number}.exr", value)
    return tmp_path


def test_maps_come_in_the_order_of_their_numbers(probe: Path):
    for word in ("probe/*.exr", "probe", "probe/p*.exr"):
        names = [path.name for path in LightSequence.found(word, folder=probe).paths]
        assert names == ["p8.exr", "p9.exr", "p10.exr", "p11.exr"]


def test_between_two_maps_radiance_is_a_straight_line_and_the_ends_hold(probe: Path):
    light = LightSequence.found("probe/*.exr", 2.0, folder=probe)
    times = [-1.0, 0.0, 0.25, 0.5, 0.875, 1.0, 1.25, 1.5, 99.0]
    found = [float(light.at(time).radiance[1, 2, 0]) for time in times]
    np.testing.assert_allclose(found, [1, 1, 2, 3, 2.25, 2, 5, 8, 8], rtol=1e-6)
    assert light.seconds == 1.5


def test_without_interpolation_the_earlier_map_lasts(probe: Path):
    light = LightSequence.found("probe/*.exr", 2.0, "none", folder=probe)
    found = [float(light.at(time).radiance[0, 0, 0]) for time in (0.0, 0.49, 0.5, 0.99, 1.0, 7.0)]
    np.testing.assert_array_equal(found, [1, 1, 3, 3, 2, 8])


def test_a_time_that_is_a_maps_own_but_for_rounding_is_that_map(probe: Path):
    light = LightSequence.found("probe/*.exr", 24.0, folder=probe)
    moment = light.moment(sum([1 / 24] * 2) + 1e-12)
    assert (moment.before.name, moment.share) == ("p10.exr", 0)


def test_marks_are_kept_where_either_map_has_them(tmp_path: Path):
    one, other = np.zeros((4, 8), np.uint8), np.zeros((4, 8), np.uint8)
    one[0, 0], other[0, 1], one[1, 1], other[1, 1] = SATURATED, OUTSIDE, SATURATED, OUTSIDE
    paths = put(tmp_path / "a1.exr", 1, clipped=one), put(tmp_path / "a2.exr", 3, clipped=other)
    marks = LightSequence(paths, 1.0).at(0.5).clipped
    assert marks is not None
    assert (marks[0, 0], marks[0, 1], marks[1, 1], marks[3, 3]) == (SATURATED, OUTSIDE, SATURATED, 0)


def test_one_map_is_a_sequence_that_stands_still(probe: Path):
    light = LightSequence.found(probe / "probe" / "p9.exr")
    np.testing.assert_array_equal(light.at(5).radiance, 3)


@pytest.mark.parametrize(
    ("rows", "unit", "part"), [(8, "relative", "8 rows, but p8.exr is a map of 4 rows"), (4, "cd/m²", "in cd/m²")]
)
def test_maps_that_are_not_alike_are_refused(probe: Path, rows: int, unit: str, part: str):
    put(probe / "probe" / "p10.exr", 1, rows, unit)
    light = LightSequence.found("probe", 1.0, folder=probe)
    with pytest.raises(UnreadableFile, match=part):
        light.checked()
    with pytest.raises(UnreadableFile, match="alike"):
        light.at(1.5)
    put(probe / "probe" / "p10.exr", 1)
    assert light.checked() is light


def test_a_gap_a_double_and_a_name_without_a_number_are_refused(probe: Path):
    put(probe / "probe" / "q9.exr", 1)
    with pytest.raises(UnreadableFile, match="has the number 9 too"):
        LightSequence.found("probe", folder=probe)
    (probe / "probe" / "q9.exr").unlink()
    (probe / "probe" / "p9.exr").unlink()
    with pytest.raises(UnreadableFile, match="the map of number 9 is missing"):
        LightSequence.found("probe", folder=probe)
    put(probe / "probe" / "sun.exr", 1)
    with pytest.raises(UnreadableFile, match="no number in its name"):
        LightSequence.found("probe", folder=probe)
    with pytest.raises(UnreadableFile, match=r"a film, and no maps; make them: relume probe around.mp4 -o around.zarr"):
        LightSequence.found("around.mp4", folder=probe)
    with pytest.raises(UnreadableFile, match="no such maps"):
        LightSequence.found("none/*.exr", folder=probe)


def test_every_second_frame_may_have_a_map(tmp_path: Path):
    paths = [put(tmp_path / f"m{number:03d}.exr", 1) for number in (1, 3, 5)]
    assert LightSequence.found(tmp_path).paths == tuple(paths)


def test_numbers_and_words_that_are_none_are_refused(probe: Path):
    with pytest.raises(ValueError, match="no maps"):
        LightSequence(())
    with pytest.raises(ValueError, match="rate is 0"):
        LightSequence((probe,), 0.0)
    with pytest.raises(ValueError, match="smooth"):
        LightSequence((probe,), 1.0, "smooth")  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("begin", "end", "expected"),
    [
        (0.0, 2.0, [0.25, 0.5, 0.25]),
        (0.5, 1.0, [0.25, 0.75]),
        (-1.0, 1.0, [0.75, 0.25]),
        (1.25, 1.25, [0.0, 0.75, 0.25]),
        (5.0, 6.0, [0.0, 0.0, 1.0]),
    ],
)
def test_the_mean_of_an_open_shutter_weighs_each_map_exactly(begin, end, expected):
    maps = LightSequence(tuple(Path(f"m_{number}.exr") for number in range(3)), 1.0)
    found = maps.weights(begin, end)
    np.testing.assert_allclose([found.get(path, 0.0) for path in maps.paths[: len(expected)]], expected, atol=1e-12)
    assert sum(found.values()) == pytest.approx(1, abs=1e-12)
    steps = LightSequence(maps.paths, 1.0, "none")
    assert list(steps.weights(0.5, 2.0).values()) == pytest.approx([1 / 3, 2 / 3])


def test_times_of_a_shutter_that_fall_are_refused():
    with pytest.raises(ValueError, match="expected seconds that rise"):
        LightSequence((Path("a.exr"),)).weights(1.0, 0.5)
