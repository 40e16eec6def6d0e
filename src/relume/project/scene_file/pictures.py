"""Writing what is rendered of a scene file: one picture, numbered pictures, a movie; here or by many workers."""

from __future__ import annotations

import hashlib
import pickle
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from relume.cluster.claims import Claimed, claim, held
from relume.cluster.connection import connect
from relume.cluster.records import RECORDS, record, recorded
from relume.cluster.renaming import remove
from relume.cluster.tasks import run_tasks
from relume.errors import CannotResume, OutputNotWritten, naming, warn
from relume.image import files
from relume.image.files.atomic import made_folder
from relume.image.radiance import RadianceMap
from relume.project.forecast import memory_for
from relume.project.scene_file.frame_plan import PREVIEW, FramePlan
from relume.project.scene_file.renders import Pictures, Report
from relume.renderers.progressive.accumulation import RenderSession, forget
from relume.renderers.progressive.convergence import Sums
from relume.renderers.progressive.graceful_shutdown import HardStop
from relume.renderers.progressive.pass_workers import PassWorkers
from relume.renderers.results import Render
from relume.virtual_camera.film.film import Film


def write_picture(out: Path, picture: Render, film: Film, unit: str) -> None:
    """Write one picture in the format that its suffix names."""
    from relume.virtual_camera.developing import develop

    suffix = out.suffix.lower()
    if suffix == ".exr":
        layers: dict[str, np.ndarray] = {"radiance": picture.radiance, "matte": picture.matte}
        layers |= {"depth": picture.depth, "normal": picture.normal}
        if picture.rays is not None:
            layers["rays"] = picture.rays.astype(np.float32)
        files.write_layers(out, layers, unit=unit)
    elif suffix == ".hdr":
        files.write(out, RadianceMap(picture.radiance, unit=unit))
    else:
        files.write(out, develop(picture.radiance, film))


@dataclass(frozen=True, eq=False)
class Preview:
    """Writes what there is of a picture under way, developed; for `RenderSession.preview`.

    path : ends in .png; its folder must exist
    film : develops it
    """

    path: Path
    film: Film

    def __call__(self, sums: Sums) -> None:
        """Write it. A full disk costs the preview, with a warning, and not the render."""
        from relume.virtual_camera.developing import develop

        try:
            files.write(self.path, develop(sums.mean("radiance").astype(np.float32), self.film))
        except OutputNotWritten as error:
            warn(f"no preview: {error}")

    def remove(self) -> None:
        """Remove it, once the picture itself is there; one that another program has open on Windows stays."""
        with suppress(OSError):
            remove(self.path)


@dataclass(frozen=True)
class Sessions:
    """What goes on around the renders of a job: a state kept of each that is interrupted, and previews.

    film : develops the previews
    restart : discard what is kept of an interrupted render
    preview : whether there are previews
    force : how a first Ctrl-C is answered in time, for programs that own their process
    """

    film: Film
    restart: bool = False
    preview: bool = False
    force: HardStop | None = None

    def of(self, target: Path) -> RenderSession:
        """The session of the picture that is written to `target`, whose state lies hidden beside it."""
        folder = target.absolute().parent
        preview = Preview(folder / f"{target.stem}{PREVIEW}", self.film) if self.preview else None
        return RenderSession(folder / f".{target.stem}.passes", self.restart, preview=preview, force=self.force)

    @contextmanager
    def rendering(self, target: Path) -> Iterator[RenderSession]:
        """The same for a block that renders and writes it, after which nothing of it is left."""
        session = self.of(target)
        yield session
        forget(session)
        if isinstance(session.preview, Preview):
            session.preview.remove()


def render_into(
    target: Path, pictures: Pictures, number: int, film: Film, unit: str, report: Report, sessions: Sessions,
    workers: PassWorkers | None = None, write: Callable[[Path, Render, Film, str], None] = write_picture,
) -> None:  # fmt: skip
    """Render one picture and write it; what is kept of an earlier run that was interrupted is resumed."""

    def once(sessions: Sessions) -> None:
        with sessions.rendering(target) as session:
            watch = replace(session, workers=workers)
            picture = next(pictures.made(report, [number], lambda number: watch))
            write(target, picture, film, unit)

    try:
        once(sessions)
    except CannotResume as error:
        warn(f"cannot resume the saved render: {str(error).partition(';')[0]}; starting over")
        once(replace(sessions, restart=True))


@contextmanager
def workers_for(out: Path, cluster: Any, pixels: int) -> Iterator[PassWorkers | None]:
    """Who makes the parts of one picture, which lie in a hidden folder beside it until it is there."""
    if cluster is None:
        yield None
        return
    folder = out.absolute().with_name(f".{out.stem}.parts")
    try:
        with held(folder), connect(cluster) as connected:
            yield PassWorkers(connected, folder, int(memory_for(pixels)))
    finally:
        # Another run may hold it: then it is not empty, and stays.
        with suppress(OSError):
            folder.rmdir()


