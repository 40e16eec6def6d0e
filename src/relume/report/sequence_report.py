"""The report of a whole sequence: some of its frames, how steady it is, and each frame's time."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from relume.image import files
from relume.project.insertion.sequence import SequenceMade, sparkles
from relume.report import plots
from relume.report.page import figure, heading, note, page, paragraph, side_by_side, table

SHOWN = 9
WIDTH = 480
"""Pixels of a picture in the report, at most."""


def write_sequence_report(result: SequenceMade, path: Path) -> None:
    """Write the page; frames without a composite.png are in the table only."""
    there = [frame for frame in result.frames if (frame.folder / "composite.png").is_file()]
    chosen = [there[i] for i in np.unique(np.linspace(0, len(there) - 1, min(SHOWN, len(there))).astype(int))]
    shown = [figure(_small(frame.folder / "composite.png"), f"Frame {frame.number}") for frame in chosen]
    unlike: dict[int, float] = {}
    window: list[np.ndarray] = []
    for index, frame in enumerate(there):
        window = [*window[-2:], files.read_photograph(frame.folder / "composite.png").pixels]
        if len(window) == 3 and len({each.shape for each in window}) == 1:
            unlike[there[index - 1].number] = sparkles(*window)
    parts = [
        "<h1>relume insert: a sequence</h1>",
        *(note(each) for each in result.notes),
        paragraph(f"{len(result.frames)} frames, {sum(frame.kept for frame in result.frames)} of them made before."),
        *(side_by_side(shown[i : i + 3]) for i in range(0, len(shown), 3)),
        heading("Frames"),
        table(
            [
                (
                    str(frame.number),
                    f"{frame.seconds:.1f} s" + (" (kept from before)" if frame.kept else ""),
                    f"{unlike[frame.number]:.3%}" if frame.number in unlike else "",
                )
                for frame in result.frames
            ],
            head=("frame", "time", "pixels unlike the frame before and after"),
        ),
    ]
    files.write_text(path, page("relume insert: a sequence", parts))


def _small(path: Path) -> bytes:
    pixels = files.read_photograph(path).pixels
    step = max(1, -(-pixels.shape[1] // WIDTH))
    return plots.encoded(np.ascontiguousarray(pixels[::step, ::step]))
