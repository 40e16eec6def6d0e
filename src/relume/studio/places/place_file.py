"""A place file as the studio's document: its marks are edited above what was found, which is written anew."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import tomlkit
from tomlkit.exceptions import TOMLKitError

import relume as rl
from relume.studio.places.headers import headers
from relume.studio.shots.document import DocumentKind
from relume.studio.shots.edits import edited

IN_LINES = 4
"""Points of a mark from which on each has a line of its own."""


def edited_place(text: str, changes: Sequence[Mapping[str, Any]]) -> str:
    """The text of a place file with changes made in order, as `edited` has them; what was found stays below.

    A mark is set at ["marks", photograph, block, edge]; its table is added beside the photograph's others. Blocks and
    lengths are added after the last and taken out by their lines, so that no comment goes with them.
    Raises ValueError for a change that cannot be made.
    """
    own = rl.scene.without_found(text).rstrip()
    found = text[len(own) :] or "\n"
    for change in changes:
        own = (_changed(own, change) or edited(own + "\n", [change])).rstrip()
    return own + found


def _changed(own: str, change: Mapping[str, Any]) -> str | None:
    """The text after a change of a whole mark or of an entry of [[…]]; None for any other change."""
    kind = next((each for each in ("set", "append", "remove") if each in change), "")
    place, lines = change.get(kind), own.split("\n")
    if not isinstance(place, list) or not place:
        return None
    if kind == "set" and len(place) == 4 and place[0] == "marks":
        return _marked(own, *map(str, place[1:]), points=change.get("value"))
    tables = headers(lines)
    entries = [number for number, keys in tables if keys == [place[0]] and lines[number].lstrip().startswith("[[")]
    if kind == "append" and len(place) == 1 and entries and isinstance(change.get("value"), dict):
        return _inserted(lines, _end_of(lines, entries[-1]), ["", *_written(place[0], change)])
    if len(place) < 2 or not isinstance(place[1], int) or not 0 <= place[1] < len(entries):
        return None
    begin = entries[place[1]]
    if kind == "remove" and len(place) == 2:
        # With the tables inside it.
        last = [number for number, keys in tables if number >= begin and keys[0] == place[0]]
        after = next((number for number in entries if number > begin), len(lines))
        end = _end_of(lines, max(number for number in last if number < after))
        return "\n".join([*lines[:begin], *lines[end:]]).replace("\n\n\n", "\n\n")
    if kind == "set" and len(place) == 3 and place[2] not in tomlkit.parse(own)[place[0]][place[1]]:  # pyright: ignore
        return _inserted(lines, _end_of(lines, begin), _written(place[2], change))
    return None


def _marked(own: str, photograph: str, block: str, edge: str, *, points: Any) -> str:
    """The text with a mark; points as pixels to a hundredth."""
    if not isinstance(points, list) or not points or not all(map(_is_pixel, points)):
        raise ValueError("a mark is a list of points, each two numbers")
    rounded = [[round(float(x), 2), round(float(y), 2)] for x, y in points]
    value = tomlkit.array().multiline(len(rounded) > IN_LINES)
    value.extend(rounded)
    try:
        document = tomlkit.parse(own + "\n")
        marks: Any = document.get("marks", {})
        table = marks.get(photograph, {}).get(block)
        if table is not None:
            table[edge] = value
            return tomlkit.dumps(document)
    except (TOMLKitError, AttributeError, TypeError) as error:
        raise ValueError(f"the file has no such place to change ({type(error).__name__}: {error})") from None
    keys = [tomlkit.key(key).as_string() for key in ("marks", photograph, block, edge)]
    lines = own.split("\n")
    beside = [number for number, found in headers(lines) if found[:2] == ["marks", photograph]]
    end = _end_of(lines, beside[-1]) if beside else len(lines)
    added = ["", f"[{'.'.join(keys[:3])}]", *f"{keys[3]} = {value.as_string()}".split("\n")]
    return _inserted(lines, end, added)


def _written(key: str, change: Mapping[str, Any]) -> list[str]:
    """The lines of a key, or of an entry of [[…]], as in a file of its own."""
    (kind,) = {"set", "append"} & set(change)
    return edited("", [{kind: [key], "value": change["value"]}]).rstrip().split("\n")


def _inserted(lines: list[str], number: int, added: list[str]) -> str:
    return "\n".join([*lines[:number], *added, *lines[number:]])


def _end_of(lines: list[str], begin: int) -> int:
    """The line after the table that begins at a line."""
    end = next((number for number, _ in headers(lines) if number > begin), len(lines))
    while not lines[end - 1].strip() or lines[end - 1].lstrip().startswith("#"):
        end -= 1
    # A comment right below a table's last line is of that table; one after an empty line is of the next.
    while end < len(lines) and lines[end].lstrip().startswith("#"):
        end += 1
    return end


def _is_pixel(point: Any) -> bool:
    return isinstance(point, list) and len(point) == 2 and all(isinstance(each, int | float) for each in point)


PLACE = DocumentKind(edited_place, lambda path: rl.scene.read_place_bodies(path), "photographs: missing")
