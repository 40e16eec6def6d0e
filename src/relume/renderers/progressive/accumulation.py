"""The loop over a render's passes: sums in a fixed order, a stop at the noise asked for, and a state kept on disk.

A pass is a few samples of every pixel with a seed of its own. Whatever interrupts the loop, the sums are those of the
passes 0, 1, 2 … in this order, so that a render that was resumed has the bits of one that never stopped.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Collection, Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from threading import Lock
from types import TracebackType

import numpy as np

from relume.errors import Doubt, Interrupted, doubts_kept_back, warn
from relume.image.bands import SMALL
from relume.renderers.progressive.checkpoint import Checkpoint, read_checkpoint, remove_checkpoint, write_checkpoint
from relume.renderers.progressive.convergence import Sums, Target
from relume.renderers.progressive.graceful_shutdown import HardStop, StopFlag, interruptible
from relume.renderers.progressive.pass_workers import PassWorkers
from relume.renderers.results import Progress

Planes = Mapping[str, np.ndarray]
Plan = Callable[[Sums], "np.ndarray | None"]
"""How many passes each pixel (H, W) is to have in all, from the first of them; None for one more of all pixels."""
Preview = Callable[[Sums], None]
"""Called with what there is after 1, 2, 4, 8 … passes."""
SHARE = 0.02
"""Share of the time that may go into writing states: the same two hundredths as of work that a crash may cost."""


@dataclass(frozen=True)
class RenderSession:
    """What goes on around a long render; none of it changes a pixel.

    checkpoint : the file that its state is kept in, so that it can be resumed; None keeps nothing
    restart : begin anew whatever is kept there
    seconds : how often the state is written, at least; more seldom where writing takes more than 2 % of the time. 30
        loses half of the minute that a crash may cost
    preview : shows what there is after 1, 2, 4, 8 … passes
    force : how the process is ended in the middle of a pass that takes too long after Ctrl-C; None for all but programs
        that own their process
    workers : who traces the passes, for renderers that have some; None traces them here
    """

    checkpoint: Path | None = None
    restart: bool = False
    seconds: float = 30.0
    preview: Preview | None = None
    force: HardStop | None = None
    workers: PassWorkers | None = None


NO_SESSION = RenderSession()
"""Nothing is kept, shown or forced."""


def pass_seed(seed: int, index: int) -> int:
    """One seed a pass, a hash of both, far from those of neighbouring seeds; 0 to 2³² − 1."""
    return int(np.random.SeedSequence([seed, index]).generate_state(1)[0])


def accumulate(
    trace: Callable[..., Planes],
    *,
    passes: int,
    seed: int = 0,
    scattered: Collection[str] | None = None,
    plan: Plan | None = None,
    target: Target | None = None,
    key: Mapping[str, str] | None = None,
    watch: RenderSession = NO_SESSION,
    progress: Progress | None = None,
    ahead: Collection[int] = (),
) -> Sums:
    """Trace passes and add them up.

    trace : planes of one pass by name, from its seed; each (H, W) or (H, W, C), the same names and shapes every time.
        With `plan` also from its pixels, (H, W) bool or None, and 0 elsewhere
    passes : at most
    seed : of the render; pass i has `pass_seed(seed, i)`
    scattered : planes whose squares are added too, for `Sums.variance`; all of them unless given
    plan : says how many passes each pixel has, asked after each pass until it does. What later passes find changes
        nothing of it: paths that are met seldom would be averaged further where one was met, and be too dark elsewhere
    target : stops earlier, once the estimated error is small enough
    key : what the pixels depend on, for the state kept on disk: a name and a hash or a short word each
    watch : what goes on around it
    progress : called with the share of `passes` that is done
    ahead : the seeds of passes that `trace` has traced together with the one before, as they are at each moment: a stop
        waits until they are added, which takes no time

    Raises Interrupted after the first Ctrl-C or signal to end, once the pass under way is done and the state kept;
    CannotResume where the state kept is another render's; OutputNotWritten; what `trace` or `progress` raise, after
    the state was kept.
    """
    if passes < 1:
        raise ValueError(f"{passes} passes; expected 1 or more")
    loop = _Loop(key or {}, watch)
    # Passes that were kept before, if any.
    sums, met = loop.begun()
    report = progress or (lambda share: None)
    due = 1 << sums.passes.bit_length()
    with _Shown(watch.preview) as shown, interruptible(force=watch.force, save=loop.save) as asked:
        try:
            while sums.passes < passes and not (target is not None and met >= target.confirmations):
                own = pass_seed(seed, sums.passes)
                if own not in ahead:
                    _leave_if(asked, loop, sums, passes)
                # One pass more, and whether the noise is low enough by now.
                planned = sums.planned
                if plan is not None and planned is None:
                    planned = plan(sums)
                chosen = None if planned is None else planned > sums.passes
                if chosen is not None and not chosen.any():
                    break
                sums = sums.plus(trace(own) if plan is None else trace(own, chosen), scattered, planned)
                if target is not None and target.due(sums.passes):
                    met = met + 1 if target.reached(sums) else 0
                loop.done(sums, met)
                report(sums.passes / passes)
                # A preview at each doubling.
                if sums.passes >= due:
                    due = 2 * sums.passes
                    shown.show(sums)
        except (Interrupted, KeyboardInterrupt):  # kept already, or a second signal that allows no more time
            raise
        except BaseException:
            loop.save()
            raise
        _leave_if(asked, loop, sums, passes)
        # Kept until the caller has put the result away: see `forget`.
        loop.save()
    report(1.0)
    return sums


def forget(watch: RenderSession) -> None:
    """Remove the state of a render whose result is safe elsewhere."""
    if watch.checkpoint is not None:
        remove_checkpoint(watch.checkpoint)


def _leave_if(asked: StopFlag, loop: _Loop, sums: Sums, passes: int) -> None:
    if asked.signal is not None:
        loop.save()
        raise Interrupted(sums.passes, passes, asked.signal, loop.watch.checkpoint)


class _Loop:
    """The state that is kept: the sums of the passes that are done, never half a pass."""

    def __init__(self, key: Mapping[str, str], watch: RenderSession) -> None:
        self.key, self.watch = key, watch
        self.current: tuple[Sums, int] = Sums(), 0
        self.saved = 0
        self.lock = Lock()
        self.next = time.monotonic() + watch.seconds

    def begun(self) -> tuple[Sums, int]:
        """The sums to go on from, and how often in a row the target was met."""
        path = self.watch.checkpoint
        if path is None:
            return self.current
        kept = None if self.watch.restart else read_checkpoint(path, self.key)
        if kept is None:
            remove_checkpoint(path)
            return self.current
        self.current = Sums.from_planes(kept.planes, kept.passes), kept.state["met"]
        self.saved = kept.passes
        return self.current

    def done(self, sums: Sums, met: int) -> None:
        self.current = sums, met
        if self.watch.checkpoint is not None and time.monotonic() >= self.next:
            before = time.monotonic()
            self.save()
            after = time.monotonic()
            self.next = after + max(self.watch.seconds, (after - before) / SHARE)

    def save(self) -> None:
        """Write the state, unless it is written already; two threads may ask for it."""
        path = self.watch.checkpoint
        with self.lock:
            sums, met = self.current
            if path is None or sums.passes == self.saved:
                return
            write_checkpoint(path, Checkpoint(self.key, sums.planes(), sums.passes, {"met": met}))
            self.saved = sums.passes


class _Shown:
    """Shows previews of small pictures while the next pass is traced, one at a time; the last before the loop ends."""

    def __init__(self, preview: Preview | None) -> None:
        self.preview = preview
        self.pool = ThreadPoolExecutor(1)
        self.last: Future[list[Doubt]] | None = None

    def __enter__(self) -> _Shown:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self.pool.shutdown()
        if error is None:
            self._finish()
        elif self.last is not None and self.last.exception() is None:
            self._finish()  # a preview's warnings often say why the render failed

    def show(self, sums: Sums) -> None:
        """Raises what the preview before raised."""
        if self.preview is None:
            return
        self._finish()
        if max(plane.size for plane in sums.totals.values()) > 3 * SMALL:
            self.preview(sums)
        else:
            self.last = self.pool.submit(self._shown, self.preview, sums)

    def _shown(self, preview: Preview, sums: Sums) -> list[Doubt]:
        with doubts_kept_back() as doubts:
            preview(sums)
        return doubts

    def _finish(self) -> None:
        last, self.last = self.last, None
        for doubt in [] if last is None else last.result():
            warn(doubt.line, doubt.effect)
