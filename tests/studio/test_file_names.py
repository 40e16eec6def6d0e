"""What pages call files, on every system: names that Windows has for devices, drives, and ways out of the folder."""

from __future__ import annotations

from pathlib import Path, PureWindowsPath

import pytest

from relume.studio.shots import folder
from relume.studio.shots.bundles import _safe
from relume.studio.shots.folder import Folder, plain_stem


@pytest.mark.parametrize(
    ("name", "plain"),
    [
        ("con", "con_"),
        ("NUL", "NUL_"),
        ("com1.scan", "com1_.scan"),
        ("a:b", "a_b"),
        ("..\\x", "x"),
        ("console", "console"),
        ("com10", "com10"),
        ("ä", ""),
        ("chair. ", "chair"),
    ],
)
def test_a_stem_is_one_that_every_system_takes(name: str, plain: str):
    assert plain_stem(name) == plain


@pytest.mark.parametrize(
    "name", ["C:secret.jpg", "C:/secret.jpg", "/secret.jpg", "//host/share/secret.jpg", "a/../../b"]
)
def test_no_name_of_windows_leads_out_of_the_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str):
    monkeypatch.setattr(folder, "Path", PureWindowsPath)
    with pytest.raises(LookupError):
        Folder(tmp_path).path(name)
    with pytest.raises(ValueError, match="is not below"):
        Folder(tmp_path).refuse_outside({"mesh": name})
    assert Folder(tmp_path).named([name]) == []


@pytest.mark.parametrize("name", ["con/chair.obj", "chair/aux.png", "NUL.bin"])
def test_no_file_that_is_dropped_is_called_like_a_device_of_windows(name: str):
    with pytest.raises(ValueError, match="is no name for a file here"):
        _safe(name)
    assert _safe("console/auxiliary.png") == "console/auxiliary.png"


def test_a_name_within_the_folder_is_taken(tmp_path: Path):
    (tmp_path / "a.jpg").write_bytes(b"x")
    assert Folder(tmp_path).path("a.jpg") == tmp_path / "a.jpg"
    Folder(tmp_path).refuse_outside({"mesh": "objects/a.glb"})
