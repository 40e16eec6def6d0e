"""Edits of a shot or place file's text: values are set, taken out and added, and all else stays as it was written."""

from __future__ import annotations

from collections.abc import Mapping, MutableMapping, Sequence
from typing import Any

import tomlkit
from tomlkit.exceptions import TOMLKitError
from tomlkit.items import AoT, InlineTable, Table


def edited(text: str, changes: Sequence[Mapping[str, Any]]) -> str:
    """The text of a shot or place file with changes made in order; comments and formatting of the rest are kept.

    changes : {"set": place, "value": value}, {"remove": place} or {"append": place, "value": value}; a place is keys
        and numbers from the top, ["objects", 1, "translate"]. Tables on the way are made where missing
    Raises ValueError for a change that cannot be made.
    """
    try:
        document = tomlkit.parse(text)
        for change in changes:
            # Parsed anew, so that what comes next finds a text as a person would have written it.
            document = tomlkit.parse(tomlkit.dumps(_changed(document, change)))
        return tomlkit.dumps(document)
    except (TOMLKitError, KeyError, IndexError, TypeError, AttributeError) as error:
        raise ValueError(f"the file has no such place to change ({type(error).__name__}: {error})") from None


def _changed(document: tomlkit.TOMLDocument, change: Mapping[str, Any]) -> tomlkit.TOMLDocument:
    kinds = [kind for kind in ("set", "remove", "append") if kind in change]
    if len(kinds) != 1:
        raise ValueError("a change is one of set, remove and append")
    place = change[kinds[0]]
    if not isinstance(place, list) or not place or not all(isinstance(part, str | int) for part in place):
        raise ValueError("the place of a change is a list of keys and numbers")
    if kinds[0] != "remove" and len(place) > 1 and place[0] not in document:
        # A table of its own at the end, after an empty line.
        before = tomlkit.dumps(document).rstrip("\n")
        document = tomlkit.parse(f"{before}{before and 2 * chr(10)}[{tomlkit.key(str(place[0])).as_string()}]\n")
    table: Any = document
    within: Any = None
    for depth, part in enumerate(place[:-1]):
        if kinds[0] != "remove" and isinstance(table, MutableMapping) and part not in table:
            # What is missing on the way is made in one piece.
            value = change["value"] if kinds[0] == "set" else [change["value"]]
            for key in reversed(place[depth + 1 :]):
                value = {key: value}
            table[part] = _plain(value)
            return document
        within, table = table, table[part]
    if kinds[0] == "remove":
        del table[place[-1]]
    elif kinds[0] == "set" and isinstance(table, InlineTable) and place[-1] not in table:
        within[place[-2]] = _inline({**table.unwrap(), str(place[-1]): change["value"]})
    elif kinds[0] == "set":
        table[place[-1]] = _plain(change["value"])
    elif place[-1] in table:
        entries, value = table[place[-1]], change["value"]
        if isinstance(entries, AoT):
            entries.append(_block(value))
            before, header, after = tomlkit.dumps(document).rpartition(f"[[{place[-1]}]]")
            document = tomlkit.parse(before.rstrip("\n") + "\n\n" + header + after)
        else:
            entries.append(_plain(value))
    elif isinstance(change["value"], dict) and len(place) == 1:
        before = tomlkit.dumps(document).rstrip("\n")
        lines = [
            f"{tomlkit.key(key).as_string()} = {tomlkit.item(_plain(v)).as_string()}"
            for key, v in change["value"].items()
        ]
        document = tomlkit.parse(
            "\n".join([f"{before}{before and 2 * chr(10)}[[{tomlkit.key(str(place[0])).as_string()}]]", *lines]) + "\n"
        )
    else:
        table[place[-1]] = _plain([change["value"]])
    return document


def _block(value: Mapping[str, Any]) -> Table:
    """An entry of [[…]], with an empty line after it, as people write them."""
    table = tomlkit.table()
    for key, each in value.items():
        table[key] = _plain(each)
    table.add(tomlkit.nl())
    return table


def _inline(value: Mapping[str, Any]) -> InlineTable:
    """A table in one line, spaced as people write it."""
    entries = [
        f"{tomlkit.key(key).as_string()} = {tomlkit.item(_plain(each)).as_string()}" for key, each in value.items()
    ]
    found = tomlkit.parse(f"table = {{ {', '.join(entries)} }}\n")["table"]
    assert isinstance(found, InlineTable)
    return found


def _plain(value: Any) -> Any:
    """A value of JSON as one of TOML; a list of tables has its entries in lines."""
    if value is None:
        raise ValueError("the file has no empty values; remove the key")
    if isinstance(value, dict):
        return _inline(value)
    if isinstance(value, list) and value and isinstance(value[0], dict):
        found = tomlkit.array().multiline(True)
        for each in value:
            found.append(_inline(each))
        return found
    return value
