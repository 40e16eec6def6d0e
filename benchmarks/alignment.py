"""Aligning seven hand-held photographs of 12 megapixels: time and error beside OpenCV's AlignMTB, in one run.

The photographs are those of the tests: a scene read through cubic splines at shifts within ±64 pixels and turns within
±1°, noise, a camera's curve, 8 bits. Errors are against the motions that made them, of the worst frame: the largest at
the picture's corners, and the root mean square over the picture. AlignMTB finds whole shifts and no turn.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
from measured import Rows, asked

from relume.capture.alignment.alignment import Aligned, align
from relume.capture.alignment.pyramid import pyramid
from relume.capture.alignment.warping import move


def timed(work: dict[str, Callable[[], object]], rounds: int) -> dict[str, tuple[list[float], list[float]]]:
    """Seconds of wall and of processor time of each turn; by turns, after a round that compiles and warms."""
    taken: dict[str, list[tuple[float, float]]] = {name: [] for name in work}
    for _ in range(rounds + 1):
        for name, each in work.items():
            begin, began = time.perf_counter(), time.process_time()
            each()
            taken[name].append((time.perf_counter() - begin, time.process_time() - began))
    return {name: ([wall for wall, _ in runs[1:]], [busy for _, busy in runs[1:]]) for name, runs in taken.items()}


if __name__ == "__main__":
    options = asked(__doc__).parse_args()
    rows = Rows(options.rows)
    sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests" / "support"))
    from handheld import stack

    held = stack(500, size=(1600, 1200) if options.quick else (4000, 3000), frames=7, fine=1)
    photographs = held.bracket.photographs
    pixels = [photograph.pixels for photograph in photographs]

    def by_opencv() -> list[np.ndarray]:
        """All frames aligned as AlignMTB does it by default, with room for 64 pixels either way."""
        moved = [np.empty_like(frame) for frame in pixels]
        cv2.createAlignMTB(max_bits=6).process(pixels, moved)
        return moved

    aligned: Aligned = align(held.bracket)
    work: dict[str, Callable[[], object]] = {
        "relume, all": lambda: align(held.bracket),
        "its reducing": lambda: [pyramid(photograph) for photograph in photographs],
        "its moving": lambda: [move(p, m) for p, m in zip(photographs, aligned.motions, strict=True)],
        "AlignMTB": by_opencv,
    }
    seconds = timed(work, 1 if options.quick else 3)
    for name, (wall, busy) in seconds.items():
        print(f"{name:14} {np.median(wall):6.2f} s, {np.median(busy):6.2f} s of processors")
    peer = f"OpenCV {cv2.__version__} AlignMTB"
    what = f"alignment, 7 × {pixels[0].size / 3e6:.0f} megapixels"
    rows.ratio(what, seconds["relume, all"][0], peer, seconds["AlignMTB"][0], limit="≥ 2")
    found = np.array([(motion.dx, motion.dy, motion.angle) for motion in aligned.motions])
    grey = [cv2.cvtColor(frame, cv2.COLOR_RGB2GRAY) for frame in pixels]
    middle = len(grey) // 2
    shifts = [cv2.createAlignMTB(max_bits=6).calculateShift(grey[middle], frame) for frame in grey]
    # OpenCV gives how a frame has to be moved, relume gives where it lies.
    theirs = np.array([(-x, -y, 0.0) for x, y in shifts])
    for name, motions, reference in (("relume", found, aligned.reference), ("AlignMTB", theirs, middle)):
        corner, average = (error.max() for error in held.errors(motions, reference))
        rows.value(f"alignment, {name}: worst frame at a corner", float(corner), "pixels")
        print(f"{name:9} worst frame: {average:7.3f} px root mean square")
