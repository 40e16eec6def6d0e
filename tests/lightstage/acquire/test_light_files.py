"""Lists of directions, as the museums' programs and the photometric sets write them."""

from pathlib import Path

import numpy as np
import pytest

from relume.errors import InvalidStage
from relume.lightstage.acquire.light_files import read_directions, read_lp, write_lp

OLAT = Path(__file__).resolve().parents[4] / "shared" / "data" / "olat"


def file(folder: Path, text: str) -> Path:
    path = folder / "lights.lp"
    path.write_bytes(text.encode())
    return path


def test_names_may_have_spaces_and_lines_may_end_as_on_windows(tmp_path: Path) -> None:
    names, directions = read_lp(
        file(tmp_path, '\ufeff2\r\n# taken in May\r\n\r\nC:\\my shots\\a 1.jpg 0 0 2\r\n"b.jpg"\t1 0 0\r\n')
    )
    assert names == ("C:\\my shots\\a 1.jpg", "b.jpg")
    np.testing.assert_array_equal(directions, [[0, 0, 1], [1, 0, 0]])


def test_an_lp_is_written_as_it_was_read(tmp_path: Path) -> None:
    names, directions = ("a b.jpg", "c.jpg"), np.array([[0.6, 0.8, 0.0], [0.0, 0.0, 1.0]])
    write_lp(tmp_path / "x.lp", names, directions)
    assert (tmp_path / "x.lp").read_text() == (
        "2\na b.jpg 0.600000000 0.800000000 0.000000000\nc.jpg 0.000000000 0.000000000 1.000000000\n"
    )
    again = read_lp(tmp_path / "x.lp")
    assert again[0] == names
    np.testing.assert_allclose(again[1], directions, atol=1e-9)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("3\na 0 0 1\nb 0 1 0\n", "line 1 says 3 lights, but 2 follow"),
        ("# x\n\n1\na 0 0 1\nb 0 1 0\n", "line 3 says 1 lights, but 2 follow"),
        ("a 0 0 1\n", 'line 1: "a 0 0 1"; an .lp begins with the number'),
        ("1\na 0 0\n", "line 2"),
        ("1\na 0 nan 1\n", "line 2"),
        ("1\na 0 0 0\n", "light 1 has the direction 0, 0, 0"),
        ("2\na 0 0 1\na 0 1 0\n", "line 3: a is named a second time"),
        ("", "empty"),
        ("0\n", "lists no light"),
    ],
)
def test_a_wrong_lp_is_refused_in_one_line(tmp_path: Path, text: str, said: str) -> None:
    with pytest.raises(InvalidStage) as caught:
        read_lp(file(tmp_path, text))
    assert said in str(caught.value) and "\n" not in str(caught.value)


def test_a_name_that_an_lp_cannot_hold_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="rename"):
        write_lp(tmp_path / "x.lp", ("#a",), np.array([[0.0, 0, 1]]))
    assert not (tmp_path / "x.lp").exists()


def test_directions_stand_in_rows_or_in_columns(tmp_path: Path) -> None:
    rows = read_directions(file(tmp_path, "2\n0 0 3\n1, 0, 0\n"))
    np.testing.assert_array_equal(rows, [[0, 0, 1], [1, 0, 0]])
    columns = read_directions(file(tmp_path, "0, 1\n0, 0\n3, 0\n"))
    np.testing.assert_array_equal(columns, rows)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("3\n0 0 1\n", "line 1 says 3"),
        ("0 0 1\n0 1\n", "line 2"),
        ("0 0 x\n", "line 1"),
        ("1 2\n3 4\n", "expected x, y"),
    ],
)
def test_a_wrong_list_is_refused(tmp_path: Path, text: str, said: str) -> None:
    with pytest.raises(InvalidStage, match=said):
        read_directions(file(tmp_path, text))


def test_the_published_lists_are_read() -> None:
    if not OLAT.is_dir():
        pytest.skip("the real sets are not beside the repository")
    lights = read_directions(OLAT / "uw_psm" / "lights.txt")
    np.testing.assert_allclose(lights[0], [0.403259, 0.480808, 0.778592], atol=1e-5)
    cat = OLAT / "gray_balls_psdata" / "cat"
    np.testing.assert_allclose(read_directions(cat / "light_directions.txt")[0, :2], [-0.28522, 0.54463], atol=2e-4)
    assert read_directions(cat / "refined_light.txt").shape == (20, 3)
