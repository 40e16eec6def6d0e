"""Running commands in this process, for the tests of every command."""

from __future__ import annotations

import json
import re
from collections.abc import Iterable
from typing import Any, NamedTuple

import pytest

from relume.cli import main


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
