"""The loop over passes with a cheap fake: stops, resumes to the bit, previews, and survives what happens to it."""

from __future__ import annotations

import os
import random
import signal
import subprocess
import sys
import threading
import time
from importlib.metadata import version
from pathlib import Path

import numpy as np
import pytest

from relume.errors import CannotResume, Interrupted, OutputNotWritten
from relume.renderers.mitsuba.path_tracer import Mitsuba
from relume.renderers.progressive.accumulation import RenderSession, accumulate, forget, pass_seed
from relume.renderers.progressive.checkpoint import Checkpoint, previous, read_checkpoint, write_checkpoint
from relume.renderers.progressive.convergence import ChangeError, Sums, Target, standard_error
from relume.renderers.progressive.fingerprint import program
from relume.renderers.progressive.graceful_shutdown import HardStop, interruptible
from relume.scene.cameras.camera import Camera
from relume.scene.materials.materials import Diffuse
from relume.scene.scene import Scene
from relume.scene.shapes.shapes import Plane
from relume.sphere.environment_map import EnvironmentMap

KEY = {"scene": "a" * 64, "samples": "64", "relume": "b" * 64}
ALWAYS = 0.0  # seconds between states: one after each pass


def trace(seed: int) -> dict[str, np.ndarray]:
    rng = np.random.default_rng(seed)
    return {"radiance": rng.gamma(2.0, size=(6, 8, 3)).astype(np.float32), "matte": rng.random((6, 8), np.float32)}


def total(count: int, seed: int = 3) -> np.ndarray:
    """The plain sum in order, not by the code under test."""
    result = np.zeros((6, 8, 3))
    for index in range(count):
        result = result + trace(pass_seed(seed, index))["radiance"].astype(np.float64)
    return result


def kept_at(path: Path) -> Checkpoint:
    kept = read_checkpoint(path, KEY)
    assert kept is not None
    return kept


class Stopped(Exception):
    pass


def stopping_after(count: int):
    calls = []

    def stopping(seed: int) -> dict[str, np.ndarray]:
        if len(calls) == count:
            raise Stopped
        calls.append(seed)
        return trace(seed)

    return stopping, calls


def cancelling_at(least: float):
    def cancel(share: float) -> None:
        if share >= least:
            raise Stopped

    return cancel


def signalled(*numbers: int, before: int | None = None):
    """The fake, which sends its own process these signals: before the pass of this number, or each."""

    def traced(seed: int) -> dict[str, np.ndarray]:
        if before is None or seed == pass_seed(3, before):
            for number in numbers:
                os.kill(os.getpid(), number)
        return trace(seed)

    return traced


def test_passes_are_added_in_order_with_seeds_that_are_hashes():
    sums = accumulate(trace, passes=7, seed=3)
    assert np.array_equal(sums.totals["radiance"], total(7))
    assert sums.totals["radiance"].dtype == np.float64
    # NumPy keeps what SeedSequence gives for ever: these are its words for [3, 0] and [3, 1].
    assert [pass_seed(3, 0), pass_seed(3, 1)] == [1576890651, 457190280]


def test_a_stop_keeps_the_passes_that_were_traced_together_with_the_one_under_way(tmp_path: Path):
    """The stop comes while the first three of ten are traced."""
    ahead: dict[int, dict[str, np.ndarray]] = {}
    at_once = signalled(signal.SIGINT, before=2)

    def three_at_once(own: int) -> dict[str, np.ndarray]:
        if own not in ahead:
            number = [pass_seed(3, index) for index in range(10)].index(own)
            ahead.update({each: at_once(each) for each in (pass_seed(3, number + i) for i in range(3))})
        return ahead.pop(own)

    watch = RenderSession(tmp_path / "render.passes")
    with pytest.raises(Interrupted):
        accumulate(three_at_once, passes=10, seed=3, key=KEY, watch=watch, ahead=ahead)
    kept = kept_at(tmp_path / "render.passes")
    assert kept.passes == 3
    assert np.array_equal(kept.planes["radiance"], total(3))


