"""`run_tasks`: the same results whoever does the tasks, failures that are named, and clusters that cannot be used."""

from __future__ import annotations

import time
import warnings
from pathlib import Path

import pytest

import cluster_tasks
from relume.cluster import held, run_tasks
from relume.cluster.attempt import may_go_elsewhere
from relume.errors import (
    ClusterUnusable,
    FormatError,
    Incomplete,
    Interrupted,
    NotABracket,
    OutputNotWritten,
    RelumeError,
    UnreadableFile,
)

pytest.importorskip("distributed", reason="Dask distributed is not installed: pip install 'relume[cluster]'")


@pytest.fixture
def numbered(tmp_path) -> list[tuple[str, int]]:
    return [(str(tmp_path), number) for number in range(8)]


def double(number: int) -> int:
    return 2 * number


def test_without_a_cluster_tasks_are_done_here_in_their_order():
    heard = []
    assert run_tasks(double, [3, 1, 2], progress=lambda *state: heard.append(state[:3])) == [6, 2, 4]
    assert heard == [(0, 0, 3), (1, 0, 2), (2, 0, 1), (3, 0, 0)]


def test_no_tasks_are_done_at_once(two):
    assert run_tasks(double, []) == run_tasks(double, [], cluster=two) == []


def test_here_and_by_two_workers_the_bits_are_the_same(numbered, two):
    heard = []
    here = run_tasks(cluster_tasks.noise, numbered)
    there = run_tasks(cluster_tasks.noise, numbered, cluster=two, progress=lambda *state: heard.append(state))
    assert here == there
    assert len(set(here)) == 8
    assert [state[:3] for state in heard] == [(done, 0, 8 - done) for done in range(9)]
    assert heard[0][3] is None and heard[-1][3] == 0


@pytest.mark.slow
@pytest.mark.parametrize("workers", [1, 4])
def test_by_one_worker_and_by_four_the_bits_are_the_same(workers, numbered):
    assert run_tasks(cluster_tasks.noise, numbered, cluster=f"local:{workers}") == run_tasks(
        cluster_tasks.noise, numbered
    )


@pytest.mark.parametrize("where", ["here", "by workers"])
def test_failing_tasks_are_named_and_all_others_are_done(where, numbered, two, tmp_path):
    names = [f"frame {number}" for _, number in numbered]
    with warnings.catch_warnings(record=True) as caught, pytest.raises(Incomplete) as raised:
        warnings.simplefilter("always")
        run_tasks(cluster_tasks.fails, numbered, names=names, cluster=two if where == "by workers" else None)
    error = raised.value
    failed = dict(error.failed)
    assert failed["frame 4"] == "4 is not a number of photographs"
    assert failed["frame 2"].startswith("a fault: RuntimeError: nothing works here, cluster_tasks.py line")
    # What another worker may do is tried there, and what is wrong everywhere but once.
    tries = [len(cluster_tasks.begun(tmp_path, number)) for number in range(8)]
    if where == "by workers":
        assert list(failed) == ["frame 2", "frame 4"]
        assert tries == [1, 1, 3, 1, 1, 2, 1, 1]
        first, second, _ = (path.name.split(".")[1] for path in cluster_tasks.begun(tmp_path, 2))
        assert len({path.name.split(".")[1] for path in cluster_tasks.begun(tmp_path, 2)}) == 2, (first, second)
    else:
        assert list(failed) == ["frame 2", "frame 4", "frame 5"]
        assert failed["frame 5"] == "/scratch/5.exr: No space left on device"
        assert tries == [1] * 8
    assert [each for each in error.results if each is not None] == [n for n in range(8) if f"frame {n}" not in failed]
    assert str(error).startswith(f"{len(failed)} of 8 failed: frame 2, frame 4")
    # Eight warnings alike are one.
    assert [str(each.message) for each in caught] == ["the light is doubtful"]


def test_what_is_at_fault_decides_whether_another_worker_tries():
    elsewhere = [UnreadableFile("a"), OutputNotWritten("b"), OSError("c"), RuntimeError("d"), MemoryError()]
    nowhere = [FormatError("a", "PNG", "byte 7", "b", "c"), NotABracket("d"), ValueError("e"), RelumeError("f")]
    assert all(map(may_go_elsewhere, elsewhere))
    assert not any(map(may_go_elsewhere, nowhere))


def test_an_interruption_ends_the_run():
    def interrupted(_: int) -> None:
        raise Interrupted(1, 2, 2, None)

    with pytest.raises(Interrupted):
        run_tasks(interrupted, [1, 2])


def test_workers_work_in_a_thread_that_is_not_the_main_one_one_task_at_a_time(two, tmp_path):
    assert run_tasks(cluster_tasks.in_main_thread, [("", 1)], cluster=two) == [False]


