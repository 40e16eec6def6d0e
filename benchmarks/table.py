"""The table of `run_all.py` in Markdown: what is asked and what is seen, then every row, with machine and versions."""

from __future__ import annotations

import os
import platform
import shutil
import subprocess
import textwrap
from collections.abc import Sequence
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from goals import GOALS, meets
from measured import Result, Row, figure

PACKAGES = (
    "numpy", "numba", "scipy", "mitsuba", "mitsuba-oidn", "opencv-python-headless", "OpenImageIO", "OpenEXR", "embreex",
)  # fmt: skip


def placed(document: str, writer: str, section: str, *, first: bool = True) -> str:
    """A document with a section that `writer` makes, in place of its earlier one, else as the first or the last."""
    opening, ending = f"<!-- {writer} writes from here -->", f"<!-- {writer} writes to here -->"
    if opening in document:
        before, _, rest = document.partition(opening)
        if ending not in rest:
            raise ValueError(f"the document has no line {ending}; put it after the section that is to be replaced")
        after = rest.partition(ending)[2]
    elif first and "\n## " in document:
        before, heading, after = document.partition("\n## ")
        before, after = before.rstrip("\n") + "\n\n", "\n" + heading + after
    else:
        before, after = document.rstrip("\n") + "\n\n", "\n"
    return f"{before}{opening}\n{section}{ending}{after}"


def written(results: Sequence[Result], peers: dict[str, str]) -> str:
    """The section: machine and versions, what is asked, what did not end well, and every row."""
    parts = ["## What is asked and what is seen", textwrap.fill(measured_on(results, peers), 119), asked(results)]
    failed = [f"- `benchmarks/{each.file}` {each.state}" for each in results if each.state != "done"]
    if failed:
        parts.append("Scripts that did not end:\n\n" + "\n".join(failed))
    parts.append("### Every row\n\n" + every_row(results))
    return "\n\n".join(parts) + "\n\n"


def asked(results: Sequence[Result]) -> str:
    """One line a goal, in the order of `goals.GOALS`."""
    lines = ["| work | before | goal | seen | met | script |", "|---|---|---|---|---|---|"]
    for key, goal in GOALS.items():
        rows = [(each, row) for each in results for row in each.rows if row.goal == key]
        seen = [row for _, row in rows if row.seen is not None]
        scripts = ", ".join(f"`benchmarks/{name}`" for name in dict.fromkeys(each.file for each, _ in rows))
        if not seen:
            words = "; ".join(dict.fromkeys(row.note for _, row in rows)) or "not measured"
            lines.append(f"| {goal.work} | {goal.before} | {goal.limit} {goal.unit} | {words} | – | {scripts} |")
            continue
        kept = sum(goal.met(row.seen) for row in seen if row.seen is not None)
        whole = len(seen) == len(rows) and all(each.state == "done" for each, _ in rows)
        if kept < len(seen):
            met = "**no**" if len(seen) == 1 else f"**no**, {kept} of {len(seen)}"
        else:
            met = "yes" if whole else "not all of it measured"
        if any(each.quick for each, _ in rows):
            met = "– (`--quick`)"
        shown = "; ".join(spread(row) for row in seen) if len(seen) <= 3 else extent(seen)
        lines.append(f"| {goal.work} | {goal.before} | {goal.limit} {goal.unit} | {shown} | {met} | {scripts} |")
    return "\n".join(lines)


def every_row(results: Sequence[Result]) -> str:
    lines = ["| what | ours | the peer's | seen | asked | script |", "|---|---|---|---|---|---|"]
    for each in results:
        for row in each.rows:
            limit = GOALS[row.goal].limit if row.goal else row.limit
            if limit and row.seen is not None:
                limit += "" if each.quick or meets(row.seen, limit) else ", **missed**"
            theirs = f"{row.peer} {shown(row.theirs)}".strip()
            what = row.what + (f" ({row.note})" if row.note and row.seen is not None else "")
            seen = spread(row) if row.seen is not None else row.note
            lines.append(f"| {what} | {shown(row.ours)} | {theirs} | {seen} | {limit} | `{each.file}` |")
    return "\n".join(lines)


def spread(row: Row) -> str:
    """The figure, and from where to where it was seen."""
    assert row.seen is not None
    words = f"{figure(row.seen)} {row.unit}"
    if row.least is None or row.most is None or row.least == row.most:
        return words
    return f"{words} ({figure(row.least)}–{figure(row.most)})"


def extent(rows: Sequence[Row]) -> str:
    """From the least to the most of several rows."""
    seen = [row.seen for row in rows if row.seen is not None]
    return f"{figure(min(seen))}–{figure(max(seen))} {rows[0].unit}"


def shown(value: float | None) -> str:
    return "" if value is None else f"{figure(value)} s"


def measured_on(results: Sequence[Result], peers: dict[str, str]) -> str:
    """One paragraph: when, how long, on what, with which versions, and how quiet it was."""
    days = sorted({each.day for each in results})
    commits = list(dict.fromkeys(each.commit for each in results if each.commit))
    quick = sum(each.quick for each in results)
    others = [each.others for each in results if each.others is not None]
    words = [
        f"By `make bench`, {' and '.join(days)}, {sum(each.seconds for each in results) / 60:.0f} minutes",
        f"{quick} of {len(results)} scripts only with `--quick`" if quick else "",
        f"commit {' and '.join(commits)}" if commits else "",
        machine(),
        ", ".join([f"Python {platform.python_version()}", *packages(), *programs(), *environments(peers)]),
        f"other programs took {min(others):.0%} to {max(others):.0%} of the processors meanwhile" if others else "",
    ]
    return (
        "; ".join(word for word in words if word)
        + ". Medians, in brackets the least and the most; a ratio (×) to a peer is its time by ours, by turns."
    )


def machine() -> str:
    memory = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") / 2**30
    return f"{os.cpu_count()} cores ({processor()}), {memory:.0f} GB"


def processor() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").split("\n")
    except OSError:
        return platform.machine()
    return next((line.partition(":")[2].strip() for line in lines if line.startswith("model name")), platform.machine())


def packages() -> list[str]:
    found = []
    for name in PACKAGES:
        try:
            found.append(f"{name} {version(name)}")
        except PackageNotFoundError:
            found.append(f"no {name}")
    return found


def programs() -> list[str]:
    """POV-Ray and Luminance HDR, as they call themselves."""
    found = []
    for name, command in (("POV-Ray", ["povray", "--version"]), ("Luminance HDR", ["luminance-hdr-cli", "--version"])):
        said = ""
        if shutil.which(command[0]):
            environment = os.environ | {"QT_QPA_PLATFORM": "offscreen"}
            done = subprocess.run(command, capture_output=True, text=True, env=environment)
            words = (done.stdout + done.stderr).split()
            said = next((word.strip(",;()") for word in words if word[0].isdigit() and "." in word), "of some version")
        found.append(f"{name} {said}" if said else f"no {name}")
    return found


def environments(peers: dict[str, str]) -> list[str]:
    """skylibs and bpy as their interpreters tell."""
    found = []
    for name in ("skylibs", "bpy"):
        if name not in peers:
            found.append(f"no {name}")
            continue
        asked_for = [peers[name], "-c", f"from importlib.metadata import version; print(version({name!r}))"]
        said = subprocess.run(asked_for, capture_output=True, text=True).stdout.strip()
        found.append(f"{name} {said or 'of some version'}")
    return found
