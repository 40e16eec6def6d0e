"""`relume insert` in parts: options that go together, lines for a farm, exit codes."""

from __future__ import annotations

import pytest

from command_line import printed, refused, reported
from relume.cli.stage_lines import FarmLines
from small_shot import write_small_shot


@pytest.fixture(scope="module")
def shot(tmp_path_factory):
    path = write_small_shot(tmp_path_factory.mktemp("shot"))
    path.write_text(path.read_text() + '\n[sequence]\nframes = "1-6"\n')
    return path


@pytest.mark.parametrize(
    ("words", "line"),
    [
        (["--prepare", "--assemble"], "--prepare and --assemble are different jobs; give one of them"),
        (["--prepare", "--preview"], "--prepare and --preview are different jobs"),
        (["--job", "job", "--to", "usd"], "--job and --to are different jobs"),
        (["--frames", "1", "--dry-run"], "--frames makes frames, and --dry-run does not; leave one of them out"),
        (["--frames", "1", "--prepare"], "--frames makes frames, and --prepare does not"),
        (["--cluster", "local:1", "--job", "job"], "--cluster renders, and --job does not; leave one of them out"),
        (["--chunk", "2"], "--chunk is for --job; leave it out"),
        (["--progress", "openjd", "--json"], "--progress and --json both write to standard output"),
        (["--frames", "0-3"], "frame 0 is not in the shot's [sequence], which has 1-6"),
        (["--frames", "4-1"], "'4-1' has no frames"),
        (["--frames", "two"], "'two' is no frame; give numbers and ranges, as 1-120, 1-120x2 or 5,7,9"),
        (["--force"], "--force replaces a shot.toml that is written"),
    ],
)
def test_options_that_contradict_one_another_are_refused_in_one_line(shot, tmp_path, capsys, words, line):
    assert line in refused(["insert", shot, "-o", tmp_path / "out", *words], capsys)
    assert not (tmp_path / "out").exists()


def test_a_folder_is_needed_for_pictures_and_a_sequence_for_frames(shot, tmp_path, capsys):
    assert "no -o; give the folder for the pictures" in refused(["insert", shot], capsys)
    still = write_small_shot(tmp_path / "still")
    for words in (["--frames", "1"], ["--assemble"]):
        assert "sequence: missing; give the frames" in refused(
            ["insert", still, "-o", tmp_path / "out", *words], capsys
        )
    assert "sequence: missing" in refused(["insert", still, "--job", tmp_path / "job"], capsys)
    plate = shot.parent / "plate.exr"
    assert "--job needs a shot file" in refused(["insert", "--plate", plate, "--job", tmp_path / "job"], capsys)


def test_frames_that_are_missing_end_with_4_and_their_names(shot, tmp_path, capsys):
    line = refused(["insert", shot, "-o", tmp_path / "out", "--assemble"], capsys, 4)
    assert "frames 1-6 are missing or not whole; make them with --frames 1-6" in line


def test_a_job_is_written_by_one_command_and_replaced_by_force(shot, tmp_path, capsys):
    words = ["insert", shot, "--frames", "1-5x2", "--job", tmp_path / "job", "--chunk", "2", "--samples", "16"]
    facts = reported(words, capsys)
    assert facts["frames"] == "1-5:2" and facts["tasks"] == 2 and facts["memory a task"] == "0.92 GB"
    assert "--samples 16 --frames 1,3" in (tmp_path / "job" / "commands.txt").read_text()
    assert "a job is there already" in refused(words, capsys, 3)
    assert reported([*words, "--force"], capsys) == facts
    assert "holds other things than a job" in refused(["insert", shot, "--job", shot.parent], capsys, 3)


def test_what_fails_is_said_to_the_farm(shot, tmp_path, capsys):
    from relume.cli import main

    code = main([str(w) for w in ("insert", shot, "-o", tmp_path / "out", "--frames", "9", "--progress", "openjd")])
    said = capsys.readouterr()
    assert code == 2 and said.out == "openjd_fail: frame 9 is not in the shot's [sequence], which has 1-6\n"
    assert said.err == "relume: frame 9 is not in the shot's [sequence], which has 1-6\n"


