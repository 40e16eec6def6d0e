"""The light maps of the film, as a mirrored ball in the robot's place would have shown them, 12 a second.

python examples/films/interface/light_maps.py [ROWS [SAMPLES]]
relume film examples/films/interface/film.toml

Miller & Hoffman (1984), §5.2: simulated environments. Each map is room.toml at one of its frames, rendered from the
middle of the robot's head. Maps that are there are kept; they take about a minute on four cores.
"""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import relume as rl

HERE = Path(__file__).parent
HEAD = (0.0, 1.22, 0.0)


def main(rows: int = 192, samples: int = 96) -> None:
    """Write probe/map_0001.hdr and so on."""
    room = rl.read_scene(HERE / "room.toml")
    assert room.sequence is not None
    (HERE / "probe").mkdir(exist_ok=True)
    settings = rl.RenderSettings(renderer="mitsuba", samples=samples, depth=6)
    for frame in room.sequence.table.frames:
        out = HERE / "probe" / f"map_{frame:04d}.hdr"
        if not out.exists():
            scene, _ = room.at_frame(frame)
            rl.render_environment(replace(room, scene=scene, sequence=None), out, HEAD, settings, rows=rows)
            print(out)


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
