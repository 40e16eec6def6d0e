"""The words of every warning and doubt in the source, with … where a value stands."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import TypeGuard

GAP = "…"
SAID_BY = {"warn": 0, "Doubt": 0, "BracketDoubt": 1}
"""What takes the words, and as which argument."""


@cache
def warned(source: Path) -> tuple[tuple[str, str], ...]:
    """(file:line, words) of each warning and doubt whose words are written where it is made.

    A line that is only handed on, as `warn(doubt.line)`, has its words elsewhere and is passed over.
    """
    return tuple(each for path in _modules(source) for each in _said(path, source)[0])


@cache
def texts(source: Path) -> tuple[str, ...]:
    """Every text in the source, with … where a value stands."""
    return tuple(each for path in _modules(source) for each in _said(path, source)[1])


def _modules(source: Path) -> list[Path]:
    return sorted(source.rglob("*.py"))


@cache
def _said(path: Path, source: Path) -> tuple[list[tuple[str, str]], list[str]]:
    """What `warned` and `texts` say of one module: its syntax tree is let go."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    nodes = list(ast.walk(tree))
    functions = [each for each in nodes if isinstance(each, ast.FunctionDef | ast.AsyncFunctionDef)]
    found = []
    for call in (each for each in nodes if isinstance(each, ast.Call)):
        if (at := SAID_BY.get(_called(call))) is not None and len(call.args) > at:
            inside = [each for each in functions if each.lineno <= call.lineno <= (each.end_lineno or 0)]
            for words in _words(call.args[at], inside[-1] if inside else tree):
                if len(words.replace(GAP, "").strip()) > 8:
                    found.append((f"{path.relative_to(source).as_posix()}:{call.lineno}", words))
    return found, [_text(each) for each in nodes if _is_text(each)]


def _is_text(node: ast.AST) -> TypeGuard[ast.expr]:
    return isinstance(node, ast.JoinedStr) or (isinstance(node, ast.Constant) and isinstance(node.value, str))


def _called(call: ast.Call) -> str:
    function = call.func
    return function.id if isinstance(function, ast.Name) else getattr(function, "attr", "")


def _words(node: ast.expr, function: ast.AST) -> Iterator[str]:
    """What a text can be: each branch of a condition, and each value that a local name is given."""
    if isinstance(node, ast.Name):
        for each in ast.walk(function):
            if isinstance(each, ast.Assign) and any(
                isinstance(at, ast.Name) and at.id == node.id for at in each.targets
            ):
                yield from _words(each.value, function)
    elif isinstance(node, ast.IfExp):
        yield from _words(node.body, function)
        yield from _words(node.orelse, function)
    else:
        yield _text(node)


def _text(node: ast.expr) -> str:
    if isinstance(node, ast.Constant):
        return str(node.value)
    if isinstance(node, ast.JoinedStr):
        return "".join(_text(each) for each in node.values)
    if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Add):
        return _text(node.left) + _text(node.right)
    return GAP
