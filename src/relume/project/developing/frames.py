"""The frames of a sequence, developed in this process or by the workers of a cluster, with the same bits.

The adaptation of a frame depends on all frames before it, by a few numbers of each. So workers first measure every
frame, this process puts what they measured in order, and workers then develop the frames. One process measures and
develops frame after frame, by the same functions.
"""

from __future__ import annotations

import hashlib
import pickle
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from relume.cluster.claims import held
from relume.cluster.connection import connect
from relume.cluster.file_tasks import FileTask, with_name
from relume.cluster.records import key_of, record, recorded
from relume.cluster.tasks import run_tasks
from relume.errors import Doubt, GatheredDoubts, Incomplete, warn
from relume.image.radiance import RadianceMap
from relume.project.developing.develop_files import DevelopSettings, Progress, read_scene_light
from relume.virtual_camera.protocols import Adaptation
from relume.virtual_camera.settling import Settled
from relume.virtual_camera.view import View
from relume.virtual_camera.virtual_camera import VirtualCamera


@dataclass(frozen=True, eq=False)
class Shared:
    """What the frames of a sequence have in common."""

    settings: DevelopSettings
    camera: VirtualCamera
    view: View


@dataclass(frozen=True)
class FrameMeasured:
    """What the adaptation of a sequence follows of one frame.

    seen : ln cd/m² before the lens; None of a black frame
    own : what the tone operator alone would adapt to; None while what the eye sees, by which a lens draws, is not known
    """

    seen: float | None
    own: tuple[float, ...] | None = None


@dataclass(frozen=True, eq=False)
class Frame:
    """One frame, for whoever measures or develops it.

    index : from 0, by which its grain is drawn
    key : a hash of what the frames share
    measured, settled : of the frames up to this one, as far as that is known
    """

    task: FileTask
    shared: Shared
    index: int
    key: str
    measured: FrameMeasured | None = None
    settled: Settled | None = None


@dataclass(frozen=True)
class FrameDeveloped:
    """A frame that is there: the shares of it that are white and black, and whether an earlier run had made it."""

    white: float
    black: float
    kept: bool


def develop_frames_in(
    tasks: Sequence[FileTask], folder: Path, shared: Shared, cluster: Any, progress: Progress, memory: int
) -> list[FrameDeveloped]:
    """Every frame in its folder; raises Incomplete where some failed."""
    key = hashlib.sha256(pickle.dumps(shared)).hexdigest()
    frames = [Frame(task, shared, index, key) for index, task in enumerate(tasks)]
    start = Settled.before(shared.settings.frames_per_second, shared.settings.settling)
    failed: dict[int, str] = {}
    with held(folder) as lock:
        if cluster is None:
            made = _run(_InOrder(start), frames, failed, "developing", progress)
        else:
            with connect(cluster) as connected:
                more = {"cluster": connected, "memory": memory, "paths": [lock, tasks[0].sources[0]]}
                made = _spread(frames, start, failed, progress, more)
    results = [made.get(index) for index in range(len(frames))]
    if failed:
        raise Incomplete([(tasks[index].name, why) for index, why in sorted(failed.items())], results)
    return [each for each in results if each is not None]


class _Work:
    """One frame while it is measured and developed; what is read or drawn for one step serves the next."""

    def __init__(self, frame: Frame) -> None:
        self.frame, self.camera, self.target = frame, frame.shared.camera, frame.task.targets[0]
        self.key = key_of(frame.task.sources, frame.key, frame.index)
        # What an earlier run recorded of the frame, with its picture; empty where there is none.
        self.before: dict[str, Any] = recorded(self.target, self.key) or {}

    def measured(self) -> FrameMeasured:
        """Before the lens alone."""
        return FrameMeasured(
            self.before["seen"] if self.before else self.camera.seen(self._scene, self.frame.shared.view)
        )

    def adapted(self, seen: float | None, settled: Settled) -> FrameMeasured:
        """Behind the lens, too."""
        # Without a lens nothing is drawn by what the eye has settled on.
        if self.before and (not self.camera.optics or self.before["eye"] == settled.eye):
            return FrameMeasured(seen, tuple(self.before["own"]))
        own = self.camera.tone.adapt(self._image(settled), self._view(settled))
        return FrameMeasured(seen, tuple(own.values.tolist()))

    def developed(self, measured: FrameMeasured, settled: Settled) -> FrameDeveloped:
        """Write the picture, unless it is there, and record of what it was made."""
        used = settled.adaptation or Adaptation(np.array(measured.own, np.float64))
        facts: dict[str, Any] = {"eye": settled.eye, "adaptation": used.values.tolist()}
        kept = bool(self.before) and all(self.before[name] == value for name, value in facts.items())
        if not kept:
            with GatheredDoubts() as gathered:
                drawn = self.camera.tone_mapped(self._image(settled), self._view(settled), used)
                clipping = drawn.write(self.target)
            doubts = [[each.line, each.effect] for each in (*self._scene_doubts, *gathered.doubts)]
            facts |= {"own": measured.own, "seen": measured.seen, "doubts": doubts}
            facts |= {"white": float(max(clipping.above)), "black": float(max(clipping.below))}
            record(self.target, self.key, facts)
            self.before = facts
        name = self.frame.task.name
        for line, effect in self.before["doubts"]:
            warn(with_name(name, line), effect)
        return FrameDeveloped(self.before["white"], self.before["black"], kept)

    @cached_property
    def _read(self) -> tuple[RadianceMap, tuple[Doubt, ...]]:
        with GatheredDoubts() as gathered:
            scene = read_scene_light(self.frame.task.sources[0], self.frame.shared.settings, lit=False)
        return scene, gathered.doubts

    @property
    def _scene(self) -> RadianceMap:
        return self._read[0]

    @property
    def _scene_doubts(self) -> tuple[Doubt, ...]:
        return self._read[1]

    @cached_property
    def _drawn(self) -> dict[float | None, np.ndarray]:
        return {}

    def _image(self, settled: Settled) -> np.ndarray:
        if settled.eye not in self._drawn:
            self._drawn[settled.eye] = self.camera.image(self._scene.radiance, self._view(settled))
        return self._drawn[settled.eye]

    def _view(self, settled: Settled) -> View:
        return settled.view(self.frame.shared.view, self.frame.index)


