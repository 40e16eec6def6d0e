"""Whatever takes a path takes a string, too."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest

import relume as rl
import relume.cluster

NOT_FOR_USERS = {"rl.insert.others", "rl.report.merge_summary.report"}
"""Stages that another call of ours has made, and a path that is only printed."""


def public_functions() -> Iterator[tuple[str, Callable[..., Any]]]:
    """Every public function by its name."""
    folders = [(f"rl.{name}", value) for name in dir(rl) if isinstance(value := getattr(rl, name), ModuleType)]
    for name, folder in [("rl", rl), *folders, ("rl.cluster", relume.cluster)]:
        for each in dir(folder):
            if not each.startswith("_") and inspect.isfunction(value := getattr(folder, each)):
                yield f"{name}.{each}", value


def only_paths(name: str, function: Callable[..., Any]) -> list[str]:
    """The arguments of a function that are paths and no strings, by their annotations."""
    given = inspect.signature(function).parameters.values()
    kinds = {each.name: str(each.annotation) for each in given if "Callable" not in str(each.annotation)}
    return [f"{name}.{each}" for each, kind in kinds.items() if "Path" in kind and "str" not in kind]


def test_every_public_function_takes_its_paths_as_strings():
    found = [each for name, function in public_functions() for each in only_paths(name, function)]
    assert set(found) <= NOT_FOR_USERS

    # A planted fault is found.
    def planted(path: Path, other: str | Path) -> None: ...

    assert only_paths("planted", planted) == ["planted.path"]


@pytest.fixture(scope="module")
def light(tmp_path_factory) -> str:
    path = tmp_path_factory.mktemp("paths") / "light.exr"
    rl.write(path, rl.as_radiance_map(rl.EnvironmentMap(np.linspace(0.1, 1, 384, dtype=np.float32).reshape(8, 16, 3))))
    return str(path)


CALLS: dict[str, Callable[[str, str], object]] = {
    "develop_file": lambda light, out: rl.develop_file(light, f"{out}/a.png"),
    "develop_sequence": lambda light, out: rl.develop_sequence([light], out),
    "undevelop_file": lambda light, out: rl.undevelop_file(_developed(light, out), f"{out}/back.exr"),
    "change_format": lambda light, out: rl.light.change_format(light, f"{out}/a.hdr"),
    "convert_map": lambda light, out: rl.light.convert_map(
        rl.read_environment(light), f"{out}/a.exr", rl.light.MapConversion()
    ),
    "convert_each": lambda light, out: rl.light.convert_each([light], out),
    "put_view": lambda light, out: rl.light.put_view(
        rl.read_environment(light), light, rl.light.CameraView((0.0, 0.0, 0.0))
    ),
    "require_radiance": lambda light, out: rl.light.require_radiance(light),
    "write_slice": lambda light, out: rl.light.write_slice(rl.read_radiance(light), f"{out}/slice.png"),
    "draw_lights": lambda light, out: rl.report.draw_lights(
        f"{out}/lights.png", rl.light.make_lights(rl.read_environment(light))
    ),
}


def _developed(light: str, out: str) -> str:
    rl.develop_file(light, f"{out}/photograph.png")
    return f"{out}/photograph.png"


@pytest.mark.parametrize("name", CALLS)
def test_a_path_given_as_a_string_is_a_path(name, light, tmp_path):
    CALLS[name](light, str(tmp_path))
