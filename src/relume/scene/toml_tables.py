"""How TOML files of ours are read and checked: unknown keys refused, every fault one line that names file and key."""

from __future__ import annotations

import difflib
import tomllib
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any, TypeVar, get_origin

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from relume.errors import RelumeError

Vector = tuple[float, float, float]
Positive = Annotated[float, Field(gt=0)]
MOST_FAULTS = 8
"""Named in one line; further ones are counted."""


class Table(BaseModel):
    """A table of a file; a key it does not know is an error, never ignored."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


class DistortionTable(Table):
    """The lens's distortion in OpenCV's coefficients."""

    k1: float = 0.0
    k2: float = 0.0
    p1: float = 0.0
    p2: float = 0.0
    k3: float = 0.0


SomeTable = TypeVar("SomeTable", bound=Table)


def read_toml(path: Path, what: str, refused: type[RelumeError]) -> dict[str, Any]:
    """The contents of a TOML file; raises `refused` when it cannot be had.

    what : the kind of file for messages, like "shot file"
    """
    text = ""
    try:
        text = path.read_text(encoding="utf-8")
        return tomllib.loads(text)
    except FileNotFoundError:
        raise refused(f"{path}: no such {what}; check the path") from None
    except (OSError, UnicodeDecodeError) as error:
        raise refused(f"{path}: cannot be read ({error.__class__.__name__}); is it a text file?") from None
    except tomllib.TOMLDecodeError as error:
        fault = str(error).replace("at end of document", f"at the end, line {len(text.splitlines())}")
        raise refused(f"{path}: not valid TOML: {fault}") from None


def checked(
    model: type[SomeTable], table: dict[str, Any], path: Path, what: str, refused: type[RelumeError]
) -> SomeTable:
    """The table as a `model`; raises `refused`, naming the key and what it should be."""
    try:
        return model.model_validate(table)
    except ValidationError as error:
        raise refused(f"{path}: {_first_fault(error, model, table, what)}") from None


def checked_whole(model: type[SomeTable], table: Any, path: Path, what: str, refused: type[RelumeError]) -> SomeTable:
    """The same for long lists that other programs write: what is refused names all faults, to `MOST_FAULTS`."""
    try:
        return model.model_validate(table)
    except ValidationError as error:
        faults = error.errors()
        lines = [_line(fault, model, table, what) for fault in faults[:MOST_FAULTS]]
        more = len(faults) - len(lines)
        raise refused(f"{path}: {'; '.join(lines)}" + (f"; and {more} more" if more else "")) from None


def _first_fault(error: ValidationError, model: type[Table], table: dict[str, Any], what: str) -> str:
    faults = error.errors()
    unknown = [fault for fault in faults if fault["type"] == "extra_forbidden"]
    # A key that is misspelt is missing too; the misspelling is what helps.
    fault = next((f for f in unknown if _nearest(model, f["loc"])), faults[0])
    line = _line(fault, model, table, what)
    # A key that is missing may stand there under a name that is like none; of one table both are named.
    beside = [other for other in unknown if fault["type"] == "missing" and other["loc"][:-1] == fault["loc"][:-1]]
    return "; ".join([line, *(_line(other, model, table, what) for other in beside[:1])])


def _line(fault: Any, model: type[Table], table: dict[str, Any], what: str) -> str:
    """What one fault of pydantic's is, with its key."""
    kind, loc, context = fault["type"], fault["loc"], fault.get("ctx") or {}
    place = _place(loc, table, with_last=kind == "missing" and isinstance(loc[-1], str))
    if kind == "extra_forbidden":
        near = _nearest(model, loc)
        return f"{place}: unknown key" + (f"; did you mean {near[0]}?" if near else "; remove it or see the docs")
    if kind == "union_tag_invalid":
        return f"{place}.kind: {_unknown_kind(context['tag'], context['expected_tags'])}"
    if kind == "union_tag_not_found":
        return f"{place}.kind: missing; the {what} must have it"
    if kind == "missing" and isinstance(loc[-1], int):
        return f"{place}: too few numbers (got {fault['input']!r})"
    if kind == "missing":
        return f"{place}: missing; the {what} must have it"
    if kind == "value_error":  # ours, which say themselves what they got
        return ": ".join(filter(None, [place, fault["msg"].removeprefix("Value error, ")]))
    said: str = fault["msg"]
    message = {
        "dict_type": "Input should be a table",
        "model_type": "Input should be a table",
        "model_attributes_type": "Input should be a table",
        "tuple_type": "Input should be a list",
    }.get(kind, said)
    # The whole file has no place in itself.
    return ": ".join(filter(None, [place, f"{message[:1].lower()}{message[1:]} (got {fault['input']!r})"]))


def _unknown_kind(got: str, expected: str) -> str:
    kinds = [kind.strip(" '") for kind in expected.split(",")]
    near = difflib.get_close_matches(got, kinds, 1)
    return f"got {got!r}; expected one of {', '.join(kinds)}" + (f"; did you mean {near[0]}?" if near else "")


def _place(loc: Sequence[int | str], table: Any, with_last: bool) -> str:
    """The keys of a fault: pydantic's path without what the file does not have, such as names of types."""
    parts: list[str] = []
    for part in loc:
        entries: Any = dict(enumerate(table)) if isinstance(table, list) else table
        if isinstance(entries, dict) and part in entries:
            table = entries[part]
            parts.append(str(part))
    if with_last:
        parts.append(str(loc[-1]))
    return ".".join(parts)


def _nearest(model: type[BaseModel], loc: Sequence[int | str]) -> list[str]:
    """The known key that an unknown one is most like, if any."""
    return difflib.get_close_matches(str(loc[-1]), _known_keys(model, loc), 1)


def _known_keys(model: type[BaseModel], loc: Sequence[int | str]) -> list[str]:
    """The keys of the table that `loc` lies in."""
    within, named_by_user = [model], False
    for part in loc[:-1]:
        field = next((m.model_fields[part] for m in within if part in m.model_fields), None)
        if named_by_user or isinstance(part, int):
            named_by_user = False
        elif field is not None:
            within, named_by_user = _models_within(field.annotation), get_origin(field.annotation) is dict
        else:  # the kind that selects one table of a union
            within = [m for m in within if part in _kinds(m)] or within
    return [key for m in within for key in m.model_fields]


def _kinds(model: type[BaseModel]) -> tuple[Any, ...]:
    field = model.model_fields.get("kind")
    return getattr(field.annotation, "__args__", ()) if field else ()


def _models_within(annotation: Any) -> list[type[BaseModel]]:
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return [annotation]
    return [model for part in getattr(annotation, "__args__", ()) for model in _models_within(part)]
