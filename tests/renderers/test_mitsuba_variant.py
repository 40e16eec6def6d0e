"""Which Mitsuba runs: machines of every kind are simulated, and no libLLVM on them may bring the process down."""

import os
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest

from relume.renderers.mitsuba import path_tracer
from relume.renderers.mitsuba import variant as mitsuba_variant
from relume.renderers.mitsuba.variant import _choice, _libraries, choose_variant, llvm_version

USUAL = Path("/usr/lib/x86_64-linux-gnu")


def library(folder, name):
    """A file that only bears the name of a libLLVM."""
    path = folder / name
    path.write_bytes(b"")
    return str(path)


@pytest.fixture
def machine(tmp_path, monkeypatch):
    """A machine whose only libraries are those that a test puts into its folder."""
    monkeypatch.setattr(mitsuba_variant, "FOLDERS", (str(tmp_path),))
    monkeypatch.setattr(mitsuba_variant, "_cuda_answers", lambda: False)
    monkeypatch.setattr(mitsuba_variant, "_loads", lambda path: True, raising=False)
    monkeypatch.setattr(sys, "platform", "linux")
    monkeypatch.delenv("DRJIT_LIBLLVM_PATH", raising=False)
    return tmp_path


def test_a_gpu_is_taken_whatever_llvm_there_is():
    assert _choice(True, []).name == "cuda_ad_rgb"
    assert _choice(True, ["/usr/lib/libLLVM-14.so.1"]) == _choice(True, ["/usr/lib/libLLVM-19.so.1"])
    assert _choice(True, []).library is None


@pytest.mark.parametrize("old", [14, 15, None])
def test_no_llvm_or_an_old_one_alone_means_scalar_and_says_how_to_get_the_faster_one(machine, old):
    if old:
        library(machine, f"libLLVM-{old}.so.1")
    choice = choose_variant()
    assert (choice.name, choice.library) == ("scalar_rgb", None)
    assert (f"libLLVM {old} is too old" if old else "no libLLVM was found") in choice.reason
    assert "install version 16 or newer" in choice.reason


@pytest.mark.parametrize("new", [16, 19])
def test_a_new_llvm_is_taken_though_an_old_one_is_there(machine, new):
    library(machine, "libLLVM-14.so.1")
    path = library(machine, f"libLLVM-{new}.so.1")
    assert choose_variant() == _choice(False, [path])
    assert (choose_variant().name, choose_variant().library) == ("llvm_ad_rgb", path)


def test_the_newest_of_several_is_taken_by_number_not_by_spelling():
    paths = ["/usr/lib/libLLVM-9.so.1", "/usr/lib/libLLVM-18.so.1", "/usr/lib/libLLVM.so.20.1"]
    assert _choice(False, paths).library == "/usr/lib/libLLVM.so.20.1"


def test_a_library_that_the_user_names_goes_before_newer_ones(machine, tmp_path_factory):
    library(machine, "libLLVM-19.so.1")
    named = library(tmp_path_factory.mktemp("named"), "libLLVM-17.so.1")
    assert _libraries({"DRJIT_LIBLLVM_PATH": named}) == [named]


@pytest.mark.parametrize("named", ["/nowhere/libLLVM-19.so.1", "", "too old"])
def test_a_library_that_the_user_names_but_that_is_too_old_or_not_there_is_passed_over(
    machine, tmp_path_factory, named
):
    new = library(machine, "libLLVM-19.so.1")
    if named == "too old":
        named = library(tmp_path_factory.mktemp("named"), "libLLVM-15.so.1")
    assert _libraries({"DRJIT_LIBLLVM_PATH": named}) == [new]


@pytest.mark.parametrize(
    ("path", "version"),
    [
        ("/usr/lib/x86_64-linux-gnu/libLLVM-14.so.1", 14),
        ("/usr/lib/x86_64-linux-gnu/libLLVM-14.0.6.so.1", 14),
        ("/usr/lib/x86_64-linux-gnu/libLLVM.so.19.1", 19),
        ("/usr/lib64/libLLVM.so.20.1", 20),
        ("/usr/lib/llvm-18/lib/libLLVM.so", 18),
        ("/opt/homebrew/opt/llvm@17/lib/libLLVM.dylib", 17),
        ("/opt/homebrew/Cellar/llvm/19.1.3/lib/libLLVM.dylib", 19),
        ("/usr/lib/libLLVM.so", None),
    ],
)
def test_the_version_is_read_from_the_name_or_the_folder(path, version):
    assert llvm_version(path) == version