def test_the_variance_is_the_scatter_of_the_passes_by_their_number():
    sums = accumulate(trace, passes=9, seed=1)
    passes = [trace(pass_seed(1, i))["radiance"].astype(np.float64) for i in range(9)]
    assert np.allclose(sums.mean("radiance"), np.mean(passes, axis=0), rtol=1e-13)
    assert np.allclose(sums.variance("radiance"), np.var(passes, axis=0, ddof=1) / 9, rtol=1e-9)
    assert not accumulate(trace, passes=1).variance("radiance").any()


def test_squares_are_added_only_where_a_variance_is_asked_for():
    sums = accumulate(trace, passes=3, scattered=("radiance",))
    assert sums.squares.keys() == {"radiance"} and sums.totals.keys() == {"radiance", "matte"}


def test_of_many_rows_each_is_added_once_and_the_sums_before_stay():
    passes = np.random.default_rng(3).random((3, 150, 70, 3)).astype(np.float32)
    first = Sums().plus({"radiance": passes[0]})
    kept = first.totals["radiance"].copy(), first.squares["radiance"].copy()
    sums = first.plus({"radiance": passes[1]}).plus({"radiance": passes[2]})
    wide = passes.astype(np.float64)
    assert np.array_equal(sums.totals["radiance"], wide[0] + wide[1] + wide[2])
    assert np.array_equal(sums.squares["radiance"], wide[0] ** 2 + wide[1] ** 2 + wide[2] ** 2)
    assert np.array_equal(first.totals["radiance"], kept[0]) and np.array_equal(first.squares["radiance"], kept[1])


def test_a_pass_with_other_planes_is_refused():
    with pytest.raises(ValueError, match="expected the same"):
        Sums().plus({"a": np.zeros(2)}).plus({"b": np.zeros(2)})


@pytest.mark.parametrize("stop", [1, 4, 9])
def test_a_resumed_render_has_the_bits_of_one_that_never_stopped(tmp_path, stop):
    watch = RenderSession(tmp_path / "render.passes")
    first, _ = stopping_after(stop)
    with pytest.raises(Stopped):
        accumulate(first, passes=10, seed=3, key=KEY, watch=watch)
    again, calls = stopping_after(99)
    resumed = accumulate(again, passes=10, seed=3, key=KEY, watch=watch)
    straight = accumulate(trace, passes=10, seed=3)
    assert len(calls) == 10 - stop
    for name in ("radiance", "matte"):
        assert np.array_equal(resumed.totals[name], straight.totals[name])
        assert np.array_equal(resumed.squares[name], straight.squares[name])


def test_a_render_that_was_done_is_not_traced_again_until_it_is_forgotten(tmp_path):
    watch = RenderSession(tmp_path / "render.passes", seconds=ALWAYS)
    accumulate(trace, passes=3, seed=3, key=KEY, watch=watch)
    none, calls = stopping_after(0)
    assert np.array_equal(accumulate(none, passes=3, seed=3, key=KEY, watch=watch).totals["radiance"], total(3))
    assert calls == []
    forget(watch)
    assert list(tmp_path.iterdir()) == []


def test_a_stop_at_a_noise_is_resumed_with_what_was_confirmed(tmp_path):
    target = Target(0.08, standard_error, confirmations=3)
    straight = accumulate(trace, passes=500, seed=5, target=target)
    assert 6 < straight.passes < 500
    watch = RenderSession(tmp_path / "p")
    # One pass before the end two of three confirmations are there already.
    first, _ = stopping_after(straight.passes - 1)
    with pytest.raises(Stopped):
        accumulate(first, passes=500, seed=5, key=KEY, target=target, watch=watch)
    assert accumulate(trace, passes=500, seed=5, key=KEY, target=target, watch=watch).passes == straight.passes
    # And what was met is met: nothing more is traced.
    assert accumulate(trace, passes=500, seed=5, key=KEY, target=target, watch=watch).passes == straight.passes


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"samples": "256"}, r"another samples \(64, now 256\); give restart=True to begin anew"),
        ({"scene": "c" * 64}, "another scene; give restart"),
        ({"scene": "c" * 64, "relume": "d" * 64}, "another scene, relume; give"),
        ({"noise": "0.1"}, r"another noise \(none, now 0.1\)"),
    ],
)
def test_the_state_of_another_render_is_refused_by_naming_the_difference(tmp_path, change, words):
    watch = RenderSession(tmp_path / "p")
    accumulate(trace, passes=2, seed=3, key=KEY, watch=watch)
    before = (tmp_path / "p").read_bytes()
    with pytest.raises(CannotResume, match=words):
        accumulate(trace, passes=2, seed=3, key=KEY | change, watch=watch)
    assert (tmp_path / "p").read_bytes() == before
    anew = accumulate(trace, passes=4, seed=3, key=KEY | change, watch=RenderSession(tmp_path / "p", restart=True))
    assert np.array_equal(anew.totals["radiance"], total(4))


