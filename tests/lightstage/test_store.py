from __future__ import annotations

import builtins
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from relume.errors import CannotResume, OutputNotWritten, UnreadableFile
from relume.lightstage.field import Noise, Pictures, whole
from relume.lightstage.lights import StageLights
from relume.lightstage.relighting import relight
from relume.lightstage.store import is_store, read_store
from relume.lightstage.store_building import build_store
from relume.scene.camera import Camera
from relume.scene.distortion import Distortion

pytest.importorskip("zarr", reason="the extra lightstage is not installed")

GENERATOR = np.random.default_rng(5)
COUNT, ROWS, COLUMNS = 40, 36, 280
VALUES = GENERATOR.random((COUNT, ROWS, COLUMNS, 3), np.float32)
LIGHTS = StageLights.towards(
    GENERATOR.normal(size=(COUNT, 3)), positions=GENERATOR.normal(size=(COUNT, 3)), grid=(5, 8)
)
CAMERA = replace(
    Camera.looking_at(np.array([0.1, 0.2, 3]), np.zeros(3), width=COLUMNS, height=ROWS, focal_length=500.5),
    distortion=Distortion(k1=0.01),
    centre=(140.25, 18.5),
)
FIELD = Pictures(VALUES, LIGHTS, CAMERA, Noise(1e-4, 1e-3))
IRRADIANCES = GENERATOR.random((COUNT, 3))


class CutShort(Exception):
    pass


class Failing:
    """The field, counting the pictures that are asked for and failing after so many."""

    def __init__(self, after: int = 10**9) -> None:
        self.after, self.asked = after, []
        self.lights, self.shape, self.camera, self.noise = FIELD.lights, FIELD.shape, FIELD.camera, FIELD.noise

    def block(self, lights, rows):
        if len(self.asked) + lights.stop - lights.start > self.after:
            raise CutShort
        assert rows == slice(0, ROWS)
        self.asked += range(lights.start, lights.stop)
        return FIELD.block(lights, rows)


@pytest.mark.parametrize(("kind", "tolerance"), [(np.float32, 0), (np.float16, 2**-12), (np.uint8, 0.5 / 255)])
def test_a_stored_field_is_the_field_to_its_types_rounding(tmp_path, kind, tolerance):
    build_store(FIELD, tmp_path / "s", dtype=kind)
    found = read_store(tmp_path / "s")
    assert is_store(tmp_path / "s") and not is_store(tmp_path)
    assert np.abs(whole(found) - VALUES).max() <= tolerance * 1.0001
    part = found.block(slice(30, 35), slice(7, 20))
    np.testing.assert_array_equal(part, whole(found)[30:35, 7:20])
    for name in ("directions", "solid_angles", "positions"):
        np.testing.assert_array_equal(getattr(found.lights, name), getattr(LIGHTS, name))
    assert found.lights.names == LIGHTS.names and found.lights.grid == (5, 8)
    camera = found.camera
    assert camera is not None and (camera.width, camera.focal_length, camera.focus) == (COLUMNS, 500.5, np.inf)
    assert camera.distortion == CAMERA.distortion and camera.centre == CAMERA.centre
    np.testing.assert_array_equal(camera.rotation, CAMERA.rotation)


@pytest.mark.parametrize("kind", [np.float32, np.float16, np.uint8])
def test_relit_from_a_store_or_from_memory_the_bytes_are_the_same(tmp_path, kind):
    build_store(FIELD, tmp_path / "s", dtype=kind)
    stored = read_store(tmp_path / "s")
    values, scale = stored.encoded(slice(0, COUNT), slice(0, ROWS))
    single = None if scale is None else scale.astype(np.float32)
    held = Pictures(values, LIGHTS, CAMERA, stored.noise, single)
    expected = relight(held, IRRADIANCES)
    for memory in (1 << 30, 6_000_000):
        found = relight(stored, IRRADIANCES, memory=memory, threads=1 if memory < 1 << 30 else None)
        np.testing.assert_array_equal(found.radiance, expected.radiance)
        np.testing.assert_array_equal(found.variance, expected.variance)


def test_eight_bits_tell_the_variance_of_their_rounding(tmp_path):
    build_store(FIELD, tmp_path / "s", dtype=np.uint8)
    found = read_store(tmp_path / "s")
    measured = float(np.var(whole(found).astype(np.float64) - VALUES))
    assert found.rounding.constant == pytest.approx(measured, rel=0.01)
    assert found.rounding.constant == pytest.approx(1 / 255**2 / 12, rel=0.001)
    assert found.noise == Noise(1e-4 + found.rounding.constant, 1e-3)
    build_store(replace(FIELD, noise=None), tmp_path / "unknown", dtype=np.uint8)
    assert read_store(tmp_path / "unknown").noise is None


def test_eight_bits_that_are_coarse_are_told(tmp_path):
    glinting = VALUES.copy()
    glinting[:, 3, 4] = 200
    # A step of 200/255 rounds by its √12th part, 0.226; the mean is 0.5 + 200/10080.
    with pytest.warns(UserWarning, match=r"8 bits are coarse here.* 44 % of the mean value"):
        build_store(Pictures(glinting, LIGHTS), tmp_path / "s", dtype=np.uint8)


def test_every_picture_is_asked_for_once(tmp_path):
    counted, told = Failing(), []
    build_store(counted, tmp_path / "s", progress=told.append)
    assert counted.asked == list(range(COUNT)) and told == [0.5, 1.0]


