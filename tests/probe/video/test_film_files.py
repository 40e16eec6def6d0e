"""The maps of a film as one zarr store: whole or not there, read as light that changes; notes name what was given."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("av")
pytest.importorskip("zarr")

import zarr

from probe_films import LAMPS, filmed, place_light, write_video
from relume.capture.response.camera_profile import CameraProfile
from relume.errors import OutputNotWritten, UnreadableFile
from relume.image.files import read_radiance
from relume.image.radiance import OUTSIDE, SATURATED, RadianceMap
from relume.image.response import Response
from relume.light.light_sequence import LightSequence
from relume.probe.video.calibrating import SphericalFilm
from relume.probe.video.filming import FilmSettings, probe_film
from relume.project.finished_light import FinishedLight
from relume.sphere.environment_files import read_environment
from relume.sphere.map_store import MapStore, is_map_store, maps_in_store, read_stored_map
from relume.sphere.mappings.mapping import LatLong, pixel_directions

ROWS = 32


@pytest.fixture(scope="module")
def film(tmp_path_factory) -> Path:
    frames = [filmed(place_light(3 * k, LAMPS)(pixel_directions(LatLong(), ROWS)), seed=k) for k in range(3)]
    return write_video(tmp_path_factory.mktemp("film") / "around.mkv", frames)


def test_a_store_holds_what_a_folder_holds(film, tmp_path):
    settings = FilmSettings(ROWS, keep_variance=True)
    folder = probe_film(film, tmp_path / "maps", SphericalFilm(), settings)
    stored = probe_film(film, tmp_path / "maps.zarr", SphericalFilm(), settings)
    assert [path.relative_to(tmp_path).as_posix() for path in stored.paths] == [
        f"maps.zarr/radiance/{number}.0.0.0" for number in range(3)
    ]
    assert all(path.is_file() for path in stored.paths) and is_map_store(tmp_path / "maps.zarr")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["maps", "maps.zarr"]
    for one, other in zip(folder.paths, stored.paths, strict=True):
        expected, found = read_radiance(one), read_stored_map(other)
        np.testing.assert_array_equal(found.radiance, expected.radiance)
        np.testing.assert_array_equal(found.clipped, expected.clipped)
        assert found.variance is not None and expected.variance is not None
        np.testing.assert_allclose(found.variance, expected.variance, rtol=2**-10)
        assert found.attributes["mapping"] == "latlong" and found.attributes["rate"] == "24"
        assert found.unit == "relative"
        np.testing.assert_array_equal(read_environment(other).radiance, expected.radiance)
    # Any program that reads zarr has the maps as one array.
    array = zarr.open_array(str(tmp_path / "maps.zarr" / "radiance"), mode="r")
    assert array.shape == (3, ROWS, 2 * ROWS, 3) and array.dtype == np.float16


def test_a_store_is_light_that_changes(film, tmp_path):
    probe_film(film, tmp_path / "maps", SphericalFilm(), FilmSettings(ROWS))
    probe_film(film, tmp_path / "maps.zarr", SphericalFilm(), FilmSettings(ROWS))
    folder, store = (LightSequence.found(name, 24.0, folder=tmp_path) for name in ("maps", "maps.zarr"))
    for seconds in (0.0, 1 / 48, 1 / 24, 5.0):
        np.testing.assert_array_equal(store.at(seconds).radiance, folder.at(seconds).radiance)
    np.testing.assert_array_equal(store.mean(0, 0.05).radiance, folder.mean(0, 0.05).radiance)
    # [light] maps of shot and scene files, and the frames that they become.
    table = FinishedLight(maps=["maps.zarr"], rate=24.0)
    assert table.names_of_maps(tmp_path) == [f"maps.zarr/radiance/{number}.0.0.0" for number in range(3)]
    part = table.at_second(1.5 / 24, tmp_path, 24.0)
    assert part["maps"] == ["maps.zarr/radiance/1.0.0.0", "maps.zarr/radiance/2.0.0.0"]
    light = FinishedLight(**part).finished(tmp_path, UnreadableFile)
    assert light is not None
    np.testing.assert_allclose(light.radiance, store.at(1.5 / 24).radiance, rtol=1e-6)


def test_maps_of_a_store_follow_by_their_numbers(tmp_path):
    pinned = [0.25, 0.5, 1, 2, 4, 8, 16, 32, 64, 128, 256]
    store = MapStore.begun(tmp_path / "eleven.zarr", len(pinned), 8)
    clipped = np.zeros((8, 16), np.uint8)
    clipped[0, :2] = OUTSIDE, SATURATED
    for number, value in reversed([*enumerate(pinned)]):
        store.write(number, RadianceMap(np.full((8, 16, 3), value, np.float32), None, clipped))
    sequence = LightSequence.found(tmp_path / "eleven.zarr", 1.0)
    assert [float(sequence.at(second).radiance[3, 3, 1]) for second in range(11)] == pinned
    found = read_stored_map(sequence.paths[10])
    np.testing.assert_array_equal(found.clipped, clipped)
    assert found.variance is None
    # Ten comes after nine, in whichever order they are named.
    names = [sequence.paths[number] for number in (10, 9, 8)]
    assert [each.name for each in LightSequence.found(names).paths] == ["8.0.0.0", "9.0.0.0", "10.0.0.0"]
    black = MapStore.begun(tmp_path / "black.zarr", 1, 8)
    assert black.write(0, RadianceMap(np.zeros((8, 16, 3), np.float32))).is_file()
    with pytest.raises(ValueError, match=r"reaches 7e\+04, beyond the largest half"):
        black.write(0, RadianceMap(np.full((8, 16, 3), 7e4, np.float32)))


def test_damaged_stores_are_told_in_one_line(tmp_path):
    store = MapStore.begun(tmp_path / "maps.zarr", 2, 8)
    for number in range(2):
        store.write(number, RadianceMap(np.full((8, 16, 3), 0.5, np.float32)))
    first, second = maps_in_store(tmp_path / "maps.zarr")
    content = bytearray(first.read_bytes())
    content[len(content) // 2] ^= 255
    first.write_bytes(bytes(content))
    with pytest.raises(UnreadableFile, match=r"maps.zarr: map 1 is damaged") as caught:
        read_environment(first)
    assert "\n" not in str(caught.value)
    second.unlink()
    with pytest.raises(UnreadableFile, match="map 2 of 2 is missing"):
        LightSequence.found(tmp_path / "maps.zarr")
    text = (tmp_path / "maps.zarr" / "zarr.json").read_text().replace('"version": 1', '"version": 9')
    (tmp_path / "maps.zarr" / "zarr.json").write_text(text)
    with pytest.raises(UnreadableFile, match="a store of version 9"):
        maps_in_store(tmp_path / "maps.zarr")


@pytest.mark.parametrize("part", ["clipped/1.0.0", "variance/1.0.0.0"])
def test_a_lost_part_of_a_map_is_not_read_as_nothing(tmp_path, part):
    light = np.full((8, 16, 3), 0.5, np.float32)
    store = MapStore.begun(tmp_path / "maps.zarr", 2, 8, variance=True)
    for number in range(2):
        store.write(number, RadianceMap(light, light / 4))
    files = maps_in_store(tmp_path / "maps.zarr")
    kept = read_stored_map(files[1]).variance
    assert kept is not None and float(kept.max()) == 0.125
    (tmp_path / "maps.zarr" / part).unlink()
    said = f"maps.zarr: {part.split('/')[0]} of map 2 is missing; make the maps again"
    for reading in (lambda: read_stored_map(files[1]), lambda: maps_in_store(tmp_path / "maps.zarr")):
        with pytest.raises(UnreadableFile, match=said):
            reading()
    read_stored_map(files[0])


def test_a_store_takes_no_light_that_is_not_finite(tmp_path):
    light = np.full((8, 16, 3), 0.5, np.float32)
    store = MapStore.begun(tmp_path / "maps.zarr", 1, 8, np.float32, variance=True)
    for value in (np.nan, np.inf):
        damaged = light.copy()
        damaged[2, 3, 1] = value
        with pytest.raises(ValueError, match="map 1: radiance is not finite in 1 values"):
            store.write(0, RadianceMap(damaged))
    damaged[2, 3, 1] = np.nan
    with pytest.raises(ValueError, match="map 1: variance is not finite in 1 values"):
        store.write(0, RadianceMap(light, damaged))
    store.write(0, RadianceMap(light, np.full_like(light, np.inf)))


@pytest.mark.parametrize("name", ["maps", "maps.zarr"])
def test_nothing_is_left_where_making_maps_fails(film, tmp_path, name, monkeypatch):
    monkeypatch.setattr("relume.probe.video.filming._clipped_share", lambda each: 1 / 0)
    with pytest.raises(ZeroDivisionError):
        probe_film(film, tmp_path / name, SphericalFilm(), FilmSettings(ROWS))
    assert list(tmp_path.iterdir()) == []


def test_a_store_that_holds_something_is_left_alone(film, tmp_path):
    (tmp_path / "maps.zarr").mkdir()
    (tmp_path / "maps.zarr" / "zarr.json").write_text("{}")
    with pytest.raises(OutputNotWritten, match=r"maps.zarr: holds files already.*choose another store"):
        probe_film(film, tmp_path / "maps.zarr", SphericalFilm(), FilmSettings(ROWS))


def test_notes_name_the_folder_that_was_given(tmp_path):
    # Light so dim beside the lamp's exposure that halves cannot hold it.
    dim = np.full((ROWS, 2 * ROWS, 3), 1e-6)
    dim[:, ::2] = 0.5
    table = np.concatenate([np.full((1, 3), 1e-7), np.full((99, 3), 1e-6), np.full((156, 3), 0.5)])
    frames = [np.where(dim > 0.1, 200, 50).astype(np.uint8)] * 3
    film = write_video(tmp_path / "dim.mkv", frames)
    curve = np.log(table.T) + np.linspace(0, 1e-3, 256)
    made = probe_film(
        film, tmp_path / "maps", SphericalFilm(), FilmSettings(ROWS),
        profile=CameraProfile("odd", Response(curve, np.full(3, 0.5))),
    )  # fmt: skip
    lines = [doubt.line for doubt in made.doubts]
    assert len(lines) == 1
    assert lines[0].startswith(f"{tmp_path / 'maps'}/map_00000") and lines[0].endswith("; so it is of 2 more")