def kept_twice(path: Path) -> tuple[Checkpoint, Checkpoint]:
    """Two generations, of two passes and of three."""
    both = []
    for count in (2, 3):
        sums = accumulate(trace, passes=count, seed=3)
        both.append(Checkpoint(KEY, sums.planes(), count, {"met": 0}))
        write_checkpoint(path, both[-1])
    return both[0], both[1]


def test_any_flipped_bit_is_found_and_the_generation_before_is_used(tmp_path):
    path = tmp_path / "p"
    kept_twice(path)
    data = path.read_bytes()
    assert len(data) < 10_000
    rng = random.Random(8)
    places = [0, 7, 8, 39, 40, 47, 48, len(data) - 1, *(rng.randrange(len(data)) for _ in range(50))]
    for place in places:
        damaged = bytearray(data)
        damaged[place] ^= 1 << rng.randrange(8)
        path.write_bytes(damaged)
        with pytest.warns(UserWarning, match="is damaged; its passes are traced again"):
            assert kept_at(path).passes == 2, place
    path.write_bytes(data)
    assert kept_at(path).passes == 3


@pytest.mark.parametrize("length", [0, 5, 30, 60, 1000, -1])
def test_a_file_cut_short_is_found(tmp_path, length):
    path = tmp_path / "p"
    kept_twice(path)
    path.write_bytes(path.read_bytes()[:length])
    with pytest.warns(UserWarning, match="/p: is damaged"):
        assert kept_at(path).passes == 2
    previous(path).write_bytes(previous(path).read_bytes()[:length])
    with pytest.warns(UserWarning, match="/p: is damaged"), pytest.warns(UserWarning, match="p.previous: is damaged"):
        assert read_checkpoint(path, KEY) is None


def test_one_lost_generation_between_two_renames_costs_only_that_one(tmp_path):
    path = tmp_path / "p"
    kept_twice(path)
    path.unlink()  # as a crash between the renames leaves it
    assert kept_at(path).passes == 2


def test_planes_come_back_to_the_bit(tmp_path):
    path = tmp_path / "p"
    _, written = kept_twice(path)
    kept = kept_at(path)
    assert kept.planes.keys() == {"radiance", "matte", "squares of radiance", "squares of matte"}
    assert all(np.array_equal(kept.planes[n], written.planes[n]) for n in kept.planes)
    assert kept.state == {"met": 0}


def test_previews_come_after_one_two_four_and_eight_passes_and_after_a_resume_go_on():
    shown = []
    watch = RenderSession(preview=lambda sums: shown.append((sums.passes, float(sums.mean("matte").mean()))))
    sums = accumulate(trace, passes=11, watch=watch)
    assert [count for count, _ in shown] == [1, 2, 4, 8]
    assert abs(shown[-1][1] - sums.mean("matte").mean()) < 0.05


def test_a_preview_is_written_while_the_next_pass_is_traced_and_all_are_at_the_end():
    passes, shown = [], []
    second = threading.Event()

    def traced(seed):
        passes.append(seed)
        if len(passes) == 2:
            second.set()
        return trace(seed)

    def preview(sums):
        assert second.wait(10)
        shown.append(sums.passes)

    accumulate(traced, passes=2, watch=RenderSession(preview=preview))
    assert shown == [1, 2]


def test_a_preview_that_fails_ends_the_render():
    def preview(sums):
        raise OSError("no room")

    with pytest.raises(OSError, match="no room"):
        accumulate(trace, passes=1, watch=RenderSession(preview=preview))