def test_a_farm_is_given_the_share_of_all_frames_once_a_percent_and_each_stage_by_its_name():
    lines: list[str] = []
    report = FarmLines(lines.append)
    for step, share in [("frames", 0.0), ("light", 0.0), ("light", 1.0), ("render", 0.0), ("render", 0.5)]:
        report(step, share)
    for share in (0.251, 0.252, 0.26, 0.1, 1.0):
        report("frames", share)
    assert lines == [
        "openjd_progress: 0", "openjd_status: light", "openjd_status: render", "openjd_progress: 25",
        "openjd_progress: 26", "openjd_progress: 100",
    ]  # fmt: skip


def test_a_still_is_as_far_as_its_render():
    lines: list[str] = []
    report = FarmLines(lines.append)
    for step, share in [("camera", 0.0), ("camera", 1.0), ("render", 0.0), ("render", 0.5), ("render", 1.0)]:
        report(step, share)
    assert lines == [
        "openjd_status: camera", "openjd_status: render", "openjd_progress: 0", "openjd_progress: 50",
        "openjd_progress: 100",
    ]  # fmt: skip


def test_what_was_prepared_is_said(shot, tmp_path, capsys):
    said = printed(["insert", shot, "-o", tmp_path / "out", "--prepare"], capsys)
    assert "prepared" in said.out and str(tmp_path / "out" / "stages") in said.out
    assert sorted(p.name for p in (tmp_path / "out").iterdir()) == ["stages"]


MOVING = """
[sequence]
frames = "1-4"
plates = "pan_*.exr"
"""


@pytest.fixture
def moving(tmp_path):
    """A shot whose camera a file moves, with a plate for each of four frames and none beside."""
    path = write_small_shot(tmp_path / "moving")
    for number in (1, 2, 3, 4):
        (path.parent / f"pan_{number}.exr").write_bytes((path.parent / "plate.exr").read_bytes())
    (path.parent / "plate.exr").unlink()
    rows = (f"{frame} {0.1 + 0.01 * frame} 0.5 1.0 -26 5 0 35\n" for frame in (1, 2, 3, 4))
    (path.parent / "track.chan").write_text("".join(rows))
    pose = path.read_text().splitlines()[5]
    text = path.read_text().replace(pose, 'file = { path = "track.chan" }').replace("focal_length = 200\n", "")
    path.write_text(text.replace('["plate.exr"]', '"pan_1.exr"') + MOVING)
    return path


def test_a_dry_run_looks_at_the_first_frame_and_says_what_all_take(moving, tmp_path, capsys):
    facts = reported(["insert", moving, "-o", tmp_path / "out", "--dry-run"], capsys)
    assert facts["frames"] == "4: 1-4; what follows is of frame 1"
    assert facts["camera"]["at"] == pytest.approx([0.11, 0.5, 1.0])
    assert facts["pixels"] == "192 × 128"
    million = 4 * 8 * 192 * 128 / 1e6
    assert facts["rays"] == f"{million:.3g} million for 4 frames"
    assert "min for 4 frames on this machine" in facts["estimate"]
    assert "quick look" not in facts and not (tmp_path / "out").exists()
    # What stands for the plate is never looked at by the job, and not by a dry run.
    moving.write_text(moving.read_text().replace('photographs = "pan_1.exr"', 'photographs = "gone.exr"'))
    assert reported(["insert", moving, "-o", tmp_path / "out", "--dry-run"], capsys)["pixels"] == "192 × 128"


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("pan_*.exr", "pan_[123].exr", "sequence.plates: no picture has the number of frame 4"),
        ('"1-4"', '"1-4"\noffset = -1', "sequence.plates: no picture has the number of frame 1, sequence.offset -1"),
        ('"track.chan"', '"track.chan", offset = 2', "track.chan has the frames 1 to 4, and the sequence asks for 3"),
    ],
)
def test_a_dry_run_refuses_frames_that_the_job_would(moving, tmp_path, capsys, old, new, words):
    moving.write_text(moving.read_text().replace(old, new))
    assert words in refused(["insert", moving, "-o", tmp_path / "out", "--dry-run"], capsys)
    assert words in refused(["insert", moving, "-o", tmp_path / "out"], capsys)