@pytest.mark.parametrize(
    ("cluster", "words"),
    [
        ("tcp://127.0.0.1:9", "no scheduler answers at tcp://127.0.0.1:9"),
        ("nowhere.json", "no such file"),
        ("env", "DASK_SCHEDULER_ADDRESS is not set"),
    ],
)
def test_a_cluster_that_is_not_there_is_one_line_within_ten_seconds(cluster, words, monkeypatch):
    from dask import config  # pyright: ignore[reportPrivateImportUsage]

    monkeypatch.delenv("DASK_SCHEDULER_ADDRESS", raising=False)
    begun = time.monotonic()
    with config.set({"scheduler-address": None}), pytest.raises(ClusterUnusable, match=words) as raised:
        run_tasks(double, [1], cluster=cluster)
    assert time.monotonic() - begun < 10
    assert "\n" not in str(raised.value)


@pytest.mark.parametrize(("file", "words"), [(None, "none are set"), ("not there.pem", "they cannot be read")])
def test_an_encrypted_scheduler_without_certificates_is_one_line(file, words):
    from dask import config  # pyright: ignore[reportPrivateImportUsage]

    names = {f"distributed.comm.tls.{name}": file for name in ("ca-file", "client.cert", "client.key")}
    with config.set(names), pytest.raises(ClusterUnusable, match=f"needs certificates, and {words}") as raised:
        run_tasks(double, [1], cluster="tls://127.0.0.1:9")
    assert "\n" not in str(raised.value)


def test_a_file_that_no_scheduler_wrote_is_refused(tmp_path):
    (tmp_path / "a.json").write_text("[]")
    with pytest.raises(ClusterUnusable, match="not the file of a scheduler"):
        run_tasks(double, [1], cluster=tmp_path / "a.json")


def test_no_workers_at_all_are_refused():
    with pytest.raises(ValueError, match="no worker"):
        run_tasks(double, [1], cluster="local:0")


def test_names_and_tries_that_make_no_sense_are_refused():
    with pytest.raises(ValueError, match="2 names for 1 tasks"):
        run_tasks(double, [1], names=["a", "b"])
    with pytest.raises(ValueError, match="tries is 0"):
        run_tasks(double, [1], tries=0)


def test_too_little_memory_is_refused_before_anything_starts(two, numbered, tmp_path):
    with pytest.raises(ClusterUnusable, match=r"a task takes 1e\+06 GB, and worker tcp"):
        run_tasks(cluster_tasks.count, numbered, cluster=two, memory=10**15)
    assert not list(tmp_path.iterdir())


def test_files_that_workers_do_not_see_are_refused_before_anything_starts(two, numbered, tmp_path):
    with pytest.raises(ClusterUnusable, match=r"does not see .*room\.exr"):
        run_tasks(cluster_tasks.count, numbered, cluster=two, paths=[tmp_path, tmp_path / "room.exr"])
    assert not list(tmp_path.iterdir())


def test_a_function_that_workers_cannot_import_is_one_line(two):
    with pytest.raises(Incomplete, match=r"ModuleNotFoundError.*the worker lacks what the task is made of"):
        run_tasks(double, [4], cluster=two)
    with pytest.raises(ValueError, match="a task cannot be sent to a worker"):
        run_tasks(print, [(each for each in ())], cluster=two)


def test_a_client_that_is_given_stays_open(two):
    assert run_tasks(cluster_tasks.in_main_thread, [("", 1)], cluster=two.client) == [False]
    assert two.client.status == "running"


def test_a_folder_is_held_by_one_run_and_given_back(tmp_path):
    with held(tmp_path / "out") as lock:
        assert lock.is_file()
        with pytest.raises(OutputNotWritten, match=r"in use by process \d+ on .* since 20"), held(tmp_path / "out"):
            pass
        assert lock.is_file()
    assert list((tmp_path / "out").iterdir()) == []


def test_what_a_dead_process_held_is_taken_over(tmp_path):
    import subprocess
    import sys

    code = "import sys, os; from relume.cluster import held; h = held(sys.argv[1]); h.__enter__(); os._exit(9)"
    subprocess.run([sys.executable, "-c", code, str(tmp_path)], env=cluster_tasks.environment(), check=False)
    assert len(list(tmp_path.iterdir())) == 1
    with held(tmp_path):
        pass
    assert list(tmp_path.iterdir()) == []


def test_what_a_process_of_another_machine_holds_is_left_alone(tmp_path):
    (tmp_path / ".relume-in-use.json").write_text('{"host": "elsewhere", "pid": 1, "since": "yesterday"}')
    with pytest.raises(OutputNotWritten, match="process 1 on elsewhere since yesterday"), held(Path(tmp_path)):
        pass
