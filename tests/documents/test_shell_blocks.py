"""Every command line on the pages has words that the parser takes; the cheap ones run."""

from __future__ import annotations

import re
import shlex
import tomllib
import warnings
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any

import pytest
from cyclopts import App

from documents.pages import ROOT, Block, of_language, without_proof
from documents.reader import folder_of_examples, folders_and_files
from relume.cli import COMMANDS, FOLDERS, main
from relume.errors import Incomplete

BLOCKS = list(of_language("sh"))
OTHERS = {"dask", "openjd", "openssl", "export", "kill", "TLS="}
"""Programs and settings of others, which the pages show beside relume's commands."""
INSTALLERS = ("pip install", "pipx install", "uv tool install", "python -m pip install")
SMALLER = {
    "256": "16",
    "1024": "32",
    "1024x768": "64x48",
    "1920x1080": "64x36",
    "640,360,20=0.9@0,1,0": "64,32,8=0.9@0,1,0",
}
"""Sizes and places on the pages, and what is taken in their place."""
FAILED = re.compile(r"\d+ of \d+ failed: ")
"""How errors.Incomplete begins."""
NOT_RUN = {
    "demo": "a minute of rendering; tests/cli/test_commands.py",
    "studio": "a page that waits for its reader; tests/studio",
    "view": "a page that waits for its reader; tests/studio",
    "model (?:place|sparse)": "edges that were marked, or another program's; tests/cli/light/test_model.py",
    "panorama '(?:views|shots)": "photographs of a whole sphere; tests/cli/test_panorama.py",
    r"probe (?:'?front|a\.jpg|ball\.jpg|film)": "single photographs, views, films of balls; tests/cli/test_probe.py",
    "--grey-ball": "a grey ball in the sun's light; tests/cli/light/test_sun.py",
    "stage import": "photographs of a light stage; tests/cli/test_stage_import.py",
    r"cat\.zarr": "what an import has stored; tests/cli/test_stage_import.py",
    "stage view head/ --position": "the mesh of a scan; tests/lightstage/novel_view",
    "stage scan": "photographs under patterns; tests/lightstage/geometry/test_scan.py",
    "stage reflectometry": "photographs of a patch; tests/lightstage/reflectometry",
    "stage matte": "photographs under stripes; tests/lightstage/matting",
    "stage perform": "a film under strobes; tests/lightstage/strobes",
    r"(?<!film\.toml )--cluster": "starts workers; tests/cluster",
    "--job": "tests/export/test_farm_job.py",
    "--renderer photon-map": "a minute of photons; tests/renderers",
    "--renderer radiosity": "half a minute; tests/renderers",
    "--frames": "many pictures; tests/cli/test_render.py and test_insert_frames.py",
    "SHOOT": "many brackets; tests/cli/test_merge.py",
    r"CR3|\$\w": "camera raws, and variables of a shell; tests/capture",
    "salvage": "a damaged file; tests/cli/test_convert_formats.py",
    r"\.mp4": "movies; tests/cli/test_develop.py",
    "--sheet": "fourteen seconds of materials; tests/cli/test_reflect.py",
    "--environment": "six pictures of rays, twenty seconds; tests/cli/test_panorama.py",
    "--(?:roi|crop|tree|foot) ": "of a larger picture; tests/cli/test_edit.py, tests/renderers/test_ray_tree.py",
    r"camera\.json": "the profile of the reader's camera; tests/cli/test_develop.py",
    r"\.binary": "a file of the MERL database; tests/scene/test_measured.py",
    "--brdf tiles": "a material of the reader's scene; tests/cli/test_render.py",
}
"""Commands, and patterns of lines, that are parsed and not run, and why; where they are proved else."""
NEVER_RUN = {"demo", "studio", "view"}
"""Commands of which no line runs; decision 74 names them."""


def lines(block: Block) -> Iterator[list[str]]:
    """The words of each line, without its comment. A line that ends with `\\` goes on; a loop is what it repeats."""
    for line in block.code.replace("\\\n", " ").splitlines():
        repeated = re.sub(r"^\s*for \w+ in .*?; *do (.*?); *done.*$", r"\1", line)
        if words := shlex.split(repeated.removesuffix("&").rstrip().removesuffix("&"), comments=True):
            yield words


@cache
def parser() -> App:
    app = App(name="relume", help_flags=[], version_flags=[])
    for name in COMMANDS:
        app.command(f"relume.cli.{FOLDERS.get(name, '')}{name}:{name}", name=name)
    return app


def parsed(words: list[str]) -> Any:
    """The command and its arguments; raises CycloptsError where the words are wrong."""
    function, bound, _ = parser().parse_args(words[1:], exit_on_error=False, print_error=False)
    return function, bound


def reason_not_to_run(words: list[str]) -> str | None:
    return next((why for what, why in NOT_RUN.items() if stands_for(what, words)), None)


def stands_for(what: str, words: list[str]) -> bool:
    """Whether a key of NOT_RUN stands for a line: it is its command, or a pattern of the line."""
    return what == words[1] if what in COMMANDS else re.search(what, shlex.join(words)) is not None


@pytest.mark.parametrize("block", BLOCKS, ids=lambda block: block.place)
def test_the_words_of_every_line_are_taken(block: Block, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)  # some options ask whether their file is there
    for words in lines(block):
        if words[0] == "relume":
            parsed(["relume", *folders_and_files(words[1:], tmp_path)])
        else:
            assert is_of_others(words), f"{block.place}: {shlex.join(words)}"


