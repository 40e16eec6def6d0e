"""The reference, written from the code each time the site is built: commands' help, public names, keys of files."""

from __future__ import annotations

import inspect
import re
from dataclasses import is_dataclass
from functools import cached_property
from pathlib import Path
from textwrap import dedent
from types import ModuleType
from typing import Any

from file_keys import escaped, file_pages

import relume as rl

WIDE = 100
CASE = re.compile(r"^(?P<names>[\w*][\w*, ]*?) : (?P<text>.*)$")
METHODS = (property, cached_property, classmethod, staticmethod)
EXAMPLE = re.compile(r"(?m)^(>>> .*(?:\n(?!\n).*)*)")
"""An example of a docstring, from its first line to the next blank one."""
MODULES = {
    "": "The names of the main job, at the top level: `import relume as rl`, then `rl.read`, `rl.merge`, …",
    "files": "Reading and writing image files: formats and their options, header facts.",
    "mappings": "Mappings of an environment map, orientation, views.",
    "capture": "Photographs to a radiance map: exposure, alignment, ghosts, response, camera raw, scale.",
    "probe": "Mirrored balls and panoramas to an environment map.",
    "light": "An environment map to lamps, sun and reflection maps; editing and converting maps.",
    "scene": "Shapes, materials, lights, cameras.",
    "renderers": "Renderers for teaching and comparison.",
    "lens": "Motion blur, depth of field, glare, distortion, vignetting.",
    "film": "Film, paper, a camera's response.",
    "tone": "Tone operators, exposure, displays.",
    "lightstage": "Photographs under one light at a time to any light.",
    "report": "Reports and plots.",
    "errors": "The errors that a caller may want to catch.",
}


def command_pages() -> dict[str, str]:
    """A page for each command, in the words of its help."""
    from cyclopts import App

    from relume.cli import COMMANDS, FOLDERS

    pages = {}
    for name, summary in COMMANDS.items():
        app = App(name="relume", version_flags=[], help_flags=["--help", "-h"])
        app.command(f"relume.cli.{FOLDERS.get(name, '')}{name}:{name}", name=name, help=summary)
        _, text = app.generate_docs(max_heading_level=4).split(f"\n## relume {name}\n", 1)
        pages[name] = f"# relume {name}\n{safe(text)}"
    return pages


def safe(text: str) -> str:
    """The help as Markdown: what stands in its tables of contents links within one page and is left out."""
    text = re.sub(r"## Table of Contents\n\n(?:\s*- .*\n)+", "", text)
    text = re.sub(r"\* \[`([^`]+)`\]\(#[^)]*\)", r"* `\1`", text)
    return re.sub(r"(?m)^##+ ", lambda found: found[0][1:] if len(found[0]) > 3 else found[0], text).replace("$", "\\$")


def module_page(name: str, summary: str) -> str:
    """What one public module holds, each name with its signature and its docstring."""
    path = f"rl.{name}" if name else "rl"
    module = getattr(rl, name) if name else rl
    members = [each for each in sorted(dir(module), key=str.lower) if not each.startswith("_")]
    parts = [f"# {path}", summary]
    for member in members:
        value = getattr(module, member)
        if not isinstance(value, ModuleType) and str(getattr(value, "__module__", "relume")).startswith("relume"):
            parts += entry(f"{path}.{member}", value)
    return "\n\n".join(parts) + "\n"


def entry(path: str, value: Any) -> list[str]:
    """A name's heading, signature and docstring; of a class also its methods."""
    lines = [f"## `{path}`"]
    if not callable(value):
        return [*lines, f"```python\n{path} = {str(value)[:200]}\n```"]
    signature = signature_of(path, value)
    lines += [f"```python\n{signature}\n```"] if signature else []
    lines += [described(inspect.getdoc(value) if own_words(value) else "")]
    if inspect.isclass(value):
        for name, member in vars(value).items():
            if name.startswith("_") or not (inspect.isfunction(member) or isinstance(member, METHODS)):
                continue
            inner = (
                getattr(member, "fget", None) or getattr(member, "func", None) or getattr(member, "__func__", member)
            )
            if words := inspect.getdoc(inner):
                of = "" if isinstance(member, (property, cached_property)) else str(as_written(inner))
                lines += [f"`.{name}{of}`", described(words)]
    return [line for line in lines if line]


