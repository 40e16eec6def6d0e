"""`write_report`: the page of any result that has one."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

if TYPE_CHECKING:
    from relume.lightstage.field.field import ReflectanceField


def write_report(result: object, path: str | Path, **choices: Any) -> None:
    """Write one HTML page that holds all it shows: pictures, plots, doubts and timings.

    result : what `insert`, `insert_frames` or `merge_brackets` returned, or the field of a light stage
    path : the file; in a folder it is report.html
    choices : of a merge `settings` and `profile` that it was made with; of a light stage `lights`, maps by name, and
        `title`

    Raises TypeError for anything else, OutputNotWritten.
    """
    path = Path(path)
    if path.is_dir():
        path = path / "report.html"
    # Each kind of result is loaded only if those before it are not what was given.
    from relume.capture.brackets.result import MergeResult

    if isinstance(result, MergeResult):
        from relume.report.capture_report import write_capture_report

        return write_capture_report(result, path, **choices)
    if type(result).__module__.startswith("relume.lightstage."):
        from relume.report.stage_report import write_stage_report

        write_stage_report(cast("ReflectanceField", result), path, **choices)
        return None
    from relume.project.insertion.outcome import Inserted
    from relume.project.insertion.sequence import SequenceMade
    from relume.report.insert_report import write_insert_report, write_sequence_report

    if isinstance(result, Inserted):
        return write_insert_report(result, path)
    if isinstance(result, SequenceMade):
        return write_sequence_report(result, path)
    raise TypeError(f"{type(result).__name__} has no report")
