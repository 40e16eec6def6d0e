"""Tasks in words that an artist would type: each is a heading of the how-to pages, so the site's search finds it.

The search of the built site was tried by hand in a browser; here the words of each query stand in the heading itself or
on its page, which the search's ranking (docs/static/search.js) wants.
"""

from __future__ import annotations

import re
from pathlib import Path

import pytest

DOCS = Path(__file__).parents[1] / "docs"
TASKS = {
    "ball on a stand": ("insert", "Put a ball on a stand into the shot"),
    "camera raw": ("capture", "Merge camera raw files"),
    "resume an interrupted render": ("render", "Resume an interrupted render"),
    "own key light": ("place", "Add your own key light"),
    "shadow on a wall": ("place", "Throw a shadow on a wall"),
    "what a warning means": ("warnings", "What a warning means"),
    "turn environment map half round": ("place", "Turn an environment map half round"),
    "clean up tripod": ("light/mend", "Clean up a tripod, paint on a map"),
    "sun too bright for the file": ("light/mend", "Mend a clipped sun that is too bright for the file"),
    "fireflies": ("render", "Get rid of fireflies"),
    "match the grain": ("match", "Match the grain"),
    "depth of field of the insert": ("match", "Give the insert depth of field"),
    "motion blur of the insert": ("match", "Give the insert motion blur"),
    "mirror ball to lat-long": ("light/convert", "Convert a mirror ball or angular map to lat-long"),
    "scale wrong": ("insert", "Put the scale right: an object of the wrong size"),
    "matte edges": ("match", "Soften or repair matte edges"),
    "AOVs cryptomatte": ("match", "Composite the layers: AOVs, no Cryptomatte"),
    "EXR colour space": ("formats", "Handle the colour space of an EXR"),
    "batch of many shots": ("film", "Render a batch of many shots"),
    "turntable": ("film", "Make a turntable"),
    "relight a face": ("light-stage/README", "Relight a face by a map or a lamp"),
    "HDRI from brackets without EXIF": ("capture", "Make an HDRI from three brackets without EXIF"),
}
SMALL = {"a", "an", "the", "of", "on", "for", "to", "from", "what", "is"}


@pytest.mark.parametrize("query", TASKS)
def test_a_task_is_a_heading_in_the_words_of_its_query(query: str) -> None:
    page, heading = TASKS[query]
    lines = (DOCS / "how-to" / f"{page}.md").read_text(encoding="utf-8").splitlines()
    assert [line for line in lines if re.fullmatch(rf"#+ {re.escape(heading)}", line)]
    words = {word for word in re.findall(r"\w+", query.lower()) if word not in SMALL}
    assert words <= set(re.findall(r"\w+", heading.lower()))


HOW_TO = DOCS / "how-to"
OPENING = sorted({*HOW_TO.glob("*.md"), *HOW_TO.glob("light/*.md"), *HOW_TO.glob("light-stage/*.md")})
OPENING.remove(HOW_TO / "index.md")


@pytest.mark.parametrize("path", OPENING, ids=lambda path: path.relative_to(HOW_TO).as_posix())
def test_a_page_opens_with_what_you_get_and_a_command(path: Path) -> None:
    opening = path.read_text(encoding="utf-8").split("\n## ")[0]
    assert "**You get**" in opening and ("```sh" in opening or "```python" in opening)
