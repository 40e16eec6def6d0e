"""A USD file opened by OpenUSD (the extra `usd`): what it would print gathered, what it raises said in one line."""

from __future__ import annotations

import textwrap
from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module
from pathlib import Path
from typing import Any

from relume.errors import UnreadableFile, warn

SUFFIXES = (".usd", ".usda", ".usdc", ".usdz")


@contextmanager
def stage_of(path: Path, *names: str) -> Iterator[tuple[Any, ...]]:
    """The stage in a file, followed by the modules of `pxr` that are named.

    What OpenUSD remarks while the stage is used becomes one warning at the end. Raises UnreadableFile where the file is
    missing or damaged, or OpenUSD is not installed.
    """
    try:
        path.open("rb").close()
    except OSError as error:
        raise UnreadableFile(f"{path}: cannot be read ({error.strerror or error}); check the path") from None
    try:
        # Its stubs lack most names.
        tf, usd, utilities = (import_module(f"pxr.{name}") for name in ("Tf", "Usd", "UsdUtils"))
        modules = [import_module(f"pxr.{name}") for name in names]
    except ImportError:
        raise UnreadableFile(f"{path}: USD files need OpenUSD; install it with: pip install 'relume[usd]'") from None
    # While it lives, OpenUSD hands it what it would print on standard error.
    diagnostics = utilities.CoalescingDiagnosticDelegate()
    try:
        yield usd.Stage.Open(str(path)), *modules
        faults = [textwrap.shorten(str(each.commentary), 160) for each in diagnostics.TakeUncoalescedDiagnostics()]
    except tf.ErrorException as error:
        reason = textwrap.shorten(str(error.args[0].commentary), 160)
        raise UnreadableFile(f"{path}: not a readable USD file ({reason}); export it again") from None
    if faults:
        warn(f"{path}: {faults[0]}" + (f" (and {len(faults) - 1} more)" if faults[1:] else ""))
