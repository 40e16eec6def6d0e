"""Every block of Python on the pages runs, page by page; of the few that cannot, the calls are looked at."""

from __future__ import annotations

import ast
import builtins
import inspect
import warnings
from pathlib import Path
from typing import Any

import pytest

import relume as rl
from documents.pages import Block, of_language, without_proof
from documents.reader import FOLDERS, NAMES, calibrate, folder_of_examples, matching, provide

BLOCKS = list(of_language("python"))
PAGES = sorted({block.page for block in BLOCKS})
NOT_RUN = {
    'connect("local:2")': "starts two workers for seven jobs, a minute; tests/cluster",
    "rl.show(": "opens the browser and waits for its reader; tests/studio",
    "PhotonMap(photons=50_000": "a million photons, a minute; tests/renderers",
    "Radiosity().prepared": "3500 shots, half a minute; tests/renderers",
    "BallCircle(1510, 980, 64)": "photographs of a whole light stage; tests/cli/test_stage_import.py, on small ones",
    "camera_from_grid(": "the chain of the whole room; tests/test_readme.py",
    "rl.capture.example_room()": "the README's, at its full size; tests/test_readme.py",
    "ray_tree(prepared, scene.camera, (330.5": "480 rows of rays of depth 8; tests/test_examples.py",
    "patches_from_photographs(": "photographs of a chart under each LED; tests/lightstage",
}
"""Blocks that are not run, by some of their words, and why; where they are proved else."""

SMALLER = {1024: 32, 1536: 48}
"""Sizes on the pages, and what is taken in their place."""
CALIBRATED = {"docs/how-to/light/sky.md"}
"""Pages whose light is in cd/m², like the sky that they join with it."""


class SmallerNumbers(ast.NodeTransformer):
    """Sizes of maps as small ones."""

    def visit_Constant(self, node: ast.Constant) -> ast.Constant:
        return ast.copy_location(
            ast.Constant(next((small for size, small in SMALLER.items() if size == node.value), node.value)), node
        )


def reason_not_to_run(block: Block) -> str | None:
    return next((reason for words, reason in NOT_RUN.items() if words in block.code), None)


def unknown(tree: ast.Module, known: set[str]) -> set[str]:
    """The names that a program reads and does not make."""
    names = [each for each in ast.walk(tree) if isinstance(each, ast.Name)]
    imports = [each for each in ast.walk(tree) if isinstance(each, ast.Import | ast.ImportFrom)]
    made = {each.id for each in names if isinstance(each.ctx, ast.Store)} | known | set(dir(builtins))
    made |= {(alias.asname or alias.name).split(".")[0] for each in imports for alias in each.names}
    return {each.id for each in names if isinstance(each.ctx, ast.Load)} - made


def words(tree: ast.Module) -> list[str]:
    return [each.value for each in ast.walk(tree) if isinstance(each, ast.Constant) and isinstance(each.value, str)]


def refused_calls(code: str) -> list[str]:
    """The calls of relume's names whose arguments those names do not take."""
    refused = []
    for call in (each for each in ast.walk(ast.parse(code)) if isinstance(each, ast.Call)):
        name = ast.unparse(call.func)
        if not name.startswith("rl.") or not all(part.isidentifier() for part in name.split(".")):
            continue
        called: Any = rl
        for part in name.split(".")[1:]:
            called = getattr(called, part)
        if any(isinstance(each, ast.Starred) for each in call.args) or any(each.arg is None for each in call.keywords):
            continue
        try:
            inspect.signature(called).bind(*call.args, **{str(each.arg): each.value for each in call.keywords})
        except TypeError as error:
            refused.append(f"{ast.unparse(call)}: {error}")
    return refused


@pytest.mark.parametrize("page", PAGES)
def test_the_programs_of_a_page_run(page: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    folder_of_examples(tmp_path)
    if page in CALIBRATED:
        calibrate(tmp_path / "light.exr")
    names: dict[str, Any] = {"rl": rl}
    for block in (each for each in BLOCKS if each.page == page and not reason_not_to_run(each)):
        tree = ast.parse(block.code)
        for word in words(tree):
            if word in FOLDERS:
                (tmp_path / word).mkdir(exist_ok=True)
            matching(word, tmp_path) if "*" in word else provide(word, tmp_path)
        names |= {name: NAMES[name]() for name in unknown(tree, set(names)) if name in NAMES}
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)  # of what is small or doubtful; other kinds fail
            exec(compile(SmallerNumbers().visit(tree), block.place, "exec"), names)


@pytest.mark.parametrize("block", BLOCKS, ids=lambda block: block.place)
def test_the_calls_of_a_program_fit_what_they_call(block: Block) -> None:
    assert refused_calls(block.code) == []


def test_a_call_that_does_not_fit_is_found() -> None:
    assert len(refused_calls("rl.merge(a, b, nothing=1)\nrl.read()")) == 2
    assert refused_calls("rl.read('a.exr')") == []


def test_every_reason_not_to_run_stands_for_its_blocks_alone() -> None:
    # A page that is not in this list has a block that is not run, or has one no more.
    assert {words: [block.page.removeprefix("docs/how-to/") for block in BLOCKS if words in block.code]
            for words in NOT_RUN} == {
        'connect("local:2")': ["scale.md"],
        "rl.show(": ["view.md"],
        "PhotonMap(photons=50_000": ["natural-light/photon-map.md"],
        "Radiosity().prepared": ["natural-light/radiosity.md"],
        "BallCircle(1510, 980, 64)": ["light-stage/README.md", "python.md"],
        "camera_from_grid(": ["python.md"],
        "rl.capture.example_room()": ["README.md"],
        "ray_tree(prepared, scene.camera, (330.5": ["whitted.md"],
        "patches_from_photographs(": ["light-stage/drive.md"],
    }  # fmt: skip
    assert without_proof(NOT_RUN.values()) == []
    assert sum(reason_not_to_run(block) is None for block in BLOCKS) > len(BLOCKS) / 2
