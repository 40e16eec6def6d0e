"""Many small brackets as files, for what merges a folder of them: three photographs of 48 × 32 pixels each."""

from __future__ import annotations

from pathlib import Path

from relume.image.photograph import Exposure
from shoots import exposed, textured, written

EXPOSURES = [Exposure(seconds, 1.0, 100.0) for seconds in (1 / 256, 1 / 32, 1 / 4)]


def write_brackets(folder: Path, count: int, *, bad: int | None = None) -> list[Path]:
    """A folder for each bracket, `room_0001` and so on; in the bad one a photograph ends early."""
    folders = []
    for index in range(1, count + 1):
        place = folder / f"room_{index:04d}"
        paths = written(place, exposed(textured(48, 32, seed=index), EXPOSURES, seed=index))
        if index == bad:
            torn = Path(paths[1])
            torn.write_bytes(torn.read_bytes()[:700])
        folders.append(place)
    return folders
