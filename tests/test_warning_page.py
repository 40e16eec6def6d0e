"""docs/how-to/warnings.md has a row for every warning, doubt and error of relume, and for nothing else."""

from __future__ import annotations

from functools import cache
from pathlib import Path

from architecture.warned import GAP, texts, warned
from relume import errors

REPOSITORY = Path(__file__).parents[1]
SOURCE = REPOSITORY / "src" / "relume"
WARNINGS, REFUSALS = (
    (REPOSITORY / "docs" / "how-to" / "warnings.md").read_text(encoding="utf-8").split("## What is refused\n")
)
WORDS = 4
"""From which on a row's words are taken to be its warning's alone."""
FROM_PARTS = "…: … of … pixels …"  # LogLuv's, whose last part the page has: three rows


def first_cells(page: str) -> list[str]:
    rows = [line.split("|")[1].strip() for line in page.splitlines() if line.startswith("| ")]
    return [row for row in rows if row not in ("it says", "error")]


def said(row: str, words: str) -> bool:
    """Whether the words have the row's pieces, which … parts, in their order."""
    at = 0
    for piece in pieces(row):
        if (found := words.find(piece, at)) < 0:
            return False
        at = found + len(piece)
    return True


@cache
def pieces(row: str) -> tuple[str, ...]:
    return tuple(piece.strip() for piece in row.split(GAP))


def without_a_row(rows: list[str], source: Path) -> list[str]:
    return [
        f"{at}: {words}"
        for at, words in warned(source)
        if words != FROM_PARTS and not any(said(row, words) for row in rows)
    ]


def test_every_warning_has_its_row() -> None:
    assert without_a_row(first_cells(WARNINGS), SOURCE) == []


def test_a_short_row_stands_for_one_warning() -> None:
    # Few words would also stand for a new warning that has them, which the page does not explain then.
    rows = first_cells(WARNINGS)
    short = [row for row in rows if len(row.replace(GAP, " ").split()) < WORDS]
    assert swallowed(short, [row for row in rows if row not in short], SOURCE) == {}


def swallowed(short: list[str], long: list[str], source: Path) -> dict[str, list[str]]:
    """The short rows that stand for several warnings of which no long row is, with those."""
    alone = {words for _, words in warned(source) if not any(said(row, words) for row in long)}
    found = {row: sorted(words for words in alone if said(row, words)) for row in short}
    return {row: warnings for row, warnings in found.items() if len(warnings) > 1}


def test_every_row_is_something_that_relume_says() -> None:
    said_somewhere = "\n\n".join(texts(SOURCE))
    assert [row for row in first_cells(WARNINGS) if not said(row, said_somewhere)] == []
    assert len(first_cells(WARNINGS)) == len(set(first_cells(WARNINGS)))


def test_every_error_has_its_row() -> None:
    public = {
        name
        for name, each in vars(errors).items()
        if isinstance(each, type) and issubclass(each, errors.RelumeError) and each is not errors.RelumeError
    }
    assert {row.strip("`") for row in first_cells(REFUSALS)} == public


def test_a_warning_without_a_row_is_found(tmp_path: Path) -> None:
    lines = (
        "def f(name, bad):",
        '    line = f"{name}: is a new thing" if bad else "nothing of the kind"',
        "    warn(line, 0.1)",
        '    found.append(BracketDoubt(name, f"is {bad} another", "mend it"))',
    )
    (tmp_path / "new.py").write_text("\n".join(lines))
    assert without_a_row(["nothing of the"], tmp_path) == [
        "new.py:3: …: is a new thing",
        "new.py:4: is … another",
    ]
    assert without_a_row(["is a … thing", "another", "nothing"], tmp_path) == []
    assert swallowed(["is"], [], tmp_path) == {"is": ["is … another", "…: is a new thing"]}
    assert swallowed(["is"], ["is a new thing"], tmp_path) == {}
