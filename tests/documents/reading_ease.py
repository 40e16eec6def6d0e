"""How hard a page is to read, as a school grade, from the lengths of its sentences and words."""

from __future__ import annotations

import re
from collections.abc import Iterator

from documents.pages import FENCE

INDENTED = re.compile(r"(?m)(?<=\n\n)(?: {4}.*\n|\n)+")
"""A block of code without marks; an item of a list that goes on after an empty line is indented less."""
COMMENT = re.compile(r"<!--.*?-->", re.S)
COLONS = re.compile(r"(?ms)^ *(:{3,})\{.*?^ *\1 *$")
NAME = "§"
"""What stands for a piece of code, or a formula, in a line."""
CODE = re.compile(r"`[^`]*`")
DISPLAYED = re.compile(r"\$\$.*?\$\$", re.S)
FORMULA = re.compile(r"\$[^$\n]+\$")
IMAGE = re.compile(r"!\[[^\]]*\]\([^)]*\)")
LINK = re.compile(r"\[([^\]]*)\]\([^)]*\)")
ROLE = re.compile(r"\{[\w:-]+\}")
NOT_PROSE = re.compile(r"^\s*(?:#|\||>? ?\[!|\(\S+\)=$|</?\w)")
ITEM = re.compile(r"^\s*(?:[-*+]|\d+\.)\s+")
END = re.compile(r"(?<=[.!?])[\"”’)*]*\s+(?=[\"“‘(*]*[A-ZÀ-Þ0-9§_])")
WORD = re.compile(r"[A-Za-zÀ-ÿ]+(?:['’][A-Za-z]+)?")

VOWELS = re.compile(r"[aeiouyà-öø-ÿ]+")
SILENT = re.compile(
    r"(?<=[^aeiouy])e$|(?<=[^aeiouytd])ed$|(?<=[^aeiouysxzcg])(?<![cs]h)es$|(?<=[^aeiouy])e(?=ly$|ment|ful|less|where)"
)
SPOKEN = re.compile(r"[^aeiouyl]le[sd]?$|[^aeiouy]sms?$|tres?$|rithm")
APART = re.compile(
    r"(?<![cstg])i[ao](?!u)|tio$|i(?:um|us|er$|ent|est$|ence)|[^q]ua[lt]|u[aeio]n[ct]|uous|[^aeiou]eo(?!p)|crea[^s]|linea|area"
    r"|real?i|[a-z][aeo]y[aeiou]|[aeio]ing$"
)


def grade(page: str) -> float:
    """The Flesch-Kincaid grade of a page: the years at school that a native reader needs.

    It is 0.39 words per sentence + 11.8 syllables per word − 15.59 (Kincaid et al. 1975). A piece of code, or a
    formula, in a line makes its sentence one word longer, without syllables of its own; numbers count as none.

    page : the page's text, in Markdown
    """
    return sum(_parts(list(sentences(page)))) - 15.59


def hardest(page: str) -> list[tuple[float, str]]:
    """A page's paragraphs and items with the grade of each, the hardest first.

    page : the page's text, in Markdown
    """
    graded = [(sum(_parts(list(_split(each)))) - 15.59, each) for each in paragraphs(page) if WORD.search(each)]
    return sorted(graded, reverse=True)


def _parts(parts: list[str]) -> tuple[float, float]:
    words = [word for sentence in parts for word in WORD.findall(sentence)]
    length = len(words) + sum(sentence.count(NAME) for sentence in parts)
    return 0.39 * length / len(parts), 11.8 * sum(map(syllables, words)) / len(words)


def sentences(page: str) -> Iterator[str]:
    """The sentences of a page's running text; an item of a list ends one."""
    for paragraph in paragraphs(page):
        yield from _split(paragraph)


def _split(paragraph: str) -> Iterator[str]:
    return (each for each in END.split(paragraph) if WORD.search(each))


def paragraphs(page: str) -> Iterator[str]:
    """The paragraphs and items of a page: no blocks of code, tables, headings, formulas or addresses of links."""
    text = COLONS.sub("\n", COMMENT.sub("", FENCE.sub("\n\n", INDENTED.sub("\n", page))))
    text = CODE.sub(NAME, LINK.sub(r"\1", ROLE.sub("", IMAGE.sub("", FORMULA.sub(NAME, DISPLAYED.sub("", text))))))
    lines: list[str] = []
    for line in [*text.splitlines(), ""]:
        item = ITEM.match(line)
        if lines and (item or not line.strip() or NOT_PROSE.match(line)):
            yield " ".join(lines)
            lines = []
        if line.strip() and not NOT_PROSE.match(line):
            lines.append(ITEM.sub("", line).strip())


def syllables(word: str) -> int:
    """How many syllables an English word has, by its groups of vowels; of 100 running words of our pages 99
    come out right."""
    small = re.sub(r"['’]\w*$", "", word.lower())
    count = len(VOWELS.findall(SILENT.sub("", small)))
    return max(1, count + len(SPOKEN.findall(small)) + len(APART.findall(small)))
