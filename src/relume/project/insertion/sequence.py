"""A sequence: a shot inserted frame by frame, each frame complete or absent, so that a second run resumes it.

Every frame is rendered with the same seed. What stands still then has the same noise in every frame, to the bit, and
does not flicker; the noise stands on the screen, and what moves goes through it.
"""

from __future__ import annotations

import json
import time
import tomllib
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from relume.cluster.claims import Claimed, claim
from relume.cluster.renaming import remove
from relume.errors import Doubt, GatheredDoubts, IncompleteSequence, naming, ranked
from relume.image import files
from relume.project.insertion.frame_shots import at_frame, frames_of
from relume.project.insertion.outcome import require_folder
from relume.project.shot_file.sequence_table import frames_as_text, frames_in
from relume.project.shot_file.shot import Shot
from relume.project.stages import Progress
from relume.renderers.progressive.fingerprint import fingerprint, program

MakeFrame = Callable[[Shot, Path, tuple[Path, ...]], Sequence[Doubt]]
"""Inserts one frame's shot into its folder and returns doubts. The last are folders of stages of earlier frames, which
serve where they were made from the same."""
_DONE, _MOVIE = "frame.json", "sequence.json"
"""What a frame holds once it is whole, and which frames the movie shows."""
_SPARKLE = 24
"""Steps of 255 by which a pixel stands out of the frames before and after it to count as a sparkle: three times the
noise of a photograph, and what the eye sees at once."""


@dataclass(frozen=True)
class FrameMade:
    """One frame of a sequence.

    number, folder : which one, and where it lies
    seconds : it took; of the run that made it
    kept : whether an earlier run had made it
    doubts : what the user should know of it
    key : a hash of what it was made from
    """

    number: int
    folder: Path
    seconds: float
    kept: bool
    doubts: tuple[Doubt, ...]
    key: str = ""


@dataclass(frozen=True)
class SequenceMade:
    """All frames of a sequence, or those that were asked for.

    frames : in order
    movie : the file that shows them, or None where none could be written, or some frames alone were asked for
    doubts : what the user should know, each once, with the frames it belongs to; what matters most first
    """

    frames: tuple[FrameMade, ...]
    movie: Path | None
    doubts: tuple[Doubt, ...]

    @property
    def notes(self) -> tuple[str, ...]:
        """The doubts, a line each."""
        return tuple(doubt.line for doubt in self.doubts)


def make_frames(
    shot: Shot, out: str | Path, make: MakeFrame, *, frames: str | Iterable[int] | None = None,
    progress: Progress = lambda step, share: None,
) -> SequenceMade:  # fmt: skip
    """Make every frame of the shot's sequence by `make`: `out`/frame_0001 and so on, and a movie.

    out : folder; frames that are complete there, made from the same files and settings, are kept
    frames : these alone, and no movie
    progress : called with "frames" and the share of them that is there, beside what `make` reports

    Raises RelumeError; an error like Interrupted leaves the frames before it to a later run.
    """
    out = Path(out)
    require_folder(out)
    numbers = chosen_frames(shot, frames)
    # All shots first, so that a wrong key is reported before hours of rendering.
    shots = {number: at_frame(shot, number) for number in numbers}
    made: list[FrameMade] = []
    held: list[int] = []

    def one(number: int, wait: bool) -> None:
        progress("frames", len(made) / len(numbers))
        folder = out / f"frame_{number:04d}"
        shared = [out / "stages"] if (out / "stages").is_dir() else []
        before = tuple(dict.fromkeys([*shared, *(each.folder / "stages" for each in (*made[:1], *made[-1:]))]))
        waiting = _waiting(number, progress) if wait else None
        made.append(_one(shots[number], number, folder, before, make, _motion_key(shot), waiting))

    # What other processes are making is looked at again when all else is done.
    for number in numbers:
        try:
            one(number, wait=False)
        except Claimed:
            held.append(number)
    for number in held:
        one(number, wait=True)
    progress("frames", 1.0)
    made.sort(key=lambda frame: frame.number)
    return _sequence_of(shot, out, made, common=frames is None)


