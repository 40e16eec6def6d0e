"""The reference of files: each key that a file may have is there with its type, its default and what it means."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from documents.pages import extension

DOCS = Path(__file__).parents[1] / "docs"


@pytest.fixture(scope="module")
def keys() -> Any:
    """The extension of the site."""
    return extension("file_keys")


def fields(keys: Any) -> list[tuple[Any, str]]:
    return [
        (model, name)
        for root in keys.models().values()
        for model, _ in keys.tables_of(root)
        for name, field in model.model_fields.items()
        if not field.exclude
    ]


def test_every_key_of_every_file_has_a_meaning(keys):
    without = [f"{model.__name__}.{name}" for model, name in fields(keys) if not keys.meaning_of(model, name)]
    assert without == []


def test_no_words_are_left_of_keys_that_are_gone(keys):
    known = {(each, name) for model, name in fields(keys) for parent in model.__mro__ for each in keys.names_of(parent)}
    given = keys.words_of_keys()
    gone = [f"{table}.{key}" for table, words in given.items() if table != "any"
            for key in words if (table, key) not in known]  # fmt: skip
    assert gone == []
    assert set(given["any"]) <= {name for _, name in fields(keys)}


def test_a_row_says_type_unit_default_and_meaning(keys):
    shot, scene, stage = (keys.file_pages()[kind] for kind in ("shot", "scene", "stage"))
    for line in (
        "| `samples` | whole number from 2 to 1000000 |  | `256` | rays a pixel on average, at most |",
        "| `photographs` | text, or a list of them |  | needed | a bracket of the ball; patterns are allowed |",
        "| `square` | number above 0 | metres | needed | metres of a square's side |",
        "## `[[light.balls]]`",
    ):
        assert line in shot
    assert '## `[[lights]]` of kind `"point"`' in scene and "`1.5`" in scene
    assert '## `"lights"`' in stage and "| `hfov_deg` | number above 0 below 180 | degrees | needed |" in stage


def units(page: str, begins: str) -> set[str]:
    """The units of the rows that begin so."""
    return {line.split(" | ")[2].strip() for line in page.splitlines() if line.startswith(f"| {begins}")}


def test_a_unit_is_the_key_s_own(keys):
    shot, scene = keys.file_pages()["shot"], keys.file_pages()["scene"]
    assert units(shot, "`noise` |") == {""}  # "mean error at which it stops"
    assert units(shot, "`stage` | text") == units(shot, "`spot` | table") == {""}
    assert units(shot, "`size` | number from 0.5 to 120") == {"degrees"}  # of a lamp "at two metres"
    assert units(shot, "`readout` |") == {"seconds"}  # its meaning goes on for three sentences
    assert units(shot, "`rim` | list of 3") == {"pixels"}  # "x and y in pixels"
    assert units(scene, "`antialiasing` | true or false") == units(scene, "`file` | text") == {""}
    assert units(scene, "`field_of_view` |") == {"degrees"}  # beside "`focal_length`, pixels"
    light = shot.split("## `[light]`")[1].split("\n## ")[0]
    assert (units(light, "`turn` |"), units(light, "`exposure` |")) == ({"degrees"}, {"stops"})


@pytest.mark.parametrize(
    ("kind", "meaning", "unit"),
    [
        ("number", "metres, half of the diameter", "metres"),
        ("list of 2: number above 0", "of a plane: metres along x and z; endless unless given", "metres"),
        ("number", "its place; goes with another's, pixels", ""),
        ("number", "in place of `focal_length`, pixels", ""),
        ("number", "how many metres it has", ""),
        ("text", "metres", ""),
        ("true or false", "metres", ""),
        ("table", "two points and the place, metres", ""),
    ],
)
def test_a_unit_begins_a_meaning_or_stands_behind_a_comma(keys, kind, meaning, unit):
    assert keys.unit_of(kind, meaning) == unit


def test_a_page_names_the_keys_of_each_table(keys):
    page = keys.file_pages()["stage"]
    found = {
        part.splitlines()[0]: [line.split("`")[1] for line in part.splitlines() if line.startswith("| `")]
        for part in page.split("\n## ")[1:]
    }
    assert found == {
        "The file": ["lights", "cameras", "light", "grid", "encoding", "subject", "target"],
        '`"lights"`': [
            *("file", "files", "name", "direction", "position", "inclination", "azimuth"),
            *("solid_angle", "irradiance", "exposure"),
        ],
        '`"cameras.NAME"`': ["position", "look_at", "hfov_deg"],
        '`"light"`': ["irradiance_at_normal_incidence", "angular_diameter_deg"],
        '`"grid"`': ["inclination", "azimuth"],
        '`"target"`': ["rectangle", "reflectance"],
    }


@pytest.mark.parametrize("kind", ["shot", "scene", "film", "place", "stage"])
def test_no_table_of_a_page_is_empty_or_names_a_key_twice(keys, kind):
    for part in keys.file_pages()[kind].split("\n## ")[1:]:
        names = [line.split("`")[1] for line in part.splitlines() if line.startswith("| `")]
        assert names and len(names) == len({*names}), part.splitlines()[0]


def test_a_link_leads_from_the_explanation_to_the_keys():
    for page, kinds in {"shot-file": ["shot"], "scene-file": ["scene", "film"]}.items():
        text = (DOCS / "reference" / f"{page}.md").read_text(encoding="utf-8")
        assert all(f"(keys/{kind}.md)" in text for kind in kinds)
