"""The pages that readers copy from, and the code on them."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import cache
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from types import ModuleType

ROOT = Path(__file__).resolve().parents[2]
FENCE = re.compile(r"^(?P<indent> *)```(?P<language>[^\n`]*)\n(?P<code>.*?)^(?P=indent)```[ ]*$", re.S | re.M)
MADE_BY_THE_SITE = ("docs/reference/api", "docs/reference/commands", "docs/reference/keys")
"""Folders that the site writes from the code; a clean clone has none of them."""
ALIASES = {"py": "python", "bash": "sh", "shell": "sh"}
LANGUAGES = {"python", "sh", "toml", "json", "console", "text"}
"""What a block may be: each is run, read, or, as `console` and `text`, what a program prints."""


@dataclass(frozen=True)
class Block:
    """A block of code on a page.

    page : its path below the repository, with `/`
    line : the line of the page on which the code begins
    language : the word behind the three marks, in small letters
    code : the text between the marks
    """

    page: str
    line: int
    language: str
    code: str

    @property
    def place(self) -> str:
        return f"{self.page}:{self.line}"


def extension(name: str) -> ModuleType:
    """An extension of the site, by its path: the site's own folder is on no test's path."""
    described = spec_from_file_location(f"extension_{name}", ROOT / "docs" / "extensions" / f"{name}.py")
    assert described is not None and described.loader is not None
    module = module_from_spec(described)
    described.loader.exec_module(module)
    return module


@cache
def pages() -> tuple[Path, ...]:
    """The pages for readers: lessons have a test of their own, and decisions are history."""
    found = [*ROOT.glob("*.md"), *ROOT.glob("docs/*.md"), *ROOT.glob("docs/how-to/**/*.md")]
    found += ROOT.glob("docs/reference/**/*.md")
    return tuple(sorted(page for page in found if page.name != "CHANGELOG.md" and not made_by_the_site(page)))


def made_by_the_site(path: Path, root: Path = ROOT) -> bool:
    """Whether a path lies in a folder that the site writes.

    root : the repository
    """
    return any(path.is_relative_to(root / folder) for folder in MADE_BY_THE_SITE)


@cache
def blocks(page: Path) -> tuple[Block, ...]:
    """A page's blocks of code; those of the site's own mark-up, like `{toctree}`, hold none."""
    text = page.read_text(encoding="utf-8")
    name = page.relative_to(ROOT).as_posix()
    return tuple(
        Block(
            name,
            text[: found.start("code")].count("\n") + 1,
            ALIASES.get(found["language"].strip(), found["language"].strip()),
            found["code"],
        )
        for found in FENCE.finditer(text)
        if not found["language"].startswith("{")
    )


def of_language(language: str) -> Iterator[Block]:
    """The blocks of one language on all pages."""
    return (block for page in pages() for block in blocks(page) if block.language == language)


def without_proof(reasons: Iterable[str]) -> list[str]:
    """The reasons not to run something that name no test, or one that is not there."""
    proofs = {why: re.findall(r"tests/[\w/.]*\w", why) for why in reasons}
    return [why for why, named in proofs.items() if not named or not all((ROOT / each).exists() for each in named)]
