from __future__ import annotations

import json
import os
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from relume.errors import CannotResume, OutputNotWritten, UnreadableFile
from relume.lightstage.acquire.store import is_store, read_store, stored_geometry
from relume.lightstage.acquire.store_building import build_store, file_facts
from relume.lightstage.field.field import Noise, Pictures, whole
from relume.lightstage.field.lights import StageLights
from relume.lightstage.relighting.relighting import weighted_sum
from relume.scene.cameras.camera import Camera
from relume.scene.cameras.distortion import Distortion

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
    expected = weighted_sum(held, IRRADIANCES)
    for memory in (1 << 30, 6_000_000):
        found = weighted_sum(stored, IRRADIANCES, memory=memory, threads=1 if memory < 1 << 30 else None)
        np.testing.assert_array_equal(found.radiance, expected.radiance)
        np.testing.assert_array_equal(found.variance, expected.variance)


@pytest.mark.parametrize("kind", [np.float32, np.float16, np.uint8])
def test_black_tiles_and_black_pictures_are_kept_and_read(tmp_path, kind):
    dark = VALUES.copy()
    dark[:32, :, 256:] = 0  # a chunk of the first group
    dark[32:] = 0  # the second group whole
    build_store(Pictures(dark, LIGHTS), tmp_path / "s", dtype=kind)
    found = read_store(tmp_path / "s")
    assert np.abs(whole(found) - dark).max() <= 0.5001 / 255
    assert np.count_nonzero(whole(found)[:32, :, 256:]) == np.count_nonzero(whole(found)[32:]) == 0
    # Of 40 pictures 32 are rounded, by steps of 1/255.
    if kind == np.uint8:
        assert found.rounding.constant == pytest.approx(0.8 / 255**2 / 12, rel=0.001)


def test_halves_keep_dim_pictures_and_dim_pixels_to_1_in_2000(tmp_path):
    # Pictures of every brightness, pixels down to 2⁻²⁷ of each; one picture is bright beyond the range of halves.
    levels = np.float32(10.0) ** np.linspace(-30, 30, COUNT, dtype=np.float32)
    wide = VALUES * 0.5 + 0.5
    wide[:, :9] *= 2.0**-13
    wide[:, 9:18] *= 2.0**-26
    values = wide * levels[:, None, None, None]
    build_store(Pictures(values, LIGHTS), tmp_path / "s")
    found = read_store(tmp_path / "s")
    error = np.abs(whole(found).astype(np.float64) / values - 1)
    assert 2**-12 < error.max() <= 2**-11
    assert error[levels < 1e-8].max() > 2**-12  # they were rounded, not kept some other way


def test_what_is_dimmest_of_all_is_off_by_two_to_the_minus_39_of_its_picture(tmp_path):
    tiny = VALUES * np.float32(2.0**-40)
    tiny[:, 0, 0] = 0.51
    build_store(Pictures(tiny, LIGHTS), tmp_path / "s")
    error = np.abs(whole(read_store(tmp_path / "s")).astype(np.float64) - tiny)[:, 1:]
    assert 2**-41 < error.max() <= 2**-39 * 0.51


def test_halves_round_by_less_than_the_variance_that_is_reported(tmp_path):
    dim = VALUES**8
    build_store(Pictures(dim, LIGHTS), tmp_path / "s")
    found = read_store(tmp_path / "s")
    squared = (whole(found).astype(np.float64) - dim) ** 2
    assert found.rounding.constant == 0
    # The greatest value is 1 but for a hair: 2⁻²² / 3.
    assert found.rounding.slope == pytest.approx(7.947e-8, rel=0.001)
    assert 0.02 < squared.sum() / (found.rounding.slope * dim.astype(np.float64)).sum() < 1


