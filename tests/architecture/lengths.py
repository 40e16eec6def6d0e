"""How much a reader has to hold at once: long functions, and long ones without a comment that names their steps."""

from __future__ import annotations

import io
import tokenize
from functools import cache
from pathlib import Path

from architecture.tree import functions, is_kernel, modules

LONGEST_FUNCTION = 100
NEEDS_STEPS = 50
FEWEST_STEPS = 3


@cache
def comment_lines(text: str) -> frozenset[int]:
    """The lines that hold a comment; one for a tool (`# fmt: skip`, `# noqa`) names no step."""
    tools = ("# fmt:", "# noqa", "# pyright:", "# type:")
    tokens = tokenize.generate_tokens(io.StringIO(text).readline)
    return frozenset(
        token.start[0] for token in tokens if token.type == tokenize.COMMENT and not token.string.startswith(tools)
    )


@cache
def functions_too_long(package: Path) -> list[str]:
    """Functions above 100 lines; a compiled kernel may be longer, since a call inside it costs."""
    return [
        f"{path}::{name}: {length} lines"
        for path, tree in modules(package)
        for name, node in functions(tree)
        if (length := lines_of(node)) > LONGEST_FUNCTION and not is_kernel(node)
    ]


@cache
def functions_without_steps(package: Path) -> list[str]:
    """Functions above 50 lines with fewer than three comments: these are the reader's table of contents."""
    faults = []
    for path, tree in modules(package):
        long = [(name, node) for name, node in functions(tree) if lines_of(node) > NEEDS_STEPS]
        if not long:
            continue
        comments = comment_lines((package / path).read_text(encoding="utf-8"))
        for name, node in long:
            found = sum(node.lineno < line <= (node.end_lineno or 0) for line in comments)
            if found < FEWEST_STEPS:
                faults.append(f"{path}::{name}: {lines_of(node)} lines, {found} comments")
    return faults


def lines_of(node) -> int:
    return (node.end_lineno or node.lineno) - node.lineno + 1
