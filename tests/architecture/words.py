"""Words that a stranger would not search for, and lines too long to read."""

from __future__ import annotations

import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path

# As a word of prose, as a part of an identifier (`is_told`) and inside a name of several words (`ToldFilm`).
PRIVATE_WORDS = re.compile(r"(?<![A-Za-z])[Tt](?:old|ells?)(?![a-z])|(?<=[a-z])T(?:old|ells?)(?![a-z])")
LONGEST_LINE = 120
WRITTEN_OTHERWISE = {"decisions", "api", "commands", "keys"}
"""Folders of documents: history, and what the site makes from the code."""


def texts(repository: Path) -> Iterator[tuple[str, str]]:
    """Everything that a reader meets: sources, documents, README. Decisions are history and stay as written."""
    files = [*repository.glob("src/**/*.py"), *repository.glob("src/**/*.pyi"), *repository.glob("src/**/*.toml")]
    files += [*repository.glob("docs/**/*.md"), *repository.glob("*.md")]
    for file in sorted(files):
        if file.name != "CHANGELOG.md" and not WRITTEN_OTHERWISE & set(file.parts):
            yield file.relative_to(repository).as_posix(), file.read_text(encoding="utf-8")


@cache
def private_words(repository: Path) -> list[str]:
    """Uses of `told` and `tells`, which hide what happens: given, named, says, warns, returns, stores."""
    return [
        f"{path}:{number}: {line.strip()}"
        for path, text in texts(repository)
        for number, line in enumerate(text.splitlines(), 1)
        if PRIVATE_WORDS.search(line)
    ]


@cache
def lines_too_long(repository: Path) -> list[str]:
    """Lines of documents above 120 characters, but for tables and addresses."""
    return [
        f"{path}:{number}: {len(line)} characters"
        for path, text in texts(repository)
        if path.endswith(".md")
        for number, line in enumerate(text.splitlines(), 1)
        if not line.lstrip().startswith("|") and len(re.sub(r"\]\([^)]*\)|https?://\S+", "", line)) > LONGEST_LINE
    ]
