"""Arrays whose pages come from a file: the same numbers, in memory only while they are read."""

from __future__ import annotations

import zipfile
from pathlib import Path

import numpy as np
import pytest

from relume.errors import OutputNotWritten
from relume.image import mapped_arrays
from relume.image.mapped_arrays import MAPS, Mapped, _trimming, give_back_freed, give_back_read

GENERATOR = np.random.default_rng(3)
ARRAYS = {
    "key": np.array("this"),
    "plane": GENERATOR.random((97, 101, 3)).astype(np.float32),
    "columns": np.asfortranarray(GENERATOR.random((64, 50))),
    "marks": GENERATOR.integers(0, 3, (97, 101)).astype(np.uint8),
    "nothing": np.zeros((0, 3)),
    "whole": np.array(7.5),
}


@pytest.fixture(autouse=True)
def small(monkeypatch: pytest.MonkeyPatch) -> None:
    """Arrays from 5 kB on are large."""
    monkeypatch.setattr(mapped_arrays, "LARGE", 5_000)


def written(path: Path) -> Path:
    with open(path, "wb") as file:
        Mapped().write(file, ARRAYS)
    return path


def test_arrays_come_back_to_the_bit_and_stay_so_when_their_memory_is_given_back(tmp_path):
    mapped = Mapped()
    back = mapped.read(written(tmp_path / "a.npz"), "this")
    assert list(back) == list(ARRAYS)
    for _ in range(2):
        for name, array in ARRAYS.items():
            assert back[name].dtype == array.dtype and np.array_equal(back[name], array), name
        mapped.release()
    # Kernels and libraries take them as any array: plain, and beginning where theirs do.
    assert all(type(array) is np.ndarray for array in back.values())
    assert all(back[name].ctypes.data % 64 == 0 for name in ("plane", "columns", "marks"))
    assert back["columns"].flags.f_contiguous
    # NumPy reads the file too.
    with np.load(tmp_path / "a.npz") as file:
        assert np.array_equal(file["plane"], ARRAYS["plane"])


@pytest.mark.skipif(not MAPS, reason="files are not mapped here")
def test_large_arrays_take_memory_only_where_they_were_read(tmp_path):
    with open(tmp_path / "a.npz", "wb") as file:
        Mapped().write(file, {"plane": np.ones(2**22, np.float32)})
    mapped = Mapped()
    plane = mapped.read(tmp_path / "a.npz")["plane"]
    assert plane.sum(dtype=np.float64) == 2**22
    before = resident()
    mapped.release()
    assert before - resident() > 0.9 * plane.nbytes
    # A map that nobody holds any more is forgotten.
    del plane
    mapped.zeros(tmp_path, [(4,)])
    assert len(mapped.maps) == 1


def resident() -> int:
    """Bytes of this process that are in memory."""
    try:
        pages = int(Path("/proc/self/statm").read_text().split()[1])
    except OSError:
        pytest.skip("this system does not say how much memory a process has")
    import resource

    return pages * resource.getpagesize()


def test_writing_to_what_was_read_changes_no_file(tmp_path):
    path = written(tmp_path / "a.npz")
    before = path.read_bytes()
    Mapped().read(path)["plane"][:] = 0
    assert path.read_bytes() == before


def test_another_key_and_damaged_files_are_refused(tmp_path):
    path = written(tmp_path / "a.npz")
    with pytest.raises(KeyError, match="that"):
        Mapped().read(path, "that")
    whole = path.read_bytes()
    for damaged in (whole[:100], whole[:2000] + bytes([whole[2000] ^ 1]) + whole[2001:]):
        path.write_bytes(damaged)
        with pytest.raises((zipfile.BadZipFile, OSError, ValueError, EOFError)):
            Mapped().read(path, "this")


def test_planes_of_zeros_lie_in_a_file_without_a_name(tmp_path):
    mapped = Mapped()
    first, second = mapped.zeros(tmp_path, [(40, 50, 3), (7,)])
    assert first.dtype == np.float32 and not first.any() and second.shape == (7,)
    first[3:5] = 2.5
    second[6] = 1
    mapped.release()
    assert first[3:5].min() == 2.5 and not first[5:].any() and not first[:3].any() and second.tolist() == [0] * 6 + [1]
    assert not list(tmp_path.iterdir())
    with pytest.raises(OutputNotWritten, match="cannot be written"):
        mapped.zeros(tmp_path / "missing", [(4,)])


@pytest.mark.skipif(_trimming() is None, reason="this C library gives back what is freed by itself, or never")
def test_freed_memory_goes_back_to_the_system():
    pieces = [np.ones(10_000) for _ in range(2000)]
    last = np.ones(10_000)  # above them, so that the heap does not shrink by itself
    del pieces
    before = resident()
    give_back_freed()
    assert before - resident() > 100e6
    assert last.sum() == 10_000


@pytest.mark.skipif(not MAPS, reason="files are not mapped here")
def test_what_is_put_away_takes_no_memory_and_keeps_every_bit(tmp_path):
    mapped = Mapped()
    small = np.ones(10)
    assert mapped.put_away(tmp_path, small) is small
    plane = np.random.default_rng(0).random((1500, 1000, 3), np.float32)
    begun = resident()
    away = mapped.put_away(tmp_path, plane)
    assert resident() - begun < 0.2 * plane.nbytes
    np.testing.assert_array_equal(away, plane)
    mapped.release()
    np.testing.assert_array_equal(away, plane)
    assert not list(tmp_path.iterdir())


@pytest.mark.skipif(not MAPS, reason="files are not mapped here")
def test_planes_of_nameless_files_are_given_back_and_what_was_written_stays(tmp_path):
    mapped = Mapped()
    plane = mapped.put_away(tmp_path, np.ones((1500, 1000, 3), np.float32))
    read = mapped.read(written(tmp_path / "a.npz"))["plane"]
    own = np.ones(3)
    plane[700], read[0], own[0] = 7, 8, 9
    assert plane.sum(dtype=np.float64) == plane.size + 6 * 3000
    begun = resident()
    # Of a part of it, too; a named file's would lose what was written to it, and what is in memory cannot go.
    give_back_read(plane[3:, ::2].T, read, own)
    assert begun - resident() > 0.9 * plane.nbytes
    assert np.all(plane[700] == 7) and np.all(plane[699] == 1) and np.all(read[0] == 8) and own[0] == 9


@pytest.mark.skipif(not MAPS, reason="files are not mapped here")
def test_what_is_put_away_is_written_in_pieces(tmp_path, monkeypatch):
    mapped, seen = Mapped(), []
    monkeypatch.setattr(Mapped, "release", lambda self: seen.append(1))
    plane = np.random.default_rng(0).random((500, 10), np.float32)
    np.testing.assert_array_equal(mapped.put_away(tmp_path, plane), plane)
    assert len(seen) == 4  # 20 kB in pieces of 5
