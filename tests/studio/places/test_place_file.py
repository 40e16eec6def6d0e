"""Edits of a place file's text: marks beside their neighbours, blocks after the last, comments kept."""

from __future__ import annotations

import tomllib
from pathlib import Path

import pytest

pytest.importorskip("tomlkit", reason="the extra studio is not installed")

from relume.studio.places.headers import is_place_file
from relume.studio.places.place_file import edited_place

OWN = """# a place
[[photographs]]
name = "north"
file = "north.jpg"

[[photographs]]
name = "east"
file = "east.jpg"

[[blocks]]
name = "house"
kind = "box"
width = 8.0   # by tape

# Marks of mine

[marks.north.house]
front_top = [[1.0, 2.0], [3.0, 4.0]]  # the eaves
# front_left = [[1, 2]]

[marks.east.house]
right_top = [[5.0, 6.0], [7.0, 8.0]]
"""
FOUND = """
# Found by `relume model`, which writes all below anew; lengths are metres, angles degrees.
[found]
chi_square = 1.5
"""


def test_a_mark_is_changed_where_it_stands():
    change = {"set": ["marks", "north", "house", "front_top"], "value": [[1.234, 2], [3, 4.005]]}
    expected = OWN.replace("[[1.0, 2.0], [3.0, 4.0]]", "[[1.23, 2.0], [3.0, 4.0]]")
    assert edited_place(OWN, [change]) == expected
    assert edited_place(OWN + FOUND, [change]) == expected + FOUND


def test_a_mark_of_another_block_stands_beside_the_photograph_s_others():
    change = {"set": ["marks", "north", "annex", "ridge"], "value": [[1, 2], [3, 4]]}
    expected = OWN.replace(
        "# front_left = [[1, 2]]\n",
        "# front_left = [[1, 2]]\n\n[marks.north.annex]\nridge = [[1.0, 2.0], [3.0, 4.0]]\n",
    )
    assert edited_place(OWN + FOUND, [change]) == expected + FOUND


def test_the_first_mark_of_a_photograph_stands_at_the_end_above_what_was_found():
    ring = [[float(i), 2.0] for i in range(5)]
    text = edited_place(OWN + FOUND, [{"set": ["marks", "south", "well", "ring_0"], "value": ring}])
    lines = "\n".join(f"    [{float(i)}, 2.0]," for i in range(5))
    assert text == f"{OWN}\n[marks.south.well]\nring_0 = [\n{lines}\n]\n{FOUND}"


def test_a_mark_is_taken_out():
    text = edited_place(OWN, [{"remove": ["marks", "east", "house", "right_top"]}])
    assert tomllib.loads(text)["marks"]["east"]["house"] == {}
    assert text == OWN.replace("right_top = [[5.0, 6.0], [7.0, 8.0]]\n", "")


def test_a_block_is_added_after_the_last_and_taken_out_with_no_comment_of_others():
    value = {"name": "porch", "kind": "box", "on": "house"}
    added = edited_place(OWN, [{"append": ["blocks"], "value": value}])
    block = '\n[[blocks]]\nname = "porch"\nkind = "box"\non = "house"\n'
    assert added == OWN.replace("width = 8.0   # by tape\n", f"width = 8.0   # by tape\n{block}")
    assert edited_place(added, [{"remove": ["blocks", 1]}]) == OWN
    assert "# Marks of mine" in edited_place(OWN, [{"remove": ["blocks", 0]}])


def test_a_key_of_a_block_is_added_to_its_table():
    text = edited_place(OWN, [{"set": ["blocks", 0, "height"], "value": 2.5}])
    assert text == OWN.replace("# by tape\n", "# by tape\nheight = 2.5\n")
    value = {"of": "house", "across": "house.left"}
    text = edited_place(text, [{"set": ["blocks", 0, "mirrored"], "value": value}])
    assert 'height = 2.5\nmirrored = {of = "house", across = "house.left"}\n\n# Marks' in text.replace(
        "{ ", "{"
    ).replace(" }", "}")
    text = edited_place(text, [{"set": ["blocks", 0, "height"], "value": "house.width"}])
    assert 'height = "house.width"\nmirrored' in text


def test_the_first_length_is_added_and_taken_out():
    value = {"between": ["house.a", "house.b"], "metres": 5.0}
    added = edited_place(OWN + FOUND, [{"append": ["lengths"], "value": value}])
    assert tomllib.loads(added)["lengths"] == [value]
    assert added.endswith(FOUND)
    assert edited_place(added, [{"remove": ["lengths", 0]}]) == OWN + FOUND


@pytest.mark.parametrize(
    ("change", "line"),
    [
        ({"set": ["marks", "north", "house", "front_top"], "value": []}, "a mark is a list of points"),
        ({"set": ["marks", "north", "house", "front_top"], "value": [[1, "2"]]}, "a mark is a list of points"),
        ({"set": ["marks", "north", "house", "front_top"], "value": "x"}, "a mark is a list of points"),
        ({"remove": ["blocks", 7]}, "no such place to change"),
        ({"remove": ["marks", "south", "house"]}, "no such place to change"),
        ({}, "a change is one of set, remove and append"),
        ({"set": ["blocks", 0, "width"], "value": None}, "no empty values"),
    ],
)
def test_a_change_that_cannot_be_made_is_one_line(change: dict, line: str):
    with pytest.raises(ValueError, match=line) as refused:
        edited_place(OWN, [change])
    assert len(str(refused.value).splitlines()) == 1


def test_a_place_file_is_known_sound_or_not(tmp_path: Path):
    path = tmp_path / "file.toml"
    for text, known in (
        (OWN, True),
        (OWN + "broken [", True),
        (OWN.split("[[blocks]]")[0], True),
        ('[plate]\nphotographs = "a.jpg"\n', False),
        ("", False),
    ):
        path.write_text(text, encoding="utf-8")
        assert is_place_file(path) is known
    path.write_text('[photogrammetry]\nmodel = "sparse/0"\n', encoding="utf-8")
    with pytest.raises(ValueError, match="nothing to mark"):
        is_place_file(path)
