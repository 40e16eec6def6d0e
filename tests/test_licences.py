"""What `pip install relume` brings is free of the GPL, and `scripts/licences` would see it."""

from __future__ import annotations

from importlib.machinery import SourceFileLoader
from importlib.util import module_from_spec, spec_from_loader
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any, cast

import pytest

SCRIPT = Path(__file__).parents[1] / "scripts" / "licences"


@pytest.fixture(scope="module")
def licences() -> ModuleType:
    pytest.importorskip("packaging", reason="scripts/licences reads requirements with packaging")
    loader = SourceFileLoader("licences", str(SCRIPT))
    spec = spec_from_loader("licences", loader)
    assert spec is not None
    module = module_from_spec(spec)
    loader.exec_module(module)
    return module


def test_nothing_of_the_core_is_under_the_gpl(licences: ModuleType, capsys: pytest.CaptureFixture[str]) -> None:
    assert licences.main([]) == 0
    listed = capsys.readouterr().out
    assert "mitsuba" in listed and "numpy" in listed
    assert "hosek_wilkie.LICENSE.txt" in listed


def test_the_gpl_is_seen_in_words_and_in_libraries(licences: ModuleType) -> None:
    assert licences.is_gpl("GPL-2.0-or-later") and licences.is_gpl("GNU General Public License v3 (GPLv3)")
    assert not licences.is_gpl("LGPL-2.1-or-later")
    assert not licences.is_gpl("GNU Lesser General Public License v3 (LGPLv3)")
    assert not licences.is_gpl("BSD-3-Clause AND MIT")
    package: Any = cast(Any, SimpleNamespace(files=["pillow_heif.libs/libx265-4883ecb5.so.217", "a/libheif.so"]))
    assert licences.gpl_inside(package) == ["libx265-4883ecb5.so.217"]
