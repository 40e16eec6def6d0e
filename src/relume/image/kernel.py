"""How every Numba kernel here is compiled, and how kernels share the cores.

A kernel is a private loop beside the friendly function that validates and allocates. Each module of kernels has a
proof: a test that reaches it and holds it against a slow twin, a closed form or an identity, as the table in
`tests/architecture/kernels.py` says. Tuples of arrays are unpacked before the loop: inside it every access would count
references. Import this module only where a kernel is used: it imports Numba.
"""

from __future__ import annotations

import hashlib
import os
import re
import tempfile
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import lru_cache
from pathlib import Path
from typing import Any

import numba

# Sums may be reordered and products fused, but nothing may assume that there is no NaN or infinity: a NaN has to
# arrive where it can be seen, and a ray that misses is at infinity.
_FLAGS = {"nsz", "arcp", "contract", "afn", "reassoc"}


@lru_cache
def cache_folder(module: str) -> str:
    """Where a module's compiled kernels are kept: a folder for this very source.

    Numba alone looks at the file that holds a kernel, not at those whose functions and numbers are compiled into it:
    these are all that it imports.
    """
    package = Path(__file__).parents[1]
    own = package / (module.removeprefix("relume.").replace(".", "/") + ".py")
    waiting, sources = [own], {Path(__file__): Path(__file__).read_bytes()}
    while waiting:
        path = waiting.pop()
        if path in sources or not path.is_file():
            continue
        sources[path] = path.read_bytes()
        names = re.findall(rb"^from relume\.([\w.]+) import", sources[path], re.MULTILINE)
        waiting += [package / (name.decode().replace(".", "/") + ".py") for name in names]
    digest = hashlib.sha1()
    for path in sorted(sources):
        digest.update(sources[path])
    name = f"kernels-{own.stem}-{digest.hexdigest()[:12]}"
    # An installation may be write-protected, and so may the home of a user on a render node.
    for place in (package / "__pycache__", Path.home() / ".cache" / "relume"):
        try:
            place.mkdir(parents=True, exist_ok=True)
        except OSError:
            continue
        if os.access(place, os.W_OK):
            return str(place / name)
    return str(Path(tempfile.gettempdir()) / f"relume-{os.getuid() if hasattr(os, 'getuid') else ''}" / name)


def _compiled(fast: set[str] | bool) -> Callable[[Callable[..., Any]], Any]:
    """Compiled on first use, kept on disk, without the interpreter's lock, division by zero as in NumPy."""

    def decorate(function: Callable[..., Any]) -> Any:
        config: Any = numba.config  # pyright: ignore[reportPrivateImportUsage]
        before = config.CACHE_DIR
        config.CACHE_DIR = before or cache_folder(function.__module__)
        try:
            return numba.njit(cache=True, nogil=True, fastmath=fast, error_model="numpy")(function)
        finally:
            config.CACHE_DIR = before

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


def in_threads(work: Callable[[int, int], Any], count: int, threads: int | None = None, *, chunk: int = 65536) -> list:
    """Call `work(begin, end)` for chunks of 0…count on every core; the results, in the chunks' order.

    The chunks do not depend on the number of threads, so neither do sums over their results.
    """
    begins = range(0, count, chunk)
    workers = min(threads or os.cpu_count() or 1, len(begins))
    if workers <= 1:
        return [work(begin, min(begin + chunk, count)) for begin in begins]
    with ThreadPoolExecutor(workers) as pool:
        return list(pool.map(lambda begin: work(begin, min(begin + chunk, count)), begins))
