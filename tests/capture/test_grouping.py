"""A folder of many brackets is sorted by what the headers say."""

from datetime import datetime, timedelta
from pathlib import Path

import numpy as np
import pytest

from relume.capture.exposure.folder import expand, name_order
from relume.capture.exposure.grouping import group, group_files
from relume.errors import NotABracket, UnreadableFile
from relume.image import files
from relume.image.files import Facts
from relume.image.photograph import Exposure, Photograph, Settings
from relume.image.radiance import RadianceMap

NOON = datetime(2020, 6, 1, 12, 0, 0)
THREE = (1 / 60, 1 / 15, 1 / 4)


def shoot(times, *, at=0.0, pause=1.0, first=1, clock=True, **fields) -> list[Facts]:
    """Facts of photographs taken one after the other, `pause` seconds between them."""
    taken, shots = at, []
    settings = fields.pop("settings", {})
    f_number, iso = fields.pop("f_number", 8.0), fields.pop("iso", 100.0)
    for number, seconds in enumerate(times, first):
        when = NOON + timedelta(seconds=taken) if clock else None
        exposure = Exposure(seconds, f_number, iso, "EXIF") if seconds else None
        shots.append(
            Facts(f"IMG_{number}.JPG", (60, 40), exposure, settings=Settings(taken=when, **settings), **fields)
        )
        taken += (seconds or 0.0) + pause
    return shots


def numbers(brackets) -> list[list[int]]:
    return [[int(Path(p.name).stem[4:]) for p in bracket] for bracket in brackets]


TWICE = (1 / 60, 1 / 60, 1 / 15, 1 / 15, 1 / 4, 1 / 4)
CASES = {
    "a panorama": (shoot(THREE * 8, pause=2.0), [[3 * i + 1, 3 * i + 2, 3 * i + 3] for i in range(8)]),
    "automatic bracketing, in its order": (
        shoot((1 / 15, 1 / 60, 1 / 4, 1 / 4, 1 / 15, 1 / 60)), [[1, 2, 3], [4, 5, 6]]
    ),
    "of different length": (shoot((*THREE, *THREE, 1.0, 4.0)), [[1, 2, 3], [4, 5, 6, 7, 8]]),
    "long exposures are no pauses": (shoot((1 / 30, 1 / 4, 30.0, 60.0, 120.0), pause=2.0), [[1, 2, 3, 4, 5]]),
    "set by hand, with slow pauses": (shoot((15, 2.5, 1 / 4, 1 / 30), pause=100.0), [[1, 2, 3, 4]]),
    "every frame twice": (shoot(TWICE), [[1, 2, 3, 4, 5, 6]]),
    "of one exposure": (shoot((1 / 20,) * 5), [[1, 2, 3, 4, 5]]),
    "of no exposure": (shoot((None,) * 5), [[1, 2, 3, 4, 5]]),
    "of no exposure, without a clock": (shoot((None,) * 5, clock=False), [[1, 2, 3, 4, 5]]),
    "a varied ISO": (shoot((1 / 60, 1 / 15)) + shoot((1 / 15, 1 / 4), at=2.0, first=3, iso=800.0), [[1, 2, 3, 4]]),
    "nothing": ([], []),
}  # fmt: skip


@pytest.mark.parametrize("case", CASES)
def test_brackets_are_parted_where_the_exposures_start_over(case):
    shots, expected = CASES[case]
    assert numbers(group(shots)) == expected


@pytest.mark.parametrize("clock", [True, False])
def test_the_number_in_the_name_stands_in_for_the_clock(clock):
    shots = shoot(THREE * 4, clock=clock)  # IMG_10 comes after IMG_9
    assert numbers(group(shots[::-1])) == [[1, 2, 3], [4, 5, 6], [7, 8, 9], [10, 11, 12]]


