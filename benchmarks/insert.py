"""What objects change of a room, cleaned by Open Image Denoise, by three renderers: how near it is to the truth.

    python benchmarks/insert.py [--bpy PYTHON] [--quick]        # without an interpreter that has bpy Cycles is left out

The scene, the ways and the efficiencies are those of `insert_scatter.py`, which measures them without a denoiser, by
their scatter alone. A denoiser is not without bias, so that here the error is the distance to a long render: relume's
for relume and for Mitsuba, which have one mean (tests/physics/test_differential_against_subtraction.py), and Cycles'
own. relume's change is cleaned as `relume insert` does it. Of Mitsuba's difference light added and light taken are
cleaned each on its own, guided by relume's planes, whose time is not counted; Cycles cleans its pictures itself.
"""

from __future__ import annotations

import numpy as np
from insert_scatter import (
    A_PASS,
    Way,
    compared,
    compiled,
    cycles_ways,
    error_rows,
    ours,
    path_pair,
    plate_of,
    seen_beside,
    two_sided,
)
from insert_scenes import Cycles, room
from measured import Rows, asked

LONG, CYCLES_LONG = 2048, 1024
"""Rays a pixel of the references."""


def main(rows: Rows, bpy: str | None, quick: bool) -> None:
    width, counts, seeds = (128, (64,), (11, 12)) if quick else (256, (32, 64, 256), (11, 12))
    share = 4 if quick else 1
    scene, camera = room(width)
    plate = plate_of(scene, camera)
    beside, guides = seen_beside(scene, camera)
    truth, _ = ours(scene, camera)(LONG // share, 1001)
    mine = Way("relume", ours(scene, camera, clean=True))
    pair = path_pair(scene, camera, "multijitter", same_seed=False)
    theirs = Way("two Mitsuba renders", lambda samples, seed: two_sided(*pair(samples, seed), guides))
    long = {} if bpy is None else cycles_ways(
        Cycles(bpy), scene, camera, plate, CYCLES_LONG // share, (1001,), denoise=False
    )  # fmt: skip
    for samples in counts:
        if samples <= A_PASS:
            compiled([mine, theirs], samples)
        runs = compared([mine, theirs], samples, seeds)
        found = {name: error_rows(each, plate, beside, truth) for name, each in runs.items()}
        told(rows, samples, found, "two Mitsuba renders", "change_mitsuba")
        if bpy is None:
            rows.absent(f"change, {samples} samples, OIDN, Cycles", "no --bpy was given", goal="change_cycles")
            continue
        catcher = cycles_ways(Cycles(bpy), scene, camera, plate, samples, seeds, denoise=True)
        for name, each in catcher.items():
            found[name] = error_rows(each, plate, beside, long[name][0][0])
            told(rows, samples, found, name, "change_cycles")


def told(rows: Rows, samples: int, found: dict[str, dict[str, float]], peer: str, goal: str) -> None:
    """One row for each measure of the error."""
    for measure, mine in found["relume"].items():
        theirs = found[peer][measure]
        rows.value(
            f"change, {samples} samples, OIDN, {measure}", theirs / mine, "×", goal=goal if "99 %" in measure else "",
            peer=peer, ours=mine, theirs=theirs, note="error × seconds",
        )  # fmt: skip


if __name__ == "__main__":
    parser = asked(__doc__)
    parser.add_argument("--bpy", metavar="PYTHON", help="an interpreter that has bpy; without it Cycles is left out")
    options = parser.parse_args()
    np.seterr(invalid="raise")
    main(Rows(options.rows), options.bpy, options.quick)
