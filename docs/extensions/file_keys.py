"""The keys of files, written from the tables that check them: a section a table, a row a key.

Type and default are those of the model. The meaning is the table's docstring's or, where that has none, that of
`words_of_keys.toml`.
"""

from __future__ import annotations

import inspect
import json
import re
import tomllib
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from types import NoneType
from typing import Annotated, Any, Literal, get_args, get_origin

from pydantic import BaseModel, BeforeValidator
from pydantic.fields import FieldInfo

Model = type[BaseModel]
CASE = re.compile(r"^(?P<names>\w[\w, ]*?) : (?P<text>.*)$")
UNITS = "metres|pixels|degrees|radians|seconds|stops|frames a second|per metre|steradians|cd/m²|µm²|µm⁴|nm|K"
UNIT = re.compile(rf"(?:^|: |(?<!`), |\bin )({UNITS})(?![\w⁻])")
"""A unit where a meaning begins, after a comma or after "in"; what follows another key's name is that key's."""
FILES = {
    "shot": ("The keys of a shot file", "`relume insert`, `rl.read_shot`", "[The shot file](../shot-file.md)"),
    "scene": ("The keys of a scene file", "`relume render`", "[The scene file](../scene-file.md)"),
    "film": ("The keys of a film file", "`relume film`", "[Films](../scene-file.md#films)"),
    "place": ("The keys of a place file", "`relume model`", "[The place itself](../../how-to/light/model.md)"),
    "stage": ("The keys of a stage file", "`relume stage`", "[Light stages](../../how-to/light-stage/README.md)"),
}
"""By a file's kind: the page's title, what reads it, and the page that explains it."""


def models() -> dict[str, Model]:
    """The table of a whole file, by its kind."""
    from relume.lightstage.acquire import stage_file_reading
    from relume.project.film.film_file import FilmTable
    from relume.project.scene_file.scene_file import SceneTable
    from relume.project.shot_file.shot import Shot
    from relume.scene.places.place_tables import PlaceTables

    stage = stage_file_reading._StageTable
    return {"shot": Shot, "scene": SceneTable, "film": FilmTable, "place": PlaceTables, "stage": stage}


def file_pages() -> dict[str, str]:
    """A page for each kind of file, by its kind."""
    return {kind: page(kind, model) for kind, model in models().items()}


def page(kind: str, root: Model) -> str:
    """All tables of a file, the outer ones first."""
    title, reader, explained = FILES[kind]
    parts = [
        f"# {title}",
        f"{reader} read it. {explained} explains it with examples. An unknown key is an error. `needed` is what has to "
        "be there; `–` is a key that may be left out. Paths are relative to the file.",
    ]
    for model, path in tables_of(root, kind):
        rows = [row(model, name, field) for name, field in model.model_fields.items() if not field.exclude]
        parts += [f"## {heading(model, path, kind)}", escaped(summary(model)) if path else ""]
        parts.append("| key | type | unit | unless given | meaning |\n|---|---|---|---|---|\n" + "\n".join(rows))
    return "\n\n".join(part for part in parts if part) + "\n"


def tables_of(root: Model, kind: str = "") -> Iterator[tuple[Model, str]]:
    """Every table of a file once, with where it stands in it."""
    waiting, seen = [(root, "")], set[Model]()
    while waiting:
        model, path = waiting.pop(0)
        if model in seen:
            continue
        seen.add(model)
        yield model, path
        for name, field in model.model_fields.items():
            if not field.exclude:
                waiting += [
                    (inner, f"{path}.{name}{many}".lstrip(".")) for inner, many in tables_within(field.annotation)
                ]


def tables_within(annotation: Any, many: str = "") -> list[tuple[Model, str]]:
    """The tables that a value may be, each with [] for a list of them and .NAME for those that have a name."""
    if inspect.isclass(annotation) and issubclass(annotation, BaseModel):
        return [(annotation, many)]
    origin = get_origin(annotation)
    inner = "[]" if origin in (list, tuple) or getattr(origin, "__name__", "") == "Sequence" else ""
    return [
        found for each in get_args(annotation)
        for found in tables_within(each, many + (".NAME" if origin is dict else inner))
    ]  # fmt: skip


def heading(model: Model, path: str, file: str) -> str:
    """Where the table stands, as a file writes it; of several kinds also which."""
    kind = model.model_fields.get("kind")
    kinds = get_args(kind.annotation) if kind is not None and get_origin(kind.annotation) is Literal else ()
    of_kind = f" of kind {' or '.join(f'`{json.dumps(each)}`' for each in kinds)}" if 0 < len(kinds) < 3 else ""
    if file == "stage":  # it is JSON
        return f'`"{path.removesuffix("[]")}"`' if path else "The file"
    plain = path.replace("[]", "")
    return (f"`[[{plain}]]`" if path.endswith("[]") else f"`[{plain}]`" if path else "The file") + of_kind


