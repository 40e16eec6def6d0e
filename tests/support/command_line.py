"""Running commands in this process, for the tests of every command."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Iterable
from copy import copy
from typing import Any, NamedTuple

import pydantic
import pytest
from cyclopts import App
from cyclopts.argument import ArgumentCollection

from relume.cli import main

# A command describes its options and builds their checks anew, which takes ten milliseconds: a process of the suite
# gives the same commands hundreds of times.
_described = App.assemble_argument_collection
_adapter = pydantic.TypeAdapter
_kept: dict[Any, ArgumentCollection] = {}
_adapters: dict[Any, Any] = {}


def _options(self: App, *, default_parameter: Any = None, parse_docstring: bool = False) -> ArgumentCollection:
    """The options of a command, described once; each call gets its own without words."""
    command: Callable[..., Any] | None = self.default_command
    if command is None or default_parameter is not None or not command.__module__.startswith("relume.cli."):
        return _described(self, default_parameter=default_parameter, parse_docstring=parse_docstring)
    key = (command, parse_docstring)
    if key not in _kept:
        _kept[key] = _described(self, parse_docstring=parse_docstring)
    own = {id(old): copy(old) for old in _kept[key]}
    for each in own.values():
        each.tokens = []
        each.children = ArgumentCollection([own[id(child)] for child in each.children])
    return ArgumentCollection(own.values())


def _adapted(hint: Any) -> Any:
    """What checks values of a type, built once."""
    try:
        if hint not in _adapters:
            _adapters[hint] = _adapter(hint)
        return _adapters[hint]
    except TypeError:  # a type that cannot be hashed
        return _adapter(hint)


App.assemble_argument_collection = _options
pydantic.TypeAdapter = _adapted  # pyright: ignore[reportAttributeAccessIssue]


class Printed(NamedTuple):
    """What a command wrote on standard output and on standard error."""

    out: str
    err: str


def printed(arguments: Iterable[object], capsys: pytest.CaptureFixture[str], code: int = 0) -> Printed:
    """Run a command that must end with `code`; what it prints."""
    capsys.readouterr()
    ended = main([str(each) for each in arguments])
    captured = capsys.readouterr()
    assert ended == code, captured.err
    return Printed(captured.out, captured.err)


def reported(arguments: Iterable[object], capsys: pytest.CaptureFixture[str], code: int = 0) -> dict[str, Any]:
    """Run a command that must end with `code`; what it prints as JSON."""
    return json.loads(printed([*arguments, "--json"], capsys, code).out)


def refused(arguments: Iterable[object], capsys: pytest.CaptureFixture[str], code: int = 2) -> str:
    """Run a command that must fail with `code`; its one line on standard error."""
    out, err = printed(arguments, capsys, code)
    # A slow machine is said to be at work before that: a stage of 15 s or more.
    err = re.sub(r"(?m)^relume: [\w %,]+ so far\b.*\n", "", err)
    assert out == ""
    assert err.count("\n") == 1 and err.startswith("relume: "), err
    assert "Traceback" not in err
    assert ("fault in relume" in err) == (code == 1), err
    return err