def test_a_link_without_a_number_has_the_version_of_what_it_leads_to(tmp_path):
    library(tmp_path, "libLLVM-15.so.1")
    (tmp_path / "libLLVM.so").symlink_to("libLLVM-15.so.1")
    assert llvm_version(str(tmp_path / "libLLVM.so")) == 15


def test_the_library_of_windows_has_no_number_in_its_name_and_is_asked(machine, monkeypatch):
    class Library:
        def __init__(self, path):
            self.version = int(Path(path).read_text())

        def LLVMGetVersion(self, major, minor, patch):
            major._obj.value = self.version

    monkeypatch.setattr(sys, "platform", "win32")
    monkeypatch.setattr(mitsuba_variant.ctypes, "CDLL", Library)
    path = machine / "LLVM-C.dll"
    path.write_text("18")
    assert llvm_version(str(path)) == 18
    assert (choose_variant().name, choose_variant().library) == ("llvm_ad_rgb", str(path))
    monkeypatch.delattr(Library, "LLVMGetVersion")  # as before 16
    assert choose_variant().name == "scalar_rgb"
    (machine / "libLLVM.so").write_text("18")
    assert llvm_version(str(machine / "libLLVM.so")) is None, "no other library is loaded to learn what it is"


RENDERING = """
import sys
import numpy as np
from relume.renderers.mitsuba import variant
variant.FOLDERS = (sys.argv[1],)
variant._cuda_answers = lambda: False
import relume as rl
ball = rl.Mesh(np.eye(3, dtype=np.float32), np.array([[0, 1, 2]], np.int32), rl.Diffuse((0.5, 0.5, 0.5)))
scene = rl.Scene(rl.EnvironmentMap(np.ones((4, 8, 3), np.float32)), (rl.Plane(rl.Diffuse((0.5, 0.5, 0.5))),), (ball,))
camera = rl.Camera.looking_at([0, 2, 5], [0, 0, 0], width=8, height=8, focal_length=9)
picture = rl.render(scene, camera, rl.Mitsuba(samples=4))
assert np.isfinite(picture.radiance).all() and picture.radiance.min() > 0.05
import mitsuba
print(mitsuba.variant())
"""


@pytest.mark.skipif(sys.platform != "linux", reason="the folders and names are those of Linux")
# slow: of the others, tests above show that they are passed over and what is chosen then.
@pytest.mark.parametrize(
    ("version", "by"),
    [
        (15, "folder"),
        pytest.param(19, "environment", marks=pytest.mark.slow),
        pytest.param(14, "folder", marks=pytest.mark.slow),
        pytest.param(14, "environment", marks=pytest.mark.slow),
        pytest.param(15, "environment", marks=pytest.mark.slow),
        pytest.param(19, "folder", marks=pytest.mark.slow),
    ],
)
def test_with_only_an_unusable_llvm_a_render_completes_by_the_scalar_variant(tmp_path, version, by):
    # The machine's own library where it has one, because a real 15 aborts the process where an empty file only fails
    # to load; version 19 is always a file that only bears the name.
    name = f"libLLVM-{version}.so.1"
    if version < 16 and (USUAL / name).exists():
        (tmp_path / name).symlink_to(USUAL / name)
    else:
        (tmp_path / name).write_bytes(b"not a library")
    environment = {k: v for k, v in os.environ.items() if k != "DRJIT_LIBLLVM_PATH"}
    if by == "environment":
        environment["DRJIT_LIBLLVM_PATH"] = str(tmp_path / name)
    finished = subprocess.run(
        [sys.executable, "-W", "error", "-c", RENDERING, str(tmp_path)],
        env=environment, capture_output=True, text=True, timeout=120, check=False,
    )  # fmt: skip
    assert finished.returncode == 0, finished.stderr
    assert finished.stdout.strip() == "scalar_rgb"


@pytest.mark.parametrize(("before", "after"), [(None, "llvm_ad_rgb"), ("cuda_ad_rgb", "cuda_ad_rgb")])
def test_a_render_leaves_the_variant_that_was_set_or_the_usual_one(monkeypatch, before, after):
    now = [before]
    mi = SimpleNamespace(variant=lambda: now[-1], set_variant=now.append)
    dr = SimpleNamespace(thread_count=lambda: 2, set_thread_count=lambda count: None)
    monkeypatch.setattr(path_tracer, "_imported", lambda variant: (mi, dr, variant or "llvm_ad_rgb"))
    with path_tracer._mitsuba("scalar_rgb", 1):
        assert now[-1] == "scalar_rgb"
    assert now[-1] == after