def test_eight_bits_say_the_variance_of_their_rounding(tmp_path):
    build_store(FIELD, tmp_path / "s", dtype=np.uint8)
    found = read_store(tmp_path / "s")
    measured = float(np.var(whole(found).astype(np.float64) - VALUES))
    assert found.rounding.constant == pytest.approx(measured, rel=0.01)
    assert found.rounding.constant == pytest.approx(1 / 255**2 / 12, rel=0.001)
    assert found.noise == Noise(1e-4 + found.rounding.constant, 1e-3)
    build_store(replace(FIELD, noise=None), tmp_path / "unknown", dtype=np.uint8)
    assert read_store(tmp_path / "unknown").noise is None


def test_eight_bits_that_are_coarse_are_reported(tmp_path):
    glinting = VALUES.copy()
    glinting[:, 3, 4] = 200
    # A step of 200/255 rounds by its √12th part, 0.226; the mean is 0.5 + 200/10080.
    with pytest.warns(UserWarning, match=r"8 bits are coarse here.* 44 % of the mean value.*\(--dtype half"):
        build_store(Pictures(glinting, LIGHTS), tmp_path / "s", dtype=np.uint8)


def test_every_picture_is_asked_for_once(tmp_path):
    counted, reports = Failing(), []
    build_store(counted, tmp_path / "s", progress=reports.append)
    assert counted.asked == list(range(COUNT)) and reports == [0.5, 1.0]


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
        weighted_sum(read_store(tmp_path / "s"), IRRADIANCES)
    assert "\n" not in str(error.value)


def test_a_whole_store_is_not_written_over(tmp_path):
    build_store(FIELD, tmp_path / "s")
    with pytest.raises(OutputNotWritten, match="whole already; delete it"):
        build_store(FIELD, tmp_path / "s")
    (tmp_path / "other").mkdir()
    (tmp_path / "other" / "notes.txt").write_text("mine")
    with pytest.raises(OutputNotWritten, match="something else is there"):
        build_store(FIELD, tmp_path / "other")


def test_an_import_is_not_finished_with_the_values_of_another(tmp_path):
    command = {"target": None, "files": [("a.exr", 10, 1), ("b.exr", 10, 2)]}
    others = ({**command, "target": "0,0,4,4=1"}, {**command, "files": [("a.exr", 10, 1), ("b.exr", 10, 3)]}, None)
    build_store(FIELD, tmp_path / "s", made_from=command)
    chunk = tmp_path / "s" / "values" / "c" / "0" / "0" / "0" / "0"
    chunk.unlink()
    for other in others:
        with pytest.raises(CannotResume, match="another import: its options, or its source's files, differ") as error:
            build_store(Pictures(2 * VALUES, LIGHTS, CAMERA, FIELD.noise), tmp_path / "s", made_from=other)
        assert "\n" not in str(error.value) and not chunk.exists()
    build_store(FIELD, tmp_path / "s", made_from=dict(command))
    assert np.abs(whole(read_store(tmp_path / "s")) - VALUES).max() < 2**-11


def test_facts_of_files_change_with_their_names_sizes_and_times(tmp_path):
    folder = tmp_path / "pictures"
    folder.mkdir()
    for name in ("b.exr", "a.exr", ".hidden"):
        (folder / name).write_bytes(b"12345")
        os.utime(folder / name, ns=(7, 1_000_000_000))
    (folder / "sub").mkdir()
    first, second = str(folder / "a.exr"), str(folder / "b.exr")
    assert file_facts([folder]) == [(first, 5, 1_000_000_000), (second, 5, 1_000_000_000)]
    assert file_facts([folder / "b.exr"]) == [(second, 5, 1_000_000_000)]
    os.utime(folder / "a.exr", ns=(7, 2_000_000_000))
    assert file_facts([folder])[0] == (first, 5, 2_000_000_000)


