"""Some frames of a sequence: which are asked for, made by whom, and put together at the end."""

from __future__ import annotations

import random
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from openjd.model import ExpressionError, IntRangeExpr, TokenError

from gltf_files import square_glb
from relume.cluster.claims import claim
from relume.errors import Doubt, IncompleteSequence
from relume.image import files
from relume.image.photograph import Photograph
from relume.project.insertion.insert_frames import insert_frames
from relume.project.insertion.sequence import chosen_frames, make_frames
from relume.project.shot_file.sequence_table import frames_as_text, frames_in
from relume.project.shot_file.shot import Shot
from toml_files import SHOT_HEAD, shot_of

SHOT = (
    SHOT_HEAD
    + """\
[sequence]
frames = "1-8"
[[objects]]
mesh = "cube.glb"
keyframes = [{ frame = 1, translate = [0, 0, 0] }, { frame = 8, translate = [7, 0, 0] }]
"""
)


@pytest.fixture
def shot(tmp_path: Path) -> Shot:
    (tmp_path / "cube.glb").write_bytes(square_glb())
    (tmp_path / "plate.exr").write_bytes(b"a plate")
    (tmp_path / "light.exr").write_bytes(b"a light")
    return shot_of(tmp_path, SHOT)


class Maker:
    """A fake job that writes a flat picture, and notes what it made."""

    def __init__(self, during: dict[int, object] | None = None, brightness: int = 10) -> None:
        self.made: list[int] = []
        self.others: list[list[str]] = []
        self.during = during or {}
        self.brightness = brightness

    def __call__(self, shot: Shot, folder: Path, others: tuple[Path, ...]) -> Sequence[Doubt]:
        number = int(folder.name[-4:])
        self.made.append(number)
        self.others.append([f"{each.parent.name}/{each.name}" for each in others])
        folder.mkdir(parents=True, exist_ok=True)
        value = self.brightness * number
        files.write(folder / "composite.png", Photograph(np.full((16, 24, 3), value, np.uint8)))
        return [Doubt("the same everywhere")]


def of_openjd(text: str) -> list[int] | None:
    try:
        return list(IntRangeExpr.from_str(text))
    except (ExpressionError, TokenError, ValueError):
        return None


def of_ours(text: str) -> list[int] | None:
    try:
        return list(frames_in(text))
    except ValueError:
        return None


def test_frames_are_written_as_openjd_writes_them_and_read_back():
    generator = random.Random(5)
    for _ in range(1500):
        most = generator.choice([5, 30, 200])
        frames = sorted({generator.randrange(most) for _ in range(generator.randrange(1, 25))})
        text = frames_as_text(generator.sample(frames, len(frames)))
        assert text == str(IntRangeExpr.from_list(list(frames)))
        assert of_ours(text) == of_openjd(text) == frames
    assert frames_as_text([12, 3, 1, 5, 7, 9, 5]) == "1-9:2,12" and frames_as_text([4, 2]) == "2,4"


@pytest.mark.parametrize(
    "text",
    ["7", "1-100", "1-100:3", " 3 , 5-8 ", "10-1:-1", "10-1:-3", "5-5", "1-10:20", "1-4:0", "4-1", "4-1:1", "1-4:-1",
     "", ",", "1,,2", "1-", "1-2-3", "1:2", "a", "1.5", "1-4:2:2", "٣", "1 2"],
)  # fmt: skip
def test_frames_mean_what_they_mean_to_openjd(text):
    assert of_ours(text) == of_openjd(text)


def test_other_farms_write_every_second_frame_with_an_x_and_what_overlaps_is_merged(shot):
    assert of_ours("1-9x2") == of_openjd("1-9:2") == [1, 3, 5, 7, 9]
    # Of OpenJD ranges may not overlap; here each frame counts once. Frames are numbered from 0 up.
    assert of_openjd("1-4,3-6") is None and of_ours("-2") is None and of_openjd("-2") == [-2]
    assert chosen_frames(shot, "6,1-4,3-5") == [1, 2, 3, 4, 5, 6]


@pytest.mark.parametrize(
    ("asked", "words"),
    [
        ("9", r"^frame 9 is not in the shot's \[sequence\], which has 1-8$"),
        ("5-12", r"^frames 9-12 are not in the shot's"),
        ([], "^no frames; give some"),
        ("1-3y", "^'1-3y' is no frame; give numbers and ranges"),
    ],
)
def test_frames_that_the_sequence_has_not_are_refused_in_one_line(shot, tmp_path, asked, words):
    with pytest.raises(ValueError, match=words) as caught:
        insert_frames(shot, tmp_path / "out", frames=asked)
    assert "\n" not in str(caught.value) and not (tmp_path / "out").exists()


