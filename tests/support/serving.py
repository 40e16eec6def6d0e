"""`relume view` as its own process, for tests that speak to it from outside."""

from __future__ import annotations

import http.client
import json
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from urllib.parse import parse_qs, urlsplit

DUMPING = "import faulthandler, signal; faulthandler.register(signal.SIGUSR1, all_threads=True); "
"""A process that begins so writes what all its threads do to its standard error when SIGUSR1 arrives."""
COMMAND = DUMPING + "import sys; from relume.cli import main; sys.exit(main())"
LIMIT = 120.0
"""Seconds after which a process that should have said something, or ended, is taken for hung: machines may be busy."""


@dataclass(frozen=True)
class Server:
    """A server that runs: its port, its token, and requests to it."""

    port: int
    token: str
    process: subprocess.Popen[str]

    @property
    def address(self) -> str:
        return f"http://127.0.0.1:{self.port}/?token={self.token}"

    @property
    def cookie(self) -> dict[str, str]:
        return {"Cookie": f"relume-{self.port}={self.token}"}

    def ask(
        self, path: str, *, method: str = "GET", body: bytes | str | None = None, **headers: str
    ) -> tuple[int, dict[str, str], bytes]:
        """Status, headers in small letters, body; the path goes out as it is written, the Host as given."""
        speaking = http.client.HTTPConnection("127.0.0.1", self.port, timeout=LIMIT)
        try:
            speaking.putrequest(method, path, skip_host=True)
            for name, value in {"Host": f"127.0.0.1:{self.port}", **headers}.items():
                speaking.putheader(name, value)
            if body is not None and "Content-Length" not in headers:
                speaking.putheader("Content-Length", str(len(body)))
            speaking.endheaders(body.encode() if isinstance(body, str) else body)
            answer = speaking.getresponse()
            return answer.status, {name.lower(): value for name, value in answer.getheaders()}, answer.read()
        finally:
            speaking.close()

    def json(self, path: str) -> Any:
        status, _, body = self.ask(path, **self.cookie)
        assert status == 200, (status, body)
        return json.loads(body)

    def post(self, path: str, content: Any = None, **headers: str) -> tuple[int, Any]:
        """What the page itself posts: status and the JSON that comes back."""
        own: dict[str, str] = {"Origin": f"http://127.0.0.1:{self.port}", **self.cookie, **headers}
        body = content if isinstance(content, bytes) else json.dumps(content or {}).encode()
        status, _, answer = self.ask(path, method="POST", body=body, **own)
        return status, json.loads(answer)

    def workers(self) -> list[int]:
        """The process ids of its workers: children of any of its threads."""
        return [each for each in _children(self.process) if b"spawn_main" in Path(f"/proc/{each}/cmdline").read_bytes()]


def _children(process: subprocess.Popen[str]) -> list[int]:
    tasks = Path(f"/proc/{process.pid}/task").iterdir()
    return [int(child) for task in tasks for child in (task / "children").read_text().split()]


def ended_with_its_threads(process: subprocess.Popen[str]) -> None:
    """End a process that hangs; what its threads did is the last thing on its standard error, if it began `DUMPING`."""
    process.send_signal(signal.SIGUSR1)
    time.sleep(1.0)
    # Children hold its pipes open: whoever reads from these would wait for them.
    for child in _children(process):
        os.kill(child, signal.SIGKILL)
    process.kill()


def first_line(process: subprocess.Popen[str], seconds: float = LIMIT) -> str:
    """What a process says first; fails with all it wrote to standard error where it ends, or says nothing for long.

    seconds : to wait; after them the process is ended, and the failure shows what each of its threads did
    """
    assert process.stdout is not None
    clock = threading.Timer(seconds, ended_with_its_threads, [process])
    clock.start()
    try:
        line = process.stdout.readline()
    finally:
        clock.cancel()
    assert line, process.communicate()[1]
    return line


def started(files: Sequence[Path | str], command: str = "view") -> Server:
    """The command over these files, in a process that whoever asked for it ends."""
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    process = subprocess.Popen(
        [sys.executable, "-c", COMMAND, command, "--no-browser", "--json", *map(str, files)],
        env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
    )  # fmt: skip
    parts = urlsplit(json.loads(first_line(process))["address"])
    assert parts.port is not None
    return Server(parts.port, parse_qs(parts.query)["token"][0], process)


@contextmanager
def serving(files: Sequence[Path | str], command: str = "view") -> Iterator[Server]:
    """The same, ended by Ctrl-C, which has to give exit code 0."""
    server = started(files, command)
    try:
        yield server
    finally:
        server.process.send_signal(signal.SIGINT)
        try:
            _, said = server.process.communicate(timeout=LIMIT)
        except subprocess.TimeoutExpired:
            ended_with_its_threads(server.process)
            _, said = server.process.communicate()
    assert server.process.returncode == 0, said
    assert "Traceback" not in said, said
