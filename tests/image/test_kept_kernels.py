"""Where compiled kernels are kept: those of a wheel are used as they are, and what they lack is compiled and kept."""

from __future__ import annotations

import json
import os
import pickle
import shutil
import subprocess
import sys
import tempfile
import zipfile
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

import relume
from relume.image.kernel import _own_temporary as _kept_temporary
from relume.image.kernel import is_common

ROOT = Path(__file__).parents[2]
MODULE = "virtual_camera/tone/luminance_kernels.py"
CALL = f"""
import json, sys
import numpy as np
from relume.{MODULE[:-3].replace("/", ".")} import channel_sums
pixels = np.arange(12, dtype=sys.argv[1]).reshape(4, 3)
sums = channel_sums(pixels, np.array([0.25, 0.5, 0.25], np.float32), 1, 4)
hits, misses = (sum(counts.values()) for counts in (channel_sums.stats.cache_hits, channel_sums.stats.cache_misses))
print(json.dumps([sums, hits, misses, channel_sums.stats.cache_path]))
"""
# Rows 1 to 3 of 0…11 by columns; the last row's weighted mean is its middle.
SUMS = [3 + 6 + 9, 4 + 7 + 10, 5 + 8 + 11, 10]


# Numba is imported once, which takes half a second; each call is a process of its own, with variables of its own.
SERVER = """
import json, os, sys
import numba, numpy
from numba.core import config
for line in sys.stdin:
    call, site, numbers, variables = json.loads(line)
    child = os.fork()
    if child == 0:
        os.environ.clear()
        os.environ.update(variables)
        config.reload_config()
        sys.dont_write_bytecode = "PYTHONDONTWRITEBYTECODE" in variables
        sys.path.insert(0, site)
        sys.argv = ["-c", numbers]
        try:
            exec(call, {"__name__": "__main__"})
            sys.stdout.flush()
        except BaseException:
            import traceback
            traceback.print_exc()
            os._exit(1)
        os._exit(0)
    if os.waitpid(child, 0)[1] != 0:
        print("null", flush=True)
"""
Called = Callable[..., tuple[int, int, str]]


