"""What a result depends on, as hashes: values, files and the program, so that kept work is used for nothing else."""

from __future__ import annotations

import hashlib
import json
from dataclasses import fields, is_dataclass, replace
from enum import Enum
from functools import lru_cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import numpy as np

from relume.renderers.mitsuba.variant import choose_variant
from relume.scene.cameras.camera import Camera
from relume.scene.scene import Scene

LIBRARIES = (
    "numpy", "scipy", "mitsuba", "drjit", "mitsuba-oidn", "opencv-python-headless", "trimesh", "imagecodecs", "rawpy",
)  # fmt: skip
"""Those whose numbers relume passes on."""


def fingerprint(value: object) -> str:
    """A SHA-256 of values; a Path counts as the bytes it holds, an array as its own, a dataclass as its fields,
    one of an enumeration as its name."""
    return hashlib.sha256(json.dumps(value, default=_content, sort_keys=True).encode()).hexdigest()


@lru_cache
def program() -> dict[str, str]:
    """What computes: every module of relume as it is now, Mitsuba's variant, and the libraries' versions."""
    package = Path(__file__).parents[2]
    modules = [path.read_bytes() for path in sorted(package.rglob("*.py"))]
    parts = {"relume": hashlib.sha256(b"".join(modules)).hexdigest(), "variant": choose_variant().name}
    return parts | {name: _version(name) for name in LIBRARIES}


def render_key(scene: Scene | str, camera: Camera, settings: object, seed: int) -> dict[str, str]:
    """What the pixels of a render depend on, part by part, so that a difference can be named.

    scene : itself or its fingerprint
    settings : the renderer, a frozen dataclass; its `threads` count for nothing
    """
    assert is_dataclass(settings)
    chosen = {f.name: str(getattr(settings, f.name)) for f in fields(settings) if f.name != "threads"}
    parts = {"scene": fingerprint(scene), "camera": fingerprint(camera), "renderer": type(settings).__name__}
    variant = getattr(settings, "variant", None)
    return parts | chosen | {"seed": str(seed)} | program() | ({"variant": variant} if variant else {})


def without_threads(renderer: Any) -> Any:
    """The same settings whatever `threads` is, as its pixels are the same; for a key. None stays None."""
    threaded = is_dataclass(renderer) and any(field.name == "threads" for field in fields(renderer))
    return replace(renderer, threads=None) if threaded and not isinstance(renderer, type) else renderer


def _version(name: str) -> str:
    try:
        return version(name)
    except PackageNotFoundError:  # a build of one's own has no entry
        return "unknown"


def _content(value: object) -> Any:
    if isinstance(value, Path):
        return hashlib.sha256(value.read_bytes()).hexdigest()
    if isinstance(value, np.ndarray):
        values = np.ascontiguousarray(value).reshape(-1).view(np.uint8)
        return [str(value.dtype), value.shape, hashlib.sha256(values.data).hexdigest()]
    if is_dataclass(value):
        return [type(value).__name__, {field.name: getattr(value, field.name) for field in fields(value)}]
    if isinstance(value, Enum):
        return [type(value).__name__, value.name]
    raise TypeError(f"{type(value).__name__} cannot be part of a fingerprint")
