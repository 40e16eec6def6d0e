"""What documents, examples and benchmarks name exists: modules, public names and files."""

from __future__ import annotations

import ast
import re
from importlib import import_module
from pathlib import Path
from types import ModuleType

import pytest

import relume as rl

ROOT = Path(__file__).parents[1]
SCRIPTS = [path for folder in ("benchmarks", "examples") for path in (ROOT / folder).rglob("*.py")]
PAGES = (
    path for path in (ROOT / "docs").rglob("*.md") if not {"decisions", "api", "commands", "keys"} & set(path.parts)
)
DOCUMENTS = [ROOT / "README.md", *PAGES]  # decisions keep the names of their day; the reference is made from the code
FILE = re.compile(r"(?:src/relume|tests|benchmarks|examples)/[\w/.-]+\.(?:py|md|toml)")


def missing_imports(text: str) -> list[str]:
    """Names imported from relume that are not there."""
    wanted = [each for each in ast.walk(ast.parse(text)) if isinstance(each, ast.ImportFrom)]
    pairs = [(each.module, alias.name) for each in wanted for alias in each.names if each.module]
    return [
        f"{module}.{name}" for module, name in pairs if module.split(".")[0] == "relume" and not exists(module, name)
    ]


def exists(module: str, name: str) -> bool:
    try:
        return hasattr(import_module(module), name) or bool(import_module(f"{module}.{name}"))
    except ImportError:
        return False


def missing_names(text: str) -> list[str]:
    """Names like rl.tone.x that a public module does not have."""
    missing = []
    for chain in re.findall(r"\brl\.([A-Za-z_]\w*(?:\.[A-Za-z_]\w*)*)", text):
        here: object = rl
        for name in chain.split("."):
            if not hasattr(here, name):
                missing.append(f"rl.{chain}")
                break
            here = getattr(here, name)
            if not isinstance(here, ModuleType):
                break
    return missing


@pytest.mark.parametrize("path", SCRIPTS, ids=lambda path: path.stem)
def test_a_script_imports_what_exists(path: Path) -> None:
    text = path.read_text(encoding="utf-8")
    assert missing_imports(text) + missing_names(text) == []


@pytest.mark.parametrize("path", DOCUMENTS, ids=lambda path: path.stem)
def test_a_document_names_what_exists(path: Path) -> None:
    text = path.read_text(encoding="utf-8")
    assert missing_names(text) == []
    assert [name for name in FILE.findall(text) if not (ROOT / name).exists()] == []


def test_what_is_not_there_is_found() -> None:
    assert missing_imports("from relume.image import files, nothing") == ["relume.image.nothing"]
    assert missing_names("rl.tone.nothing and rl.files.read") == ["rl.tone.nothing"]