def assemble_frames(shot: Shot, out: str | Path, frames: str | Iterable[int] | None = None) -> SequenceMade:
    """The frames of the shot's sequence as they were made in `out`, or some of them, and the movie of them.

    Raises IncompleteSequence where one is not there, whole and of this shot.
    """
    out = Path(out)
    motion, made, missing, other = _motion_key(shot), [], [], []
    for number in chosen_frames(shot, frames):
        folder = out / f"frame_{number:04d}"
        key = fingerprint([frame_key(at_frame(shot, number)), motion])
        if (kept := _kept(number, folder, key)) is not None:
            made.append(kept)
        else:
            (other if (folder / _DONE).is_file() else missing).append(number)
    if missing or other:
        lacking = []
        if missing:
            lacking.append(f"frames {frames_as_text(missing)} are missing or not whole")
        if other:
            why = "other files or settings, or by another relume, library or kind of processor"
            lacking.append(f"frames {frames_as_text(other)} were made from {why}")
        again = frames_as_text([*missing, *other])
        raise IncompleteSequence(f"{out}: {' and '.join(lacking)}; make them with --frames {again}")
    return _sequence_of(shot, out, made, common=True)


def frame_key(shot: Shot) -> str:
    """A hash of what a frame at its moment depends on: the program, the tables, the bytes of every file they name."""
    # Without [[local]] the surface depends on the camera, which the tables alone do not say.
    surfaces = [table.model_dump(mode="json") for table in shot.surfaces()]
    return fingerprint([program(), shot.model_dump(mode="json"), surfaces, files_named_in(shot)])


def sparkles(before: np.ndarray, frame: np.ndarray, after: np.ndarray) -> float:
    """The share of pixels of a frame that stand out of both of their neighbours in time.

    before, frame, after : (H, W, 3) uint8, developed
    """
    middle = np.median(np.stack([before, frame, after]), axis=0)
    return float(np.mean(np.abs(frame - middle).max(axis=-1) > _SPARKLE))


def _motion_key(shot: Shot) -> object:
    """The keys of what moves while the shutter is open, which a frame's own shot lacks; None without a shutter."""
    if shot.sequence is None or shot.sequence.shutter is None:
        return None
    tables = shot.sequence.model_dump(mode="json", exclude={"frames", "plates"})
    keys = [each.keyframes for each in (shot.camera, shot.light, *shot.objects)]
    return [tables, [[key.model_dump(mode="json") for key in some] for some in keys]]


def chosen_frames(shot: Shot, frames: str | Iterable[int] | None) -> list[int]:
    """The numbers of the frames that are asked for; raises ValueError for one that the sequence has not."""
    numbers = frames_of(shot)
    if frames is None:
        return numbers
    asked = sorted(set(frames_in(frames) if isinstance(frames, str) else frames))
    if not asked:
        raise ValueError("no frames; give some, as 1-120, 1-120x2 or 5,7,9")
    if unknown := sorted(set(asked).difference(numbers)):
        what = f"frame {unknown[0]} is" if len(unknown) == 1 else f"frames {frames_as_text(unknown)} are"
        raise ValueError(f"{what} not in the shot's [sequence], which has {frames_as_text(numbers)}")
    return asked


def _waiting(number: int, progress: Progress) -> Callable[[str], None]:
    return lambda holder: progress(f"waiting for frame {number}, which {holder} makes", 0.0)


def _one(
    shot: Shot, number: int, folder: Path, before: tuple[Path, ...], make: MakeFrame, motion: object,
    waiting: Callable[[str], None] | None,
) -> FrameMade:  # fmt: skip
    """One frame, kept or made; raises Claimed where another process makes it, unless that is waited for."""
    key = fingerprint([frame_key(shot), motion])
    if (kept := _kept(number, folder, key)) is not None:
        return kept
    with claim(folder.with_name(f".{folder.name}.lock"), waiting):
        # Another process may have made it meanwhile.
        if (kept := _kept(number, folder, key)) is not None:
            return kept
        # From here until all is written the frame counts as not made.
        remove(folder / _DONE)
        begun = time.perf_counter()
        with naming(f"frame {number}"), GatheredDoubts() as gathered:
            found = make(shot, folder, before)
        seconds = time.perf_counter() - begun
        doubts = ranked([*gathered.doubts, *found])
        written = (path for path in sorted(folder.iterdir()) if path.is_file() and not path.name.startswith("."))
        sizes = {path.name: path.stat().st_size for path in written}
        record = {"key": key, "files": sizes, "seconds": seconds, "doubts": [[d.line, d.effect] for d in doubts]}
        files.write_text(folder / _DONE, json.dumps(record, indent=1))
    return FrameMade(number, folder, seconds, False, doubts, key)


def _kept(number: int, folder: Path, key: str) -> FrameMade | None:
    """The frame as an earlier run made it, if that is complete and of this key."""
    kept = _complete(folder, key)
    if kept is None:
        return None
    return FrameMade(number, folder, float(kept["seconds"]), True, tuple(Doubt(*each) for each in kept["doubts"]), key)