def test_progress_rises_to_one():
    said = []
    accumulate(trace, passes=5, progress=said.append)
    assert said == pytest.approx([0.2, 0.4, 0.6, 0.8, 1.0, 1.0])


def test_progress_may_cancel_and_what_was_done_is_kept(tmp_path):
    watch = RenderSession(tmp_path / "p")
    with pytest.raises(Stopped):
        accumulate(trace, passes=6, seed=3, key=KEY, watch=watch, progress=cancelling_at(0.5))
    kept = kept_at(tmp_path / "p")
    assert kept.passes == 3 and np.array_equal(kept.planes["radiance"], total(3))


def test_ctrl_c_finishes_the_pass_keeps_it_and_says_how_to_go_on(tmp_path):
    watch = RenderSession(tmp_path / "p")
    before = signal.getsignal(signal.SIGINT), signal.getsignal(signal.SIGTERM)
    with pytest.raises(Interrupted, match=r"5 of 9 passes are kept in .*p; give the same command again") as caught:
        accumulate(signalled(signal.SIGINT, before=4), passes=9, seed=3, key=KEY, watch=watch)
    assert (caught.value.passes, caught.value.of, caught.value.exit_code) == (5, 9, 130)
    assert (signal.getsignal(signal.SIGINT), signal.getsignal(signal.SIGTERM)) == before
    resumed = accumulate(trace, passes=9, seed=3, key=KEY, watch=watch)
    assert np.array_equal(resumed.totals["radiance"], total(9))


def test_a_second_ctrl_c_is_not_waited_for():
    with pytest.raises(KeyboardInterrupt):
        accumulate(signalled(signal.SIGINT, signal.SIGINT), passes=9)


def test_nothing_kept_is_said():
    with pytest.raises(Interrupted, match="interrupted; nothing is kept") as caught:
        accumulate(signalled(signal.SIGTERM), passes=9)
    assert caught.value.exit_code == 143


@pytest.mark.skipif(not hasattr(signal, "SIGHUP"), reason="Windows has no such signal")
def test_a_closed_terminal_keeps_what_was_done(tmp_path):
    watch, before = RenderSession(tmp_path / "p"), signal.signal(signal.SIGHUP, signal.SIG_DFL)
    try:
        with pytest.raises(Interrupted, match="3 of 9 passes are kept") as caught:
            accumulate(signalled(signal.SIGHUP, before=2), passes=9, seed=3, key=KEY, watch=watch)
        signal.signal(signal.SIGHUP, signal.SIG_IGN)  # as nohup leaves it: nothing stops then
        accumulate(signalled(signal.SIGHUP, before=2), passes=4)
    finally:
        signal.signal(signal.SIGHUP, before)
    assert caught.value.exit_code == 129


@pytest.mark.skipif(not hasattr(signal, "SIGHUP"), reason="Windows has no such signal")
@pytest.mark.parametrize("first", ["SIGHUP", "SIGTERM"])
def test_a_terminal_that_closes_sends_its_signal_twice_and_is_not_impatient(tmp_path, first):
    """Its shell sends one and the system another; a session that ends sends SIGTERM before."""
    watch, before = RenderSession(tmp_path / "p"), signal.signal(signal.SIGHUP, signal.SIG_DFL)
    twice = signalled(getattr(signal, first), signal.SIGHUP, signal.SIGHUP, before=2)
    try:
        with pytest.raises(Interrupted, match="3 of 9 passes are kept"):
            accumulate(twice, passes=9, seed=3, key=KEY, watch=watch)
    finally:
        signal.signal(signal.SIGHUP, before)


@pytest.mark.skipif(not hasattr(signal, "SIGHUP"), reason="Windows has no such signal")
def test_what_is_done_is_saved_before_a_process_ends_though_its_terminal_hangs_up_twice():
    done, ended = [], threading.Event()
    before = signal.signal(signal.SIGHUP, signal.SIG_DFL)

    def end(number: int, words: str) -> None:
        done.append((number, words.split(";")[0]))
        ended.set()

    try:
        with interruptible(force=HardStop(end, after=0.4), save=lambda: done.append("saved")):
            signal.raise_signal(signal.SIGHUP)
            signal.raise_signal(signal.SIGHUP)
            assert ended.wait(20)
    finally:
        signal.signal(signal.SIGHUP, before)
    assert done == ["saved", (signal.SIGHUP, "interrupted")]


