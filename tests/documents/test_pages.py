"""Every page: its blocks are of languages that a test reads, its files can be read, its links lead somewhere."""

from __future__ import annotations

import json
import re
import tomllib
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import relume as rl
from documents.pages import (
    FENCE,
    LANGUAGES,
    MADE_BY_THE_SITE,
    ROOT,
    Block,
    blocks,
    made_by_the_site,
    of_language,
    pages,
)
from relume.errors import RelumeError
from relume.lightstage.acquire.stage_file_reading import read_stage_file
from relume.lightstage.reflectometry.patch_files import LIST, read_patch
from relume.lightstage.reflectometry.patch_samples import FEWEST
from relume.project.film.film_file import FilmTable
from relume.project.presets.preset import preset_of
from relume.project.scene_file.scene_file import SceneTable
from relume.project.shot_file.shot import Shot
from relume.renderers.progressive.graceful_shutdown import ENDING
from relume.scene.places.place_tables import PlaceTables

TOML = list(of_language("toml"))
LINKING = [*pages(), *sorted(ROOT.glob("docs/course/*.md")), *sorted(ROOT.glob("docs/decisions/*.md"))]
LINKING += [*sorted(ROOT.glob("docs/accuracy/*.md")), ROOT / "CHANGELOG.md"]
LINKING += [*sorted(ROOT.glob("examples/**/*.md")), *sorted(ROOT.glob(".github/**/*.md"))]
LINK = re.compile(r"(?<!\\)\]\(<?([^()\s>]+)>?\)")
PROGRAMS = re.compile(r"```.*?```|`[^`\n]*`", re.S)
ROOM = tomllib.loads((ROOT / "examples" / "room" / "shot.toml").read_text(encoding="utf-8"))


@pytest.mark.parametrize("page", pages(), ids=lambda page: page.stem)
def test_the_blocks_of_a_page_are_of_languages_that_are_tested(page: Path) -> None:
    assert [block.place for block in blocks(page) if block.language not in LANGUAGES] == []
    # Marks that open no block, or close none, would hide one from the tests.
    assert not re.search(r"(?m)^ *```", FENCE.sub("", page.read_text(encoding="utf-8")))


@pytest.mark.parametrize("block", list(of_language("json")), ids=lambda block: block.place)
def test_json_on_a_page_is_a_file_that_relume_reads(block: Block, tmp_path: Path) -> None:
    read_json(block.code, tmp_path)


def read_json(code: str, folder: Path) -> None:
    """Read a file of a light stage, or the list of a patch's photographs, which are made."""
    tables = json.loads(code)
    if "lights" in tables:
        (folder / "stage.json").write_text(code, encoding="utf-8")
        assert set(read_stage_file(folder / "stage.json").others) <= {"mesh"}
        return
    for each in tables["pictures"]:
        rl.write(folder / each["file"], rl.RadianceMap(np.full((256, 256, 3), 0.5, np.float32)))
    tables["pictures"] *= FEWEST  # of which a page shows one
    (folder / LIST).write_text(json.dumps(tables), encoding="utf-8")
    read_patch(folder)


@pytest.mark.parametrize(
    ("code", "named"),
    [
        ('{ "lights": [ { "file": "a.exr", "directon": [0, 1, 0] } ] }', "directon"),
        ('{ "lights": [ { "file": "a.exr", "direction": [0, 1, 0] } ], "camera": {} }', "cameras"),
        ('{ "area": [4, 6, 8, 8], "pictures": [ { "file": "a.exr", "incident": 3, "view": 2 } ] }', "incident"),
        ('{ "aera": [4, 6, 8, 8], "pictures": [ { "file": "a.exr", "incidence": 3, "view": 2 } ] }', "aera"),
    ],
)
def test_json_with_a_wrong_key_is_found(code: str, named: str, tmp_path: Path) -> None:
    with pytest.raises(RelumeError, match=named):
        read_json(code, tmp_path)


@pytest.mark.parametrize("block", TOML, ids=lambda block: block.place)
def test_a_file_on_a_page_is_of_a_kind_that_relume_reads(block: Block, tmp_path: Path) -> None:
    tables = tomllib.loads(block.code)
    faults = {}
    for kind, reads in KINDS.items():
        try:
            reads(tables, tmp_path)
        except (ValueError, RelumeError) as error:
            faults[kind] = str(error)
    assert len(faults) < len(KINDS), faults


def _shot(tables: dict[str, Any], _: Path) -> None:
    whole = tables if {"plate", "light", "objects"} <= set(tables) else ROOM | tables
    if isinstance(whole["light"], dict) and not SOURCES & {*whole["light"]}:
        whole = {**whole, "light": ROOM["light"] | whole["light"]}
    if "ball" in tables.get("camera", {}):
        whole = {**whole, "light": {"balls": [{"photographs": ["ball/*.jpg"]}], "ball": {"radius": 0.05}}}
    Shot.model_validate(whole)