@pytest.fixture(scope="module")
def called() -> Iterator[Called]:
    """How often a process found a kernel that was kept, and did not, and where it looked; its sums are right."""
    usual = {name: value for name, value in os.environ.items() if not name.startswith("NUMBA_")}
    usual.pop("PYTHONPATH", None)
    python = [sys.executable, "-c", SERVER]
    with subprocess.Popen(python, env=usual, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as server:
        questions, answers = server.stdin, server.stdout
        assert questions is not None and answers is not None

        def call(
            site: Path, home: Path, numbers: str = "float32", before: str = "", **variables: str
        ) -> tuple[int, int, str]:
            chosen = {**usual, "HOME": str(home), **variables}
            print(json.dumps([before + CALL, str(site), numbers, chosen]), file=questions, flush=True)
            return _counts(answers.readline())

        yield call


def called_anew(site: Path, home: Path, after: str = "") -> tuple[int, int, str]:
    """The same of a process that has imported nothing yet, and goes on with `after`."""
    chosen = {name: value for name, value in os.environ.items() if not name.startswith("NUMBA_")}
    chosen |= {"PYTHONPATH": str(site), "HOME": str(home)}
    run = [sys.executable, "-c", CALL + after, "float32"]
    return _counts(subprocess.run(run, env=chosen, stdout=subprocess.PIPE, text=True, check=True).stdout)


def _counts(said: str) -> tuple[int, int, str]:
    sums, hits, misses, folder = json.loads(said)
    assert sums == SUMS
    return hits, misses, folder


def times_in(folder: Path) -> dict[Path, int]:
    """Every file of kernels and when it was written."""
    return {path: path.stat().st_mtime_ns for path in folder.rglob("*.nb?")}


@pytest.fixture(scope="module")
def brought(called, tmp_path_factory):
    """The package as a wheel brings it, with one kernel for one kind of arrays."""
    site = tmp_path_factory.mktemp("built")
    shutil.copytree(Path(relume.__file__).parent, site / "relume", ignore=shutil.ignore_patterns("__pycache__"))
    called(site, site, NUMBA_CACHE_DIR=str(site / "relume" / "kernels"), PYTHONDONTWRITEBYTECODE="1")
    return site


@pytest.fixture
def site(brought, tmp_path):
    """It, unpacked somewhere else and at another time."""
    shutil.copytree(brought, tmp_path / "site", copy_function=shutil.copyfile)
    return tmp_path / "site"


def test_kernels_that_a_package_brings_are_used_wherever_and_whenever_it_was_unpacked(site, tmp_path):
    before = times_in(site)
    hits, misses, folder = called_anew(site, tmp_path / "home")
    assert (hits, misses) == (1, 0)
    assert Path(folder).parent == site / "relume" / "kernels"
    assert before and times_in(site) == before
    assert not (tmp_path / "home").exists()


def test_a_kept_kernel_does_not_make_the_compiler_ready(site, tmp_path):
    """Which imports SciPy's linear algebra, and takes longer than all else that a short command does."""
    asked = "assert not {'scipy.linalg', 'numba.np.arraymath'} & set(sys.modules)"
    assert called_anew(site, tmp_path / "home", asked)[:2] == (1, 0)


def test_a_processor_that_they_are_not_for_compiles_its_own_and_keeps_them(called, site, tmp_path):
    for kept in (0, 1):
        assert called(site, tmp_path, NUMBA_CPU_NAME="generic")[:2] == (kept, 1 - kept)
    assert called(site, tmp_path)[:2] == (1, 0)  # and the package's are still there


def test_another_version_of_numba_compiles_its_own_and_keeps_them(called, site, tmp_path):
    (index,) = (site / "relume" / "kernels").rglob("*.nbi")
    whole = index.read_bytes()
    own = pickle.loads(whole)
    index.write_bytes(whole.replace(own.encode(), ("9" * len(own)).encode(), 1))
    for kept in (0, 1):
        assert called(site, tmp_path)[:2] == (kept, 1 - kept)


def test_kernels_of_another_source_are_not_used(called, site, tmp_path):
    """Not only of another file: of anything that the kernel's file imports."""
    with (site / "relume" / "image" / "kernel.py").open("a") as file:
        file.write("# changed\n")
    before = times_in(site / "relume" / "kernels")
    for kept in (0, 1):
        hits, misses, folder = called(site, tmp_path)
        assert (hits, misses) == (kept, 1 - kept)
        assert Path(folder).parent == site / "relume" / "__pycache__"
    assert times_in(site / "relume" / "kernels") == before


def test_what_a_process_compiles_of_an_older_source_is_not_kept_for_the_newer_one(called, site, tmp_path):
    """As in a server that runs while another version is put in its place: what it has imported is the old one."""
    changed = "import relume.image.kernel\nopen(relume.image.kernel.__file__, 'a').write('# changed')\n"
    assert called(site, tmp_path, before=changed)[:2] == (1, 0)
    for kept in (0, 1):
        assert called(site, tmp_path)[:2] == (kept, 1 - kept)


def test_in_a_write_protected_package_they_are_used_and_others_are_kept_with_the_user(called, site, tmp_path):
    folders, home = [site, *(path for path in site.rglob("*") if path.is_dir())], tmp_path / "home"
    for each in folders:
        each.chmod(0o555)
    # Root may write anywhere, and finds out here that it should not.
    root = f"import os; may = os.access; os.access = lambda at, how: {str(site)!r} not in str(at) and may(at, how)\n"
    before = times_in(site)
    try:
        for numbers, kept in (("float32", 1), ("float64", 0), ("float64", 1), ("float32", 1)):
            hits, misses, folder = called(site, home, numbers, root, PYTHONDONTWRITEBYTECODE="1")
            assert (hits, misses) == (kept, 1 - kept)
            assert Path(folder).parent == home / ".cache" / "relume"
    finally:
        for each in folders:
            each.chmod(0o755)
    assert times_in(site) == before
    assert Path(folder).stat().st_mode & 0o200
    assert list(Path(folder).parent.iterdir()) == [Path(folder)]  # nothing half-copied is left


def kept_files(site: Path, end: str) -> list[Path]:
    return sorted((site / "relume" / "kernels").rglob(f"*{end}"))


@pytest.mark.parametrize("damage", ["empty", "half", "zeros behind"])
@pytest.mark.parametrize("end", [".nbi", ".nbc"])
def test_a_damaged_file_is_made_anew(called, site, tmp_path, end, damage):
    """As a power cut leaves it, or a full disk; it would stop every further command."""
    (file,) = kept_files(site, end)
    whole = file.read_bytes()
    half = len(whole) // 2
    file.write_bytes({"empty": b"", "half": whole[:half], "zeros behind": whole[:half] + bytes(half)}[damage])
    for kept in (0, 1):
        assert called(site, tmp_path)[:2] == (kept, 1 - kept)


@pytest.mark.parametrize("other", [{"numbers": "int32"}, {"NUMBA_CPU_NAME": "generic"}], ids=["types", "processor"])
def test_a_form_in_the_place_of_another_is_not_called(called, site, tmp_path, other):
    """As two processes leave them that each keep a form at once: Numba gives both the same number."""
    assert called(site, tmp_path, **other)[:2] == (0, 1)
    first, second = kept_files(site, ".nbc")
    whole = first.read_bytes()
    first.write_bytes(second.read_bytes())
    second.write_bytes(whole)
    for kept in (0, 1):
        assert called(site, tmp_path)[:2] == (kept, 1 - kept)
        assert called(site, tmp_path, **other)[:2] == (kept, 1 - kept)


def test_on_a_full_disk_kernels_run_and_are_not_kept(called, site, tmp_path):
    full = (
        "import resource, signal; signal.signal(signal.SIGXFSZ, signal.SIG_IGN)\n"
        "resource.setrlimit(resource.RLIMIT_FSIZE, (1000, resource.RLIM_INFINITY))\n"
    )
    before = times_in(site)
    assert called(site, tmp_path, "float64", full, PYTHONDONTWRITEBYTECODE="1")[:2] == (0, 1)
    assert set(times_in(site)) == set(before)  # nothing half-written is left


@pytest.mark.parametrize(
    "changed",
    [
        "del nrt.rtsys",
        "Cache.other = Cache._load_overload; del Cache._load_overload\n"
        "Cache.load_overload = lambda self, sig, target: (target.refresh(), self.other(sig, target))[1]",
    ],
    ids=["runtime", "cache"],
)
def test_a_numba_of_other_ways_loads_them_as_it_does(called, site, tmp_path, changed):
    names = "from numba.core.caching import Cache; from numba.core.runtime import nrt\n"
    assert called(site, tmp_path, before=f"{names}{changed}\n")[:2] == (1, 0)


def test_they_are_copied_to_the_folder_that_the_user_chose(called, site, tmp_path):
    chosen = tmp_path / "chosen"
    hits, misses, folder = called(site, tmp_path / "home", NUMBA_CACHE_DIR=str(chosen))
    assert (hits, misses) == (1, 0)
    assert Path(folder).parent == chosen


@pytest.mark.skipif(not hasattr(os, "getuid"), reason="no owners and modes of files as POSIX has them")
def test_what_others_may_write_to_is_not_run(tmp_path, monkeypatch):
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    _own_temporary = _kept_temporary.__wrapped__  # found once a process
    usual = _own_temporary()
    assert usual == tmp_path / f"relume-{os.getuid()}" == _own_temporary() and usual.stat().st_mode & 0o777 == 0o700
    usual.chmod(0o777)
    assert _own_temporary() != usual
    usual.rmdir()
    # Another's folder behind a link.
    other = tmp_path / "other"
    other.mkdir(mode=0o700)
    usual.symlink_to(other)
    assert _own_temporary() not in (usual, other)


def test_the_common_processor_is_one_with_all_that_it_stands_for():
    """x86-64-v3 as the System V ABI's supplement lists it."""
    v3 = "cx16 sahf popcnt sse3 sse4.1 sse4.2 ssse3 avx avx2 bmi bmi2 f16c fma lzcnt movbe xsave".split()
    features = {**dict.fromkeys(v3, True), "avx512f": False}
    assert is_common(features)
    assert not is_common({**features, "fma": False})
    assert not is_common({name: True for name in v3 if name != "avx2"})
    assert not is_common({})


def test_what_a_user_sets_for_numba_stays():
    ask = "import relume.image.kernel, numba; print(numba.config.CPU_NAME, repr(numba.config.CPU_FEATURES))"
    run = [sys.executable, "-c", ask]
    seen = subprocess.run(run, env={**os.environ, "NUMBA_CPU_NAME": "nehalem"}, capture_output=True, text=True)
    assert seen.stdout.split() == ["nehalem", "None"]


def project(brought: Path, folder: Path) -> Path:
    """A copy of the project that lists a single kernel."""
    shutil.copytree(brought / "relume", folder / "src" / "relume", ignore=shutil.ignore_patterns("kernels"))
    (folder / "examples" / "room").mkdir(parents=True)
    (folder / "examples" / "room" / "shot.toml").touch()
    for name in ("pyproject.toml", "README.md", "LICENSE"):
        shutil.copy(ROOT / name, folder)
    (folder / "scripts").mkdir()
    for name in ("compile_kernels", "kernels_in_wheel.py"):
        shutil.copy(ROOT / "scripts" / name, folder / "scripts")
    name = f"relume.{MODULE[:-3].replace('/', '.')}:channel_sums"
    line = f"{name} (float32[:, ::1], float32[::1], int64, int64,)\n"
    assert line in (ROOT / "scripts" / "kernel_types.txt").read_text()
    (folder / "scripts" / "kernel_types.txt").write_text(line)
    return folder


def test_what_compiles_them_finds_its_sources_where_no_path_leads_to_them():
    """As pip leaves it where relume is installed for working on it."""
    script = ROOT / "scripts" / "compile_kernels"
    code = (
        "import runpy, sys\n"
        f"sys.path[:] = [path for path in sys.path if path != {str(ROOT / 'src')!r}]\n"
        f"runpy.run_path({str(script)!r}, run_name='read')\n"
        "import relume; print(relume.__file__)"
    )
    others = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    said = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, env=others)
    assert Path(said.stdout.strip()).is_relative_to(ROOT / "src")