def test_ctrl_break_of_windows_is_noted_and_other_systems_do_not_ask_for_it(monkeypatch):
    number = signal.SIGTERM  # one that this system has
    monkeypatch.setattr(signal, "SIGBREAK", number, raising=False)
    for name in ("SIGHUP", "SIGTERM"):
        monkeypatch.delattr(signal, name, raising=False)
    before = signal.getsignal(number)
    with interruptible() as asked:
        signal.raise_signal(number)
    assert asked.signal == number and signal.getsignal(number) == before


# What happens to a process, from outside

CHILD = """
import os, sys, time
import numpy as np
from pathlib import Path
sys.path[:0] = {path!r}
from relume.errors import Interrupted, OutputNotWritten
from relume.renderers.progressive.accumulation import RenderSession, accumulate
from relume.renderers.progressive.graceful_shutdown import HardStop
from test_accumulation import KEY, trace

def slow(seed):
    time.sleep({seconds})
    return trace(seed)

def end(number, words):
    print("relume:", words, file=sys.stderr, flush=True)
    os._exit(128 + number)

{before}
watch = RenderSession(Path(sys.argv[1]), seconds={every}, force=HardStop(end, {force}) if {force} else None)
print("begun", flush=True)
try:
    sums = accumulate(slow, passes={passes}, seed=3, key=KEY, watch=watch)
except (Interrupted, OutputNotWritten) as error:
    print(error, flush=True)
    sys.exit(getattr(error, "exit_code", 3))
"""


