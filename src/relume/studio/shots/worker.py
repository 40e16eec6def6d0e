"""What the studio's worker process does: the work of `relume insert`, one piece at a time, reported as it goes."""

from __future__ import annotations

import signal
import warnings
from collections.abc import Callable
from dataclasses import replace
from multiprocessing.connection import Connection
from pathlib import Path
from types import FrameType
from typing import Any

import numpy as np

import relume as rl
from relume.studio.shots.cameras import camera_facts
from relume.studio.shots.merging import merged_facts
from relume.studio.words import in_the_page

Report = Callable[[str, float], None]
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
    return _measured(result, camera, step, scratch) | {"picture": "preview.png", "radiance": "preview.exr"}


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
    found = _measured(result, result.camera, 1, scratch)
    return found | {"picture": "composite.png", "radiance": "composite.exr", "report": "report.html"}


def _merge(shot: Path, _out: Path, scratch: Path, report: Report) -> dict[str, Any]:
    """The photographs merged, for their radiance to be looked at."""
    return merged_facts(shot, scratch, report)


JOBS: dict[str, Callable[..., dict[str, Any]]] = {
    "check": _check,
    "merge": _merge,
    "look": _look,
    "insert": _insert,
}
PICTURED = ("look", "insert")
"""Those that show a picture while they go on."""


def _measured(result: Any, camera: rl.Camera, step: int, scratch: Path) -> dict[str, Any]:
    """What a page draws over the plate: camera, points it was fitted to, light; the light as a file beside."""
    probe = result.calibrated.probe
    scratch.mkdir(parents=True, exist_ok=True)  # what cleans temporary folders may have taken it since
    rl.write(scratch / "light.exr", rl.as_radiance_map(probe.light))
    fit, place = result.place.fit, result.place
    surfaces = () if place.recovered is None else place.recovered.surfaces
    return {
        "camera": camera_facts(camera),
        "points": (step * fit.points).round(2).tolist(),
        "offsets": (step * fit.offsets).round(3).tolist(),
        "agreement": replace(fit, points=step * fit.points, offsets=step * fit.offsets).agreement,
        "light": "light.exr",
        "irradiance": irradiance_facts(probe.light),
        "lamp": lamp_direction(probe.light),
        "unit": result.plate.unit,
        "reflectance": [list(each.reflectance) for each in surfaces if each.reflectance],
        "doubts": _lines(result.doubts),
        "seconds": {name: round(each, 2) for name, each in result.seconds.items()},
        "kept": list(result.kept),
    }


def irradiance_facts(light: rl.EnvironmentMap) -> list[list[float]]:
    """E(n) as coefficients (9, 3) of 1, x, y, z, xy, yz, zx, x² − y² and 3z² − 1 of a unit normal, fitted.

    What is left out of matte shading is about a hundredth (Ramamoorthi & Hanrahan 2001).
    """
    coarse = light.remapped(rl.mappings.LatLong(), 64)
    normals = rl.mappings.pixel_directions(rl.mappings.LatLong(), 8).reshape(-1, 3)
    x, y, z = normals.T
    basis = np.stack([np.ones_like(x), x, y, z, x * y, y * z, z * x, x * x - y * y, 3 * z * z - 1], axis=1)
    return np.linalg.lstsq(basis, coarse.irradiance(normals), rcond=None)[0].tolist()


def lamp_direction(light: rl.EnvironmentMap) -> list[float]:
    """The unit vector towards what throws the sharpest shadows: ∫ L² ω dω, so that a lamp counts more than a window."""
    coarse = light.remapped(rl.mappings.LatLong(), 64)
    weights = coarse.radiance.sum(-1).astype(np.float64) ** 2 * coarse.mapping.solid_angles(64)
    directions = rl.mappings.pixel_directions(coarse.mapping, 64)
    above = np.where(directions[..., 1] > 0, weights, 0.0)
    found = (above[..., None] * directions).sum((0, 1)) + np.array([0.0, 1e-12, 0.0])
    return (found / np.linalg.norm(found)).tolist()


def _plate_size(shot: rl.Shot) -> tuple[int, int]:
    path = shot.files(shot.plate.photographs)[0]
    if rl.files.kind_of(path) not in ("JPEG", "PNG", "TIFF", "HEIF", "RAW"):
        return rl.read_radiance(path).size
    return rl.files.read_facts(path).size


def _lines(doubts: Any) -> list[str]:
    return [in_the_page(each.line) for each in doubts]


def _shown(value: object) -> str:
    return ", ".join(map(str, value)) if isinstance(value, list | tuple) else str(value)
