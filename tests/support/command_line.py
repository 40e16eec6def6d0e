"""Running a command that has to fail, for the tests of every command."""

from __future__ import annotations

from collections.abc import Sequence

import pytest

from relume.cli import main


def refused(arguments: Sequence[str], capsys: pytest.CaptureFixture[str], code: int = 2) -> str:
    """Run a command that must fail with `code`; its one line on standard error."""
    assert main(list(arguments)) == code
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err.count("\n") == 1 and captured.err.startswith("relume: "), captured.err
    assert "Traceback" not in captured.err
    assert ("fault in relume" in captured.err) == (code == 1), captured.err
    return captured.err
