"""Reading hostile files in a child process, and the verdict on what each of them did (goal G4 of the issue on files).

A child is bounded in memory, watched by a clock and replaced when it dies; it serves many files, because starting one
costs more than reading a thousand.
"""

from __future__ import annotations

import json
import os
import re
import select
import signal
import subprocess
import sys
import tempfile
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Self

from corpus.files import Bad, Good

HANG = 10.0
"""Seconds of the clock after which a file is said to hang."""
_REJECT_SECONDS = 2.0
_REJECT_GROWTH, _READ_GROWTH = 96 * 2**20, 64 * 2**20
_START = 120.0  # seconds: the package is imported, and kernels compiled, on a machine that may be busy
# A refusal that says where: a number (byte, line, row, tag, size) or a name in quotes. FormatError always does.
_PLACE = re.compile(r"\d|[\"'“”][^\"'“”]+[\"'“”]|\bchannels?\b|\b(IHDR|IDAT|IEND|SOI|EOI|SOF|SOS|DHT|DQT|APP)\b")
# What is no file of its format any more, since its first bytes are gone, has no place to say.
_ANOTHER_KIND = re.compile(
    r"no picture relume reads|an empty file|which relume does not read|is needed|not a photograph yet|not one picture|"
    r"a deep EXR|no KTX 2.0 file"
)


@dataclass(frozen=True)
class Outcome:
    """What reading one file through one door did.

    kind : "read", "refused", "format" (refused by a FormatError), "raised", "died", "hung"
    error : the refusal, or what was raised, or how the child died
    warnings : (whether it is a UserWarning, its text)
    seconds, computed : by the clock, and of the processor
    growth, decoded : bytes of memory at the worst beyond those before, and of the picture as float32
    printed : what the reader wrote to the output or error output
    """

    file: str
    path: str
    door: str
    kind: str
    error: str = ""
    trace: str = ""
    warnings: list[tuple[bool, str]] = field(default_factory=list)
    seconds: float = 0.0
    computed: float = 0.0
    growth: int = 0
    decoded: int = 0
    printed: str = ""

    @property
    def is_refused(self) -> bool:
        return self.kind in ("refused", "format")

    @property
    def says_where(self) -> bool:
        """Whether a refusal names a place, or the file is no longer one of its format."""
        line = self.error.removeprefix(self.path)
        return self.kind == "format" or bool(_PLACE.search(line)) or bool(_ANOTHER_KIND.search(line))

    def faults(self) -> list[str]:
        """What is wrong with the outcome; none for a clean one."""
        faults = []
        if self.kind in ("raised", "died", "hung"):
            places = [line.strip() for line in self.trace.splitlines() if line.startswith("  File ")]
            faults.append(f"{self.kind}: {self.error}" + (f" ({places[-1]})" if places else ""))
        if self.is_refused and ("\n" in self.error or "\r" in self.error):
            faults.append(f"more than one line: {self.error!r}")
        if self.is_refused and not self.error.startswith(f"{self.path}: "):
            faults.append(f"does not begin with the file: {self.error!r}")
        if self.is_refused and self.computed > _REJECT_SECONDS:
            faults.append(f"refused after {self.computed:.2f} s")
        allowed = _READ_GROWTH + 3 * self.decoded if self.kind == "read" else _REJECT_GROWTH
        if self.growth > allowed:
            faults.append(f"{self.growth / 2**20:.0f} MiB of memory where {allowed / 2**20:.0f} are allowed")
        bare = [text for ours, text in self.warnings if not ours]
        loose = [t for ours, t in self.warnings if ours and (not t.startswith(f"{self.path}: ") or "\n" in t)]
        faults += [f"a bare warning: {bare[0]!r} and {len(bare) - 1} more"] if bare else []
        faults += [f"warns, but not in a line about the file: {loose[0]!r} and {len(loose) - 1} more"] if loose else []
        if self.printed:
            faults.append(f"printed {self.printed!r}")
        return [f"{self.file} through {self.door.split(':')[1]}: {fault}" for fault in faults]