def test_a_wheel_brings_kernels_and_says_so_in_its_name(brought, tmp_path):
    pytest.importorskip("hatchling", reason="hatchling builds wheels; pip install hatchling")
    source = project(brought, tmp_path / "project")
    build = [sys.executable, "-c", "from hatchling.build import build_wheel; print(build_wheel('.'))"]
    chosen = {name: value for name, value in os.environ.items() if not name.startswith(("NUMBA_", "HATCH_"))}
    names = []
    for more in ({}, {"HATCH_BUILD_NO_HOOKS": "true"}):
        done = subprocess.run(build, cwd=source, env={**chosen, **more}, capture_output=True, text=True)
        assert done.returncode == 0, done.stderr
        names.append(done.stdout.split()[-1])
    with zipfile.ZipFile(source / names[0]) as wheel, zipfile.ZipFile(source / names[1]) as pure:
        kernels = [name for name in wheel.namelist() if name.startswith("relume/kernels/")]
        assert sorted(name.rpartition(".")[2] for name in kernels) == ["nbc", "nbi"]
        assert set(wheel.namelist()) - set(pure.namelist()) == set(kernels)
        wheel.extractall(tmp_path / "site")
    python = f"cp{sys.version_info.major}{sys.version_info.minor}"
    assert f"-{python}-{python}" in names[0] and "-any" not in names[0]
    assert names[1].endswith("-py3-none-any.whl")
    assert called_anew(tmp_path / "site", tmp_path / "home")[:2] == (1, 0)
