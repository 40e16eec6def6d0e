"""Each lesson as a notebook beside its page: text, code and the code that the page includes, without what checks it."""

from __future__ import annotations

import ast
import json
import re
from pathlib import Path
from typing import Any

CELL = re.compile(r"```\{code-cell\} ipython3\n(?P<options>(?::[^\n]*\n)*)(?P<code>.*?)^```$", re.S | re.M)
INCLUDED = re.compile(r"```\{literalinclude\} (?P<path>\S+)\n(?P<options>(?::[^\n]*\n)*)```")
KERNEL = {"name": "python3", "display_name": "Python 3", "language": "python"}


def notebook(page: Path) -> dict[str, Any]:
    """A lesson as a notebook (nbformat 4.5): its cells in their order, none of them run.

    page : the lesson in Markdown; what it includes lies beside it as the page says
    """
    text = re.sub(r"\A---\n.*?\n---\n", "", page.read_text(encoding="utf-8"), flags=re.S)
    cells, end = [], 0
    for found in CELL.finditer(text):
        cells += _words(text[end : found.start()], page)
        if "remove-cell" not in found["options"]:
            cells += _code(found["options"], found["code"])
        end = found.end()
    cells += _words(text[end:], page)
    numbered = [{"id": f"cell-{number}", **cell} for number, cell in enumerate(cells)]
    metadata = {"kernelspec": KERNEL, "language_info": {"name": "python"}}
    return {"cells": numbered, "metadata": metadata, "nbformat": 4, "nbformat_minor": 5}


def _code(options: str, code: str) -> list[dict[str, Any]]:
    """A cell of code; what the page folds up is folded up here, below a line that says what it is."""
    cell = {"cell_type": "code", "execution_count": None, "metadata": {}, "outputs": [], "source": code.rstrip("\n")}
    if "hide-" not in options:
        return [cell]
    prompt = re.search(r'code_prompt_show: "([^"]*)"', options)
    said = _markdown(f"*{prompt[1] if prompt else 'More'}:*")
    return [said, {**cell, "metadata": {"jupyter": {"source_hidden": True}}}]


def _words(text: str, page: Path) -> list[dict[str, Any]]:
    """A cell of text, where there is some: its links lead to the site's pages, its included code is written out."""
    text = INCLUDED.sub(lambda found: _included(found, page), text)
    text = re.sub(r"(\]\([^):#\s]+)\.md(#[^)\s]*)?\)", r"\1.html\2)", text)
    return [_markdown(text.strip())] if text.strip() else []


def _markdown(text: str) -> dict[str, Any]:
    return {"cell_type": "markdown", "metadata": {}, "source": text}


def _included(found: re.Match[str], page: Path) -> str:
    """The code of a function, a class or a method out of a file, as the page shows it."""
    source = (page.parent / found["path"]).read_text(encoding="utf-8")
    name = re.search(r":pyobject: (\S+)", found["options"])
    if name is None:
        raise ValueError(
            f"{page.name}: {found['path']} is included without :pyobject:, which names a function or class"
        )
    here: Any = ast.parse(source)
    for part in name[1].split("."):
        here = next(each for each in here.body if getattr(each, "name", None) == part)
    first = min([here.lineno, *(each.lineno for each in here.decorator_list)])
    return "```python\n" + "\n".join(source.splitlines()[first - 1 : here.end_lineno]) + "\n```"


def lessons(folder: Path) -> list[Path]:
    """The lessons below the documents' folder."""
    return sorted((folder / "course").glob("[01]*.md"))


def write(app: Any, exception: Exception | None) -> None:
    """Write the notebooks beside the finished pages."""
    if exception is None and app.builder.format == "html":
        for page in lessons(Path(app.srcdir)):
            path = Path(app.outdir) / "course" / f"{page.stem}.ipynb"
            path.write_text(json.dumps(notebook(page), ensure_ascii=False, indent=1) + "\n", encoding="utf-8")


def offer(app: Any, doctree: Any, page: str) -> None:
    """Put the link to the notebook below a lesson's heading."""
    from docutils import nodes

    if not re.match(r"course/[01]", page):
        return
    name = f"{page.rpartition('/')[2]}.ipynb"
    # As HTML, for a link of Sphinx's cannot ask the browser to keep the file instead of showing its text.
    line = (
        f'<p class="notebook"><a href="{name}" download>Download this lesson as a notebook</a> to run it yourself.</p>'
    )
    title = next(iter(doctree.findall(nodes.title)))
    title.parent.insert(1, nodes.raw("", line, format="html"))


def setup(app: Any) -> dict[str, bool]:
    app.connect("doctree-resolved", offer)
    app.connect("build-finished", write)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
