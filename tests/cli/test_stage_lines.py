"""What a log says of a long job: stages, shares and the time left, no more often than one reads it."""

from __future__ import annotations

import time

import pytest

from relume.cli.console import OutputOptions, progress
from relume.cli.stage_lines import StageLines, in_words, stage_lines


class Clock:
    """Seconds that pass when they are set to."""

    now = 0.0

    def __call__(self) -> float:
        return self.now


@pytest.fixture
def clock() -> Clock:
    return Clock()


def lines_of(clock: Clock, every: bool = False) -> tuple[StageLines, list[str]]:
    said: list[str] = []
    return StageLines(every, said.append, clock), said


def test_a_log_says_share_and_time_left_every_quarter_of_a_minute(clock):
    lines, said = lines_of(clock)
    lines("render", 0.0)
    for second in range(1, 101):
        clock.now = second
        lines("render", min(second / 200, 0.9999))
    assert said == [
        "render 8 %, 15 s so far, about 3 min left",
        "render 15 %, 30 s so far, about 3 min left",
        "render 22 %, 45 s so far, about 3 min left",
        "render 30 %, 60 s so far, about 2 min left",
        "render 38 %, 75 s so far, about 2 min left",
        "render 45 %, 90 s so far, about 2 min left",
    ]
    lines("render", 1.0)
    assert said[-1] == "render: 100.0 s"


def test_what_is_slow_is_said_once_a_minute(clock):
    lines, said = lines_of(clock)
    lines("render", 0.0)
    for second in range(1, 601):
        clock.now = second
        lines("render", second / 72000)
    assert 9 <= len(said) <= 11 and said[-1].startswith("render 1 %, 10 min so far, about 19 h")


def test_time_left_is_that_of_the_latest_progress(clock):
    lines, said = lines_of(clock)
    lines("render", 0.0)
    # Parts that were kept, at once; then a tenth of a per cent a second.
    lines("render", 0.5)
    for second in range(1, 401):
        clock.now = second
        lines("render", 0.5 + second / 1000)
    assert said[-1].startswith("render 8") and said[-1].endswith("about 2 min left")


def test_short_stages_are_not_worth_a_line_of_a_log(clock):
    lines, said = lines_of(clock)
    for stage in ("photographs", "response", "plate"):
        lines(stage, 0.0)
        clock.now += 10
        lines(stage, 1.0)
    assert said == []
    verbose, each = lines_of(clock, every=True)
    verbose("plate", 0.0)
    clock.now += 2
    verbose("plate", 1.0)
    assert each == ["plate …", "plate: 2.0 s"]


def test_a_stage_that_says_nothing_of_itself_is_looked_after(clock):
    lines, said = lines_of(clock)
    lines("denoised", 0.0)
    for clock.now in (5.0, 14.0, 16.0, 20.0, 32.0):
        lines.look()
    assert said == ["denoised, 16 s so far", "denoised, 32 s so far"]


def test_the_watching_thread_ends_with_the_job(capsys, monkeypatch):
    monkeypatch.setattr("relume.cli.stage_lines.EVERY", 0.01)
    monkeypatch.setattr("relume.cli.stage_lines.LOOK", 0.02)
    with stage_lines(every=False) as lines:
        lines("denoised", 0.0)
        time.sleep(0.3)
    said = capsys.readouterr().err
    assert said.startswith("relume: denoised, 0 s so far\n")
    time.sleep(0.1)
    assert capsys.readouterr().err == ""


def test_quiet_and_json_print_no_progress(capsys, monkeypatch):
    monkeypatch.setattr("relume.cli.stage_lines.EVERY", 0.0)
    for output in (OutputOptions(quiet=True), OutputOptions(json=True)):
        with progress(output) as report:
            report("render", 0.0)
            report("render", 1.0)
    assert capsys.readouterr().err == ""
    with progress(OutputOptions()) as report:
        report("render", 0.0)
        report("render", 1.0)
    assert capsys.readouterr().err == "relume: render: 0.0 s\n"


def test_lengths_of_time_as_one_says_them():
    assert [in_words(seconds) for seconds in (0.4, 99, 100, 3600, 5399, 5400, 72000)] == [
        "0 s", "99 s", "2 min", "60 min", "1 h 30 min", "1 h 30 min", "20 h 00 min",
    ]  # fmt: skip
