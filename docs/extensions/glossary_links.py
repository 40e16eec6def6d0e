"""Links from the first use of each of the glossary's words on a page to the glossary, whatever page it is.

Pages stay plain text: nobody has to mark a word, and nobody can forget to.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from typing import Any

PAGES = ("start", "course/", "how-to/")
"""Pages that are read from the beginning; the reference is looked up."""
NARROWER = {
    "stop": r"(?:one|two|three|four|half a|a|[−-]?\d+(?:\.\d+)?) stops?\b",
    "matte": r"(?:the|its|each) matte\b(?! (?:ball|ground|surface|paint|grey|white|black|wall|table|body))|\bmattes\b",
    "response": r"(?:camera's|camera|the|recovered) response\b|\bresponse curve\b",
    "ghost": r"ghosts?\b(?!ed)",
    "variance": r"variance\b(?! reduction)",
    "clipping": r"clip(?:ping|ped|s)\b",
    "compositing": r"(?:compositing|composited)\b",
    "mesh": r"mesh(?:es)?\b",
    "grain": r"(?:the|its|film|plate's) grain\b",
    "firefly": r"firefl(?:y|ies)\b",
    "denoising": r"denois(?:ing|ed|e)\b",
}
"""Words that English uses for other things too: what has to be read for the field's meaning."""


def pattern(terms: Iterable[str]) -> re.Pattern[str]:
    """What finds the terms in running text, one group a term in the order given, the longest first where two begin.

    terms : as the glossary has them; a plural counts, and capital letters do not, but in abbreviations
    """
    parts = []
    for number, term in sorted(enumerate(terms), key=lambda each: -len(each[1])):
        words = NARROWER.get(term) or re.escape(term) + r"(?:s|es)?\b"
        words = words if term[1:] != term[1:].lower() else f"(?i:{words})"
        parts.append(rf"(?P<t{number}>\b{words})")
    return re.compile("|".join(parts))


def first_uses(text: str, terms: list[str], used: set[str]) -> Iterator[tuple[int, int, str]]:
    """Where terms that were not used yet stand in a text, from, to, which; they count as used from then on."""
    # What stands alone, as an emphasized word does, needs no words round it to be the field's.
    alone = {term.lower(): term for term in terms}.get(text.strip().lower())
    if alone and alone not in used:
        used.add(alone)
        yield 0, len(text), alone
        return
    for found in pattern(terms).finditer(text):
        term = terms[int(str(found.lastgroup)[1:])]
        if term not in used:
            used.add(term)
            yield found.start(), found.end(), term


def first_sentence(words: str) -> str:
    """A definition in short, for what the browser shows when the pointer rests on the link."""
    return re.split(r"(?<=[a-z)²])[.:;](?= [A-Z`]|$)", " ".join(words.split()), maxsplit=1)[0] + "."


def link(app: Any, doctree: Any, page: str) -> None:
    """Link the first uses on one page."""
    from docutils import nodes
    from sphinx.util.nodes import make_refnode

    if not page.startswith(PAGES):
        return
    # The terms as the glossary has them, each with the page and the anchor where it is explained.
    places = {name: place for (kind, name), place in app.env.domains["std"].objects.items() if kind == "term"}
    meanings = _meanings(app.env.get_doctree(next(iter(places.values()))[0])) if places else {}
    terms, used = sorted(places), set()
    closed = (nodes.literal, nodes.reference, nodes.title, nodes.literal_block, nodes.math, nodes.math_block, nodes.raw)
    for text in list(doctree.findall(nodes.Text)):
        if any(isinstance(above, (*closed, nodes.caption)) for above in _above(text)) or not _in_prose(text):
            continue
        parts, end = [], 0
        for start, stop, term in first_uses(text.astext(), terms, used):
            where, anchor = places[term]
            words = nodes.inline(text=text.astext()[start:stop], classes=["glossary-word"])
            parts += [nodes.Text(text.astext()[end:start])]
            parts += [make_refnode(app.builder, page, where, anchor, words, meanings.get(term))]
            end = stop
        if parts:
            text.parent.replace(text, [*parts, nodes.Text(text.astext()[end:])])


def _above(node: Any) -> Iterator[Any]:
    while (node := node.parent) is not None:
        yield node


def _in_prose(node: Any) -> bool:
    """Whether text stands in a paragraph or a list, and not in a card, a table of contents or a cell's output."""
    from docutils import nodes

    return any(isinstance(above, nodes.paragraph) for above in _above(node)) and not any(
        "cell" in " ".join(above.get("classes", [])) or above.get("is_div") for above in _above(node)
    )


def _meanings(glossary: Any) -> dict[str, str]:
    """What each term means, in a sentence."""
    from docutils import nodes

    found = {}
    for entry in glossary.findall(nodes.definition_list_item):
        words = first_sentence(next(iter(entry.findall(nodes.paragraph))).astext())
        found |= {term.astext(): words for term in entry.findall(nodes.term)}
    return found


def setup(app: Any) -> dict[str, bool]:
    app.connect("doctree-resolved", link)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
