"""Results of steps, kept on disk under the hash of what made them, so that a second run redoes only what changed.

A result is any value of frozen dataclasses, tuples, dictionaries, texts, bytes, numbers, dates and arrays: it is kept
as one .npz, its arrays by number and the rest as JSON. Large arrays stay in that file (`mapped_arrays`), so that memory
holds what a step works on, and not the results of all before it.
"""

from __future__ import annotations

import importlib
import json
import time
import zipfile
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager
from contextvars import copy_context
from dataclasses import dataclass, field, fields, is_dataclass
from datetime import datetime
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from relume.errors import Doubt, GatheredDoubts, OutputNotWritten, doubts_kept_back, warn
from relume.image import mapped_arrays
from relume.image.files import replacing
from relume.image.mapped_arrays import Mapped, give_back_freed
from relume.renderers.mitsuba.path_tracer import give_back
from relume.renderers.progressive.fingerprint import fingerprint, program

Result = TypeVar("Result")
Progress = Callable[[str, float], None]
"""Called with the name of a step and the share of it that is done."""
_FORM, _KEY = "form", "key"


@dataclass(frozen=True)
class Stages:
    """The kept results of one output folder.

    folder : where they are kept, one .npz a step
    others : folders of other jobs whose results serve as well where they were made from the same: other frames
    mapped : their large arrays
    """

    folder: Path
    others: tuple[Path, ...] = ()
    mapped: Mapped = field(default_factory=Mapped)

    def put_away(self, array: np.ndarray) -> np.ndarray:
        """The same array in a nameless file beside the stages, if it is large; raises OutputNotWritten."""
        if array.nbytes >= mapped_arrays.LARGE:
            self._make_folder()
        return self.mapped.put_away(self.folder, array)

    def get(self, name: str, made_from: object, make: Callable[[], Result]) -> tuple[Result, bool]:
        """The result of step `name`, and whether it was kept from an earlier run.

        made_from : everything the result depends on: JSON-able values, paths, arrays and dataclasses of them
        """
        key = fingerprint([program(), name, made_from])
        path = self.folder / f"{name}.npz"
        if (arrays := self._found(name, key)) is not None:
            return unpacked(arrays), True
        # What the result depends on was read for the key; a step may need little of it.
        self.mapped.release()
        result = make()
        arrays = {_KEY: np.array(key), **packed(result)}
        self._make_folder()
        with replacing(path) as temporary, open(temporary, "wb") as file:
            self.mapped.write(file, arrays)
        if any(array.nbytes >= mapped_arrays.LARGE for array in arrays.values()):
            # From now on from the file, so that what it was made in can go.
            result = unpacked(self.mapped.read(path))
        return result, False

    def _make_folder(self) -> None:
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise OutputNotWritten(f"{self.folder}: cannot be made ({error.strerror}); choose another -o") from None

    def has(self, name: str, made_from: object) -> bool:
        """Whether `get` would find the result of a step kept."""
        return self._found(name, fingerprint([program(), name, made_from])) is not None

    def _found(self, name: str, key: str) -> dict[str, np.ndarray] | None:
        kept = (_kept(folder / f"{name}.npz", key, self.mapped) for folder in (self.folder, *self.others))
        return next((arrays for arrays in kept if arrays is not None), None)