def summary(model: Model) -> str:
    """The table's docstring without the words of its keys."""
    lines, of_key = [], False
    for line in inspect.cleandoc(model.__dict__.get("__doc__") or "").splitlines():
        of_key = bool(CASE.match(line)) or (of_key and line.startswith("    "))
        lines += [] if of_key else [line]
    return "\n".join(lines).strip()


def row(model: Model, name: str, field: FieldInfo) -> str:
    meaning = meaning_of(model, name) or ""
    kind = type_of(field.annotation, field.metadata)
    cells = [f"`{name}`", kind, unit_of(kind, meaning), default_of(field), escaped(meaning)]
    return "| " + " | ".join(re.sub(r"(?<!\\)\|", r"\|", cell) for cell in cells) + " |"


def unit_of(kind: str, meaning: str) -> str:
    """The unit that the first part of a meaning names, of a key that holds numbers."""
    found = UNIT.search(meaning.partition(";")[0]) if "number" in kind else None
    return found[1] if found else ""


def meaning_of(model: Model, name: str) -> str | None:
    """What a key means, or None where nobody says it."""
    given = words_of_keys()
    for each in model.__mro__:
        if not (issubclass(each, BaseModel) and name in each.model_fields):
            continue
        docstring = words_in(each)
        for said in (docstring, *(given.get(key, {}) for key in names_of(each))):
            if name in said:
                return said[name]
    return given["any"].get(name)


def names_of(model: type) -> tuple[str, str]:
    """How the file of words may name a table."""
    return f"{model.__module__.rpartition('.')[2]}.{model.__name__}", model.__name__


@cache
def words_in(model: type) -> dict[str, str]:
    """The words of keys in a table's own docstring."""
    found: dict[str, str] = {}
    names: list[str] = []
    for line in inspect.cleandoc(model.__dict__.get("__doc__") or "").splitlines():
        case = CASE.match(line)
        if case:
            names = [name.strip() for name in case["names"].split(",")]
            found |= dict.fromkeys(names, case["text"])
        elif names and line.startswith("    "):
            found |= {name: f"{found[name]} {line.strip()}" for name in names}
        else:
            names = []
    return found


@cache
def words_of_keys() -> dict[str, dict[str, str]]:
    return tomllib.loads(Path(__file__).with_name("words_of_keys.toml").read_text(encoding="utf-8"))


def default_of(field: FieldInfo) -> str:
    """What holds where the key is left out."""
    if field.is_required():
        return "needed"
    value = field.default if field.default_factory is None else None
    if value is None or isinstance(value, BaseModel) or value in ((), [], {}, ""):
        return "–"
    return f"`{json.dumps(value)}`"


def type_of(annotation: Any, metadata: Any = ()) -> str:
    """A type in words, with its bounds."""
    if any(isinstance(each, BeforeValidator) for each in metadata):
        return also_single(annotation, metadata)
    return described(annotation) + bounds(metadata)


def also_single(annotation: Any, metadata: Any) -> str:
    """What is turned into the type before it is checked: one value for a list of them, or one number for a colour."""
    if get_origin(annotation) is list:
        (inner,) = get_args(annotation)
        return f"{described(inner)}, or a list of them"
    if get_origin(annotation) is tuple and len(set(get_args(annotation))) == 1 and ... not in get_args(annotation):
        return f"{described(annotation)}, or one number for all"
    return described(annotation) + bounds(metadata)


def described(annotation: Any) -> str:
    origin, inner = get_origin(annotation), get_args(annotation)
    plain = {str: "text", bool: "true or false", int: "whole number", float: "number", Any: "any"}
    if annotation in plain:
        return plain[annotation]
    if inspect.isclass(annotation) and issubclass(annotation, BaseModel):
        return "table"
    if origin is Annotated:
        return type_of(inner[0], inner[1:])
    if origin is Literal:
        return ", ".join(f"`{json.dumps(each)}`" for each in inner)
    if origin is dict:
        return f"table by name: {described(inner[1])}"
    if origin is tuple and ... not in inner:
        each = list(dict.fromkeys(map(described, inner)))
        return f"list of {len(inner)}: {' or '.join(each)}"
    if origin in (list, tuple) or getattr(origin, "__name__", "") == "Sequence":
        each = described(inner[0])
        return "list of tables" if each == "table" else f"list: {each}"
    choices = [described(each) for each in inner if each is not NoneType]
    return " or ".join(dict.fromkeys(choices))


def bounds(metadata: Any) -> str:
    """The bounds of a number, as pydantic keeps them."""
    words = {"gt": "above", "ge": "from", "lt": "below", "le": "to"}
    flat = [inner for each in metadata for inner in (getattr(each, "metadata", None) or [each])]
    found = [f"{words[key]} {getattr(each, key):.10g}" for each in flat for key in words if hasattr(each, key)]
    return f" {' '.join(found)}" if found else ""


def escaped(text: str) -> str:
    """Text outside of `code` in which nothing is taken for mark-up."""
    parts = text.split("`")
    return "`".join(re.sub(r"([\\*_$<\[\]|#])", r"\\\1", each) if i % 2 == 0 else each for i, each in enumerate(parts))
