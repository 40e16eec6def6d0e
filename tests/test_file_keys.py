"""The reference of files: each key that a file may have is there with its type, its default and what it means."""

from __future__ import annotations

from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from typing import Any

import pytest

DOCS = Path(__file__).parents[1] / "docs"


@pytest.fixture(scope="module")
def keys() -> Any:
    """The extension of the site."""
    spec = spec_from_file_location("extension_of_keys", DOCS / "extensions" / "file_keys.py")
    assert spec is not None and spec.loader is not None
    module = module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


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


def test_the_pages_name_every_key_once_a_table(keys):
    for kind, root in keys.models().items():
        page = keys.file_pages()[kind]
        rows = sum(line.startswith("| `") for line in page.splitlines())
        assert rows == sum(not f.exclude for m, _ in keys.tables_of(root) for f in m.model_fields.values())


def test_a_link_leads_from_the_explanation_to_the_keys():
    for page, kinds in {"shot-file": ["shot"], "scene-file": ["scene", "film"]}.items():
        text = (DOCS / "reference" / f"{page}.md").read_text(encoding="utf-8")
        assert all(f"(keys/{kind}.md)" in text for kind in kinds)
