"""`relume insert`: a shot in words, stages as they run, a look in seconds, and which doubts end with which code."""

from __future__ import annotations

import re
from dataclasses import replace
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest

import relume as rl
from command_line import printed, refused, reported
from relume.cli.console import OutputOptions, finish, progress
from relume.errors import BallNotFound, Doubt, DoubtfulResult, ranked
from relume.image.files import read_photograph
from relume.project.shot_file.shot import read_shot

ROOM = Path(__file__).parents[2] / "examples" / "room"
OBJECT = ROOM / "objects" / "cube_gold.glb"


@pytest.fixture
def no_forecast(monkeypatch):
    """How long a render would take is not measured, by rendering a part: the first test below does."""
    monkeypatch.setattr("relume.report.shot_check.forecast", lambda *_: None)


def test_a_dry_run_looks_at_the_board_the_balls_and_the_times(tmp_path, capsys):
    facts = reported(["insert", ROOM / "shot.toml", "-o", tmp_path / "out", "--dry-run"], capsys)
    assert facts["plate"] == {
        "IMG_0001.jpg": "1/4 s",
        "IMG_0002.jpg": "1 s",
        "IMG_0003.jpg": "4 s",
        "IMG_0004.jpg": "16 s",
    }
    assert [ball["ball"]["radius"] for ball in facts["balls"]] == pytest.approx([296, 296], rel=0.01)
    # One photograph is not what the job looks at, and is named.
    assert all(ball["ball"]["from"].startswith("IMG_000") for ball in facts["balls"])
    assert facts["balls"][0]["ball"]["from"].endswith(".jpg alone")
    assert facts["camera"]["at"] == pytest.approx([0.25, 0.55, 1.15], abs=0.004)
    assert "points, off by" in facts["camera"]["from"] and facts["pixels"] == "768 × 512"
    # Of the 64 that are allowed 33 are traced, on the room's own light and table.
    assert 33 <= facts["rays a pixel"] < 48 and facts["quick look"] == "--preview"
    assert float(facts["rays"].split()[0]) == pytest.approx(facts["rays a pixel"] * 0.768 * 0.512, rel=0.01)
    assert re.fullmatch(r"\d+ min on this machine .*, 1.3 GB of memory, 0.17 GB of disk", facts["estimate"])
    assert any("0.2" in size for size in facts["objects"].values()) and not (tmp_path / "out").exists()
    # Below the middle of the picture, right of it: where the composite shows it.
    assert facts["objects"]["cube_gold"].endswith("in the plate at 544,369")


@pytest.mark.usefixtures("no_forecast")
def test_a_shot_in_words_is_looked_at_without_being_written(tmp_path, capsys):
    plates, balls = sorted((ROOM / "plate").glob("*.jpg")), sorted((ROOM / "ball_0").glob("*_000[567].jpg"))
    words = ["insert", "--plate", *plates, "--ball", *balls, "--object", OBJECT, "-o", tmp_path / "out", "--dry-run"]
    said = printed([*words, "-v"], capsys)
    # This ball was photographed by another camera from another place, so its place in the plate is guessed.
    assert "where the ball stood in the plate is not known" in said.err and "radius was not given" in said.err
    assert "1.2 × 1.2 m about the ball, a guess; [[local]] gives its size" in said.out
    assert re.search(r"from +the ball's rim, \d+ pixels across, focal length", said.out)
    assert not (tmp_path / "out").exists()
    stages = [line for line in said.err.splitlines() if line.startswith(("relume: balls", "relume: camera "))]
    # On a busy machine a stage says in between how long it has taken so far.
    assert stages[0] == "relume: balls …" and re.fullmatch(
        r"relume: balls: [\d.]+ s", [line for line in stages if not line.endswith("so far")][1]
    )


