"""What the reference is made of: every public name has words of its own, and examples in them run."""

from __future__ import annotations

import doctest
import inspect
import re
import warnings
from collections.abc import Iterator
from dataclasses import is_dataclass
from enum import Enum
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest
from pydantic import BaseModel

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


def unsaid(name: str, value: Any) -> list[str]:
    """The parameters of a public name, and of its methods, that no docstring speaks of.

    A method may name the one whose words hold for it too, as `Renderer.render`. What a file's table holds is on the
    pages of keys, which have a test of their own; errors are caught, and enumerations and protocols are not called.
    """
    if inspect.isclass(value) and issubclass(value, BaseModel | BaseException):
        return []
    called = not inspect.isclass(value) or not (issubclass(value, Enum) or getattr(value, "_is_protocol", False))
    calls = {name: value} if called else {}
    for part in vars(value) if inspect.isclass(value) else ():
        inner = getattr(member := inspect.getattr_static(value, part), "__func__", member)
        if not part.startswith("_") and inspect.isfunction(inner):
            calls[f"{name}.{part}"] = inner
    return [
        f"{call}: {parameter}"
        for call, made in calls.items()
        for parameter in inspect.signature(made).parameters
        if parameter != "self" and parameter != "cls" and not re.search(rf"\b{parameter}\b", words_for(made))
    ]


def words_for(value: Any) -> str:
    """A docstring, with that of the method that it names."""
    words = inspect.getdoc(value) or ""
    parent = re.search(r"`Renderer\.(render|change)`", words)
    return words + (inspect.getdoc(getattr(rl.Renderer, parent[1])) or "" if parent else "")


def test_every_parameter_is_spoken_of() -> None:
    assert sorted({each for name, value in public() for each in unsaid(name, value)}) == []


def test_a_parameter_without_words_is_found() -> None:
    def spin(picture: object, angle: float) -> None:
        """Turn a picture by an angle."""

    assert unsaid("spin", spin) == []
    spin.__doc__ = "Turn a picture."
    assert unsaid("spin", spin) == ["spin: angle"]


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
