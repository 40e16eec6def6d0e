"""The headers of a TOML text: by them a place file is known, sound or not, and a table finds its neighbours."""

from __future__ import annotations

import re
from pathlib import Path

import relume as rl

HEADER = re.compile(r"^\s*\[\[?[^\[\],=]+\]\]?\s*(?:#.*)?$")
"""A line that begins a table, and none within a list of points."""


def headers(lines: list[str]) -> list[tuple[int, list[str]]]:
    """The number of each line that begins a table, and the table's keys."""
    return [(number, _keys(line)) for number, line in enumerate(lines) if HEADER.match(line)]


def _keys(header: str) -> list[str]:
    return [key.strip().strip("\"'") for key in header.partition("#")[0].strip().strip("[]").split(".")]


def is_place_file(path: Path) -> bool:
    """Whether a file of TOML is a place file and no shot: it has [[blocks]] or [[photographs]], sound or not.

    Raises UnreadableFile; ValueError for photogrammetry, in which there is nothing to mark.
    """
    try:
        text = path.read_text(encoding="utf-8", errors="replace")
    except OSError as error:
        raise rl.errors.UnreadableFile(f"{path}: cannot be read ({error.strerror})") from None
    tables = {keys[0] for _, keys in headers(text.splitlines())}
    if "photogrammetry" in tables:
        raise ValueError(f"{path}: its cameras were found elsewhere, so that there is nothing to mark in it")
    return bool(tables & {"blocks", "photographs"})