def child(
    folder: Path,
    *,
    passes: int = 40,
    seconds: float = 0.004,
    every: float = 0.0,
    force: float | None = None,
    before: str = "",
) -> subprocess.Popen[str]:
    """A process that renders with the fake, once it has begun."""
    path = [str(Path(__file__).parent), *sys.path]
    text = CHILD.format(path=path, seconds=seconds, every=every, force=force, passes=passes, before=before)
    process = subprocess.Popen(
        [sys.executable, "-c", text, str(folder / "p")], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    STARTED.append(process)
    assert process.stdout is not None and process.stdout.readline() == "begun\n"
    return process


STARTED: list[subprocess.Popen[str]] = []


@pytest.fixture(autouse=True)
def no_child_is_left():
    yield
    while STARTED:
        process = STARTED.pop()
        process.kill()
        process.communicate()


def killed_and_resumed(folder: Path, moments: list[float]) -> None:
    for moment in moments:
        process = child(folder)
        time.sleep(moment)
        process.kill()
        process.communicate()
    resumed = accumulate(trace, passes=40, seed=3, key=KEY, watch=RenderSession(folder / "p"))
    assert np.array_equal(resumed.totals["radiance"], total(40))
    assert np.array_equal(resumed.squares["matte"], accumulate(trace, passes=40, seed=3).squares["matte"])
    forget(RenderSession(folder / "p"))
    assert list(folder.iterdir()) == []


def test_a_process_that_is_killed_is_resumed_to_the_bit(tmp_path):
    killed_and_resumed(tmp_path, [0.03, 0.06])


@pytest.mark.slow
def test_twenty_processes_that_are_killed_are_resumed_to_the_bit(tmp_path):
    rng = random.Random(4)
    for index in range(20):
        folder = tmp_path / str(index)
        folder.mkdir()
        killed_and_resumed(folder, [rng.uniform(0.0, 0.3)])


def test_a_pass_that_does_not_end_is_given_up_and_those_before_are_kept(tmp_path):
    # C's sleep lets other threads run, as a renderer's native code does; a signal wakes it, so that it has to repeat.
    before = """
import ctypes
pause = ctypes.CDLL(None).usleep
def slow(seed):
    if seed in LATE:
        print("within", flush=True)
        for _ in range(400):
            pause(250_000)
    return trace(seed)
from relume.renderers.progressive.accumulation import pass_seed
LATE = {pass_seed(3, 5)}
"""
    process = child(tmp_path, force=0.3, every=100, before=before)
    assert process.stdout is not None and process.stdout.readline() == "within\n"
    process.send_signal(signal.SIGTERM)
    _, errors = process.communicate(timeout=60)  # the pass itself takes 100 s
    assert process.returncode == 143
    assert "relume: interrupted; the pass under way was given up" in errors
    kept = kept_at(tmp_path / "p")
    assert np.array_equal(kept.planes["radiance"], total(5))


def test_a_second_signal_ends_a_pass_that_does_not_end_at_once(tmp_path):
    # As native code does, it goes on whatever Python's handlers raise.
    before = """
def slow(seed):
    print("within", flush=True)
    for _ in range(1000):
        try:
            time.sleep(0.1)
        except KeyboardInterrupt:
            pass
"""
    process = child(tmp_path, force=30, every=100, before=before)
    assert process.stdout is not None and process.stdout.readline() == "within\n"
    process.send_signal(signal.SIGINT)
    time.sleep(0.1)  # two signals of one kind at once are one
    process.send_signal(signal.SIGINT)
    process.communicate(timeout=60)  # the pass itself takes 100 s
    assert process.returncode == 130


def test_a_disk_that_is_full_is_reported_in_one_line_and_the_old_state_stays(tmp_path):
    accumulate(trace, passes=2, seed=3, key=KEY, watch=RenderSession(tmp_path / "p"))
    before = (tmp_path / "p").read_bytes()
    limit = """
import resource, signal
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
resource.setrlimit(resource.RLIMIT_FSIZE, (2000, 2000))
"""
    process = child(tmp_path, before=limit)
    words, errors = process.communicate(timeout=60)
    assert process.returncode == 3 and words.count("\n") == 1 and "cannot be written: File too large" in words, errors
    assert (tmp_path / "p").read_bytes() == before
    assert [file.name for file in tmp_path.iterdir()] == ["p"]


def test_a_folder_that_cannot_be_made_is_reported(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(OutputNotWritten, match="file"):
        accumulate(trace, passes=2, key=KEY, watch=RenderSession(tmp_path / "file" / "p"))


# With Mitsuba


def test_mitsuba_goes_on_where_it_was_interrupted(tmp_path):
    camera = Camera.looking_at(np.array([0, 1.0, 3]), np.zeros(3), width=8, height=6, focal_length=8)
    scene = Scene(EnvironmentMap(np.ones((4, 8, 3), np.float32)), local=(Plane(Diffuse((0.5, 0.5, 0.5))),))
    method = Mitsuba(samples=16)
    watch = RenderSession(tmp_path / "p")
    with pytest.raises(Stopped):
        method.render(scene, camera, seed=2, watch=watch, progress=cancelling_at(0.25))
    with pytest.raises(CannotResume, match=r"another camera, samples \(16, now 32\), seed \(2, now 4\)"):
        wider = Camera.looking_at(np.array([0, 1.0, 3]), np.zeros(3), width=8, height=6, focal_length=7)
        Mitsuba(samples=32).render(scene, wider, seed=4, watch=watch)
    resumed, straight = (method.render(scene, camera, seed=2, watch=w) for w in (watch, RenderSession()))
    assert np.array_equal(resumed.radiance, straight.radiance)
    assert np.array_equal(resumed.variance, straight.variance)


# When there is little noise enough


def speckled(seed: int) -> dict[str, np.ndarray]:
    """A change of known truth with the long-tailed noise of path tracing: few samples carry much."""
    rng = np.random.default_rng(seed)
    objects, difference, matte = truth()
    tail = rng.pareto(2.5, objects.shape) * 1.5  # mean 1: of Pareto II with 2.5 it is 1/1.5
    noise = rng.gamma(1.0, size=objects.shape)
    return {"objects": objects * tail, "difference": difference * noise, "matte": matte}


def truth() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    matte = np.zeros((20, 30))
    matte[5:12, 8:20] = 1
    fading = np.exp(-np.hypot(*np.mgrid[-10:10, -15:15]) / 4)
    difference = np.repeat((-0.5 * fading * (1 - matte))[..., None], 3, axis=-1)
    return np.repeat((0.8 * matte)[..., None], 3, axis=-1), difference, matte


def test_a_noise_that_is_asked_for_is_the_error_that_is_left():
    objects, difference, matte = truth()
    backdrop = np.ones((20, 30, 3))
    change = np.abs(objects).sum(-1) + np.abs(difference).sum(-1)
    largest = np.argsort(change, axis=None)[::-1]
    held = largest[: 1 + int(np.searchsorted(np.cumsum(change.ravel()[largest]), 0.99 * change.sum()))]
    right = (objects + difference + (1 - matte)[..., None] * backdrop).reshape(-1, 3)[held]
    ratios = []
    for seed in range(6):
        sums = accumulate(speckled, passes=3000, seed=seed, target=Target(0.04, ChangeError(backdrop)))
        assert 16 < sums.passes < 3000
        got = sums.mean("objects") + sums.mean("difference") + (1 - matte)[..., None] * backdrop
        ratios.append(np.abs(got.reshape(-1, 3)[held] - right).mean() / right.mean() / 0.04)
    assert 1 / 1.3 < np.mean(ratios) < 1.3


def test_the_error_of_a_change_does_not_fall_with_the_size_of_the_picture():
    small = accumulate(speckled, passes=8)

    def larger(seed: int) -> dict[str, np.ndarray]:
        return {n: np.pad(p, [(0, 40), (0, 40), (0, 0)][: p.ndim]) for n, p in speckled(seed).items()}

    large = accumulate(larger, passes=8)
    errors = [ChangeError(np.ones((*size, 3)))(sums) for size, sums in (((20, 30), small), ((60, 70), large))]
    assert errors[0] == pytest.approx(errors[1], rel=1e-12) and errors[0] > 0.01


def test_a_scene_that_nothing_changes_is_done_at_once():
    def nothing(seed: int) -> dict[str, np.ndarray]:
        return {"objects": np.zeros((4, 5, 3)), "difference": np.zeros((4, 5, 3)), "matte": np.zeros((4, 5))}

    assert accumulate(nothing, passes=100, target=Target(0.01, ChangeError(np.ones((4, 5, 3))))).passes == 5


def test_an_estimate_from_few_passes_is_not_too_small():
    # The mean of |error| of normal noise is √(2/π)·σ/√n; without correction four passes say 8 % less.
    rng = np.random.default_rng(1)
    planes = [rng.normal(1.0, 0.1, (100, 100, 3)) for _ in range(4)]
    zeros, ones = np.zeros((100, 100, 3)), np.ones((100, 100))
    sums = Sums()
    for plane in planes:
        sums = sums.plus({"objects": plane, "difference": zeros, "matte": ones})
    assert ChangeError(zeros)(sums) == pytest.approx(np.sqrt(2 / np.pi) * 0.1 / 2, rel=0.01)


def test_an_estimate_of_pixels_traced_unequally_corrects_each_by_its_own_passes():
    # Half the pixels are traced four times, half sixteen, and one, which nothing changes, twice.
    rng = np.random.default_rng(2)
    zeros, ones = np.zeros((100, 100, 3)), np.ones((100, 100))
    planned = np.full((100, 100), 16, np.int32)
    planned[:50], planned[0, 0] = 4, 2
    sums = Sums()
    for index in range(16):
        plane = rng.normal(1.0, 0.1, (100, 100, 3))
        plane[0, 0] = 0
        traced = planned > index
        plane[~traced] = 0
        planes = {"objects": plane, "difference": zeros, "matte": ones * traced}
        sums = sums.plus(planes, planned=None if index < 2 else planned)
    expected = np.sqrt(2 / np.pi) * 0.1 * (1 / 2 + 1 / 4) / 2
    assert ChangeError(zeros)(sums) == pytest.approx(expected, rel=0.01)


@pytest.mark.parametrize(("noise", "confirmations"), [(0.0, 1), (-1.0, 1), (0.1, 0), (float("nan"), 1)])
def test_a_target_that_cannot_be_is_refused(noise, confirmations):
    with pytest.raises(ValueError, match="expected above 0, and 1 or more"):
        Target(noise, standard_error, confirmations)


@pytest.mark.parametrize("decoder", ["imagecodecs", "rawpy"])
def test_a_result_depends_on_the_libraries_that_decode_photographs(decoder):
    assert program()[decoder] == version(decoder)
