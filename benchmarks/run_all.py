"""Every benchmark of speed, one after the other, each with its peers by turns; and the table of what was seen.

    python benchmarks/run_all.py [--quick] [--write docs/benchmarks.md] [SCRIPT …]     # all scripts unless named
    python benchmarks/run_all.py --set-up                          # environments of the peers that pip can install

What each script measured, and its words, are kept in `out/bench` (`out/bench/quick` of `--quick`); the table is made
from what lies there, so that a single script can be run again by its name. A script that fails or takes longer than
its limit stands in the table as such, with the rows that it had written till then. Those that take too long for a run
of all (`first_run`, `suite`, `natural_light`, `large_plates`) run only by their names. Peers: skylibs and Blender's
bpy are looked for in environments made by `--set-up` unless their interpreters are given; POV-Ray, Luminance HDR and
Embree are used where they are installed. Scripts of this folder that measure truth rather than time are not among
these.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import signal
import subprocess
import sys
import time
import venv
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from pathlib import Path

from measured import Result, Row, read_rows
from table import placed, written

HERE = Path(__file__).resolve().parent
OUT = HERE.parent / "out" / "bench"
PEERS = HERE.parent / "out" / "peers"
PACKAGES = {"skylibs": ("skylibs",), "bpy": ("bpy==5.0.1", "numpy")}
"""What pip installs into an environment of its own; each is another program's, so none of them is ours."""
MINUTES, LEAST = 40.0, 0.2
"""For everything, on two quiet cores; and what a script is started with at least."""


@dataclass(frozen=True)
class Script:
    """A script of the run.

    minutes : how long it may take
    peers : interpreters that it is given as `--NAME PYTHON`
    arguments : what else it is given
    by_name : whether it runs only when it is named, for it takes too long
    """

    file: str
    minutes: float
    peers: tuple[str, ...] = ()
    arguments: tuple[str, ...] = ()
    by_name: bool = False


SCRIPTS = (
    Script("start_up.py", 1),
    Script("commands.py", 4),
    Script("demo.py", 2),
    Script("merging.py", 2),
    Script("alignment.py", 2),
    Script("response.py", 1),
    Script("raw.py", 3),
    Script("mappings.py", 2, ("skylibs",)),
    Script("constellation.py", 1),
    Script("reflection_maps.py", 3),
    Script("light_stage.py", 3),
    Script("develop.py", 5),
    Script("files.py", 5),
    Script("ray_casting.py", 1),
    Script("whitted.py", 5),
    Script("insert_size.py", 3),
    Script("insert_scatter.py", 10, ("bpy",)),
    Script("growth.py", 5),
    Script("insert.py", 9, ("bpy",)),
    Script("first_run.py", 12, by_name=True),
    Script("suite.py", 40, by_name=True),
    Script("natural_light.py", 20, ("bpy",), by_name=True),
    Script("large_plates.py", 40, arguments=("--insert", "48"), by_name=True),
)


def ran(script: Path, minutes: float, arguments: list[str], folder: Path, quick: bool = False) -> Result:
    """Run one script, at most so long, and gather its rows; what it said goes to a file in `folder`."""
    rows, said = folder / f"{script.stem}.rows", folder / f"{script.stem}.txt"
    rows.unlink(missing_ok=True)
    words = [sys.executable, str(script), "--rows", str(rows), *arguments, *(["--quick"] if quick else [])]
    start, busy, own = time.perf_counter(), machine_seconds(), own_seconds()
    with said.open("wb") as out:
        # A session of its own, so that its processes end with it.
        process = subprocess.Popen(words, stdout=out, stderr=subprocess.STDOUT, start_new_session=True)
        try:
            code = process.wait(60 * minutes)
            state = "done" if code == 0 else f"failed ({code}): {last_line(said)}"
        except subprocess.TimeoutExpired:
            state = f"stopped after {60 * minutes:.0f} s"
        finally:
            end(process)
    seconds = time.perf_counter() - start
    others = None
    if busy is not None and (later := machine_seconds()) is not None:
        others = max(0.0, later - busy - (own_seconds() - own)) / seconds / (os.cpu_count() or 1)
    day = datetime.now(UTC).strftime("%Y-%m-%d")
    result = Result(script.name, state, seconds, others, day, quick, tuple(read_rows(rows)), commit())
    (folder / f"{script.stem}.json").write_text(json.dumps(asdict(result), ensure_ascii=False), encoding="utf-8")
    return result


def commit() -> str:
    """The checkout's commit, with "+" where its files have changed; nothing where git does not say."""
    words = ["git", "-C", str(HERE), "describe", "--always", "--dirty=+", "--exclude=*"]
    try:
        return subprocess.run(words, capture_output=True, text=True, check=True).stdout.strip()
    except (OSError, subprocess.CalledProcessError):
        return ""


