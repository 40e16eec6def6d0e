"""Which relume and which Python this process runs, so that machines can be asked whether they run the same."""

from __future__ import annotations

import hashlib
import sys
from functools import lru_cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path


@lru_cache
def program() -> str:
    """The versions of relume and Python, and a hash of relume's source: one number may be of many a source."""
    try:
        number = version("relume")
    except PackageNotFoundError:
        number = "of no version"
    digest = hashlib.sha256()
    for path in sorted(Path(__file__).parents[1].rglob("*.py")):
        digest.update(path.read_bytes())
    return f"relume {number} ({digest.hexdigest()[:8]}) on Python {sys.version_info[0]}.{sys.version_info[1]}"