def test_some_frames_leave_what_all_share_to_the_last_command(shot, tmp_path):
    out, maker = tmp_path / "out", Maker()
    made = make_frames(shot, out, maker, frames="2,7-8")
    assert maker.made == [2, 7, 8] and [frame.number for frame in made.frames] == [2, 7, 8] and made.movie is None
    assert sorted(path.name for path in out.iterdir()) == ["frame_0002", "frame_0007", "frame_0008"]
    maker = Maker()
    make_frames(shot, out, maker, frames=[1, 2, 3])
    assert maker.made == [1, 3]
    with pytest.raises(IncompleteSequence, match=r"frames 4-6 are missing or not whole; make them with --frames 4-6$"):
        insert_frames(shot, out, assemble=True)
    # Of those that are there.
    some = insert_frames(shot, out, frames="1-3", assemble=True)
    assert some.movie == out / "sequence.mp4" and [frame.kept for frame in some.frames] == [True] * 3
    make_frames(shot, out, Maker(), frames="4-6")
    whole = insert_frames(shot, out, assemble=True)
    assert len(whole.frames) == 8 and whole.notes == ("the same everywhere",)


def test_frames_of_another_shot_are_named(shot, tmp_path):
    out = tmp_path / "out"
    make_frames(shot, out, Maker())
    (out / "frame_0005" / "composite.png").unlink()
    (out / "frame_0002" / "frame.json").unlink()
    another = shot_of(tmp_path, SHOT.replace("[7, 0, 0]", "[7, 1, 0]"))
    with pytest.raises(IncompleteSequence, match=r"frames 2 are missing.* and frames 3-8 were made from other files"):
        insert_frames(another, out, assemble=True)


def test_a_movie_shows_frames_that_other_processes_made_since(shot, tmp_path):
    av = pytest.importorskip("av")
    out = tmp_path / "out"
    make_frames(shot, out, Maker())

    def brightness() -> list[float]:
        with av.open(str(out / "sequence.mp4")) as container:
            return [frame.to_ndarray(format="rgb24").mean() for frame in container.decode(video=0)]

    assert brightness() == pytest.approx([10 * n for n in range(1, 9)], abs=3)
    written = (out / "sequence.mp4").stat().st_mtime_ns
    make_frames(shot, out, Maker())
    assert (out / "sequence.mp4").stat().st_mtime_ns == written
    # Another shot, its frames made one by one, put together by a run that makes none.
    another = shot_of(tmp_path, SHOT.replace("focal_length = 100", "focal_length = 101"))
    make_frames(another, out, Maker(brightness=20), frames="1-8")
    assert make_frames(another, out, Maker()).movie is not None
    assert brightness() == pytest.approx([20 * n for n in range(1, 9)], abs=3)


@pytest.mark.skipif(sys.platform == "win32", reason="no locks there")
def test_a_frame_that_another_process_makes_is_left_to_it_and_waited_for(shot, tmp_path):
    out, steps = tmp_path / "out", []
    held = claim(out / ".frame_0003.lock")
    held.__enter__()
    maker = Maker()

    def progress(step: str, share: float) -> None:
        steps.append(step)
        if step.startswith("waiting for frame 3, which ") and "process" in step:
            held.__exit__(None, None, None)

    made = make_frames(shot, out, maker, frames="2-5", progress=progress)
    assert maker.made == [2, 4, 5, 3] and [frame.number for frame in made.frames] == [2, 3, 4, 5]
    assert steps[-2].startswith("waiting for frame 3") or "frames" in steps[-1]
    assert [path.name for path in out.iterdir() if path.name.startswith(".")] == []


@pytest.mark.skipif(sys.platform == "win32", reason="no locks there")
def test_what_another_process_made_while_this_one_waited_is_not_made_again(shot, tmp_path):
    out = tmp_path / "out"
    held = claim(out / ".frame_0003.lock")
    held.__enter__()

    def progress(step: str, share: float) -> None:
        if step.startswith("waiting for frame 3"):
            # The other has done its work, and gives the claim back.
            held.__exit__(None, None, None)
            make_frames(shot, out, other, frames="3")

    maker, other = Maker(), Maker()
    made = make_frames(shot, out, maker, frames="2-4", progress=progress)
    assert other.made == [3] and maker.made == [2, 4]
    assert [frame.kept for frame in made.frames] == [False, True, False]


def test_what_was_prepared_serves_every_frame(shot, tmp_path):
    out, maker = tmp_path / "out", Maker()
    (out / "stages").mkdir(parents=True)
    make_frames(shot, out, maker, frames="1-2")
    assert maker.others == [["out/stages"], ["out/stages", "frame_0001/stages"]]