def test_a_pause_parts_brackets_whose_exposures_differ():
    # Aperture priority: the second bracket is a third of a stop longer, so no exposure is taken twice.
    shots = shoot(THREE, pause=0.3) + shoot((1 / 50, 1 / 13, 0.3), at=40.0, pause=0.3, first=4)
    assert numbers(group(shots)) == [[1, 2, 3], [4, 5, 6]]
    assert numbers(group(shoot((*THREE, 1 / 50, 1 / 13, 0.3), pause=0.3))) == [[1, 2, 3, 4, 5, 6]]  # no pause to go by


def test_a_bracket_that_goes_on_after_a_pause_stays_whole():
    dark, middle, bright = (1 / 1000, 1 / 250, 1 / 4000), (1 / 15, 1 / 4, 1 / 60), (4.0, 1.0, 15.0)
    shots = shoot(dark, pause=0.2) + shoot(middle, at=45, pause=0.2, first=4) + shoot(bright, at=90, pause=0.2, first=7)
    assert numbers(group(shots)) == [[1, 2, 3, 4, 5, 6, 7, 8, 9]]
    # A yard after a room: the exposures are far from each other, and the pause parts them.
    shots = shoot(bright, pause=0.2) + shoot(dark, at=300, pause=0.2, first=4)
    assert numbers(group(shots)) == [[1, 2, 3], [4, 5, 6]]
    # The same after an hour is another bracket.
    shots = shoot(dark, pause=0.2) + shoot(middle, at=3600, pause=0.2, first=4)
    assert numbers(group(shots)) == [[1, 2, 3], [4, 5, 6]]


@pytest.mark.parametrize(
    "one, other",
    [
        ({"camera": "A"}, {"camera": "B"}),
        ({"settings": {"serial": "1"}}, {"settings": {"serial": "2"}}),
        ({"settings": {"focal_length": 24.0}}, {"settings": {"focal_length": 50.0}}),
        ({"settings": {"automatic_white": True}}, {"settings": {"automatic_white": False}}),
        ({"f_number": 8.0}, {"f_number": 4.0}),
    ],
)
def test_other_settings_make_another_bracket(one, other):
    shots = shoot(THREE, **one) + shoot((1.0, 4.0, 15.0), at=3.0, first=4, **other)
    assert numbers(group(shots)) == [[1, 2, 3], [4, 5, 6]]
    assert numbers(group(shoot(THREE, **one) + shoot((1.0, 4.0, 15.0), at=3.0, first=4, **one))) == [[1, 2, 3, 4, 5, 6]]


def test_another_size_makes_another_bracket():
    wide = Photograph(np.zeros((4, 6, 3), np.uint8), "wide.png", Exposure(1.0))
    tall = Photograph(np.zeros((6, 4, 3), np.uint8), "tall.png", Exposure(2.0))
    assert group([wide, tall]) == ((tall,), (wide,))


def grey(path: Path, seconds: float, second: int) -> Path:
    settings = Settings(taken=NOON + timedelta(seconds=second))
    files.write(path, Photograph(np.full((8, 8, 3), 90, np.uint8), exposure=Exposure(seconds), settings=settings))
    return path


def test_folders_are_read_from_headers_and_not_mixed(tmp_path):
    for folder in ("b", "a"):
        (tmp_path / folder).mkdir()
        for i, seconds in enumerate(THREE * 2):
            grey(tmp_path / folder / f"IMG_{i + 8}.jpg", seconds, i)
    brackets = group_files([tmp_path / "b", tmp_path / "a"])
    assert [[str(p.relative_to(tmp_path)) for p in bracket] for bracket in brackets] == [
        ["b/IMG_8.jpg", "b/IMG_9.jpg", "b/IMG_10.jpg"],
        ["b/IMG_11.jpg", "b/IMG_12.jpg", "b/IMG_13.jpg"],
        ["a/IMG_8.jpg", "a/IMG_9.jpg", "a/IMG_10.jpg"],
        ["a/IMG_11.jpg", "a/IMG_12.jpg", "a/IMG_13.jpg"],
    ]