def end(process: subprocess.Popen[bytes]) -> None:
    """End what a script left running."""
    try:
        os.killpg(process.pid, signal.SIGKILL)
    except ProcessLookupError:
        return
    finally:
        process.wait()


def last_line(path: Path) -> str:
    lines = path.read_text(encoding="utf-8", errors="replace").split("\n")
    return next((line.strip()[:160] for line in reversed(lines) if line.strip()), "it said nothing")


def machine_seconds() -> float | None:
    """Seconds that all processors have worked for anybody, since the machine started."""
    try:
        counts = [int(word) for word in Path("/proc/stat").read_text(encoding="ascii").split("\n")[0].split()[1:9]]
    except OSError:
        return None
    return (sum(counts) - counts[3] - counts[4]) / os.sysconf("SC_CLK_TCK")


def own_seconds() -> float:
    """Seconds of the processors that children took which have ended."""
    use = resource.getrusage(resource.RUSAGE_CHILDREN)
    return use.ru_utime + use.ru_stime


def interpreters(given: argparse.Namespace) -> dict[str, str]:
    """The peers' interpreters by name: given, or set up before."""
    found = {}
    for name in PACKAGES:
        python = getattr(given, name) or PEERS / name / "bin" / "python"
        if Path(python).is_file():
            found[name] = str(python)
        else:
            print(
                f"{name} is left out: no interpreter of it at {python}; --set-up makes one, --{name} PYTHON gives one"
            )
    return found


def set_up() -> None:
    """An environment for each peer that pip can install; one that is there stays."""
    for name, packages in PACKAGES.items():
        place = PEERS / name
        if not (place / "bin" / "python").is_file():
            venv.create(place, with_pip=True)
        done = subprocess.run([str(place / "bin" / "python"), "-m", "pip", "install", "-q", *packages])
        print(f"{name}: {'installed' if done.returncode == 0 else 'pip did not install it'} in {place}")


def results(folder: Path) -> list[Result]:
    """Everything that lies there, in the order of the scripts."""
    found = []
    for script in SCRIPTS:
        path = folder / f"{Path(script.file).stem}.json"
        if path.is_file():
            kept = json.loads(path.read_text(encoding="utf-8"))
            found.append(Result(**kept | {"rows": tuple(Row(**row) for row in kept["rows"])}))
    return found


def run(given: argparse.Namespace) -> int:
    """Run what is asked for and write the table; how many scripts did not end well."""
    # What was measured quickly does not take the place of what was measured whole.
    out = OUT / "quick" if given.quick else OUT
    out.mkdir(parents=True, exist_ok=True)
    peers, start, failures = interpreters(given), time.perf_counter(), 0
    chosen = [
        script for script in SCRIPTS
        if Path(script.file).stem in given.scripts or not (given.scripts or script.by_name)
    ]  # fmt: skip
    for script in chosen:
        left = given.minutes - (time.perf_counter() - start) / 60
        if left < LEAST:
            print(f"{script.file:20} not run, the {given.minutes:g} minutes are over; name it to run it alone")
            failures += 1
            continue
        arguments = [word for name in script.peers if name in peers for word in (f"--{name}", peers[name])]
        arguments += script.arguments
        result = ran(HERE / script.file, min(script.minutes, left), arguments, out, given.quick)
        failures += result.state != "done"
        others = "" if result.others is None else f", others {result.others:.0%} of the processors"
        print(f"{script.file:20} {result.seconds:6.1f} s, {len(result.rows)} rows{others}: {result.state}", flush=True)
    text = written(results(out), peers)
    (out / "table.md").write_text(text, encoding="utf-8")
    print(f"{out / 'table.md'}: {(time.perf_counter() - start) / 60:.1f} min in all")
    if given.write:
        document = given.write.read_text(encoding="utf-8")
        given.write.write_text(placed(document, "`make bench`", text), encoding="utf-8")
    return failures


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scripts", nargs="*", metavar="SCRIPT", help="names without .py; others keep what they had")
    parser.add_argument("--quick", action="store_true", help="smaller and fewer: is all in order?")
    parser.add_argument("--minutes", type=float, default=MINUTES, help="for everything")
    parser.add_argument("--write", type=Path, metavar="DOCUMENT", help="put the table there as its first section")
    parser.add_argument("--set-up", action="store_true", help="install the peers that pip can install, and end")
    for name in PACKAGES:
        parser.add_argument(f"--{name}", metavar="PYTHON", help=f"an interpreter that has {name}")
    options = parser.parse_args()
    if unknown := set(options.scripts) - {Path(script.file).stem for script in SCRIPTS}:
        parser.error(f"no such scripts: {', '.join(sorted(unknown))}")
    sys.exit(set_up() if options.set_up else min(1, run(options)))
