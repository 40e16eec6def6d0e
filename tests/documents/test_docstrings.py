"""What the reference is made of: every public name has words of its own, and examples in them run."""

from __future__ import annotations

import doctest
import inspect
import re
import warnings
from collections.abc import Iterator
from dataclasses import is_dataclass
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

import relume as rl
import relume.cluster

SOURCE = Path(rl.__file__).parent
MODULES = {"rl": rl, "relume.cluster": relume.cluster} | {
    f"rl.{name}": value for name in dir(rl) if isinstance(value := getattr(rl, name), ModuleType)
}
WITH_EXAMPLES = sorted(path for path in SOURCE.rglob("*.py") if ">>> " in path.read_text(encoding="utf-8"))


def public() -> Iterator[tuple[str, Any]]:
    """Every public class and function of ours by its name."""
    for path, module in MODULES.items():
        for name in dir(module):
            value = getattr(module, name)
            if not name.startswith("_") and callable(value) and _is_ours(value):
                yield f"{path}.{name}", value


def _is_ours(value: Any) -> bool:
    return str(getattr(value, "__module__", "")).startswith("relume")


def without_words(name: str, value: Any) -> list[str]:
    """The name, and those of its public methods and properties, that have no docstring; inherited ones count."""
    words = inspect.getdoc(value) if not inspect.isclass(value) else value.__doc__
    made = is_dataclass(value) and (value.__doc__ or "").startswith(f"{getattr(value, '__name__', '')}(")
    missing = [] if words and not made else [name]
    for part in vars(value) if inspect.isclass(value) else ():
        member = inspect.getattr_static(value, part)
        inner = getattr(member, "fget", None) or getattr(member, "func", None) or getattr(member, "__func__", member)
        if not part.startswith("_") and inspect.isfunction(inner) and not inspect.getdoc(getattr(value, part)):
            missing.append(f"{name}.{part}")
    return missing


def test_every_public_name_has_a_docstring() -> None:
    assert [each for name, value in public() for each in without_words(name, value)] == []


def first_sentence_is_whole(words: str) -> bool:
    """Whether a docstring opens with one line that ends as a sentence does."""
    return bool(re.search(r"[.?:;…)]$", words.split("\n\n")[0].rstrip()))


def test_every_docstring_opens_with_a_sentence() -> None:
    cut = [name for name, value in public() if not first_sentence_is_whole(inspect.getdoc(value) or "")]
    assert cut == []


def test_a_name_without_words_is_found() -> None:
    class Silent:
        """A class."""

        def speak(self) -> None: ...

    assert without_words("Silent", Silent) == ["Silent.speak"]
    assert not first_sentence_is_whole("The radiance\n\nof a map.")


@pytest.mark.parametrize("path", WITH_EXAMPLES, ids=lambda path: path.stem)
def test_the_examples_of_a_module_run(path: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    module = import_module("relume." + ".".join(path.relative_to(SOURCE).with_suffix("").parts))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)
        result = doctest.testmod(module, optionflags=doctest.NORMALIZE_WHITESPACE)
    assert result.attempted > 0 and result.failed == 0


def test_some_examples_are_there() -> None:
    assert len(WITH_EXAMPLES) >= 6
