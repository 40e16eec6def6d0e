"""Workers that die, join late or are others, and a scheduler that is restarted: real processes, started by hand."""

from __future__ import annotations

import shutil
import signal
import threading
import time
from pathlib import Path

import pytest

import cluster_tasks
from cluster_tasks import begun, by_hand
from relume.cluster import run_tasks
from relume.errors import ClusterUnusable, Incomplete

pytest.importorskip("distributed", reason="Dask distributed is not installed: pip install 'relume[cluster]'")


@pytest.fixture
def folders(tmp_path) -> tuple[Path, Path]:
    """Where a cluster keeps its things, and where tasks leave theirs."""
    places = tmp_path / "cluster", tmp_path / "tasks"
    for place in places:
        place.mkdir()
    return places


def given(folder: Path, count: int) -> list[tuple[str, int]]:
    return [(str(folder), number) for number in range(count)]


def test_a_worker_that_is_killed_costs_its_own_task_alone(folders):
    cluster, tasks = folders
    with by_hand(cluster, workers=2) as started:
        assert run_tasks(cluster_tasks.dies_first, given(tasks, 10), cluster=started.address) == list(range(10))
        assert [process.poll() for process in started.processes].count(-signal.SIGKILL) == 1
    assert [len(begun(tasks, number)) for number in range(10)] == [1, 1, 1, 2, 1, 1, 1, 1, 1, 1]


@pytest.mark.slow
def test_a_task_that_kills_every_worker_is_named_and_the_others_are_done(folders):
    with pytest.raises(Incomplete) as raised:
        run_tasks(cluster_tasks.always_dies, given(folders[1], 6), names=list("abcdef"), cluster="local:1")
    assert dict(raised.value.failed).keys() == {"b"}
    assert "the worker died in this task" in str(raised.value)
    assert raised.value.results == [0, None, 2, 3, 4, 5]


@pytest.mark.slow
def test_a_worker_that_joins_late_takes_its_share(folders):
    cluster, tasks = folders
    with by_hand(cluster, workers=1) as started:
        late = threading.Thread(target=lambda: (some_are_begun(tasks), started.start_worker()))
        late.start()
        pids = run_tasks(cluster_tasks.slow, given(tasks, 60), cluster=cluster / "scheduler.json")
        late.join()
    assert pids == list(range(60))
    assert len({path.name.split(".")[1] for number in range(60) for path in begun(tasks, number)}) == 2
    assert all(len(begun(tasks, number)) == 1 for number in range(60))


def some_are_begun(folder: Path) -> None:
    while len(list(folder.iterdir())) < 2:
        time.sleep(0.05)


def some_are_done(folder: Path) -> None:
    while len(list(folder.glob("*.result"))) < 4:
        time.sleep(0.05)


@pytest.mark.slow
def test_after_a_scheduler_is_restarted_the_job_redoes_what_is_not_there(folders, monkeypatch):
    monkeypatch.setattr("relume.cluster.spreading.LOST", 3.0)
    cluster, tasks = folders
    with by_hand(cluster, workers=2) as started:
        threading.Thread(target=lambda: (some_are_done(tasks), started.scheduler.kill())).start()
        with pytest.raises(Incomplete, match="the scheduler was lost") as raised:
            run_tasks(cluster_tasks.once, given(tasks, 40), cluster=started.address)
        before = {number for number in range(40) if begun(tasks, number)}
        whole = {number for number in range(40) if (tasks / f"{number}.result").is_file()}
        assert 0 < len(whole) <= len(before) < 40
        assert len(raised.value.failed) >= 40 - len(before)
        # Workers join the new scheduler, or are started anew.
        for process in started.processes[1:]:
            process.kill()
            process.wait()
        started.start_scheduler()
        started.start_worker()
        started.start_worker()
        assert run_tasks(cluster_tasks.once, given(tasks, 40), cluster=started.address) == list(range(40))
    assert {number: len(begun(tasks, number)) for number in whole} == dict.fromkeys(whole, 1)
    assert all((tasks / f"{number}.result").is_file() for number in range(40))


def test_another_relume_is_refused_with_both_versions(folders, tmp_path):
    other = tmp_path / "other"
    shutil.copytree(cluster_tasks.SOURCE / "relume", other / "relume", ignore=shutil.ignore_patterns("__pycache__"))
    (other / "relume-7.8.9.dist-info").mkdir()
    (other / "relume-7.8.9.dist-info" / "METADATA").write_text("Metadata-Version: 2.1\nName: relume\nVersion: 7.8.9\n")
    cluster, tasks = folders
    with by_hand(cluster, workers=0) as started:
        started.start_worker(source=other)
        with pytest.raises(ClusterUnusable, match=r"runs relume 7\.8\.9 .* and this is relume 0\."):
            run_tasks(cluster_tasks.count, given(tasks, 2), cluster=started.address)
    assert not list(tasks.iterdir())


@pytest.mark.slow
def test_another_relume_that_joins_late_is_given_nothing_to_do(folders, tmp_path):
    other = tmp_path / "other"
    shutil.copytree(cluster_tasks.SOURCE / "relume", other / "relume", ignore=shutil.ignore_patterns("__pycache__"))
    (other / "relume" / "errors.py").write_text((other / "relume" / "errors.py").read_text() + "\n# changed\n")
    cluster, tasks = folders
    with by_hand(cluster, workers=1) as started:
        late = threading.Thread(target=lambda: (some_are_begun(tasks), started.start_worker(source=other)))
        late.start()
        assert run_tasks(cluster_tasks.slow, given(tasks, 60), cluster=started.address) == list(range(60))
        late.join()
        assert started.processes[-1].poll() is None
        assert len(started.processes) == 3
    assert (cluster / "log.txt").read_text().count("Registered to") == 2
    assert len({path.name.split(".")[1] for number in range(60) for path in begun(tasks, number)}) == 1


def test_workers_with_too_little_memory_are_refused(folders):
    cluster, tasks = folders
    with by_hand(cluster, workers=0) as started:
        started.start_worker(memory="1GB")
        begun_at = time.monotonic()
        with pytest.raises(ClusterUnusable, match=r"takes 2 GB, .* may use 0\.8 of its 1 GB"):
            run_tasks(cluster_tasks.count, given(tasks, 2), cluster=started.address, memory=2 * 10**9)
        assert time.monotonic() - begun_at < 60
    assert not list(tasks.iterdir())
