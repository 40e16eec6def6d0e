"""The runner of benchmarks: a script that reports, one that fails, one that takes too long; and the table of them."""

import sys
import textwrap
import time
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path

import pytest

BENCHMARKS = Path(__file__).parents[1] / "benchmarks"
REPORTS = """
from measured import Rows, asked
options = asked(__doc__).parse_args()
rows = Rows(options.rows)
rows.ratio("merge", [1.0, 2.0, 4.0], "OpenCV", [10.0, 28.0, 52.0], goal="merge")
rows.value("look-up", [0.5, 0.2, 0.9] if not options.quick else 0.25, "s", goal="info")
rows.absent("Cycles", "no interpreter with bpy was given", goal="change_cycles")
"""


@pytest.fixture
def runner(monkeypatch: pytest.MonkeyPatch):
    """`run_all` and what belongs to it, as when it is run as a script."""
    monkeypatch.syspath_prepend(str(BENCHMARKS))
    spec = spec_from_file_location("run_all", BENCHMARKS / "run_all.py")
    assert spec is not None and spec.loader is not None
    # A dataclass looks its module up by its name.
    module = sys.modules["run_all"] = module_from_spec(spec)
    spec.loader.exec_module(module)
    yield module
    for name in ("run_all", "table", "goals", "measured"):
        sys.modules.pop(name, None)


def script(folder: Path, text: str, name: str = "one.py") -> Path:
    path = folder / name
    path.write_text(f"import sys\nsys.path.insert(0, {str(BENCHMARKS)!r})\n" + textwrap.dedent(text), encoding="utf-8")
    return path


def test_rows_of_a_script_come_back(runner, tmp_path: Path) -> None:
    result = runner.ran(script(tmp_path, REPORTS), 1, [], tmp_path)
    assert result.state == "done"
    merge, info, cycles = result.rows
    # The turns' ratios are 10, 14 and 13: their median, not the medians' ratio.
    assert (merge.seen, merge.least, merge.most, merge.ours, merge.theirs) == (13, 10, 14, 2, 28)
    assert (info.seen, info.least, info.most, info.unit) == (0.5, 0.2, 0.9, "s")
    assert (cycles.seen, cycles.note) == (None, "no interpreter with bpy was given")


def test_quick_is_passed_on(runner, tmp_path: Path) -> None:
    assert runner.ran(script(tmp_path, REPORTS), 1, [], tmp_path, quick=True).rows[1].seen == 0.25


def test_a_failure_is_told_with_the_rows_before_it(runner, tmp_path: Path) -> None:
    result = runner.ran(script(tmp_path, REPORTS + "raise ValueError('the lamp is out')"), 1, [], tmp_path)
    assert result.state == "failed (1): ValueError: the lamp is out"
    assert len(result.rows) == 3


def test_a_script_and_its_children_end_at_the_limit(runner, tmp_path: Path) -> None:
    beats = tmp_path / "beats"
    child = f"import time\nwhile True: open({str(beats)!r}, 'a').write('.'); time.sleep(0.01)"
    text = REPORTS + f"import subprocess; subprocess.run([sys.executable, '-c', {child!r}])"
    start = time.monotonic()
    result = runner.ran(script(tmp_path, text), 0.05, [], tmp_path)
    assert time.monotonic() - start < 20
    assert result.state == "stopped after 3 s"
    seen = beats.stat().st_size if beats.exists() else 0
    time.sleep(0.1)
    assert (beats.stat().st_size if beats.exists() else 0) == seen


def test_the_table_says_what_is_met_missed_absent_and_failed(runner, tmp_path: Path) -> None:
    first = runner.ran(script(tmp_path, REPORTS), 1, [], tmp_path)
    second = runner.ran(script(tmp_path, "raise SystemExit('no lamp')", "two.py"), 1, [], tmp_path)
    text = runner.written([first, second], {})
    assert "| ≥ 12 × | 13 × (10–14) | yes | `benchmarks/one.py` |" in text
    assert "| ≤ 0.3 s | 0.5 s (0.2–0.9) | **no** | `benchmarks/one.py` |" in text
    assert "| ≥ 20 × | no interpreter with bpy was given | – | `benchmarks/one.py` |" in text
    assert "- `benchmarks/two.py` failed (1): no lamp" in text
    assert "no skylibs" in text
    assert "| merge | 2 s | OpenCV 28 s | 13 × (10–14) | ≥ 12 | `one.py` |" in text


def test_a_section_takes_the_place_of_its_earlier_one(runner) -> None:
    document = "# Benchmarks\n\nWords.\n\n## Capture\n\nMore.\n"
    once = runner.placed(document, "`make bench`", "## Asked\n\nfirst\n\n")
    assert once.index("Words.") < once.index("first") < once.index("## Capture")
    last = runner.placed(once, "gpu.py", "## On a GPU\n\nquick\n\n", first=False)
    assert last.index("first") < last.index("More.") < last.index("quick")
    again = runner.placed(last, "`make bench`", "## Asked\n\nsecond\n\n")
    assert "first" not in again
    assert again.replace("second", "first") == last


def test_scripts_of_the_run_know_the_options(runner) -> None:
    for each in runner.SCRIPTS:
        path = BENCHMARKS / each.file
        text = path.read_text(encoding="utf-8")
        assert "asked(__doc__)" in text, each.file
        assert all(f'"--{peer}"' in text for peer in each.peers), each.file
