"""The glossary says of each word what it means and where it comes from; pages link to it where they use it first."""

from __future__ import annotations

import re

import pytest

from documents.pages import ROOT, extension

GLOSSARY = (ROOT / "docs" / "reference" / "glossary.md").read_text(encoding="utf-8")


LINKS = extension("glossary_links")


def entries() -> dict[str, str]:
    """Each word with its definition."""
    body = GLOSSARY.split("```{glossary}\n")[1].split("\n```")[0]
    found = {}
    for entry in body.split("\n\n"):
        lines = entry.splitlines()
        meaning = " ".join(line.strip() for line in lines if line.startswith(" "))
        found |= {line: meaning for line in lines if not line.startswith(" ")}
    return found


def test_every_word_has_a_meaning_and_a_name_in_the_code() -> None:
    assert len(entries()) > 50
    assert [word for word, meaning in entries().items() if not re.match(r"[A-Z].{15,}[.:]", meaning)] == []
    assert [word for word, meaning in entries().items() if not re.search(r"`[^`]+`", meaning)] == []
    words = [word.lower() for word in entries()]
    assert words == sorted(words, key=lambda word: word.replace("–", " ").replace("-", " "))


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("The environment map, and then environment maps.", ["environment map"]),
        ("Radiance is light along a ray; radiance again.", ["radiance"]),
        ("Irradiance and irradiances", ["irradiance"]),
        ("It stops when the picture is sharp.", []),
        ("It is 3.5 stops brighter.", ["stop"]),
        ("A matte ball, and the matte of the object.", ["matte"]),
        ("An HDR file; an hdr suffix.", ["HDR"]),
        ("meshes", ["mesh"]),
        ("response", ["response"]),
        ("The light constellation has lamps; a light stage has more.", ["light constellation", "light stage"]),
    ],
)
def test_the_first_use_is_found_and_no_other(text: str, expected: list[str]) -> None:
    used: set[str] = set()
    found = list(LINKS.first_uses(text, sorted(entries()), used))
    assert [term for _, _, term in found] == expected and used == {*expected}
    assert list(LINKS.first_uses(text, sorted(entries()), used)) == []


def test_every_narrower_word_is_in_the_glossary() -> None:
    assert set(LINKS.NARROWER) <= set(entries())


def test_a_meaning_is_shown_in_a_sentence() -> None:
    assert LINKS.first_sentence("A factor of two, e.g. in exposure. More.") == "A factor of two, e.g. in exposure."
