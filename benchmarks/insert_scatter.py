"""What objects change of a room, by three renderers: efficiency = 1 / (variance × seconds), from the scatter of seeds.

    python benchmarks/insert_scatter.py [--bpy PYTHON]        # without it, Cycles is left out

All of them are without bias, so that the variance over a few seeds is the error; no long references are needed, as
`insert.py` renders them. Pixels that no object covers; one warm call of each before.
"""

from __future__ import annotations

import time

import numpy as np
from insert import cycles, ours, path_pair
from insert_scenes import Cycles, room
from measured import Rows, asked

from relume.renderers.mitsuba.differential import Differential

WIDTH, SAMPLES, CYCLES_SAMPLES, SEEDS = 256, 384, 64, (11, 12, 13)


def main(rows: Rows, python: str | None, quick: bool) -> None:
    scene, camera = room(WIDTH // 4 if quick else WIDTH)
    more, seeds = (1, SEEDS[:2]) if quick else (16, SEEDS)
    beside = Differential(samples=64).change(scene, camera, seed=5).matte == 0
    ways = [
        ("relume", ours(scene, camera, False), SAMPLES),
        ("Mitsuba, two seeds", path_pair(scene, camera, "independent", False), SAMPLES),
        ("Mitsuba, multijittered", path_pair(scene, camera, "multijitter", False), SAMPLES),
        ("Mitsuba, one seed", path_pair(scene, camera, "independent", True), SAMPLES),
    ]
    if python is not None:
        peer = Cycles(python)
        for name, catcher in (("Cycles, with and without", False), ("Cycles, catcher", True)):
            way = cycles(peer, scene, camera, catcher=catcher, same_seed=not catcher, denoise=False)
            ways.append((name, way, CYCLES_SAMPLES))
    else:
        rows.absent("what objects change, by Cycles", "no interpreter with bpy was given (--bpy)", goal="change_cycles")
    own: tuple[float, float] | None = None
    for name, way, most_samples in ways:
        samples = most_samples * more // 16
        way(samples, 1)
        begun = time.perf_counter()
        runs = [way(samples, seed) for seed in seeds]
        seconds = float(np.median([each for _, each in runs]))
        variance = np.stack([difference for difference, _ in runs]).var(axis=0, ddof=1)[beside].mean(axis=-1)
        all_, most = (float(np.sort(variance)[: round(len(variance) * share)].mean()) for share in (1, 0.99))
        own = own or (all_ * seconds, most * seconds)
        print(
            f"{name:26} {samples:4} samples {seconds:6.2f} s, variance {all_:.3g}, without the worst 1 % {most:.3g}; "
            f"relume is {all_ * seconds / own[0]:.1f} and {most * seconds / own[1]:.1f} times as efficient "
            f"({time.perf_counter() - begun:.0f} s in all)"
        )
        if name != "relume":
            goal = "change_cycles" if name.startswith("Cycles") else "change_mitsuba"
            what = f"what objects change, {samples} samples: efficiency by {name}"
            rows.value(f"{what}, without the worst 1 %", most * seconds / own[1], "×", goal=goal)
            rows.value(what, all_ * seconds / own[0], "×")


if __name__ == "__main__":
    parser = asked(__doc__)
    parser.add_argument("--bpy", metavar="PYTHON", help="an interpreter that has bpy")
    options = parser.parse_args()
    main(Rows(options.rows), options.bpy, options.quick)
