"""What is asked of the whole's speed, in the order of the table that `run_all.py` writes."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Goal:
    """One row of the table.

    before : what was seen when the goal was set
    limit : the most ("≤ 0.3") or the least ("≥ 5") that is asked, in the unit of the rows that name the goal
    """

    work: str
    before: str
    limit: str
    unit: str

    def met(self, seen: float) -> bool:
        return meets(seen, self.limit)


def meets(seen: float, limit: str) -> bool:
    """Whether a figure keeps a limit such as "≥ 5" or "≤ 0.3"."""
    sign, _, number = limit.partition(" ")
    return {"≥": seen >= float(number), "≤": seen <= float(number)}[sign]


GOALS: dict[str, Goal] = {
    "cold": Goal("first runs after an installation by pip, against the second", "2.6–17 ×", "≤ 1.5", "×"),
    "demo": Goal("the demo, warm, from JPEGs to the report", "47 s", "≤ 25", "s"),
    "change_mitsuba": Goal(
        "what objects change, efficiency at equal robust error, by two Mitsuba renders", "3.1–7.9 ×", "≥ 5", "×"
    ),
    "change_cycles": Goal("the same by Cycles", "3.6–4.7 ×", "≥ 20", "×"),
    "pass_start": Goal("starting a pass, of the pass", "not measured", "≤ 5", "%"),
    "triangles": Goal("an object of 1.88 million triangles against one of 20 thousand", "2.8 ×", "≤ 1.3", "×"),
    "shading": Goal("shading 1280×720, D + S", "45–63 frames/s", "≥ 90", "frames/s"),
    "whitted": Goal("Whitted against POV-Ray's trace, like for like", "1.35–3.1 ×", "≥ 3", "×"),
    "mapping": Goal("lat-long 2048 to angular 1024, by skylibs", "4.4 ×", "≥ 8", "×"),
    "merge": Goal("merging 7 × 12 megapixels by turns, by OpenCV's MergeDebevec", "7.6 ×", "≥ 12", "×"),
    "relighting": Goal("relighting 2,048 lights of 8 bits, by the memory's time", "1.87 ×", "≤ 1.3", "×"),
    "low_rank": Goal("low rank within 1 %", "21 pictures/s", "≥ 40", "pictures/s"),
    "exr_write": Goal("EXR writing, by OpenImageIO", "0.52–0.59 ×", "≥ 1", "×"),
    "develop": Goal("`relume develop`, Reinhard global, the whole process, by Luminance HDR", "0.7 ×", "≥ 1.5", "×"),
    "info": Goal("`relume info FILE`", "0.53 s", "≤ 0.3", "s"),
    "reflect_memory": Goal("memory of `reflect` at 4096", "2.4 GB", "≤ 1", "GB"),
    "mapped_memory": Goal("memory of a 4K frame by `Prefiltered`", "3.5 GB", "≤ 1", "GB"),
    "sheet": Goal("`reflect --sheet`, processor time", "39 s", "≤ 7.8", "s"),
    "stage_view": Goal("`stage view` 256², processor time", "137 s", "≤ 27.4", "s"),
    "stage_relight": Goal("`stage relight` with a mesh, processor time", "30 s", "≤ 6", "s"),
    "suite": Goal("`make test`", "7.3 min", "≤ 6", "min"),
    "quick_suite": Goal("`make quick`", "not measured", "≤ 60", "s"),
    "large_plate": Goal("a plate of 48 megapixels inserted into whole, memory", "not tried", "≤ 6", "GB"),
}
