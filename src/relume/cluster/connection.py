"""What `--cluster` and `cluster=` may be, and the connection to a scheduler that each becomes."""

from __future__ import annotations

import json
import logging
import os
import re
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from relume.cluster.tally import TaskProgress
from relume.cluster.workers import check_workers
from relume.errors import ClusterUnusable

if TYPE_CHECKING:
    from distributed import Client

SECONDS = 8.0
"""What a scheduler may take to answer; with what comes before and after it less than ten."""
_FORMS = "local, local:4, tcp://HOST:8786, the path of a scheduler.json, or env for DASK_SCHEDULER_ADDRESS"
_ADDRESS = re.compile(r"(tcp|tls|ucx|ws|wss|inproc)://")
_LIBRARIES = ("OMP", "OPENBLAS", "MKL", "NUMBA")


@dataclass(frozen=True, eq=False)
class Cluster:
    """A scheduler with its workers, as `run_tasks` and every `cluster=` take it.

    client : Dask's own
    dashboard : the address of the page that shows what each worker does; "" where there is none
    progress : called after every task of every run, beside the run's own
    """

    client: Client
    dashboard: str = ""
    progress: TaskProgress | None = None

    @property
    def address(self) -> str:
        """The address of the scheduler."""
        scheduler: Any = self.client.scheduler
        return str(scheduler.address) if scheduler is not None else "?"


@contextmanager
def connect(
    cluster: str | os.PathLike[str] | Client | Cluster, *, progress: TaskProgress | None = None
) -> Iterator[Cluster]:
    """Connect for the block; what was started or opened for it is closed at its end, what was given stays open.

    cluster : "local" for a worker a core of this machine, "local:N" for N; the address of a scheduler; the path of the
        file that a scheduler wrote; "env" for the address in DASK_SCHEDULER_ADDRESS or Dask's configuration; a Client
    progress : called after every task with (done, failed, to go, seconds left or None)
    Raises ClusterUnusable where nobody answers within ten seconds, or the workers run another relume or Python.
    """
    if isinstance(cluster, Cluster):
        yield cluster
        return
    with ExitStack() as stack:
        client = _client(cluster, stack)
        check_workers(client)
        yield Cluster(client, _dashboard(client), progress)


def _dashboard(client: Any) -> str:
    """The address of the scheduler's page, "" where it has none."""
    return str(client.dashboard_link) if "dashboard" in client.scheduler_info().get("services", {}) else ""


def _client(cluster: Any, stack: ExitStack) -> Client:
    """The client of whatever was given; what is opened for it is closed with the stack."""
    try:
        import distributed
        from dask import config  # pyright: ignore[reportPrivateImportUsage]
    except ImportError:
        raise ClusterUnusable(
            "a cluster needs Dask, which is not installed; install it: pip install 'relume[cluster]'"
        ) from None
    if isinstance(cluster, distributed.Client):
        if cluster.asynchronous:
            raise ValueError("cluster is an asynchronous Client; give one that is made without asynchronous=True")
        return cluster
    word = os.fspath(cluster)
    if found := re.fullmatch(r"local(?::(\d+))?", word):
        return _local(None if found[1] is None else int(found[1]), stack)
    if word == "env":
        word = config.get("scheduler-address", None)
        if not word:
            raise ClusterUnusable(
                "cluster env: DASK_SCHEDULER_ADDRESS is not set; set it to an address like tcp://HOST:8786"
            )
    if not _ADDRESS.match(word):
        word = _address_in(Path(word))
    return _connected(word, stack)


def _address_in(path: Path) -> str:
    """The address in the file that a scheduler wrote."""
    if not path.is_file():
        raise ClusterUnusable(f'cluster "{path}": no such file, and no word for a cluster; give {_FORMS}')
    try:
        return str(json.loads(path.read_bytes())["address"])
    except (ValueError, KeyError, TypeError):
        raise ClusterUnusable(
            f"cluster {path}: not the file of a scheduler; give what dask scheduler --scheduler-file wrote"
        ) from None


def _connected(address: str, stack: ExitStack) -> Client:
    from distributed import Client

    # What is wrong is said in our line, and not in those of Dask's log beside it.
    for name in ("distributed.client", "distributed.comm", "distributed.batched", "distributed.core"):
        log = logging.getLogger(name)
        stack.callback(log.setLevel, log.level)
        log.setLevel(logging.CRITICAL)
    if address.startswith("tls:"):
        _check_certificates(address)
    try:
        return stack.enter_context(Client(address, timeout=SECONDS, set_as_default=False))
    except (OSError, TimeoutError, ValueError, ImportError) as error:
        words = " ".join(str(error.__cause__ or error).split())
        raise ClusterUnusable(
            f"no scheduler answers at {address} ({words[:120]}); start one with dask scheduler, or check the address"
        ) from None


def _check_certificates(address: str) -> None:
    """Refuse an encrypted scheduler where Dask was given no certificates: its client would fail in many lines."""
    from distributed.security import Security

    try:
        if Security().get_connection_args("client").get("ssl_context") is not None:
            return
        words = "none are set"
    except (OSError, ValueError) as error:
        words = f"they cannot be read: {' '.join(str(error).split())[:120]}"
    raise ClusterUnusable(
        f"{address} needs certificates, and {words}; give their files in DASK_DISTRIBUTED__COMM__TLS__CA_FILE, "
        "DASK_DISTRIBUTED__COMM__TLS__CLIENT__CERT and DASK_DISTRIBUTED__COMM__TLS__CLIENT__KEY"
    )


def _local(count: int | None, stack: ExitStack) -> Client:
    """Workers of this machine, one task each at a time, which share its cores."""
    from dask import config  # pyright: ignore[reportPrivateImportUsage]
    from dask.system import CPU_COUNT
    from distributed import Client, LocalCluster

    workers = CPU_COUNT if count is None else count
    if workers < 1:
        raise ValueError(f"cluster local:{workers}: no worker; give at least one, like local:2")
    share = str(max(1, CPU_COUNT // workers))
    settings = {
        "distributed.nanny.pre-spawn-environ": {f"{name}_NUM_THREADS": share for name in _LIBRARIES},
        # A task waits at the scheduler and not behind another, so that a worker's death concerns its own task alone.
        "distributed.scheduler.worker-saturation": 1.0,
        # Who waited behind one that kills workers is tried again by itself in any case; see `spreading`.
        "distributed.scheduler.allowed-failures": 1,
    }
    try:
        with config.set(settings):
            local = LocalCluster(
                n_workers=workers, threads_per_worker=1, processes=True, dashboard_address="127.0.0.1:0",
                silence_logs=logging.CRITICAL,
            )  # fmt: skip
    except (RuntimeError, OSError) as error:
        raise ClusterUnusable(f"{workers} workers could not be started on this machine: {error}") from error
    stack.enter_context(local)
    return stack.enter_context(Client(local, set_as_default=False))