def make_frames(
    folder: Path, pictures: Pictures, suffix: str, film: Film, unit: str, *, cluster: Any = None,
    report: Report = lambda stage, share: None, sessions: Sessions | None = None,
) -> int:  # fmt: skip
    """Make the frames of a plan as frame_0001 and so on in a folder; how many of them an earlier run had made.

    suffix : of the files, .png or .exr
    cluster : workers that make the frames; None makes them here
    Those that are there, made from the same, are kept. Several processes may make frames of a sequence in one folder.
    """
    plan = pictures.plan
    assert plan is not None  # of frames
    made_folder(folder)
    work = _Work(folder.absolute(), pictures, suffix, film, unit)
    if cluster is not None:
        return _spread(work, cluster, report)
    if plan.count is not None and pictures.name != "mitsuba":
        return _motion_made(work, plan, report)
    made, kept, waiting = 0, 0, []
    total = len(plan.numbers)

    def share(stage: str, part: float) -> None:
        report(stage, (made + part) / total if stage == "rendering" else part)

    # What other processes are making is looked at again when all else is done.
    for wait, numbers in ((False, plan.numbers), (True, waiting)):
        for number in numbers:
            with naming(f"frame {number}"):
                try:
                    kept += work.one(number, share, sessions or Sessions(film), report if wait else None)
                except Claimed:
                    waiting.append(number)
                    continue
            made += 1
            report("rendering", made / total)
    return kept


def join_frames(out: Path, folder: Path, plan: FramePlan, suffix: str = ".png") -> None:
    """Write the movie of frames that are there."""
    from relume.image.files.video import Movie

    with Movie(out, plan.rate) as movie:
        for number in plan.numbers:
            movie.add(files.read_photograph(folder / f"frame_{number:04d}{suffix}").pixels)


@dataclass(frozen=True, eq=False)
class _Work:
    """The frames of a job: what they are of, and where and how they are written. It pickles."""

    folder: Path
    pictures: Pictures
    suffix: str
    film: Film
    unit: str

    def target(self, number: int) -> Path:
        return self.folder / f"frame_{number:04d}{self.suffix}"

    def key(self, number: int) -> str:
        return self.pictures.key(number, [self.suffix, self.film if self.suffix == ".png" else None, self.unit])

    def there(self, number: int) -> bool:
        return recorded(self.target(number), self.key(number)) is not None

    def written(self, number: int, picture: Render) -> None:
        _write_frame(self.target(number), picture, self.film, self.unit)
        record(self.target(number), self.key(number), [])

    def one(self, number: int, report: Report, sessions: Sessions, waiting: Report | None) -> bool:
        """Make a frame, unless that was done: whether it was. Raises Claimed where another process makes it."""
        if self.there(number):
            return True
        say = waiting and (lambda holder: waiting(f"waiting for frame {number}, which {holder} makes", 0.0))
        with claim(self.folder / f".frame_{number:04d}.lock", say):
            # Another process may have made it meanwhile.
            if self.there(number):
                return True
            render_into(
                self.target(number), self.pictures, number, self.film, self.unit, report, sessions, write=_write_frame
            )
            record(self.target(number), self.key(number), [])
        return False


def _write_frame(target: Path, picture: Render, film: Film, unit: str) -> None:
    """Write a frame: as .exr its radiance alone, for there are many."""
    if target.suffix == ".exr":
        files.write(target, RadianceMap(picture.radiance, unit=unit))
    else:
        write_picture(target, picture, film, unit)


def _motion_made(work: _Work, plan: FramePlan, report: Report) -> int:
    """The frames of a motion that are not there, one after the other, by tables that are made once."""
    todo = [number for number in plan.numbers if not work.there(number)]
    pictures = work.pictures.made(report, todo)
    for number in todo:
        with naming(f"frame {number}"):
            work.written(number, next(pictures))
    return len(plan.numbers) - len(todo)


@dataclass(frozen=True)
class FrameTask:
    """One frame for a worker.

    shared : the file in which all that the frames share is pickled, beside them
    key : a hash of it
    """

    shared: Path
    key: str
    number: int


def _spread(work: _Work, cluster: Any, report: Report) -> int:
    """The frames by the workers of a cluster; those that an earlier run made are kept."""
    plan = work.pictures.plan
    assert plan is not None
    numbers = plan.numbers
    with held(work.folder) as lock, connect(cluster) as connected:
        # What all frames share lies in a file, which each worker reads once.
        content = pickle.dumps(work)
        shared, key = work.folder / RECORDS / "motion.pickle", hashlib.sha256(content).hexdigest()
        shared.parent.mkdir(exist_ok=True)
        with files.replacing(shared) as temporary:
            temporary.write_bytes(content)
        kept = run_tasks(
            _frame_made, [FrameTask(shared, key, number) for number in numbers],
            names=[f"frame {number}" for number in numbers], cluster=connected, paths=[lock, shared],
            progress=lambda done, failed, to_go, left: report("rendering", (done + failed) / len(numbers)),
        )  # fmt: skip
        remove(shared)
    return sum(kept)


def _frame_made(task: FrameTask) -> bool:
    work = _shared(task.shared, task.key)
    if work.there(task.number):
        return True
    work.written(task.number, next(work.pictures.made(lambda stage, share: None, (task.number,))))
    return False


@lru_cache(maxsize=1)
def _shared(path: Path, key: str) -> _Work:
    """What the frames share; `key` is there for the cache alone."""
    return pickle.loads(path.read_bytes())