def _scene(tables: dict[str, Any], _: Path) -> None:
    rest = {"camera": {"position": [0, 0, 1], "target": [0, 0, 0]}, "objects": [{"mesh": "a.obj"}]}
    SceneTable.model_validate(rest | tables)


def _film(tables: dict[str, Any], _: Path) -> None:
    FilmTable.model_validate(tables)


def _preset(tables: dict[str, Any], folder: Path) -> None:
    preset_of(tables, folder)


def _place(tables: dict[str, Any], _: Path) -> None:
    PlaceTables.model_validate(tables)


SOURCES = {"balls", "map", "maps", "probes", "sky"}
"""Where a shot's light may come from; a part of its table that names none goes with the room's."""
KINDS = {"shot": _shot, "scene": _scene, "film": _film, "preset": _preset, "place": _place}
"""The files that relume reads, and what reads each from its tables; parts of a shot go with the rest of the room's."""


@cache
def anchors(page: Path) -> frozenset[str]:
    """The headings of a page as links name them, and its labels."""
    text = PROGRAMS.sub(lambda found: found[0].strip("`") if "\n" not in found[0] else "", page.read_text("utf-8"))
    headings = re.findall(r"(?m)^#+ +(.*?) *$", text)
    names = [re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings]
    return frozenset(names) | frozenset(re.findall(r"(?m)^\(([\w-]+)\)=$", text))


def broken_links(page: Path, text: str) -> list[str]:
    """The links to files and headings that are not there; those to other places are not followed."""
    broken = []
    for link in LINK.findall(PROGRAMS.sub("", text)):
        if re.match(r"[a-z]+:", link):
            continue
        name, _, heading = link.partition("#")
        path = (page.parent / name).resolve() if name else page
        made = made_by_the_site(path)
        if not path.exists() and not made:
            broken.append(link)
        elif heading and path.suffix == ".md" and not made and heading not in anchors(path):
            broken.append(link)
    return broken


@pytest.mark.parametrize("page", LINKING, ids=lambda page: page.stem)
def test_the_links_of_a_page_lead_somewhere(page: Path) -> None:
    assert broken_links(page, page.read_text(encoding="utf-8")) == []


def hidden_lines(text: str) -> list[str]:
    """The lines that the site leaves out: it takes what begins with % for a comment, so "3 %" is kept on one line."""
    return [line for line in PROGRAMS.sub("", text).splitlines() if re.match(r" *%", line)]


@pytest.mark.parametrize("page", LINKING, ids=lambda page: page.stem)
def test_no_line_of_a_page_is_taken_for_a_comment(page: Path) -> None:
    assert hidden_lines(page.read_text(encoding="utf-8")) == []


def test_a_line_that_the_site_leaves_out_is_found() -> None:
    assert hidden_lines("within 3\n%, as asked\n\n```text\n% a comment\n```\n") == ["%, as asked"]


def test_a_broken_link_is_found() -> None:
    readme = ROOT / "README.md"
    text = "[a](nowhere.md) [b](docs/start.md#no-such-heading) [c](#in-python) [d](https://a.b) `[e](code.md)`"
    assert broken_links(readme, text) == ["nowhere.md", "docs/start.md#no-such-heading"]


def test_the_folders_that_the_site_makes_are_known() -> None:
    ignored = (ROOT / ".gitignore").read_text(encoding="utf-8").splitlines()
    assert {f"{folder}/" for folder in MADE_BY_THE_SITE} == {each for each in ignored if each.startswith("docs/")}
    root = Path("/api/keys/relume")  # a checkout below folders of these names
    assert made_by_the_site(root / "docs/reference/keys/shot.md", root)
    assert not made_by_the_site(root / "docs/reference/shot-file.md", root)
    assert not [page for page in pages() if made_by_the_site(page)]


def test_the_exit_codes_of_all_signals_that_end_a_render_are_named() -> None:
    page = (ROOT / "docs" / "reference" / "exit-codes.md").read_text(encoding="utf-8")
    cells = [line.split("|")[1] for line in page.splitlines() if line.startswith("| ")]
    numbers = {"SIGHUP": 1, "SIGINT": 2, "SIGTERM": 15, "SIGBREAK": 21}  # Windows has no SIGHUP, others no SIGBREAK
    assert set(numbers) == set(ENDING)
    assert {str(128 + number) for number in numbers.values()} <= set(re.findall(r"\d+", " ".join(cells)))
