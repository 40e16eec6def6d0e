"""A file of TOML as a document: edited by the page and by anyone else, undone and redone without end.

The file is the document. What the page does is written to it whole or not at all, and what others write to it is taken
over: every text that the file has had since it was opened is a step that can be undone.
"""

from __future__ import annotations

import threading
import tomllib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import relume as rl
from relume.studio.shots.edits import edited

LARGEST = 4 * 1024**2
"""Bytes that are read of a file; the largest shot file of ours has 3000, the largest place file 10 000."""


class Conflict(ValueError):
    """The file was changed since the window that edits it last saw it."""


@dataclass(frozen=True)
class DocumentKind:
    """What a document is.

    change : the text after changes, as `edited` has them
    check : raises RelumeError for a file that is not sound
    empty : what is wrong with a file that is not there yet
    """

    change: Callable[[str, Sequence[Mapping[str, Any]]], str]
    check: Callable[[Path], object]
    empty: str


SHOT = DocumentKind(edited, lambda path: rl.read_shot(path), "plate: missing; choose its photographs")


class Document:
    """A shot file, or a file of another kind, that may not be there yet; safe to use from several threads.

    path : .toml
    revision : how many times its text has changed since it was opened
    table : the last contents that were valid TOML
    fault : what is wrong with the text as it is, one line that begins with the key or "line …"; None where it is sound
    """

    def __init__(self, path: Path, kind: DocumentKind = SHOT) -> None:
        self.path, self.kind = path, kind
        self.revision = 0
        self.table: dict[str, Any] = {}
        self.fault: str | None = None
        self.readable = True
        self._changing = threading.RLock()
        self._stamp: tuple[int, int] | None = None
        self._texts: list[str] = [self._read()]
        self._place = 0
        self._judge(self._texts[0])

    @property
    def text(self) -> str:
        """What the file holds; "" where it is not there yet."""
        return self._texts[self._place]

    def state(self) -> dict[str, Any]:
        """All that a window shows of it, for JSON."""
        with self._changing:
            return {
                "name": self.path.name, "revision": self.revision, "table": self.table, "fault": self.fault,
                "readable": self.readable, "undo": self._place, "redo": len(self._texts) - 1 - self._place,
            }  # fmt: skip

    def look(self) -> bool:
        """Take over what others wrote to the file; whether they did."""
        with self._changing:
            if self._stamp_now() == self._stamp:
                return False
            try:
                text = self._read()
            except rl.RelumeError as error:
                self.readable, self.fault, self.revision = False, str(error), self.revision + 1
                return True
            if text == self.text:
                return False
            self._step(text)
            return True

    def edit(self, changes: Sequence[Mapping[str, Any]], *, revision: int, unfinished: bool = False) -> None:
        """Make changes, as `edited` has them, and write the file.

        revision : that the changes were made to
        unfinished : whether the result may lack what a shot needs, as while its photographs are being chosen
        Raises Conflict where the text has changed since; ValueError for changes that cannot be made, and for those
        that would make a sound file a wrong one; OutputNotWritten. Nothing is written then.
        """
        with self._changing:
            self.look()
            if not self.readable:
                raise ValueError(f"{self.path.name}: {self.fault}; mend the file or undo, then edit")
            if revision != self.revision:
                raise Conflict(f"{self.path.name} was changed meanwhile, here or outside; look at it and do that again")
            text = self.kind.change(self.text, changes)
            if text == self.text:
                return
            with rl.files.replacing(self.path) as temporary:
                temporary.write_bytes(_bytes(text))
                fault = self._fault(temporary)
                if fault is not None and self.fault is None and not unfinished:
                    raise ValueError(f"not done: {fault}")
                if self._stamp_now() != self._stamp:  # written by others at this very moment: theirs stays
                    raise Conflict(f"{self.path.name} was changed outside meanwhile; look at it and do that again")
            self._stamp = self._stamp_now()
            self._step(text)

    def undo(self, by: int) -> None:
        """Go back to the text `by` steps before, or on to a later one where that is negative; to the first or last.

        Raises OutputNotWritten; nothing changes then.
        """
        with self._changing:
            self.look()
            place = min(max(self._place - by, 0), len(self._texts) - 1)
            if place == self._place:
                return
            if self._texts[place]:
                with rl.files.replacing(self.path) as temporary:
                    temporary.write_bytes(_bytes(self._texts[place]))
            else:
                try:
                    rl.files.remove(self.path)
                except OSError as error:
                    why = error.strerror or error
                    raise rl.errors.OutputNotWritten(f"{self.path.name}: cannot be removed ({why})") from None
            self._stamp = self._stamp_now()
            self._place = place
            self.revision += 1
            self._judge(self.text)

    def _step(self, text: str) -> None:
        """A new text after the present one; what was undone before it is gone."""
        del self._texts[self._place + 1 :]
        self._texts.append(text)
        self._place += 1
        self.revision += 1
        self._judge(text)

    def _judge(self, text: str) -> None:
        """Read the text for its table and its fault."""
        try:
            text.encode("utf-8")
            self.table = tomllib.loads(text)
            self.readable = True
        except UnicodeEncodeError:
            self.readable, self.fault = False, "not a text in UTF-8"
            return
        except tomllib.TOMLDecodeError as error:
            self.readable, self.fault = False, " ".join(f"not valid TOML: {error}".split())
            return
        self.fault = self._fault(self.path) if text else self.kind.empty

    def _fault(self, path: Path) -> str | None:
        """What is wrong with a file, without its name; None where it is sound."""
        try:
            self.kind.check(path)
        except rl.RelumeError as error:
            return " ".join(str(error).removeprefix(f"{path}: ").split())
        return None

    def _read(self) -> str:
        """The file's text, "" where there is none, and when it was written."""
        self._stamp = self._stamp_now()
        try:
            with open(self.path, "rb") as file:
                # What is no UTF-8 goes through unharmed, for undo to write the same bytes.
                return file.read(LARGEST).decode("utf-8", "surrogateescape")
        except FileNotFoundError:
            return ""
        except OSError as error:
            raise rl.errors.UnreadableFile(f"{self.path}: cannot be read ({error.strerror})") from None

    def _stamp_now(self) -> tuple[int, int] | None:
        try:
            facts = self.path.stat()
        except OSError:
            return None
        return facts.st_mtime_ns, facts.st_size


def _bytes(text: str) -> bytes:
    return text.encode("utf-8", "surrogateescape")
