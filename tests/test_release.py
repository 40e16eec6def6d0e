"""What a release says of itself is said in one place, and the rest agrees with it."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

ROOT = Path(__file__).parents[1]
SECTIONS = {"Learning and installing", "Added", "Changed", "Deprecated", "Removed", "Fixed", "Security"}


def version() -> str:
    return tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["version"]


def test_the_citation_has_the_version():
    text = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    assert re.findall(r"^version: (\S+)$", text, re.MULTILINE) == [version()]


def test_the_source_asks_the_distribution_for_its_version():
    files = [path for path in (ROOT / "src").rglob("*.py") if f'"{version()}"' in path.read_text(encoding="utf-8")]
    assert files == []


def test_the_changelog_has_the_sections_of_keep_a_changelog():
    lines = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8").splitlines()
    assert {line[4:] for line in lines if line.startswith("### ")} <= SECTIONS
    releases = [line for line in lines if line.startswith("## ")]
    assert releases[0] == "## [Unreleased]"
    assert all(re.fullmatch(r"## \[\d+\.\d+\.\d+\] - \d{4}-\d\d-\d\d", line) for line in releases[1:])


def test_a_report_of_a_fault_is_asked_for_what_the_command_prints():
    form = (ROOT / ".github" / "ISSUE_TEMPLATE" / "bug.yml").read_text(encoding="utf-8")
    assert "relume info --system" in form
