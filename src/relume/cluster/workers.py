"""The workers of a scheduler: whether they run this relume, have the memory and see the files, and their cores."""

from __future__ import annotations

import sys
import time
from collections import Counter
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from relume.cluster.attempt import SPARE, set_threads, too_little
from relume.cluster.program import program
from relume.errors import ClusterUnusable

PATIENCE = 60.0
"""Seconds for which a scheduler without workers is waited for: queues start workers later."""


def check_workers(client: Any, *, memory: int | None = None, paths: Sequence[Path] = ()) -> None:
    """Refuse workers that cannot do the work, and give each its share of its machine's cores.

    memory : bytes that a task takes
    paths : files and folders that every worker has to see
    Raises ClusterUnusable.
    """
    workers = _workers(client)
    # Python first: what it compiled cannot be sent to another.
    mine = f"{sys.version_info[0]}.{sys.version_info[1]}"
    for address, facts in (client.get_versions(check=False)["workers"] or {}).items():
        theirs = ".".join(str(facts["host"]["python"]).split(".")[:2])
        if theirs != mine:
            raise ClusterUnusable(
                f"worker {address} runs Python {theirs}, and this is Python {mine}; start workers of the same"
            )
    # What else is asked travels as code: relume there may be another, or none.
    answers = client.run(_question([str(path) for path in paths]), on_error="return")
    for address, answer in answers.items():
        if isinstance(answer, BaseException):
            raise ClusterUnusable(
                f"worker {address} has no relume that can be used ({answer}); install {program()} there"
            )
        if answer["program"] != program():
            raise ClusterUnusable(
                f"worker {address} runs {answer['program']}, and this is {program()}; install the same on both sides"
            )
        if answer["unseen"]:
            raise ClusterUnusable(
                f"worker {address} on {answer['host']} does not see {answer['unseen'][0]}; put the files where every "
                "machine has them under this path"
            )
        limit = int(workers.get(address, {}).get("memory_limit") or 0)
        if memory and limit and memory > SPARE * limit:
            raise ClusterUnusable(too_little(f"worker {address}", memory, limit))
    _share_cores(client, answers)


def share_cores(client: Any) -> None:
    """Give each worker its share anew, after some came or went; those that do not answer are passed over."""
    answers = client.run(_question([]), on_error="ignore")
    _share_cores(client, {address: each for address, each in answers.items() if each["program"] == program()})


def _share_cores(client: Any, answers: dict[str, Any]) -> None:
    on_host = Counter(answer["host"] for answer in answers.values())
    shares: dict[int, list[str]] = {}
    for address, answer in answers.items():
        shares.setdefault(max(1, answer["cores"] // on_host[answer["host"]]), []).append(address)
    for share, addresses in shares.items():
        client.run(set_threads, share, workers=addresses, on_error="ignore")


def _workers(client: Any) -> dict[str, Any]:
    """The workers that are there, once there is one."""
    end = time.monotonic() + PATIENCE
    while not (workers := _info(client)["workers"]):
        if time.monotonic() > end:
            raise ClusterUnusable(
                f"the scheduler at {_info(client)['address']} has no workers after {PATIENCE:.0f} s; start some with "
                "dask worker"
            )
        time.sleep(0.2)
    return dict(workers)


def _info(client: Any) -> dict[str, Any]:
    """What the scheduler knows of its workers."""
    info = client.scheduler_info(n_workers=-1)
    if "workers" not in info:
        raise ClusterUnusable("the scheduler went away as its workers were asked; start it and give the command again")
    return dict(info)


def _question(paths: list[str]) -> Callable[[], dict[str, Any]]:
    """A function that is sent as code, since it is defined in another."""

    def answer() -> dict[str, Any]:
        import os
        import socket

        try:
            from relume.cluster.program import program

            runs = program()
        except ImportError:
            from importlib.metadata import version

            runs = f"relume {version('relume')}"
        cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
        unseen = [path for path in paths if not os.path.exists(path)]
        return {"program": runs, "host": socket.gethostname(), "cores": cores, "unseen": unseen}

    return answer
