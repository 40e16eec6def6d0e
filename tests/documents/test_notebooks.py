"""The notebooks of the lessons: the lessons' text and code, whole, in a form that Jupyter opens."""

from __future__ import annotations

import ast
import json
import re
from pathlib import Path
from typing import Any

import pytest

from documents.pages import ROOT, extension

NOTEBOOKS = extension("notebooks")
LESSONS = NOTEBOOKS.lessons(ROOT / "docs")


def of_kind(notebook: dict[str, Any], kind: str) -> list[str]:
    return [cell["source"] for cell in notebook["cells"] if cell["cell_type"] == kind]


@pytest.mark.parametrize("page", LESSONS, ids=lambda page: page.stem)
def test_a_lesson_is_a_notebook(page: Path) -> None:
    notebook = json.loads(json.dumps(NOTEBOOKS.notebook(page)))
    assert (notebook["nbformat"], notebook["nbformat_minor"]) == (4, 5)
    assert notebook["metadata"]["kernelspec"]["display_name"] == "Python 3"
    names = [cell["id"] for cell in notebook["cells"]]
    assert len(names) == len(set(names)) > 8
    text = "\n".join(of_kind(notebook, "markdown"))
    # Nothing of the site's own mark-up is left, and the code inside relume is written out.
    assert not re.search(r"\{code-cell\}|\{literalinclude\}|^---$|\.md[)#]", text, re.M)
    assert text.startswith("# ") and "```python\n" in text
    for code in of_kind(notebook, "code"):
        ast.parse(code)


@pytest.mark.parametrize("page", LESSONS, ids=lambda page: page.stem)
def test_its_code_is_the_lesson_s_but_for_wrong_answers(page: Path) -> None:
    cells = re.findall(r"```\{code-cell\} ipython3\n((?::[^\n]*\n)*)(.*?)```", page.read_text(encoding="utf-8"), re.S)
    kept = [code.rstrip("\n") for options, code in cells if "remove-cell" not in options]
    assert of_kind(NOTEBOOKS.notebook(page), "code") == kept
    assert len(kept) < len(cells)


def test_answers_are_folded_up() -> None:
    cells = NOTEBOOKS.notebook(LESSONS[0])["cells"]
    folded = [i for i, cell in enumerate(cells) if cell["metadata"].get("jupyter", {}).get("source_hidden")]
    assert len(folded) == 4
    assert "One answer" in {cells[i - 1]["source"].strip("*:") for i in folded}
