"""What relume says, in the page: no option of the command line, and what the page has in its place."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import relume as rl
from relume.studio.words import in_the_page

PACKAGE = Path(rl.__file__).parent
SAID = {
    "probe/ball": 8, "virtual_camera": 2, "project/merging": 1, "project/insertion": 5, "project/developing": 2,
    "sphere": 2, "image": 8, "capture": 15, "light/editing": 8,
}  # fmt: skip
"""Folders whose messages the page shows, and at least how many of those name options."""
IN_THE_SHOT_FILE = re.compile(r"“([^”]*)” in the shot file")


def keys(schema: Any) -> Iterator[str]:
    """Every key of a JSON schema's tables."""
    if isinstance(schema, dict):
        yield from schema.get("properties", {})
        schema = list(schema.values())
    for each in schema if isinstance(schema, list) else []:
        yield from keys(each)


OF_SHOTS = {key.replace("_", " ") for key in keys(rl.Shot.model_json_schema())}


def messages(folder: Path) -> list[str]:
    """Every text in a folder's code that names an option, 7 in each gap; those that document are left out."""
    found = []
    for path in sorted(folder.rglob("*.py")):
        source = path.read_text("utf-8")
        if "--" not in source:
            continue
        tree = ast.parse(source)
        nodes = list(ast.walk(tree))
        owners = (ast.Module, ast.ClassDef, ast.FunctionDef)
        documents = {ast.get_docstring(each, clean=False) for each in nodes if isinstance(each, owners)}
        parts = {id(part) for each in nodes if isinstance(each, ast.JoinedStr) for part in each.values}
        alone = {id(each.value) for each in nodes if isinstance(each, ast.Expr)}
        for each in nodes:
            if isinstance(each, ast.JoinedStr):
                text = "".join(str(p.value) if isinstance(p, ast.Constant) else "7" for p in each.values)
            elif isinstance(each, ast.Constant) and isinstance(each.value, str) and id(each) not in parts | alone:
                text = each.value
            else:
                continue
            if len(text.split()) > 3 and " --" in f" {text}".replace("(", " ") and text not in documents:
                found.append(text)
    return found


@pytest.mark.parametrize(("folder", "at_least"), SAID.items())
def test_no_message_names_an_option_in_the_page(folder: str, at_least: int):
    found = messages(PACKAGE / folder)
    assert len(found) >= at_least
    for text in found:
        shown = in_the_page(text)
        assert "--" not in shown and "  " not in shown, (text, shown)
        # What the page sends to the shot file is there.
        named = IN_THE_SHOT_FILE.findall(shown)
        assert set(named) <= OF_SHOTS, (text, shown)
        assert not re.search(r"`relume |relume (merge|probe|insert|develop|convert) ", shown), (text, shown)
    if folder == "probe/ball":
        # Each of these has a place of its own in the page.
        assert [text for text in found if "in the shot file" in in_the_page(text) and "profile" not in text] == []


def test_the_keys_of_shots_are_known():
    assert {"times", "neutral", "profile", "surface reflectance"} <= OF_SHOTS
    assert not {"picture", "times from names", "ignore", "vectors"} & OF_SHOTS


@pytest.mark.parametrize(
    "line, expected",
    [
        ("view 1: at 3,4,5; look at it with --picture and choose it with --pick",
         "view 1: at 3,4,5; look at it under Light, and drag the rim to the right one"),
        ("no ball in a.jpg; round things that may be picked are 1: --pick 1,2,3, 2: --pick 4,5,6; --picture draws "
         "them", "no ball in a.jpg; lay the rim on it by its handles, under Light"),
        ("no ball in a.jpg; or write the ball's rim into light.balls.0: pick = [1, 2, 3]; `relume probe --picture` "
         "draws what is round", "no ball in a.jpg; lay the rim on it by its handles, under Light"),
        ("a.jpg: it was taken as it is; `relume probe --picture` draws it",
         "a.jpg: it was taken as it is; look at it under Light"),
        ("cut off; take it whole; or pick its rim with --pick 10,20,30, and what is cut off is filled in",
         "cut off; take it whole; or lay its rim on it under Light, and what is cut off is filled in"),
        ("20 are taken for a camera; give --radius and --distance, metres",
         "20 are taken for a camera; give the ball's radius (under Light) and the camera's place, metres"),
        ("a.hdr: 3 pixels were negative; they are set to 0 (--clamp)",
         "a.hdr: 3 pixels were negative; they are set to 0"),
        ("something new; give --never-seen before", "something new; give “never seen” in the shot file before"),
        ("one - two -- three, a--b stay", "one - two -- three, a--b stay"),
    ],
)  # fmt: skip
def test_a_line_names_what_the_page_offers(line: str, expected: str):
    assert in_the_page(line) == expected


def test_the_doubt_of_an_absolute_camera_names_the_place_where_a_meters_value_is_typed(tmp_path: Path):
    from relume.studio.shots.developed import developed

    rl.write(tmp_path / "composite.exr", rl.RadianceMap(np.full((16, 24, 3), 0.3, np.float32)))
    body = {"of": "composite.exr", "tone": "ferwerda"}
    found = developed(body, results=tmp_path, named="out", scratch=tmp_path, camera=None)
    (doubt,) = (each for each in found["doubts"] if "relative" in each)
    assert doubt.endswith("give cd/m² per unit, which a meter shows: click a place under Radiance and type it")