def test_two_ways_to_say_a_shot_and_none_are_refused(tmp_path, capsys):
    assert "no shot; give a shot file, or --plate" in refused(["insert", "-o", tmp_path], capsys)
    words = ["insert", ROOM / "shot.toml", "--radius", "0.05", "-o", tmp_path]
    assert "--radius and the shot file" in refused(words, capsys)
    assert "no ball was given" in refused(["insert", "--plate", OBJECT, "--object", OBJECT, "-o", tmp_path], capsys)
    (tmp_path / "shot.toml").write_text("# mine\n")
    plate = sorted((ROOM / "plate").glob("*.jpg"))[0]
    words = ["insert", "--plate", plate, "--ball", plate, "--object", OBJECT, "--radius", "0.05", "-o", tmp_path]
    assert "or force (--force) to replace it" in refused(words, capsys, 3)
    assert (tmp_path / "shot.toml").read_text() == "# mine\n"


@pytest.mark.usefixtures("no_forecast")
def test_a_map_and_a_reflectance_are_options(tmp_path, capsys):
    plate = sorted((ROOM / "plate").glob("*.jpg"))[2]
    light = tmp_path / "light.hdr"
    rl.files.write(light, rl.RadianceMap(np.ones((8, 16, 3), np.float32)))
    words = [
        "insert",
        "--plate",
        plate,
        "--light",
        light,
        "--object",
        OBJECT,
        "--radius",
        "0.05",
        "--rim",
        "384,300,60",
    ]
    facts = reported([*words, "--surface-reflectance", "0.4", "-o", tmp_path / "out", "--dry-run"], capsys)
    assert facts["plate"] == {"IMG_0003.jpg": "4 s"} and facts["balls"] == []
    assert "times are of a ball's bracket" in refused([*words, "--times-from-names", "-o", tmp_path], capsys)
    both = ["insert", ROOM / "shot.toml", "--times-from-names", "-o", tmp_path]
    assert "--times-from-names and the shot file" in refused(both, capsys)


LITTLE, MORE, WRONG, UNKNOWN = Doubt("little", 0.01), Doubt("more", 0.12), Doubt("wrong", 0.4), Doubt("unknown")


def ended(capsys, *doubts: Doubt, accept: bool = False, **output: bool) -> tuple[list[str], str | None]:
    """The notes that `finish` printed, and the message it raised."""
    raised = None
    try:
        finish(OutputOptions(**output), doubts, accept=accept, rest=Path("out/report.html"))
    except DoubtfulResult as error:
        raised = str(error)
    return [line.removeprefix("relume: note: ") for line in capsys.readouterr().err.splitlines()], raised


def test_the_two_doubts_that_matter_are_said_and_the_rest_counted(capsys):
    notes, raised = ended(capsys, LITTLE, UNKNOWN, MORE, Doubt("more", 0.05))
    assert notes == [
        "more [about 10 % of the light]",
        "unknown",
        "1 lesser doubt: out/report.html has it, and -v shows it",
    ]
    assert raised is None
    assert ended(capsys, LITTLE, UNKNOWN, MORE, verbose=True)[0][-1] == "little [about 1 % of the light]"
    assert ended(capsys, LITTLE, UNKNOWN, MORE, quiet=True) == ([], None)


def test_what_makes_the_result_wrong_ends_with_4_unless_accepted(capsys):
    notes, raised = ended(capsys, WRONG)
    assert notes == [] and raised is not None and raised.startswith("wrong [about 40 % of the light] (all was written;")
    notes, raised = ended(capsys, WRONG, MORE, LITTLE)
    assert len(notes) == 3 and raised is not None and raised.startswith("wrong")
    notes, raised = ended(capsys, WRONG, MORE, accept=True)
    assert len(notes) == 2 and raised is None
    _, raised = ended(capsys, WRONG, Doubt("worse", 2.0), quiet=True)
    assert raised is not None and raised.startswith("2 doubts: worse [more than 100 % of the light] | wrong")
    assert ended(capsys, Doubt("just below", 0.2499))[1] is None
    words = [Doubt("it", effect).words for effect in (0.07, 0.096, 0.2499, 0.25, 0.3, 0.999, 1.01)]
    assert [each.removeprefix("it [").removesuffix(" of the light]") for each in words] == [
        *("about 7 %", "about 10 %", "about 20 %", "about 25 %", "about 30 %", "about 95 %", "more than 100 %")
    ]