def test_a_list_beside_the_photographs_shows_where_exposures_start_over(tmp_path):
    for i in range(4):
        grey(tmp_path / f"{i}.png", 1.0, i)
    assert len(group_files([tmp_path])) == 1
    (tmp_path / "times.txt").write_text("0.png 1/30\n1.png 1/8\n2.png 1/30\n3.png 1/8\n")
    assert [[p.name for p in bracket] for bracket in group_files([tmp_path])] == [
        ["0.png", "1.png"],
        ["2.png", "3.png"],
    ]
    assert len(group_files([tmp_path], sidecars=False)) == 1


def test_expanding_a_folder_passes_over_what_is_no_photograph(tmp_path):
    grey(tmp_path / "IMG_10.jpg", 1.0, 0)
    grey(tmp_path / "img_9.JPG.png", 1.0, 0)
    grey(tmp_path / "._IMG_9.png", 1.0, 0)
    (tmp_path / "IMG_11.jpg").write_text("no photograph")
    (tmp_path / "times.txt").write_text("IMG_10.jpg 1/30")
    (tmp_path / "inside").mkdir()
    files.write(tmp_path / "merged.hdr", RadianceMap(np.ones((4, 4, 3), np.float32)))
    files.write(tmp_path / "merged.exr", RadianceMap(np.ones((4, 4, 3), np.float32)))
    assert [p.name for p in expand([tmp_path])] == ["img_9.JPG.png", "IMG_10.jpg"]
    assert expand([tmp_path / "IMG_11.jpg", "nowhere.jpg"]) == (tmp_path / "IMG_11.jpg", Path("nowhere.jpg"))
    with pytest.raises(NotABracket, match="inside: no photograph is in this folder"):
        expand([tmp_path / "inside"])
    with pytest.raises(UnreadableFile, match=r"IMG_11\.jpg: no picture"):
        group_files([tmp_path / "IMG_11.jpg"])


def test_names_are_ordered_as_people_number_them():
    names = ["b2.jpg", "B10.jpg", "a.jpg", "1.jpg", "10.jpg", "9.jpg", "IMG_2b.jpg", "IMG_2.jpg"]
    assert sorted(names, key=name_order) == [
        "1.jpg", "9.jpg", "10.jpg", "a.jpg", "b2.jpg", "B10.jpg", "IMG_2.jpg", "IMG_2b.jpg"]  # fmt: skip


@pytest.mark.parametrize(
    "name",
    ["arch_full", "garage", "ghost_hall", "ghost_sculpture_garden", "handheld_street", "memorial", "room", "window"],
)
def test_every_real_set_is_one_bracket(shared, name):
    (bracket,) = group_files([shared / "data/brackets" / name])
    assert set(bracket) == set(expand([shared / "data/brackets" / name]))


def test_a_real_shoot_of_two_balls_and_a_plate(shared):
    folder = shared / "shoots/room"
    brackets = group_files([folder / "plate", folder / "ball_0", folder / "ball_90"])
    assert [(bracket[0].parent.name, len(bracket)) for bracket in brackets] == [
        ("plate", 4),
        ("ball_0", 9),
        ("ball_90", 9),
    ]


def test_folders_inside_a_folder_are_each_by_themselves(tmp_path):
    for name in ("b/IMG_2.jpg", "b/IMG_1.jpg", "a/IMG_1.jpg", "IMG_9.jpg", ".hidden/IMG_1.jpg"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        files.write(tmp_path / name, Photograph(np.full((8, 8, 3), 90, np.uint8), exposure=Exposure(0.1)))
    found = [path.relative_to(tmp_path).as_posix() for path in expand([tmp_path])]
    assert found == ["IMG_9.jpg", "a/IMG_1.jpg", "b/IMG_1.jpg", "b/IMG_2.jpg"]