@dataclass(frozen=True, eq=False)
class Steps:
    """How the steps of a job run: where their results are kept, who is informed, and a record of both.

    seconds : of each step so far; of one that was begun before, what was still to be waited for
    kept : the steps whose results an earlier run had made
    begun : the steps that threads work on, each with the fingerprint of what it is made from
    """

    stages: Stages
    progress: Progress = lambda step, share: None
    seconds: dict[str, float] = field(default_factory=dict)
    kept: list[str] = field(default_factory=list)
    begun: dict[str, tuple[str, Future[tuple[Any, list[Doubt]]]]] = field(default_factory=dict)

    @contextmanager
    def timed(self, name: str) -> Iterator[None]:
        """Measure and report a step, which begins with next to nothing of the others' results in memory."""
        self.progress(name, 0.0)
        self.stages.mapped.release()
        give_back()
        give_back_freed()
        start = time.perf_counter()
        yield
        self.seconds[name] = time.perf_counter() - start
        self.progress(name, 1.0)

    def keep(self, name: str, made_from: object, make: Callable[[], Result]) -> Result:
        """The result of a step, made now or kept from an earlier run; its warnings are given either way."""

        def with_warnings() -> tuple[Result, tuple[Doubt, ...]]:
            with GatheredDoubts() as gathered:
                begun = self.begun.pop(name, None)
                if begun is not None and begun[0] == fingerprint(made_from):
                    result, kept_back = begun[1].result()
                    for doubt in kept_back:
                        warn(doubt.line, doubt.effect)
                else:
                    result = make()
            return result, gathered.doubts

        with self.timed(name):
            (result, doubts), was_kept = self.stages.get(name, made_from, with_warnings)
        if was_kept:
            self.kept.append(name)
        for doubt in doubts:
            warn(doubt.line, doubt.effect)
        return result

    def begin(self, name: str, made_from: object, make: Callable[[], Result]) -> None:
        """Begin a step in a thread, unless its result is kept, for `keep` to wait for; others go on beside it.

        make : may neither gather doubts by `GatheredDoubts` nor use Mitsuba
        """
        if self.stages.has(name, made_from):
            return

        def work() -> tuple[Result, list[Doubt]]:
            with doubts_kept_back() as doubts:
                return make(), doubts

        pool = ThreadPoolExecutor(1)
        self.begun[name] = fingerprint(made_from), pool.submit(copy_context().run, work)
        pool.shutdown(wait=False)


def packed(value: object) -> dict[str, np.ndarray]:
    """The value as named arrays, for `unpacked`; an array that stands in it twice is packed once.

    Raises TypeError for a value that is none of relume's dataclasses and no plain value.
    """
    arrays: dict[str, np.ndarray] = {}
    text = json.dumps(_form(value, arrays, {}))
    return {_FORM: np.array(text), **arrays}


# Neither of these is a function within the one above: such a one, calling itself, would hold the arrays of a large
# plate until Python next looks for what holds itself.
def _form(value: Any, arrays: dict[str, np.ndarray], names: dict[int, str]) -> Any:
    if value is None or isinstance(value, bool | int | float | str):
        return value
    if isinstance(value, np.generic):
        return value.item()
    if isinstance(value, np.ndarray):
        name = names.setdefault(id(value), str(len(names)))
        arrays[name] = value
        return {"array": name}
    if isinstance(value, list | tuple):
        return {type(value).__name__: [_form(each, arrays, names) for each in value]}
    if isinstance(value, dict):
        return {"dict": [[_form(key, arrays, names), _form(each, arrays, names)] for key, each in value.items()]}
    if isinstance(value, datetime):
        return {"datetime": value.isoformat()}
    if isinstance(value, bytes):  # a photograph's colour profile
        return {"bytes": value.hex()}
    if is_dataclass(value) and not isinstance(value, type):
        parts = {each.name: _form(getattr(value, each.name), arrays, names) for each in fields(value) if each.init}
        return {"class": f"{type(value).__module__}:{type(value).__qualname__}", "fields": parts}
    raise TypeError(f"{type(value).__name__} cannot be kept")


def unpacked(arrays: dict[str, np.ndarray]) -> Any:
    """The value that `packed` packed."""
    return _value(json.loads(str(arrays[_FORM])), arrays)


def _value(form: Any, arrays: dict[str, np.ndarray]) -> Any:
    if not isinstance(form, dict):
        return form
    if "array" in form:
        return arrays[form["array"]]
    if "class" in form:
        return _class(form["class"])(**{name: _value(each, arrays) for name, each in form["fields"].items()})
    if "bytes" in form:
        return bytes.fromhex(form["bytes"])
    if "datetime" in form:
        return datetime.fromisoformat(form["datetime"])
    if "dict" in form:
        return {_value(key, arrays): _value(each, arrays) for key, each in form["dict"]}
    if "tuple" in form:
        return tuple(_value(each, arrays) for each in form["tuple"])
    return [_value(each, arrays) for each in form["list"]]


def _class(name: str) -> Any:
    module, _, qualified = name.partition(":")
    if not module.startswith("relume."):
        raise ValueError(f"{name} is no class of relume")
    found: Any = importlib.import_module(module)
    for part in qualified.split("."):
        found = getattr(found, part)
    if not is_dataclass(found):
        raise ValueError(f"{name} is no dataclass")
    return found


def _kept(path: Path, key: str, mapped: Mapped) -> dict[str, np.ndarray] | None:
    """The arrays in a file of this key; None for any other file, and for a damaged one."""
    try:
        return mapped.read(path, key)
    except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile):
        return None
