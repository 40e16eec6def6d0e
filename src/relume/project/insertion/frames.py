"""The frames of a sequence, each by the whole job, with what moves blurred while the shutter is open."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

from relume.project.insertion.insert import insert
from relume.project.insertion.sequence import SequenceMade, insert_sequence
from relume.project.insertion.sequence_moments import at_frame
from relume.project.shot_file.shot import Shot
from relume.renderers.progressive.graceful_shutdown import Force
from relume.renderers.renderer import Renderer
from relume.scene.cameras.shutter import Shutter


def insert_frames(
    shot: Shot, out: str | Path, *, renderer: Renderer | None = None, threads: int | None = None,
    report: Callable[[str, float], None] = lambda stage, share: None, restart: bool = False, force: Force | None = None,
) -> SequenceMade:  # fmt: skip
    """Insert the objects into every frame of the shot's sequence.

    The arguments are those of `insert`. Frames that are whole in `out` are kept. Raises RelumeError.
    """
    table = shot.sequence
    blurs = table is not None and table.shutter is not None
    shutter = Shutter(*table.shutter) if table is not None and table.shutter is not None else Shutter(0.0, 0.0)

    def one(frame: Shot, folder: Path, others: tuple[Path, ...]) -> Sequence[str]:
        number = int(folder.name.rpartition("_")[2])
        moving = (lambda time: at_frame(shot, number + time)) if blurs else None
        return insert(
            frame, folder, renderer=renderer, threads=threads, report=report, others=others, moving=moving,
            shutter=shutter, restart=restart, force=force,
        ).notes  # fmt: skip

    return insert_sequence(shot, out, insert=one, report=report)
