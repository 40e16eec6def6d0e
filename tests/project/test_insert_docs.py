"""What the pages of docs/how-to on shots and docs/reference/shot-file.md say is what the shot file takes."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path
from typing import Any

import pytest
from pydantic import BaseModel

from relume.project.mesh_tables import MaterialTable
from relume.project.shot_file.camera_table import CameraTable
from relume.project.shot_file.light_table import Light
from relume.project.shot_file.local_table import LocalTable
from relume.project.shot_file.match_table import MatchTable
from relume.project.shot_file.sequence_table import SequenceTable
from relume.project.shot_file.shot import DevelopTable, Object, Plate, RenderTable, Shot
from relume.scene.materials.presets import PRESETS

REPOSITORY = Path(__file__).parents[2]
PAGES = [
    (REPOSITORY / "docs" / "how-to" / f"{name}.md").read_text(encoding="utf-8")
    for name in ("insert", "place", "match", "film", "render")
]
PAGE, OBJECTS = PAGES[0], PAGES[2]
KEYS = (REPOSITORY / "docs" / "reference" / "shot-file.md").read_text(encoding="utf-8")
SHOTS = [tomllib.loads(text) for text in re.findall(r"```toml\n(.*?)```", "\n".join(PAGES), re.S)]
ROOM = tomllib.loads((REPOSITORY / "examples" / "room" / "shot.toml").read_text(encoding="utf-8"))


def test_the_page_opens_with_five_lines_that_are_a_shot() -> None:
    first, second, *_ = re.findall(r"```toml\n(.*?)```", PAGE, re.S)
    # The second has no nested tables, so that lines with dots may be added to it.
    assert (len(first.splitlines()), len(second.splitlines())) == (5, 7)
    assert "{" not in second
    ball, finished = map(Shot.model_validate, SHOTS[:2])
    assert ball.camera.of_ball is not None and finished.camera.of_ball is not None and finished.light.map is not None


def test_the_page_shows_the_room_as_it_is() -> None:
    shown = next(shot for shot in SHOTS if shot.keys() >= {"plate", "local", "objects"})
    assert shown == {name: table for name, table in ROOM.items() if name != "develop"}


@pytest.mark.parametrize("part", SHOTS[3:], ids=lambda part: "+".join(part))
def test_every_example_of_the_pages_is_taken(part: dict[str, Any]) -> None:
    # What is said of the ball goes with the five lines, all else with the room; a light added joins the room's.
    whole = (SHOTS[0] if "ball" in part.get("camera", {}) else ROOM) | part
    if "added" in part.get("light", {}):
        whole["light"] = ROOM["light"] | part["light"]
    shot = Shot.model_validate(whole)
    assert set(part) <= shot.model_fields_set


def test_the_pages_name_every_preset_and_no_other() -> None:
    table = re.search(r"\| presets \|.*?\n\n", OBJECTS, re.S)
    assert table is not None
    assert set(re.findall(r"`(\w+)`", table[0])) == set(PRESETS)


@pytest.mark.parametrize(
    ("heading", "table"),
    [
        ("[plate]", Plate), ("[camera]", CameraTable), ("[light]", Light), ("[[local]]", LocalTable),
        ("[[objects]]", Object), ("[match]", MatchTable), ("[render]", RenderTable), ("[develop]", DevelopTable),
        ("[sequence]", SequenceTable),
    ],
)  # fmt: skip
def test_every_key_has_its_row(heading: str, table: type[BaseModel]) -> None:
    section = re.search(rf"\| `{re.escape(heading)}` \|.*?\n\n", KEYS, re.S)
    assert section is not None
    rows = "\n".join(line.split("|")[1] for line in section[0].splitlines() if line.startswith("|"))
    assert set(re.findall(r"`(\w+)`", rows)) == set(table.model_fields)


def test_every_field_of_a_material_is_named() -> None:
    assert {name for name in MaterialTable.model_fields if f"`{name}`" not in KEYS} == set()
