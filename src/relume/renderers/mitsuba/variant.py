"""Which variant of Mitsuba runs here: CUDA, LLVM on the CPU, or scalar; chosen before Mitsuba is imported.

Dr.Jit takes whatever libLLVM it finds first, and with version 15 aborts the process, with 14 fails at import; so
this module finds one of version 16 or newer and says so in DRJIT_LIBLLVM_PATH, or chooses the scalar variant,
which needs none and is about three times slower.
"""

from __future__ import annotations

import ctypes
import os
import re
import sys
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

OLDEST_LLVM = 16
FOLDERS = (
    "/usr/lib/*-linux-gnu",
    "/usr/lib",
    "/usr/lib64",
    "/usr/lib/llvm-*/lib",
    "/usr/lib64/llvm*/lib*",
    "/usr/local/lib",
    "/opt/homebrew/opt/llvm*/lib",
    "/usr/local/opt/llvm*/lib",
    "/Program Files/LLVM/bin",
)


@dataclass(frozen=True)
class Variant:
    """A choice and why it was made.

    name : Mitsuba's name of the variant
    library : the libLLVM to use, None where none is needed
    reason : one line for `relume info --system`
    """

    name: str
    library: str | None
    reason: str


def choose_variant() -> Variant:
    """The fastest variant that is sure not to abort on this machine."""
    return _choice(_cuda_answers(), _unfailing())


def choose_llvm() -> Variant:
    """The LLVM variant also beside a GPU; the scalar one where no libLLVM is sure not to abort."""
    return _choice(False, _unfailing())


def why_not_here(name: str) -> str:
    """Why a variant of Mitsuba does not run on this machine, or ""."""
    if name.startswith("cuda"):
        return "" if _cuda_answers() else "no NVIDIA GPU answers"
    return choose_llvm().reason if name.startswith("llvm") and choose_llvm().library is None else ""


def _unfailing() -> Iterable[str]:
    """The libraries that are there, without new ones that do not load."""
    return (p for p in _libraries(os.environ) if (llvm_version(p) or 0) < OLDEST_LLVM or _loads(p))


def _choice(cuda: bool, libraries: Iterable[str]) -> Variant:
    if cuda:
        return Variant("cuda_ad_rgb", None, "an NVIDIA GPU answers")
    versions = [(version, path) for path in libraries if (version := llvm_version(path)) is not None]
    recent = [found for found in versions if found[0] >= OLDEST_LLVM]
    if recent:
        version, path = max(recent)
        return Variant("llvm_ad_rgb", path, f"libLLVM {version} at {path}")
    found = f"libLLVM {max(versions)[0]} is too old" if versions else "no libLLVM was found"
    return Variant(
        "scalar_rgb",
        None,
        f"{found}, so rendering is about 3 times slower; install version {OLDEST_LLVM} or newer "
        "(Debian, Ubuntu: apt-get install libllvm19; macOS: brew install llvm; Windows: winget install LLVM.LLVM)",
    )


def llvm_version(path: str) -> int | None:
    """The major version in a libLLVM's file name, following links, or what Windows' says itself; None if neither."""
    for name in (Path(path).name, Path(os.path.realpath(path)).name, str(Path(os.path.realpath(path)).parent)):
        match = re.search(r"LLVM(?:-|\.so\.|\.)(\d+)", name) or re.search(r"llvm[@/-]?(\d+)", name)
        if match:
            return int(match.group(1))
    return _said_version(path) if Path(path).name.lower() == "llvm-c.dll" else None


def _said_version(path: str) -> int | None:
    """What a library answers, for the one of Windows has no number in its name; before 16 none answers."""
    major = ctypes.c_uint(0)
    try:
        ctypes.CDLL(path).LLVMGetVersion(ctypes.byref(major), None, None)
    except (OSError, AttributeError):
        return None
    return major.value


def _libraries(environment: Mapping[str, str]) -> list[str]:
    """Every libLLVM in the usual places; one that the environment names goes alone, when it is there and new enough."""
    named = environment.get("DRJIT_LIBLLVM_PATH")
    if named and Path(named).is_file() and (llvm_version(named) or 0) >= OLDEST_LLVM:
        return [named]
    pattern = {"darwin": "libLLVM*.dylib", "win32": "LLVM-C.dll"}.get(sys.platform, "libLLVM*.so*")
    root = Path(f"{environment.get('SystemDrive', '')}/")  # of Windows, where one may be on another drive
    return sorted(str(file) for folder in FOLDERS for file in root.glob(f"{folder[1:]}/{pattern}") if file.is_file())


def _loads(path: str) -> bool:
    """Whether the library is one for this machine, whole, and everything that it needs is there."""
    try:
        ctypes.CDLL(path)
    except OSError:
        return False
    return True


def _cuda_answers() -> bool:
    """Whether the driver, its ray tracing library and at least one device are there."""
    try:
        driver = ctypes.CDLL("nvcuda.dll" if sys.platform == "win32" else "libcuda.so.1")
        if sys.platform != "win32":
            ctypes.CDLL("libnvoptix.so.1")
        count = ctypes.c_int(0)
        return driver.cuInit(0) == 0 and driver.cuDeviceGetCount(ctypes.byref(count)) == 0 and count.value > 0
    except (OSError, AttributeError):
        return False