def test_a_part_that_is_lost_while_the_rest_is_written_is_reported_before_the_store_counts_as_whole(tmp_path):
    class Losing(Failing):
        def block(self, lights, rows):
            if lights.start:
                (tmp_path / "s" / "values" / "c" / "0" / "0" / "0" / "0").unlink()
            return super().block(lights, rows)

    with pytest.raises(OutputNotWritten, match="1 groups of lights were written and are not there; give the same"):
        build_store(Losing(), tmp_path / "s")
    with pytest.raises(UnreadableFile, match="not whole"):
        read_store(tmp_path / "s")


def test_the_mesh_and_the_size_of_the_lamps_are_kept_and_a_lost_mesh_is_reported(tmp_path, monkeypatch):
    build_store(FIELD, tmp_path / "plain")
    assert stored_geometry(tmp_path / "plain") == (None, None)
    mesh = tmp_path / "head.glb"
    mesh.write_bytes(b"mesh")
    monkeypatch.chdir(tmp_path)
    build_store(FIELD, "s", mesh=Path("head.glb"), light_radius=0.0125)
    assert stored_geometry("s") == (mesh, 0.0125)
    mesh.unlink()
    with pytest.raises(
        UnreadableFile, match=r"s: the store names the mesh .*head\.glb, which is not there; put"
    ) as error:
        stored_geometry("s")
    assert "\n" not in str(error.value)
    assert read_store("s").shape == (ROWS, COLUMNS)
    with pytest.raises(UnreadableFile, match="no store"):
        stored_geometry(mesh.parent)


def test_geometry_that_cannot_be_is_refused_before_anything_is_written(tmp_path):
    with pytest.raises(UnreadableFile, match=r"none\.glb: no such file; name the mesh"):
        build_store(FIELD, tmp_path / "s", mesh=tmp_path / "none.glb")
    for radius in (-0.1, 4.0, np.nan):
        with pytest.raises(ValueError, match=f"light_radius is {radius}; expected radians"):
            build_store(FIELD, tmp_path / "s", light_radius=radius)
    assert not (tmp_path / "s").exists()


def test_an_import_that_is_gone_on_with_may_learn_of_a_mesh(tmp_path):
    (tmp_path / "head.glb").write_bytes(b"mesh")
    with pytest.raises(CutShort):
        build_store(Failing(after=35), tmp_path / "s", light_radius=0.02)
    build_store(FIELD, tmp_path / "s", mesh=tmp_path / "head.glb")
    assert stored_geometry(tmp_path / "s") == (tmp_path / "head.glb", None)


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
        (np.float16, np.inf, '"7" holds values that are not finite'),
        (np.float32, np.nan, '"7" holds values that are not finite'),
    ],
)
def test_what_a_type_cannot_hold_is_refused(tmp_path, kind, value, said):
    odd = VALUES.copy()
    odd[7, 5, 5, 1] = value
    with pytest.raises(ValueError, match=said):
        build_store(Pictures(odd, LIGHTS), tmp_path / "s", dtype=kind)


def test_too_little_memory_is_reported_before_anything_is_written_and_little_is_enough(tmp_path):
    with pytest.raises(ValueError, match=r"max_memory is 1 MB; pictures of 280×36 need 34 MB"):
        build_store(FIELD, tmp_path / "s", max_memory=1_000_000)
    assert not (tmp_path / "s").exists()
    # A little more takes fewer lights at once.
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
    file = tmp_path / "s" / "zarr.json"
    content = json.loads(file.read_text())
    assert content["attributes"]["version"] == 1
    content["attributes"]["version"] = 2
    file.write_text(json.dumps(content))
    with pytest.raises(UnreadableFile, match="a store of version 2, and this relume reads version 1"):
        read_store(tmp_path / "s")


def test_without_zarr_one_line_says_what_to_install(tmp_path, monkeypatch):
    build_store(FIELD, tmp_path / "s")
    monkeypatch.setitem(sys.modules, "zarr", None)
    for work in (lambda: read_store(Path(tmp_path / "s")), lambda: build_store(FIELD, tmp_path / "t")):
        with pytest.raises(ValueError, match=r'zarr, which is not installed: pip install "relume\[lightstage\]"'):
            work()
