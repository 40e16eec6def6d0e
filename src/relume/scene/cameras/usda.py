"""The text form of USD: prims with their attributes, as far as a camera and the prims that place it need it."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from relume.errors import FormatError

TOKEN = re.compile(
    r"""(?P<blank>[\s;,]+|\#[^\n]*)
      | (?P<string>\"\"\"(?:[^\\]|\\.)*?\"\"\"|'''(?:[^\\]|\\.)*?'''|"(?:[^"\\\n]|\\.)*"|'(?:[^'\\\n]|\\.)*')
      | (?P<asset>@@@.*?@@@|@[^@\n]*@)
      | (?P<path><[^>\n]*>)
      | (?P<number>[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?(?![\w.])|[-+]?(?:inf|nan)\b)
      | (?P<name>[A-Za-z_!][\w:.!|]*(?:\[\])?)
      | (?P<mark>[(){}\[\]=:&?*./+-])""",
    re.VERBOSE | re.DOTALL,
)
"""Commas and semicolons part values, which blanks do as well."""
SPECIFIERS = {"def", "over", "class"}
QUALIFIERS = {"uniform", "custom", "varying", "prepend", "append", "add", "delete", "reorder", "config"}
"""Words before an attribute's type that do not change what it holds."""


@dataclass(frozen=True)
class Prim:
    """A prim of a USD layer.

    kind : its type, such as "Camera"; "" for none
    attributes : values by name; numbers, strings, lists, and dicts of time samples under "….timeSamples"
    metadata : what stands in parentheses behind its name
    """

    kind: str
    name: str
    attributes: dict[str, Any] = field(default_factory=dict)
    metadata: dict[str, Any] = field(default_factory=dict)
    children: list[Prim] = field(default_factory=list)


def read_usda(path: Path, text: str) -> Prim:
    """A layer as a nameless prim: its metadata and top prims. Raises FormatError for what is no USD text."""
    if not text.startswith("#usda"):
        raise FormatError(path, "USD", "line 1", "#usda 1.0", repr(text[:12]), "save it as .usda")
    reader = _Reader(path, text)
    layer = Prim("", "")
    try:
        if reader.at("("):
            layer.metadata.update(reader.assignments(")"))
        while not reader.done:
            reader.statement(layer)
    except RecursionError:
        raise FormatError(path, "USD", "its nesting", "a few levels", "hundreds", "export it again as .usda") from None
    return layer


class _Reader:
    def __init__(self, path: Path, text: str) -> None:
        self.path, self.text, self.tokens, self.next = path, text, [], 0
        end = 0
        while end < len(text):
            found = TOKEN.match(text, end)
            if found is None:
                raise self.fault(end, "a word, number or string", repr(text[end : end + 12]))
            if found.lastgroup != "blank":
                self.tokens.append((str(found.lastgroup), found.group(), end))
            end = found.end()

    @property
    def done(self) -> bool:
        return self.next >= len(self.tokens)

    def fault(self, place: int, expected: str, found: str) -> FormatError:
        where = f"line {self.text.count(chr(10), 0, place) + 1}"
        return FormatError(self.path, "USD", where, expected, found, "export it again as .usda")

    def take(self, expected: str = "") -> tuple[str, str, int]:
        if self.done:
            raise self.fault(len(self.text), expected or "more", "the end")
        token = self.tokens[self.next]
        if expected and token[1] != expected:
            raise self.fault(token[2], expected, token[1])
        self.next += 1
        return token

    def at(self, mark: str) -> bool:
        """Whether the next token is `mark`, which is then taken."""
        if not self.done and self.tokens[self.next][1] == mark:
            self.next += 1
            return True
        return False

    def statement(self, prim: Prim) -> None:
        """One child prim, attribute, relationship or variant set of a prim."""
        if self.tokens[self.next][1] in SPECIFIERS:
            prim.children.append(self.prim())
        elif self.tokens[self.next][1] == "variantSet":
            self.variants()
        else:
            name, value = self.assignment()
            if value is not None:
                prim.attributes[name] = value

    def prim(self) -> Prim:
        self.take()
        kind, text, _ = self.take()
        name = text
        if kind == "name":
            name = self.take()[1]
        found = Prim(text if kind == "name" else "", name.strip("\"'"))
        if self.at("("):
            found.metadata.update(self.assignments(")"))
        self.take("{")
        while not self.at("}"):
            if self.done:
                self.take("}")
            self.statement(found)
        return found

    def variants(self) -> None:
        """What a variant holds is left out: which one is chosen is another program's to say."""
        self.take()
        self.take()
        self.take("=")
        self.value()

    def assignments(self, end: str) -> dict[str, Any]:
        """`name = value` until `end`; a lone string is a comment."""
        found: dict[str, Any] = {}
        while not self.at(end):
            if self.done:
                self.take(end)
            if self.tokens[self.next][0] == "string":
                self.take()
                continue
            name, value = self.assignment()
            found[name] = value
        return found

    def assignment(self) -> tuple[str, Any]:
        """Qualifiers, a type, a name and a value where there is one; the metadata behind it is skipped."""
        word = self.take()
        while word[1] in QUALIFIERS:
            word = self.take()
        if word[0] not in ("name", "string"):
            raise self.fault(word[2], "a name", word[1])
        if not self.done and self.tokens[self.next][0] in ("name", "string"):
            word = self.take()  # that was the type
        value = self.value() if self.at("=") else None
        if self.at("("):
            self.assignments(")")
        return word[1].strip("\"'"), value

    def value(self) -> Any:
        kind, text, place = self.take()
        if kind == "number":
            return float(text)
        if kind == "asset":
            # A reference: the prim in the other file, and how its times are shifted.
            if not self.done and self.tokens[self.next][0] == "path":
                self.take()
            if self.at("("):
                self.assignments(")")
            return text
        if kind in ("string", "path", "name"):
            return text[3:-3] if text[:3] in ('"""', "'''") else text.strip("\"'")
        if text in "([":
            end, items = {"(": ")", "[": "]"}[text], []
            while not self.at(end):
                items.append(self.value())
            return items
        if text == "{":
            return self.table()
        raise self.fault(place, "a value", text)

    def table(self) -> dict[Any, Any]:
        """A dictionary, time samples, or the prims and attributes of a variant."""
        found: dict[Any, Any] = {}
        while not self.at("}"):
            if self.done:
                self.take("}")
            kind, text, _ = self.tokens[self.next]
            if text in SPECIFIERS:
                self.prim()
            elif kind == "number":
                time = float(self.take()[1])
                self.take(":")
                found[time] = self.value()
            elif kind == "string":
                # A variant: its name, its metadata, its prims.
                self.take()
                if self.at("("):
                    self.assignments(")")
                self.value()
            else:
                name, value = self.assignment()
                found[name] = value
        return found
