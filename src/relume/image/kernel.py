"""How every Numba kernel here is compiled.

A kernel is a private loop beside the friendly function that validates and allocates. Each module of kernels has a
proof: a test that reaches it and holds it against a slow twin, a closed form or an identity, as the table in
`tests/architecture/kernels.py` says. Tuples of arrays are unpacked before the loop: inside it every access would count
references. Import this module only where a kernel is used: it imports Numba.

Kernels are compiled for one common processor rather than for the one at hand, so that those in a wheel
(`scripts/kernels_in_wheel.py`) run on all of its kind, and give the same bits on each (docs/decisions/0073).
"""

from __future__ import annotations

import hashlib
import os
import pickle
import re
import shutil
import stat
import tempfile
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from functools import lru_cache
from pathlib import Path
from threading import Lock
from typing import Any

import llvmlite.binding as llvm
import numba
from numba.core.caching import CompileResultCacheImpl, FunctionCache, InTreeCacheLocator
from numba.core.serialize import dumps

_CONFIG: Any = numba.config  # pyright: ignore[reportPrivateImportUsage]

# What processors of desktops and servers have had since 2013 (Intel) and 2015 (AMD).
_COMMON = "x86-64-v3"
_FEATURES = ("avx", "avx2", "bmi", "bmi2", "cx16", "f16c", "fma", "lzcnt", "movbe", "popcnt", "sahf", "sse4.2", "xsave")

# Sums may be reordered and products fused, but nothing may assume that there is no NaN or infinity: a NaN has to
# arrive where it can be seen, and a ray that misses is at infinity.
_FLAGS = {"nsz", "arcp", "contract", "afn", "reassoc"}


def is_common(features: Mapping[str, bool]) -> bool:
    """Whether a processor with these features, as LLVM names them, runs what is compiled for the common one."""
    return all(features.get(name, False) for name in _FEATURES)


def _choose_processor() -> None:
    """Let Numba compile for the common processor, where this one is of its kind and the user chose none."""
    if (
        _CONFIG.ENABLE_AVX
        and (_CONFIG.CPU_NAME, _CONFIG.CPU_FEATURES) == (None, None)
        and llvm.get_process_triple().startswith("x86_64")
        and is_common(llvm.get_host_cpu_features())
    ):
        _CONFIG.CPU_NAME, _CONFIG.CPU_FEATURES = _COMMON, ""


_choose_processor()  # Numba reads it once, when it first compiles in this process


@lru_cache
def fuses() -> bool:
    """Whether the processor fuses products with sums itself; else each is a call, slower than the two."""
    return not llvm.get_process_triple().startswith("x86") or llvm.get_host_cpu_features().get("fma", False)


@lru_cache
def cache_folder(module: str) -> str:
    """Where a module's compiled kernels are kept: a folder for this very source.

    Numba alone looks at the file that holds a kernel, not at those whose functions and numbers are compiled into it:
    these are all that it imports. A wheel brings its kernels in `relume/kernels`; where nothing may be written there,
    they are copied to where the user may, since Numba adds to them what else is called.
    """
    package = Path(__file__).parents[1]
    own = package / (module.removeprefix("relume.").replace(".", "/") + ".py")
    waiting, sources = [own], {Path(__file__): _source(Path(__file__))}
    while waiting:
        path = waiting.pop()
        if path in sources or not path.is_file():
            continue
        sources[path] = _source(path)
        names = re.findall(rb"^from relume\.([\w.]+) import", sources[path], re.MULTILINE)
        waiting += [package / (name.decode().replace(".", "/") + ".py") for name in names]
    digest = hashlib.sha1()
    for path in sorted(sources):
        digest.update(sources[path])
    name = f"kernels-{own.stem}-{digest.hexdigest()[:12]}"
    brought = package / "kernels" / name
    for place in _writable(package / ("kernels" if brought.is_dir() else "__pycache__")):
        folder = place / name
        try:
            if brought.is_dir() and not folder.exists():
                folder.parent.mkdir(parents=True, exist_ok=True)
                _copied(brought, folder)
        except OSError:  # a full disk: the next place may have room
            continue
        break
    return str(folder)


@lru_cache(None)
def _source(path: Path) -> bytes:
    """What a file held when it was first asked for: soon after this process imported it, whatever is written later."""
    return path.read_bytes()


_source(Path(__file__))


def _writable(first: Path) -> Iterator[Path]:
    """Places for kernels that may be written to, the best first; the user's choice goes before all."""
    # An installation may be write-protected, and so may the home of a user on a render node.
    chosen = [Path(_CONFIG.CACHE_DIR)] if _CONFIG.CACHE_DIR else []
    for place in (*chosen, first, Path.home() / ".cache" / "relume"):
        try:
            place.mkdir(parents=True, exist_ok=True)
        except OSError:
            continue
        if os.access(place, os.W_OK):
            yield place
    yield _own_temporary()


@lru_cache(None)
def _own_temporary() -> Path:
    """A folder for temporary files that only this user may write to: what is kept there is run."""
    user = os.getuid() if hasattr(os, "getuid") else None
    place = Path(tempfile.gettempdir()) / f"relume-{'' if user is None else user}"
    with suppress(OSError):
        place.mkdir(mode=0o700)
    found = place.lstat() if place.exists() else None
    if found and stat.S_ISDIR(found.st_mode) and (user is None or (found.st_uid == user and not found.st_mode & 0o022)):
        return place
    return Path(tempfile.mkdtemp(prefix="relume-"))


