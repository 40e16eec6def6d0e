"""Option words become typed values: what is accepted, and that a fault names the option, its form and an example."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import pytest
from cyclopts import App, CycloptsError

from relume.cli.option_types import Angles, Colour, Point, Seconds, Size, numbers

Spot = tuple[int, int, float] | tuple[int, int, float, float]
Patch = tuple[tuple[float, float], float | tuple[float, float, float]]


def _read(words: list[str], kind: Any) -> Any:
    app = App()

    def command(*, option: Any = None) -> Any:
        return option

    command.__annotations__["option"] = kind
    app.default(command)
    return app(words, exit_on_error=False, print_error=False, result_action="return_value")


@pytest.mark.parametrize(
    ("kind", "word", "value"),
    [
        (Point, "-1,0.17,1e1", (-1.0, 0.17, 10.0)),
        (Point, "1 2 3", (1.0, 2.0, 3.0)),
        (Point | None, "1,2,3", (1.0, 2.0, 3.0)),
        (Size, "640x360", (640, 360)),
        (Size, "640×360", (640, 360)),
        (Colour, "0.5", (0.5, 0.5, 0.5)),
        (Colour, "0.6,0.5,0.4", (0.6, 0.5, 0.4)),
        (Angles, "-90", (-90.0, 0.0, 0.0)),
        (Seconds, "1/4,0.5", (0.25, 0.5)),
        (Annotated[Spot, numbers("X,Y,CD[,RADIUS]", like="1,2,3")], "7,4,28.5,3", (7, 4, 28.5, 3.0)),
        (Annotated[tuple[Path, float], numbers("MASK=STOPS", like="sun.png=12")], "a=b.png=12", (Path("a=b.png"), 12)),
        (Annotated[Patch, numbers("X,Y=ALBEDO", like="1,2=0.9")], "1,2=.5,.4,.3", ((1, 2), (0.5, 0.4, 0.3))),
        (Annotated[float | str, numbers("NUMBER or auto", like="2", words=("auto",))], "auto", "auto"),
    ],
)  # fmt: skip
def test_a_word_becomes_the_annotated_type(kind: Any, word: str, value: Any):
    assert _read(["--option", word], kind) == value
    assert _read([f"--option={word}"], kind) == value


def test_an_option_may_be_repeated():
    kind = Annotated[list[tuple[int, int]], numbers("X,Y", like="1,2")]
    assert _read(["--option", "1,2", "--option", "-3,4"], kind) == [(1, 2), (-3, 4)]


@pytest.mark.parametrize(
    ("kind", "word"),
    [
        (Point, "1,2"), (Point, "1,2,3,4"), (Point, "1,b,3"), (Point, "1,2,nan"), (Point, ""), (Size, "0x5"),
        (Size, "4.5x5"), (Seconds, "1/0"), (Seconds, "1/30,-2"), (Seconds, ""), (Angles, "1,2,3,4"), (Colour, "1,2"),
        (Annotated[tuple[Path, float], numbers("MASK=STOPS", like="sun.png=12")], "sun.png"),
        (Annotated[tuple[Path, float], numbers("MASK=STOPS", like="sun.png=12")], "=3"),
        (Annotated[tuple[float, float] | str | None, numbers("X,Y", like="1,2 or auto", words=("auto",))], "foo"),
        (Annotated[tuple[float, float] | str | None, numbers("X,Y", like="1,2 or auto", words=("auto",))], "0.001"),
        (Annotated[list[tuple[float, float] | str], numbers("X,Y", like="1,2 or auto", words=("auto",))], "1,2,3"),
    ],
)  # fmt: skip
def test_a_fault_names_the_option_and_shows_an_example(kind: Any, word: str):
    with pytest.raises(CycloptsError, match=r"--option.*write it like"):
        _read(["--option", word], kind)