def is_of_others(words: list[str]) -> bool:
    """Whether a line that is not relume's is one of make, of an installer, or of the programs above."""
    line = " ".join(words)
    if words[0] == "make":
        return bool(re.search(rf"(?m)^{words[1]}( \w+)*:|^{words[1]}:", (ROOT / "Makefile").read_text()))
    if line.startswith(INSTALLERS):
        extras = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"][
            "optional-dependencies"
        ]
        return all(set(each.split(",")) <= set(extras) for each in re.findall(r"relume\[([^]]+)\]", line))
    return any(words[0] == each or (each.endswith("=") and words[0].startswith(each)) for each in OTHERS)


@pytest.fixture(scope="module")
def looked_at() -> set[str]:
    """Shots in words that were looked at: they stand on several pages, and a dry run leaves nothing for later lines."""
    return set()


@pytest.mark.parametrize("block", BLOCKS, ids=lambda block: block.place)
def test_the_cheap_lines_of_a_block_run(
    block: Block,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    looked_at: set[str],
) -> None:
    run = [words for words in lines(block) if words[0] == "relume" and not reason_not_to_run(words)]
    if not run:
        return
    monkeypatch.chdir(tmp_path)
    folder_of_examples(tmp_path)
    for words in run:
        given = [SMALLER.get(word, word) for word in folders_and_files(words[1:], tmp_path)]
        given += [word for word in fewer(words) if word not in given]
        if (shot := shot_in_words(given)) in looked_at:
            continue
        looked_at |= {shot} - {""}
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)  # of what is small or doubtful; other kinds fail
            code = main(given)
        said = capsys.readouterr().err
        # 4 is said of what is doubtful, as small and made photographs are, and of tasks of which some failed.
        assert code == 0 or (code == 4 and not FAILED.search(said)), f"{block.place}: {shlex.join(words)}\n{said}"


def shot_in_words(given: list[str]) -> str:
    """What a dry run of `insert` with --plate is given, but for its output; "" of other lines."""
    if not {"insert", "--plate", "--dry-run"} <= {*given}:
        return ""
    return shlex.join(sorted(word for before, word in zip(["", *given], given, strict=False) if before != "-o"))


def fewer(words: list[str]) -> list[str]:
    """What is put at the end of a line, so that it takes little time."""
    if words[1] == "render" and "--brdf" not in words:
        return ["--size", "32x16"]
    if words[1] == "probe" and "--size" not in words:
        return ["--size", "32"]
    if words[1] in ("film", "sun") or (words[1] == "insert" and not {"--dry-run", "--prepare", "--to"} & {*words}):
        return ["--dry-run"]
    return []


def test_a_wrong_word_is_found() -> None:
    from cyclopts import CycloptsError

    with pytest.raises(CycloptsError):
        parsed(["relume", "convert", "a.exr", "-o", "b.exr", "--nothing"])
    assert not is_of_others(["make", "coffee"]) and not is_of_others(["pipx", "install", "relume[coffee]"])


def test_shots_in_words_are_told_apart_by_all_but_their_output() -> None:
    one = ["insert", "--plate", "a.jpg", "--object", "b.glb", "-o", "OUT", "--dry-run"]
    assert shot_in_words(one) == shot_in_words([*one[:5], "--dry-run", "-o", "else"]) != ""
    assert shot_in_words([*one, "--radius", "0.1"]) not in (shot_in_words(one), "")
    assert shot_in_words(one[:-1]) == shot_in_words(["insert", "shot.toml", "--dry-run"]) == ""


def test_tasks_that_failed_are_told_from_doubts() -> None:
    assert FAILED.search(str(Incomplete([("a.exr", "no such file")], [None, 1])))
    assert not FAILED.search("relume: one photograph, assumed to be sRGB (all was written; --accept takes it as it is)")


def test_every_reason_not_to_run_is_needed() -> None:
    found = [words for block in BLOCKS for words in lines(block) if words[0] == "relume"]
    assert [what for what in NOT_RUN if not any(stands_for(what, words) for words in found)] == []
    assert without_proof(NOT_RUN.values()) == []
    assert sum(reason_not_to_run(words) is None for words in found) > len(found) * 2 / 5


def test_of_few_commands_no_line_runs() -> None:
    found = [words for block in BLOCKS for words in lines(block) if words[0] == "relume"]
    assert {words[1] for words in found} - {words[1] for words in found if not reason_not_to_run(words)} == NEVER_RUN
    decision = (ROOT / "docs" / "decisions" / "0074-pages-are-run.md").read_text(encoding="utf-8")
    assert all(f"`{command}`" in decision for command in NEVER_RUN)


def test_a_command_is_no_pattern_of_a_line() -> None:
    assert not stands_for("sun", ["relume", "convert", "sky.png", "--hot", "sun.png=12"])
    assert not stands_for("view", ["relume", "insert", "shot.toml", "--preview"])
    assert stands_for("view", ["relume", "view", "a.exr"]) and stands_for("--frames", ["relume", "render", "--frames"])
    assert without_proof(["a minute", "a minute; tests/nowhere.py", "a minute; tests/cli"]) == [
        "a minute",
        "a minute; tests/nowhere.py",
    ]