def own_words(value: Any) -> bool:
    """Whether a docstring is written and not made by `dataclass`, which repeats the signature."""
    return not (is_dataclass(value) and (value.__doc__ or "").startswith(f"{getattr(value, '__name__', '')}("))


def signature_of(path: str, value: Any) -> str:
    """The call as Python writes it, a parameter a line where it is long."""
    try:
        signature = as_written(value)
    except (TypeError, ValueError):
        return ""
    text = f"{path}{re.sub(r' at 0x[0-9a-f]+', '', str(signature))}"
    if len(text) <= WIDE:
        return text
    parameters = [str(each) for each in signature.parameters.values()]
    if any(each.kind is each.KEYWORD_ONLY for each in signature.parameters.values()) and not any(
        each.kind is each.VAR_POSITIONAL for each in signature.parameters.values()
    ):
        first = next(i for i, each in enumerate(signature.parameters.values()) if each.kind is each.KEYWORD_ONLY)
        parameters.insert(first, "*")
    back = "" if signature.return_annotation is signature.empty else f" -> {signature.return_annotation}"
    return f"{path}(\n    " + ",\n    ".join(parameters) + f",\n){back}"


def as_written(value: Any) -> inspect.Signature:
    """A signature whose annotations show as they stand in the source."""
    signature = inspect.signature(value)
    back = signature.empty if inspect.isclass(value) else plain(signature.return_annotation)
    shown = []
    for each in signature.parameters.values():
        default = each.default if isinstance(each.default, str) else plain(each.default)
        shown.append(each.replace(annotation=plain(each.annotation), default=default))
    return signature.replace(parameters=[each for each in shown if each.name != "self"], return_annotation=back)


class Written:
    """What a signature shows as these words and not as a string's repr."""

    def __init__(self, words: str) -> None:
        self.words = words

    def __repr__(self) -> str:
        return self.words


def plain(value: Any) -> Any:
    """An annotation or a default as it stands in the source."""
    if value is inspect.Signature.empty or value is None:
        return value
    if isinstance(value, str):
        return Written(value)
    return Written(value.__name__) if inspect.isclass(value) else value


def described(words: str | None) -> str:
    """A docstring as Markdown: its lines `name : text` as a list, examples as code, the rest as paragraphs."""
    parts = EXAMPLE.split(inspect.cleandoc(words or ""))
    return "\n\n".join(
        f"```python\n{part.strip()}\n```" if part.startswith(">>> ") else listed(part) for part in parts if part.strip()
    )


def listed(words: str) -> str:
    """Text as Markdown: its lines `name : text` as a list, the rest as paragraphs."""
    out: list[str] = []
    for line in dedent(words).splitlines():
        text = line.strip()
        found = CASE.match(line)
        if found:
            names = ", ".join(f"`{name.strip()}`" for name in found["names"].split(","))
            out += ([""] if out and out[-1] and not out[-1].startswith(("* ", "  ")) else []) + [
                f"* {names}: {escaped(found['text'])}"
            ]
        elif text and out and out[-1].startswith(("* ", "  ")) and line.startswith("    "):
            out.append(f"  {escaped(text)}")
        else:
            out += ([""] if out and out[-1].startswith(("* ", "  ")) else []) + [escaped(text)]
    return "\n".join(out).strip()


def write(app: Any) -> None:
    """Write the pages where they differ from what is there, so that only these are read again."""
    folder = Path(app.srcdir) / "reference"
    pages = {f"commands/{name}.md": text for name, text in command_pages().items()}
    pages |= {f"api/{name or 'rl'}.md": module_page(name, summary) for name, summary in MODULES.items()}
    pages |= {f"keys/{kind}.md": text for kind, text in file_pages().items()}
    for name, text in pages.items():
        path = folder / name
        path.parent.mkdir(exist_ok=True)
        if not path.exists() or path.read_text(encoding="utf-8") != text:
            path.write_text(text, encoding="utf-8")


def setup(app: Any) -> dict[str, bool]:
    app.connect("builder-inited", write)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
