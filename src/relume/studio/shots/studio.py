"""The studio's server: one shot or place, its folder, its windows and its worker, on this machine alone."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Callable
from contextlib import contextmanager, suppress
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING

import relume as rl
from relume.studio.library import Library
from relume.studio.places.headers import is_place_file
from relume.studio.server import require_host, serve
from relume.studio.shots.folder import Folder

if TYPE_CHECKING:
    from collections.abc import Iterator

    from starlette.applications import Starlette

    from relume.studio.shots.jobs import Jobs

SHOT_FILE = "shot.toml"
RESULTS = "out"
"""The folder of results beside the shot file, unless another is given."""


def open_studio(
    path: str | os.PathLike[str],
    out: str | os.PathLike[str] | None = None,
    *,
    host: str = "127.0.0.1",
    port: int = 0,
    allow_remote: bool = False,
    open_browser: bool = True,
    say: Callable[[str], None] | None = None,
) -> None:
    """Make a composite by looking and pointing: a shot file and its photographs in the browser, until interrupted.

    path : a shot file, or a folder of photographs, in which shot.toml is read, or written at the first act; or a place
        file, in whose photographs edges are marked, and which `model_place` solves
    out : the folder of results and kept stages, as `insert` has it; "out" beside the shot file unless given; not of a
        place
    host : the address to listen at; this machine alone unless given, since whoever reaches the server edits the shot
    port : 0 for a free one
    allow_remote : needed for a host that other machines reach
    open_browser : whether to open the page, as long as there is a browser
    say : called once with the address, which holds the token that lets in
    Raises ValueError for another host without `allow_remote`, or for photogrammetry made elsewhere, which has nothing
    to mark; UnreadableFile for a path that is missing; RelumeError
    where the extra `studio` is not installed, or the port is taken.
    """
    shot = Path(path)
    if shot.is_dir():
        shot = shot / SHOT_FILE
    elif shot.suffix.lower() != ".toml":
        raise ValueError(f"{path} is neither a folder nor a shot file (.toml); give one of them")
    elif not shot.is_file():
        raise rl.errors.UnreadableFile(f"{path}: no such shot file; check its name, or give the folder of photographs")
    shot = shot.resolve()
    place = shot.is_file() and is_place_file(shot)
    if place and out is not None:
        raise ValueError(f"{shot.name} is a place file, which holds what is found itself; leave the folder {out} out")
    require_host(host, allow_remote, f"edits this {'place' if place else 'shot'} and reads its folder")
    results = Path(out).resolve() if out is not None else shot.parent / RESULTS
    _load_usd()
    with _place(shot) if place else _application(shot, results) as application:
        serve(application, host, port, allow_remote=allow_remote, open_browser=open_browser, say=say)


def _load_usd() -> None:
    """Load OpenUSD, where it is installed, while there is one thread.

    While it is loaded it holds the loader's lock and waits for Python's; a thread that begins just then has Python's
    and waits for the loader's. A mesh of USD that was dropped while material balls were made so ended all answers.
    """
    with suppress(ImportError):
        import_module("pxr.Tf")


@contextmanager
def _application(shot: Path, out: Path) -> Iterator[Callable[[], Starlette]]:
    """Makes the application of a shot; its worker and its scratch folder go with the block."""

    def make(scratch: Path, jobs: Jobs) -> Starlette:
        # Here and not above, for one line to say what is not installed.
        from relume.studio.shots.bundles import sweep
        from relume.studio.shots.document import Document
        from relume.studio.shots.routes import Studio, studio_application

        sweep(Folder(shot.parent))
        return studio_application(Studio(Folder(shot.parent), Document(shot), out, scratch, Library(()), jobs))

    with _working(make) as application:
        yield application


@contextmanager
def _place(path: Path) -> Iterator[Callable[[], Starlette]]:
    """Makes the application of a place file; its worker goes with the block."""

    def make(_scratch: Path, jobs: Jobs) -> Starlette:
        from relume.studio.places.place_file import PLACE
        from relume.studio.places.routes import PlaceStudio, place_application
        from relume.studio.shots.document import Document

        return place_application(PlaceStudio(Folder(path.parent), Document(path, PLACE), Library(()), jobs))

    with _working(make) as application:
        yield application


@contextmanager
def _working(make: Callable[[Path, Jobs], Starlette]) -> Iterator[Callable[[], Starlette]]:
    """An application with a scratch folder and a worker, which end with the block."""
    with tempfile.TemporaryDirectory(prefix="relume-studio-") as scratch:
        kept: list[Callable[[], None]] = []

        def made() -> Starlette:
            from relume.studio.shots.jobs import Jobs

            jobs = Jobs(Path(scratch))
            kept.append(jobs.close)
            return make(Path(scratch), jobs)

        try:
            yield made
        finally:
            for close in kept:
                close()
