"""Stages in blocks: the same bytes in memory, in bands, and by two or eight workers; what fails is named."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import stage_blocks
from relume.errors import Incomplete, OutputNotWritten, UnreadableFile
from relume.image import files
from relume.image.radiance import RadianceMap
from relume.lightstage import blocks
from relume.lightstage.acquire import store_building
from relume.lightstage.acquire.import_stage import ImportSettings, import_stage
from relume.lightstage.acquire.read_stage import read_stage
from relume.lightstage.acquire.store import read_store
from relume.lightstage.acquire.store_building import build_store
from relume.lightstage.field.field import whole
from relume.lightstage.field.polarised import PolarisedPair
from relume.lightstage.relighting.relight import relight, relight_per_pixel, relight_sequence
from relume.lightstage.relighting.relight_frames import relight_frames
from relume.lightstage.relighting.relight_settings import RelightSettings, SubjectMesh
from relume.lightstage.relighting.stage_lighting import StageLighting
from relume.lightstage.surface.separation import separate
from relume.lightstage.surface.surface_files import measure_surface
from relume.lightstage.surface.surface_maps import MAPS, surface_maps
from relume.lightstage.view import view
from relume.scene.cameras.camera import Camera

pytest.importorskip("zarr", reason="the extra lightstage is not installed")
pytest.importorskip("distributed", reason="Dask distributed is not installed: pip install 'relume[cluster]'")

BAND = 24 * 40 * 3 * 144 * 2
"""Bytes of 24 of the 96 rows under 144 lights, as they are kept."""
ROWS, COLUMNS = stage_blocks.SIZE


@pytest.fixture(scope="module")
def two() -> Iterator[Any]:
    from relume.cluster import connect

    with connect("local:2") as cluster:
        yield cluster


@pytest.fixture(scope="module")
def stage(tmp_path_factory) -> Path:
    """A store of 144 lights."""
    path = tmp_path_factory.mktemp("stages") / "ball.zarr"
    build_store(stage_blocks.ball(144), path)
    return path


@pytest.fixture(scope="module")
def few(tmp_path_factory) -> Path:
    """A store of 30 lights, which needs a fit of each pixel."""
    path = tmp_path_factory.mktemp("stages") / "few.zarr"
    build_store(stage_blocks.ball(30), path)
    return path


@pytest.fixture
def banded(monkeypatch) -> None:
    """Bands of 24 rows of the stage of 144 lights."""
    monkeypatch.setattr(blocks, "BAND", BAND)


def planes(picture: RadianceMap) -> list[np.ndarray]:
    assert picture.variance is not None
    return [picture.radiance, picture.variance]


TURNED = StageLighting((stage_blocks.light(),)).turntable(5)
LABELS = np.random.default_rng(4).integers(0, 2, (ROWS, COLUMNS))
PAIR = [StageLighting((stage_blocks.light(seed),)) for seed in (1, 2)]
JOBS: dict[str, Callable[..., list[np.ndarray]]] = {
    "a picture": lambda path, **given: planes(relight(path, stage_blocks.light(), **given)),
    "a sequence": lambda path, **given: [p for each in relight_sequence(path, TURNED, **given) for p in planes(each)],
    "the nearest lights": lambda path, **given: planes(
        relight(path, stage_blocks.light(), settings=RelightSettings(nearest=True), **given)
    ),
    "a light for each pixel": lambda path, **given: planes(relight_per_pixel(path, LABELS, PAIR, **given)),
}


# slow: "a sequence" under few lights and "a picture" under many go red for the same break.
@pytest.mark.parametrize(
    ("lights", "name"),
    [
        pytest.param(lights, name, marks=pytest.mark.slow if (lights, name) == ("many", "a sequence") else ())
        for lights in ("many", "few")
        for name in JOBS
    ],
)
def test_two_workers_relight_to_the_bytes_of_one_sum_in_memory(name, lights, stage, few, banded, two):
    path, job = {"many": stage, "few": few}[lights], JOBS[name]
    expected, found = job(path), job(path, cluster=two)
    assert len(found) == len(expected)
    for one, other in zip(found, expected, strict=True):
        np.testing.assert_array_equal(one, other)


def test_frames_that_do_not_fit_into_the_memory_together_are_made_in_bands_to_the_same_bytes(stage, banded, tmp_path):
    expected = [p for each in relight_sequence(stage, TURNED) for p in planes(each)]
    little = RelightSettings(memory=1_200_000, scratch=tmp_path)
    found, places = [], set()
    for each in relight_sequence(stage, TURNED, little):
        found += planes(each)
        places |= {path.name for path in tmp_path.iterdir()}
    assert len(places) == 1 and not list(tmp_path.iterdir())  # it was in bands, and they are gone
    for one, other in zip(found, expected, strict=True):
        np.testing.assert_array_equal(one, other)


@pytest.mark.slow
def test_with_a_mesh_two_workers_relight_to_the_bytes_of_one_process(stage, two):
    mesh = SubjectMesh([stage_blocks.mesh()])
    settings = RelightSettings(memory=144 * COLUMNS * 96 * 26)
    expected = relight(stage, StageLighting((stage_blocks.light(),)), mesh, settings)
    found = relight(stage, StageLighting((stage_blocks.light(),)), mesh, settings, cluster=two)
    for one, other in zip(planes(found), planes(expected), strict=True):
        np.testing.assert_array_equal(one, other)


@pytest.mark.slow
def test_two_workers_see_a_new_view_as_one_process_does(stage, two):
    new = Camera.looking_at(np.array([2.0, 0, 3.4]), np.zeros(3), width=40, height=64, focal_length=80.0)
    mesh = SubjectMesh([stage_blocks.mesh()])
    expected = view(read_stage(stage), PAIR[0], new, mesh)
    found = view(read_stage(stage), PAIR[0], new, mesh, cluster=two)
    np.testing.assert_array_equal(found.picture.radiance, expected.picture.radiance)
    np.testing.assert_array_equal(found.unseen, expected.unseen)
    assert found.picture.radiance.max() > 0


@pytest.mark.slow
def test_two_workers_measure_a_surface_to_the_bytes_of_one_process(stage, banded, two):
    expected = measure_surface(read_stage(stage))
    found = measure_surface(read_stage(stage), cluster=two)
    known = surface_maps(separate(read_stage(stage)))
    for name in MAPS:
        np.testing.assert_array_equal(getattr(found, name), getattr(expected, name))
        np.testing.assert_array_equal(getattr(found, name), getattr(known, name))
    assert (found.weight > 0).mean() > 0.2


def test_two_workers_measure_a_polarised_pair_to_the_bytes_of_one_process(tmp_path, banded, two):
    taken = stage_blocks.ball(144)
    build_store(taken, tmp_path / "parallel")
    build_store(replace(taken, values=taken.values * np.float32(0.4)), tmp_path / "crossed")
    pair = read_stage(tmp_path / "parallel"), read_stage(tmp_path / "crossed")
    expected, found = surface_maps(PolarisedPair(*pair)), measure_surface(*pair, cluster=two)
    for name in MAPS:
        np.testing.assert_array_equal(getattr(found, name), getattr(expected, name))


@pytest.mark.slow
def test_eight_workers_do_all_of_it_to_the_same_bytes(stage, few, banded, tmp_path):
    from relume.cluster import connect

    with connect("local:8") as eight:
        for path in (stage, few):
            for job in JOBS.values():
                for one, other in zip(job(path, cluster=eight), job(path), strict=True):
                    np.testing.assert_array_equal(one, other)
        maps, expected = measure_surface(read_stage(stage), cluster=eight), measure_surface(read_stage(stage))
        for name in MAPS:
            np.testing.assert_array_equal(getattr(maps, name), getattr(expected, name))
        import_stage(stage, tmp_path / "again.zarr", cluster=eight)
    import_stage(stage, tmp_path / "alone.zarr")
    assert contents(tmp_path / "again.zarr") == contents(tmp_path / "alone.zarr")


def test_workers_write_the_frames_that_one_process_writes(stage, banded, two, tmp_path):
    assert relight_frames(stage, TURNED, tmp_path / "alone") == 5
    assert relight_frames(stage, TURNED, tmp_path / "two", cluster=two) == 5
    names = sorted(path.name for path in (tmp_path / "two").iterdir())
    assert names == sorted(f"frame_{number:04d}.{kind}" for number in range(1, 6) for kind in ("exr", "png"))
    for name in names:
        one, other = files.read(tmp_path / "two" / name), files.read(tmp_path / "alone" / name)
        planes = ("radiance", "variance") if name.endswith("exr") else ("pixels",)
        for plane in planes:
            np.testing.assert_array_equal(getattr(one, plane), getattr(other, plane))


def contents(store: Path) -> dict[str, bytes]:
    return {str(path.relative_to(store)): path.read_bytes() for path in store.rglob("*") if path.is_file()}


def test_two_workers_import_to_the_bytes_of_one_process(stage, two, tmp_path):
    import_stage(stage, tmp_path / "alone.zarr", ImportSettings(dtype="float"))
    import_stage(stage, tmp_path / "two.zarr", ImportSettings(dtype="float"), cluster=two)
    assert len(contents(tmp_path / "two.zarr")) > 15
    assert contents(tmp_path / "two.zarr") == contents(tmp_path / "alone.zarr")


def test_a_large_store_has_shards_of_many_chunks_and_is_the_same_field(tmp_path, monkeypatch):
    field = stage_blocks.ball(70)
    build_store(field, tmp_path / "plain")
    monkeypatch.setattr(store_building, "_SHARDED", 1)
    monkeypatch.setattr(store_building, "_SHARD", 32 * 64 * 40 * 3 * 2)
    build_store(field, tmp_path / "sharded")
    plain, sharded = read_store(tmp_path / "plain"), read_store(tmp_path / "sharded")
    np.testing.assert_array_equal(whole(sharded), whole(plain))
    assert (plain.file_rows, sharded.file_rows) == (16, 64)
    shards = sorted(path for path in contents(tmp_path / "sharded") if path.startswith("values/c/"))
    assert len(shards) == 3 * 2
    (tmp_path / "sharded" / shards[2]).unlink()
    with pytest.raises(UnreadableFile, match="not whole, 1 of its 3 groups"):
        read_store(tmp_path / "sharded")
    build_store(field, tmp_path / "sharded")
    np.testing.assert_array_equal(whole(read_store(tmp_path / "sharded")), whole(plain))


@pytest.mark.parametrize("where", ["here", "by workers"])
def test_every_light_and_every_row_is_read_once(where, two, tmp_path):
    cluster = two if where == "by workers" else None
    for name in ("import", "relight"):
        (tmp_path / name).mkdir()
    imported = stage_blocks.Counted(stage_blocks.ball(144), tmp_path / "import")
    build_store(imported, tmp_path / "s", cluster=cluster)
    np.testing.assert_array_equal(imported.times(), 1)
    relit = stage_blocks.Counted(read_stage(tmp_path / "s"), tmp_path / "relight")
    pictures = relight_sequence(relit, TURNED, RelightSettings(memory=3_000_000), cluster=cluster)
    assert len(list(pictures)) == 5
    np.testing.assert_array_equal(relit.times(), 1)


def test_lights_that_fail_are_named_the_rest_is_written_and_a_second_import_does_them_alone(tmp_path, two):
    field, store = stage_blocks.ball(144), tmp_path / "s"
    with pytest.raises(Incomplete, match=r"lights 64…95 \(64 …\).*this part of the disk is lost") as raised:
        build_store(stage_blocks.Failing(field, range(70, 71)), store, cluster=two)
    assert len(raised.value.failed) == 1
    with pytest.raises(UnreadableFile, match="not whole, 1 of its 5 groups of lights are missing"):
        read_store(store)
    before = {path: facts for path, facts in contents(store).items() if path.startswith("values/c/")}
    assert len(before) == 4 * 6
    written = {path: (store / path).stat().st_mtime_ns for path in before}
    build_store(field, store, cluster=two)
    assert written == {path: (store / path).stat().st_mtime_ns for path in before}
    after = contents(store)
    assert all(after[path] == content for path, content in before.items())
    build_store(field, tmp_path / "alone")
    np.testing.assert_array_equal(whole(read_store(store)), whole(read_store(tmp_path / "alone")))
    assert np.abs(whole(read_store(store)) - field.values).max() < 0.02


def test_rows_that_fail_are_named_and_nothing_is_left_behind(stage, banded, two, tmp_path):
    broken = stage_blocks.Failing(read_stage(stage), rows_lost=range(30, 31))
    settings = RelightSettings(scratch=tmp_path)
    with pytest.raises(Incomplete, match=r"1 of \d failed: rows \d+…\d+ \(this part of the disk is lost"):
        relight(broken, stage_blocks.light(), settings=settings, cluster=two)
    assert not list(tmp_path.iterdir())


@pytest.mark.slow  # tests/cluster/test_lost_workers.py kills one under the same tasks; lights that fail: above
def test_a_worker_that_is_killed_costs_its_own_lights_alone(tmp_path):
    pytest.importorskip("fcntl")
    seen = tmp_path / "seen"
    seen.mkdir()
    field = stage_blocks.Killing(stage_blocks.ball(144), range(64, 65), seen)
    build_store(field, tmp_path / "s", cluster="local:2")
    begun = sorted(path.name.split(".")[0] for path in seen.iterdir())
    # What the worker had just finished may be done once more, where nobody had heard of it yet.
    assert set(begun) == {"0", "32", "64", "96", "128"} and begun.count("64") == 2 and len(begun) <= 7
    build_store(field.field, tmp_path / "alone")
    assert contents(tmp_path / "s") == contents(tmp_path / "alone")


def test_scratch_that_cannot_be_made_is_reported(stage, banded, two, tmp_path):
    with pytest.raises(OutputNotWritten, match="no folder can be made there"):
        relight(stage, stage_blocks.light(), settings=RelightSettings(scratch=tmp_path / "none"), cluster=two)


def test_a_compressed_sequence_and_a_cluster_are_refused(stage, two):
    with pytest.raises(ValueError, match="leave the compression or the cluster out"):
        relight_sequence(stage, TURNED, RelightSettings(compression="cosine"), cluster=two)


def test_bands_are_of_whole_files_where_these_fit_and_cover_all_rows():
    class Stored:
        shape, lights, value_bytes, chunks, file_rows = (1000, 512), range(64), 4, (32, 16), 128

    for memory, size in ((1 << 40, 640), (300 * 1000, 256), (100 * 1000, 96), (10 * 1000, 10), (1, 1)):
        bands = blocks.bands_of(Stored(), 1000, memory)  # type: ignore[arg-type]
        assert bands[0] == slice(0, size) and bands[-1].stop == 1000
        assert all(before.stop == after.start for before, after in pairwise(bands))