class Reader:
    """A child process that reads files; use it in a `with` block.

    folder : where files are put for it, and what it prints
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._child: subprocess.Popen[bytes] | None = None
        self._warm: list[tuple[Good, str]] = []
        self.deaths = 0

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._end()

    def warm(self, files: Iterable[Good], doors: Iterable[str]) -> list[Outcome]:
        """Read good files through every door, so that libraries are loaded and kernels compiled before measuring.

        A child that replaces a dead one reads them again by itself.
        """
        self._warm = [(file, door) for file in files for door in doors]
        return self._warmed()

    def read(self, file: Good | Bad, door: str, *, patience: float = HANG) -> Outcome:
        """What a file does; it hangs when it takes more than `patience` seconds by the clock."""
        path = self._folder / f"file{file.suffix}"
        path.write_bytes(file.data)
        outcome = self.read_path(path, door, name=file.name, patience=patience)
        path.unlink()
        return outcome

    def read_path(self, path: Path, door: str, *, name: str = "", patience: float = HANG) -> Outcome:
        """What a file that is there already does."""
        name = name or path.name
        if self._child is None:
            self._start()
            self._warmed()
        outcome = self._asked(path, door, name, patience)
        if outcome.kind in ("died", "hung"):
            self.deaths += 1
            self._end()
        return outcome

    def _warmed(self) -> list[Outcome]:
        if self._child is None:
            self._start()
        outcomes = []
        for number, (file, door) in enumerate(self._warm):
            path = self._folder / f"good{number}{file.suffix}"
            path.write_bytes(file.data)
            outcomes.append(self._asked(path, door, file.name, _START))
            path.unlink()
            if outcomes[-1].kind in ("died", "hung"):
                self._end()
                self._start()
        return outcomes

    def _start(self) -> None:
        answers, channel = os.pipe()
        self._printed = tempfile.TemporaryFile(dir=self._folder)
        tests = str(Path(__file__).resolve().parents[1])
        import relume

        package = str(Path(relume.__file__).resolve().parents[1])
        environment = {**os.environ, "PYTHONPATH": os.pathsep.join([tests, package])}
        self._child = subprocess.Popen(
            [sys.executable, "-m", "corpus.child", str(channel)],
            stdin=subprocess.PIPE,
            stdout=self._printed,
            stderr=self._printed,
            pass_fds=[channel],
            env=environment,
        )
        os.close(channel)
        self._answers = os.fdopen(answers, "rb", buffering=0)
        self._pending = b""
        outcome = self._asked(Path(os.devnull), "corpus.doors:silent", "the start", _START)
        if outcome.kind != "read":
            raise RuntimeError(f"the child process does not start: {outcome.error} {outcome.printed}")

    def _asked(self, path: Path, door: str, name: str, patience: float) -> Outcome:
        assert self._child is not None and self._child.stdin is not None
        try:
            self._child.stdin.write(json.dumps([str(path), door]).encode() + b"\n")
            self._child.stdin.flush()
        except BrokenPipeError:
            return Outcome(name, str(path), door, "died", "before it was asked", printed=self._heard())
        while b"\n" not in self._pending:
            ready, _, _ = select.select([self._answers], [], [], patience)
            if not ready:
                return Outcome(name, str(path), door, "hung", f"no answer in {patience:.0f} s", printed=self._heard())
            received = self._answers.read(2**16)
            if not received:
                return Outcome(name, str(path), door, "died", self._death(), printed=self._heard())
            self._pending += received
        line, self._pending = self._pending.split(b"\n", 1)
        said = json.loads(line)
        said["warnings"] = [(bool(ours), text) for ours, text in said["warnings"]]
        return Outcome(name, str(path), door, printed=self._heard(), **said)

    def _death(self) -> str:
        assert self._child is not None
        code = self._child.wait(HANG)
        return f"of {signal.Signals(-code).name}" if code < 0 else f"with exit code {code}"

    def _heard(self) -> str:
        end = os.fstat(self._printed.fileno()).st_size
        if end == 0:
            return ""
        text = os.pread(self._printed.fileno(), min(end, 4096), 0).decode("utf-8", "replace")
        # The child's descriptors share this offset.
        os.lseek(self._printed.fileno(), 0, os.SEEK_SET)
        os.ftruncate(self._printed.fileno(), 0)
        return text

    def _end(self) -> None:
        if self._child is None:
            return
        self._child.kill()
        self._child.wait()
        assert self._child.stdin is not None
        self._child.stdin.close()
        self._answers.close()
        self._printed.close()
        self._child = None