def test_a_build_that_was_cut_short_is_refused_and_goes_on_where_it_stopped(tmp_path):
    first, second = Failing(after=35), Failing()
    with pytest.raises(CutShort):
        build_store(first, tmp_path / "s")
    assert is_store(tmp_path / "s") and first.asked == list(range(32))
    with pytest.raises(UnreadableFile, match=r"not whole, 1 of its 2 groups .*; give the same import again") as error:
        read_store(tmp_path / "s")
    assert "\n" not in str(error.value)
    build_store(second, tmp_path / "s")
    assert second.asked == list(range(32, 40))
    build_store(FIELD, tmp_path / "once")
    np.testing.assert_array_equal(whole(read_store(tmp_path / "s")), whole(read_store(tmp_path / "once")))


@pytest.mark.parametrize("harm", ["missing", "shortened"])
def test_a_lost_chunk_is_found_when_the_store_is_opened_and_only_its_group_is_built_again(tmp_path, harm):
    build_store(FIELD, tmp_path / "s")
    chunk = tmp_path / "s" / "values" / "c" / "0" / "1" / "1" / "0"
    if harm == "missing":
        chunk.unlink()
    else:
        chunk.write_bytes(chunk.read_bytes()[:-100])
    with pytest.raises(UnreadableFile, match=r"1 of its 2 groups of lights are missing or cut short; give the same"):
        read_store(tmp_path / "s")
    again = Failing()
    build_store(again, tmp_path / "s")
    assert again.asked == list(range(32))
    assert np.abs(whole(read_store(tmp_path / "s")) - VALUES).max() < 2**-11


def test_a_chunk_whose_bytes_changed_is_refused_when_it_is_read(tmp_path):
    build_store(FIELD, tmp_path / "s")
    chunk = tmp_path / "s" / "values" / "c" / "1" / "0" / "0" / "0"
    content = bytearray(chunk.read_bytes())
    content[len(content) // 2] ^= 1
    chunk.write_bytes(content)
    with pytest.raises(UnreadableFile, match="damaged among lights 0…39 and rows 0…35") as error:
        relight(read_store(tmp_path / "s"), IRRADIANCES)
    assert "\n" not in str(error.value)


def test_a_whole_store_is_not_written_over(tmp_path):
    build_store(FIELD, tmp_path / "s")
    with pytest.raises(OutputNotWritten, match="whole already; delete it"):
        build_store(FIELD, tmp_path / "s")
    (tmp_path / "other").mkdir()
    (tmp_path / "other" / "notes.txt").write_text("mine")
    with pytest.raises(OutputNotWritten, match="something else is there"):
        build_store(FIELD, tmp_path / "other")


def test_another_fields_store_is_not_gone_on_with(tmp_path):
    with pytest.raises(CutShort):
        build_store(Failing(after=35), tmp_path / "s")
    with pytest.raises(CannotResume, match="its noise differs"):
        build_store(replace(FIELD, noise=None), tmp_path / "s")
    with pytest.raises(CannotResume, match="its dtype differs"):
        build_store(FIELD, tmp_path / "s", dtype=np.float32)


@pytest.mark.parametrize(
    ("kind", "value", "said"),
    [
        (np.uint8, -0.1, '"7" reaches -0.1, below 0'),
        (np.float16, 70000, '"7" reaches 70000, above float16; choose float32'),
        (np.float32, np.nan, '"7" holds values that are not finite'),
    ],
)
def test_what_a_type_cannot_hold_is_refused(tmp_path, kind, value, said):
    odd = VALUES.copy()
    odd[7, 5, 5, 1] = value
    with pytest.raises(ValueError, match=said):
        build_store(Pictures(odd, LIGHTS), tmp_path / "s", dtype=kind)


def test_too_little_memory_is_told_before_anything_is_written(tmp_path):
    with pytest.raises(ValueError, match=r"max_memory is 1 MB; pictures of 280×36 need 34 MB"):
        build_store(FIELD, tmp_path / "s", max_memory=1_000_000)
    assert not (tmp_path / "s").exists()


def test_little_memory_takes_fewer_lights_at_once(tmp_path):
    build_store(FIELD, tmp_path / "s", max_memory=35_000_000)
    assert read_store(tmp_path / "s").chunks[0] < 32
    assert np.abs(whole(read_store(tmp_path / "s")) - VALUES).max() < 2**-11


def test_what_is_no_store_is_refused(tmp_path):
    with pytest.raises(UnreadableFile, match="no such store"):
        read_store(tmp_path / "none")
    with pytest.raises(UnreadableFile, match="no store of a reflectance field"):
        read_store(tmp_path)


def test_a_later_version_is_refused(tmp_path):
    build_store(FIELD, tmp_path / "s")
    described = tmp_path / "s" / "zarr.json"
    content = json.loads(described.read_text())
    assert content["attributes"]["version"] == 1
    content["attributes"]["version"] = 2
    described.write_text(json.dumps(content))
    with pytest.raises(UnreadableFile, match="a store of version 2, and this relume reads version 1"):
        read_store(tmp_path / "s")


def test_without_zarr_one_line_tells_what_to_install(tmp_path, monkeypatch):
    build_store(FIELD, tmp_path / "s")
    plain = builtins.__import__

    def without(name, *rest, **more):
        if name == "zarr":
            raise ImportError(name)
        return plain(name, *rest, **more)

    monkeypatch.setattr(builtins, "__import__", without)
    for work in (lambda: read_store(Path(tmp_path / "s")), lambda: build_store(FIELD, tmp_path / "t")):
        with pytest.raises(ValueError, match=r'zarr, which is not installed: pip install "relume\[lightstage\]"'):
            work()
