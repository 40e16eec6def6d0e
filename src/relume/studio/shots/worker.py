"""What the studio's worker process does: the work of `relume insert` piece by piece, and of `relume model`."""

from __future__ import annotations

import signal
import warnings
from collections.abc import Callable
from multiprocessing.connection import Connection
from pathlib import Path
from types import FrameType
from typing import Any

import relume as rl
from relume.studio.shots.measured import measured_facts
from relume.studio.shots.merging import merged_facts
from relume.studio.words import in_the_page

Report = Callable[[str, float], None]
READY = ("ready",)
"""What comes first: from then on it can be stopped by a signal."""
HOLD, GO_ON = "hold", "go on"
"""What the pipe brings in the middle of a job."""
TRIED_AGAIN = 0.05
"""Seconds after which a job that could not be stopped where it was is stopped."""


def work(pipe: Connection) -> None:
    """Do the jobs that come through the pipe, until it is closed; a job is stopped by Ctrl-C's signal.

    A job is (kind, shot, folder of results, scratch folder, place looked at or None). What goes back is
    ("step", name, share) for progress and, last, ("done", facts), ("failed", line) or ("stopped",). After HOLD a job
    rests at its next report, until GO_ON.
    """
    signal.signal(signal.SIGINT, stop_where_modules_are_whole)
    if hasattr(signal, "SIGALRM"):
        signal.signal(signal.SIGALRM, lambda number, frame: signal.raise_signal(signal.SIGINT))
    pipe.send(READY)
    while True:
        try:
            asked = pipe.recv()
        except KeyboardInterrupt:  # meant for a job that was done already
            continue
        except (EOFError, OSError):
            return
        if asked in (HOLD, GO_ON):  # the same
            continue
        kind, shot, out, scratch, about = asked
        try:
            answer = _answer(pipe, kind, Path(shot), Path(out), Path(scratch), about)
        except KeyboardInterrupt:
            answer = ("stopped",)
        try:
            pipe.send(answer)
        except OSError:
            return


def stop_where_modules_are_whole(number: int, frame: FrameType | None) -> None:
    """Ctrl-C's signal: it waits while a module is imported, for one of which half is there fails every later job."""
    while frame is not None:
        if frame.f_code.co_filename.startswith("<frozen importlib") and hasattr(signal, "setitimer"):
            signal.setitimer(signal.ITIMER_REAL, TRIED_AGAIN)
            return
        frame = frame.f_back
    raise KeyboardInterrupt


def _answer(
    pipe: Connection, kind: str, shot: Path, out: Path, scratch: Path, about: tuple[float, float] | None
) -> tuple[Any, ...]:  # fmt: skip
    def report(step: str, share: float) -> None:
        pipe.send(("step", step, share))
        held = False
        while held or pipe.poll():
            held = pipe.recv() == HOLD

    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # they come back as the result's doubts
            seen = {} if about is None or kind not in PICTURED else {"about": about}
            return ("done", JOBS[kind](shot, out, scratch, report, **seen))
    except rl.errors.Interrupted:
        return ("stopped",)
    except MemoryError:
        return (
            "failed",
            "there is not enough memory for this; close what else is open, or make the photographs smaller",
        )
    except OSError as error:
        return ("failed", f"{error.filename or out}: {error.strerror or error}")
    except (rl.RelumeError, ValueError) as error:
        return ("failed", in_the_page(str(error).removeprefix(f"{shot}: ")))
    except Exception as error:
        return ("failed", f"a fault of relume itself: {type(error).__name__}: {' '.join(str(error).split())[:300]}")


def _check(shot: Path, _out: Path, _scratch: Path, report: Report) -> dict[str, Any]:
    """What the photographs show, in seconds."""
    found = rl.report.check_shot(rl.read_shot(shot), progress=report)
    return {"facts": {name: _shown(value) for name, value in found.facts.items()}, "doubts": _lines(found.doubts)}


def _look(
    shot: Path, out: Path, scratch: Path, report: Report, about: tuple[float, float] | None = None
) -> dict[str, Any]:  # fmt: skip
    """A quick look at the composite, and with it the light and the camera."""
    table = rl.read_shot(shot)
    result = rl.insert(table, out, progress=report, preview=True, about=about)
    # The small plate has whole squares of the plate's pixels as its own.
    small = result.camera
    whole = _plate_size(table)
    step = max(1, whole[0] // small.width)
    camera = small.resized(small.width * step, small.height * step).window(0, 0, *whole)
    found = measured_facts(table, result, camera, step, scratch) | {"doubts": _lines(result.doubts)}
    return found | {"picture": "preview.png", "radiance": "preview.exr"}


def _insert(
    shot: Path, out: Path, scratch: Path, report: Report, about: tuple[float, float] | None = None
) -> dict[str, Any]:  # fmt: skip
    """The whole job, as `relume insert` does it."""
    table = rl.read_shot(shot)
    if table.sequence is not None:
        made = rl.insert_frames(table, out, progress=report, finished=rl.write_report)
        rl.write_report(made, out)
        return {"frames": len(made.frames), "doubts": _lines(made.doubts), "report": "report.html"}
    result = rl.insert(table, out, progress=report, about=about)
    report("report", 0.0)
    rl.write_report(result, out)
    found = measured_facts(table, result, result.camera, 1, scratch) | {"doubts": _lines(result.doubts)}
    return found | {"picture": "composite.png", "radiance": "composite.exr", "report": "report.html"}


def _merge(shot: Path, _out: Path, scratch: Path, report: Report) -> dict[str, Any]:
    """The photographs merged, for their radiance to be looked at."""
    return merged_facts(shot, scratch, report)


def _model(place: Path, _out: Path, _scratch: Path, report: Report) -> dict[str, Any]:
    """Cameras and sizes of a place file, written into it."""
    report("finding cameras and sizes", 0.0)
    found = rl.model_place(place, out=place)
    return {"facts": found.facts(), "doubts": list(found.doubts)}


JOBS: dict[str, Callable[..., dict[str, Any]]] = {
    "check": _check,
    "merge": _merge,
    "look": _look,
    "insert": _insert,
    "model": _model,
}
PICTURED = ("look", "insert")
"""Those that show a picture while they go on."""


def _plate_size(shot: rl.Shot) -> tuple[int, int]:
    path = shot.files(shot.plate.photographs)[0]
    if rl.files.kind_of(path) not in ("JPEG", "PNG", "TIFF", "HEIF", "RAW"):
        return rl.read_radiance(path).size
    return rl.files.read_facts(path).size


def _lines(doubts: Any) -> list[str]:
    return [in_the_page(each.line) for each in doubts]


def _shown(value: object) -> str:
    return ", ".join(map(str, value)) if isinstance(value, list | tuple) else str(value)