def _complete(folder: Path, key: str) -> dict[str, Any] | None:
    """The record of a frame that is there, complete and of this key; None for any other."""
    try:
        record = json.loads((folder / _DONE).read_text(encoding="utf-8"))
        same = record["key"] == key and bool(record["files"])
        there = all((folder / name).stat().st_size == size for name, size in record["files"].items())
        return record if same and there else None
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        return None


def files_named_in(shot: Shot) -> list[Path]:
    """Every file that a string of the shot names, alone or by a pattern, and those that .gltf and place files name."""
    found: list[Path] = []
    for text in strings_in(shot):
        if any(c in text for c in "*?["):
            found.extend(sorted(p for p in shot.folder.glob(text) if p.is_file()))
        elif 0 < len(text) < 1024 and "\0" not in text and (shot.folder / text).is_file():
            found.append(shot.folder / text)
    parts = {".gltf": _parts_of, ".toml": _model_of}
    named = [part for path in found if path.suffix.lower() in parts for part in parts[path.suffix.lower()](path)]
    return [*found, *named]


def strings_in(shot: Shot) -> Iterator[str]:
    """Every string of the shot's tables; those that name files among them."""
    return _strings(shot.model_dump(mode="json"))


def _parts_of(path: Path) -> Iterator[Path]:
    try:
        header = json.loads(path.read_bytes())
    except (OSError, ValueError):  # reported where the mesh is read
        return
    for text in _strings([header.get("buffers"), header.get("images")]):
        if not text.startswith("data:") and len(text) < 1024 and (path.parent / text).is_file():
            yield path.parent / text


def _model_of(path: Path) -> Iterator[Path]:
    """The files of the photogrammetry that a place file names."""
    try:
        model = path.parent / str(tomllib.loads(path.read_text(encoding="utf-8"))["photogrammetry"]["model"])
    except (OSError, ValueError, KeyError, TypeError):  # reported where the place is read
        return
    if model.is_dir():
        yield from sorted(model / f"{name}{suffix}" for name in ("cameras", "images") for suffix in (".txt", ".bin")
                          if (model / f"{name}{suffix}").is_file())  # fmt: skip
    elif model.is_file():
        yield model


def _strings(value: Any) -> Iterator[str]:
    if isinstance(value, str):
        yield value
    elif isinstance(value, dict | list):
        for part in value.values() if isinstance(value, dict) else value:
            yield from _strings(part)


def _gathered(made: Sequence[FrameMade]) -> Iterator[Doubt]:
    """Each doubt once, with its frame where not all frames have it; of several effects the greatest."""
    for doubt in ranked(doubt for frame in made for doubt in frame.doubts):
        numbers = [frame.number for frame in made if doubt.line in {each.line for each in frame.doubts}]
        if len(numbers) == len(made):
            yield doubt
        else:
            more = f" and {len(numbers) - 1} more" if len(numbers) > 1 else ""
            yield Doubt(f"frame {numbers[0]}{more}: {doubt.line}", doubt.effect)


def _sequence_of(shot: Shot, out: Path, made: Sequence[FrameMade], common: bool) -> SequenceMade:
    """The frames together, with their movie if what they have in common is to be written."""
    doubts = list(_gathered(made))
    rate = float(shot.sequence.rate if shot.sequence is not None else 24)
    return SequenceMade(tuple(made), _movie(out, made, rate, doubts) if common else None, ranked(doubts))


def _movie(out: Path, made: Sequence[FrameMade], rate: float, doubts: list[Doubt]) -> Path | None:
    pictures = [frame.folder / "composite.png" for frame in made]
    path, record = out / "sequence.mp4", out / _MOVIE
    if len(made) < 2 or not all(picture.is_file() for picture in pictures):
        return None
    # Frames that are all kept may have been made since by other processes.
    key = {"rate": rate, "frames": {str(frame.number): frame.key for frame in made}}
    if path.is_file() and _recorded(record) == key:
        return path
    from relume.image.files.video import Movie

    try:
        remove(record)
        with Movie(path, rate) as movie:
            for picture in pictures:
                movie.add(files.read_photograph(picture).pixels)
    except ValueError as error:  # no PyAV, or frames of several sizes
        doubts.append(Doubt(f"no movie was written: {error}"))
        return None
    files.write_text(record, json.dumps(key, indent=1))
    return path


def _recorded(path: Path) -> object:
    try:
        return json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return None