def _copied(brought: Path, folder: Path) -> None:
    """Copy kernels whole or not at all; another process may do the same at once."""
    with tempfile.TemporaryDirectory(dir=folder.parent, prefix=".kernels-") as half:
        copy = Path(half) / folder.name
        copy.mkdir()
        for each in brought.iterdir():
            shutil.copyfile(each, copy / each.name)
        try:
            copy.rename(folder)
        except OSError:
            if not folder.is_dir():
                raise


_CHOOSING = Lock()
"""Held while Numba's locators are ours: modules of kernels are imported in threads too."""


class KeptWithSource(InTreeCacheLocator):
    """Where Numba keeps a kernel, and for which source: no path and no time is part of either."""

    def __init__(self, function: Callable[..., Any], path: str) -> None:
        super().__init__(function, path)
        self._cache_path = cache_folder(function.__module__)

    @classmethod
    def from_function(cls, py_func: Callable[..., Any], py_file: str) -> KeptWithSource | None:
        """None for others' functions, whose sources are not known here."""
        return cls(py_func, py_file) if py_func.__module__.startswith("relume.") else None

    def get_source_stamp(self) -> str:
        """The folder's name, which holds a hash of all that is compiled."""
        return Path(self._cache_path).name


class _Sealed(CompileResultCacheImpl):
    """What is written of a compiled form, with a hash of it, of the Numba and of the processor that it is for.

    Numba numbers its files of forms, and two processes that keep forms at once may give one number to two.
    """

    def reduce(self, cres: Any) -> tuple[bytes, bytes]:
        """The hash and the form."""
        form = dumps(super().reduce(cres))
        return _seal(form, cres.library.codegen), form

    def rebuild(self, target_context: Any, payload: tuple[bytes, bytes]) -> Any:
        """The form as it was; raises ValueError for a damaged one, and another Numba's or processor's."""
        seal, form = payload
        if seal != _seal(form, target_context.codegen()):
            raise ValueError("not the form that was kept")
        return super().rebuild(target_context, pickle.loads(form))


def _seal(form: bytes, codegen: Any) -> bytes:
    return hashlib.sha1(repr((numba.__version__, codegen.magic_tuple())).encode() + form).digest()


class KeptKernels(FunctionCache):
    """Compiled forms of one kernel on disk, loaded without making Numba ready to compile others.

    Numba first imports and registers all that its compiler knows, SciPy's linear algebra among it: 0.35 s of a process.
    Code that is compiled already needs only what counts references to its arrays; where a form is missing, Numba's
    compiler makes itself ready. So it does where a form cannot be read, or where Numba's own ways have changed.
    """

    _impl_class = _Sealed

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """The form for a signature; None where none is kept, or not a sound one."""
        for load in (self._at_once, super().load_overload):
            # A damaged pickle may raise anything.
            with suppress(Exception):
                found = load(sig, target_context)
                # Numba calls what it is given without another look at its arguments.
                right = found is None or tuple(found.signature.args) == tuple(getattr(sig, "args", sig))
                return found if right else None
        return None

    def _at_once(self, sig: Any, target_context: Any) -> Any:
        from numba.core.runtime.nrt import rtsys

        rtsys.initialize(target_context)
        return self._load_overload(sig, target_context)

    def save_overload(self, sig: Any, data: Any) -> None:
        """Keep a form, if the disk allows: it is in memory whether it is kept or not."""
        with suppress(OSError):
            try:
                super().save_overload(sig, data)
            except OSError:
                raise
            except Exception:  # a damaged index
                self.flush()
                super().save_overload(sig, data)


def _compiled(fast: set[str] | bool) -> Callable[[Callable[..., Any]], Any]:
    """Compiled on first use, kept on disk, without the interpreter's lock, division by zero as in NumPy."""

    def decorate(function: Callable[..., Any]) -> Any:
        with _CHOOSING:
            before = _CONFIG.CACHE_LOCATOR_CLASSES
            _CONFIG.CACHE_LOCATOR_CLASSES = before or f"{__name__}.{KeptWithSource.__name__},UserWideCacheLocator"
            try:
                kept: Any = numba.njit(cache=True, nogil=True, fastmath=fast, error_model="numpy")(function)
                # Where Numba keeps kernels in another way, or compiles none, that stays.
                if isinstance(getattr(kept, "_cache", None), FunctionCache):
                    kept._cache = KeptKernels(function)
                return kept
            finally:
                _CONFIG.CACHE_LOCATOR_CLASSES = before

    return decorate


kernel = _compiled(_FLAGS)
inlined = numba.njit(nogil=True, fastmath=_FLAGS, error_model="numpy", inline="always")

# A partition must repeat the rounding of its bins, and two triangles that share an edge must agree on which side of it
# a ray passes: reordered sums and fused products break both. `fastmath` has to be named, or a function would take its
# caller's; one compiled into its caller always does.
exact_kernel = _compiled(False)
exact_inlined = numba.njit(nogil=True, fastmath=False, error_model="numpy", inline="always")

# Where no array is passed, LLVM does as well with a call, and types are inferred once instead of at every place.
exact_small = numba.njit(nogil=True, fastmath=False, error_model="numpy")