def test_doubts_are_ranked_by_their_effect_and_each_stands_once():
    assert [each.line for each in ranked([UNKNOWN, LITTLE, Doubt("wrong", 0.1), WRONG, MORE])] == [
        "wrong", "more", "unknown", "little",
    ]  # fmt: skip


def test_stages_are_printed_with_their_seconds(capsys):
    with progress(OutputOptions(verbose=True)) as report:
        for stage, share in (("plate", 0.0), ("plate", 1.0), ("plate", 1.0), ("render", 0.0), ("render", 0.4)):
            report(stage, share)
    lines = capsys.readouterr().err.splitlines()
    assert lines[0] == "relume: plate …" and lines[1] == "relume: plate: 0.0 s" and lines[2:] == ["relume: render …"]
    with progress(OutputOptions(verbose=True, quiet=True)) as report:
        report("plate", 0.0)
    assert capsys.readouterr().err == ""


@pytest.mark.usefixtures("no_forecast")
def test_a_rim_that_is_given_is_not_sought(monkeypatch):
    import relume.report.shot_check as shot_check

    def sought(photographs, index):
        raise AssertionError("the ball was sought")

    monkeypatch.setattr(shot_check, "_any_ball", sought)
    shot = read_shot(ROOM / "shot.toml")
    known = {"pick": (400.0, 300.0, 296.0), "photographs": ["ball_0/IMG_000[56].jpg"]}
    balls = [each.model_copy(update=known) for each in shot.light.balls or []]
    picked = shot.model_copy(update={"light": shot.light.model_copy(update={"balls": balls})})
    found = shot_check.check_shot(picked).facts["balls"]
    assert [each["ball"] for each in found] == [{"x": 400.0, "y": 300.0, "radius": 296.0, "from": "the shot file"}] * 2  # pyright: ignore


def test_a_ball_that_is_not_seen_is_named_by_the_pixels_of_its_photograph():
    import relume.report.shot_check as shot_check

    whole = read_photograph(ROOM / "ball_0/IMG_0005.jpg")
    half = np.ascontiguousarray(whole.pixels[:, 160:].repeat(2, 0).repeat(2, 1))  # larger than what is made small
    cut = replace(whole, pixels=half, focal_length=None)
    with pytest.raises(BallNotFound, match="cuts off") as refused:
        shot_check._any_ball([cut], 1)
    said = re.search(r"light\.balls\.1: pick = \[(.*)\]; `relume probe", str(refused.value))
    assert said is not None and "--pick" not in str(refused.value)
    assert [float(value) for value in said[1].split(", ")] == pytest.approx([320, 640, 592.5], abs=6)


def test_force_replaces_a_shot_file_that_is_written_and_none_that_is_given(tmp_path, capsys):
    line = refused(["insert", str(ROOM / "shot.toml"), "-o", str(tmp_path), "--force"], capsys)
    assert "--force replaces a shot.toml that is written" in line and "shot.toml is given" in line


def test_an_export_names_no_report(monkeypatch, tmp_path, capsys):
    import relume as rl

    def prepared(shot, out, *, progress):
        for number in range(4):
            rl.errors.warn(f"doubt {number}", 0.01)

    class Made:
        main, not_held = "a.py", ()

    monkeypatch.setattr(rl, "prepare_shot", prepared, raising=False)
    monkeypatch.setattr(rl, "export_shot", lambda *_: Made, raising=False)
    said = printed(["insert", ROOM / "shot.toml", "-o", tmp_path, "--to", "blender"], capsys)
    assert "2 lesser doubts: -v shows them" in said.err and "report.html" not in said.err


@pytest.mark.parametrize("said_before", [False, True])
def test_the_report_is_named_only_for_what_it_holds(said_before, monkeypatch, tmp_path, capsys):
    import relume as rl

    def made(*_):
        if said_before:
            rl.errors.warn("not of the job", 0.001)
        return [Doubt(f"doubt {number}", 0.01 * number) for number in range(1, 4)]

    monkeypatch.setattr(import_module("relume.cli.insert"), "inserted", made)
    said = printed(["insert", ROOM / "shot.toml", "-o", tmp_path], capsys).err
    assert ("report.html" in said) is not said_before and "-v shows" in said