class _InOrder:
    """Frame after frame in one process: each is measured, then developed with what is settled on by then."""

    def __init__(self, settled: Settled) -> None:
        self.settled = settled

    def __call__(self, frame: Frame) -> FrameDeveloped:
        work = _Work(frame)
        seen = work.measured().seen
        self.settled = self.settled.seeing(seen)
        measured = work.adapted(seen, self.settled)
        self.settled = _adapting(self.settled, measured)
        return work.developed(measured, self.settled)


def _measured(frame: Frame) -> FrameMeasured:
    """Measured by a worker: behind the lens too, once that is known by which it draws."""
    work = _Work(frame)
    with GatheredDoubts():  # of the picture they are gathered as it is developed
        if frame.measured is not None and frame.settled is not None:
            return work.adapted(frame.measured.seen, frame.settled)
        seen = work.measured().seen
        return FrameMeasured(seen) if frame.shared.camera.optics else work.adapted(seen, _UNSETTLED.seeing(seen))


def _developed(frame: Frame) -> FrameDeveloped:
    """Developed by a worker."""
    assert frame.measured is not None and frame.settled is not None  # `_spread` gives both
    return _Work(frame).developed(frame.measured, frame.settled)


_UNSETTLED = Settled(1.0)
"""For tone operators, none of which goes by what the eye before the lens has settled on."""


def _adapting(settled: Settled, measured: FrameMeasured) -> Settled:
    return settled.adapting(Adaptation(np.array(measured.own, np.float64)), lit=measured.seen is not None)


def _spread(
    frames: list[Frame], start: Settled, failed: dict[int, str], progress: Progress, more: dict[str, Any]
) -> dict[int, FrameDeveloped]:
    """The frames by workers: measured, put in order here, and developed."""
    measured = _run(_measured, frames, failed, "measuring", progress, **more)
    seen = {index: each.seen for index, each in measured.items()}
    settled, eyes = start, {}
    for frame in frames:
        if frame.index in seen:
            settled = eyes[frame.index] = settled.seeing(seen[frame.index])
    if frames[0].shared.camera.optics:
        behind = [replace(frame, measured=measured[frame.index], settled=eyes[frame.index])
                  for frame in frames if frame.index in seen]  # fmt: skip
        measured = _run(_measured, behind, failed, "measuring behind the lens", progress, **more)
    ready, settled = [], start
    for frame in frames:
        if frame.index in seen:
            settled = settled.seeing(seen[frame.index])
        if (own := measured.get(frame.index)) is not None:
            settled = _adapting(settled, own)
            ready.append(replace(frame, measured=own, settled=settled))
    return _run(_developed, ready, failed, "developing", progress, **more)


def _run(
    function: Callable[[Frame], Any], frames: Sequence[Frame], failed: dict[int, str], step: str, progress: Progress,
    **more: Any,
) -> dict[int, Any]:  # fmt: skip
    """The results by the frames' indices; why frames failed goes into `failed`."""
    progress(step, 0.0)
    try:
        results = run_tasks(
            function, frames, names=[str(frame.index) for frame in frames], **more,
            progress=lambda done, lost, to_go, left: progress(step, (done + lost) / max(1, len(frames))),
        )  # fmt: skip
    except Incomplete as error:
        failed.update((int(name), why) for name, why in error.failed)
        results = error.results
    return {frame.index: each for frame, each in zip(frames, results, strict=True) if each is not None}
