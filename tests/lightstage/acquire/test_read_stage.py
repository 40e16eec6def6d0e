"""Stages in folders: what is read of their pictures, and what of them is refused."""

import json
from pathlib import Path

import numpy as np
import pytest

from relume.errors import InvalidStage
from relume.image import files
from relume.image.files.metadata.icc_profile import adobe_rgb
from relume.image.photograph import Exposure, Photograph
from relume.image.primaries import ADOBE_RGB, REC709, between
from relume.image.radiance import RadianceMap
from relume.image.response import Response
from relume.lightstage.acquire.picture_folder import PictureFolder
from relume.lightstage.acquire.read_stage import find_stage_file, open_pictures, read_stage
from relume.lightstage.acquire.stage_file_reading import read_stage_file
from relume.lightstage.field.field import whole

HEAD = Path(__file__).resolve().parents[4] / "shared" / "stages" / "head"
HALF = {"irradiance_at_normal_incidence": 0.5}
DIRECTIONS = [[0, 1, 0], [0, 0, 1], [1, 0, 0], [0, -1, 0.1]]


def pictures(count: int = 3, shape: tuple[int, int] = (5, 7), seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).uniform(0.1, 2, (count, *shape, 3)).astype(np.float32)


def stage_of(folder: Path, values: np.ndarray, ending: str = "exr", **table: object) -> Path:
    """A stage's folder: radiance maps, or photographs where values are whole numbers."""
    folder.mkdir(exist_ok=True)
    lights = []
    for index, value in enumerate(values):
        name = f"{index}.{ending}"
        files.write(folder / name, RadianceMap(value) if value.dtype == np.float32 else Photograph(value, name))
        lights.append({"file": name, "direction": DIRECTIONS[index]})
    (folder / "stage.json").write_text(json.dumps({"lights": lights} | table))
    return folder


def refusal(folder: Path) -> str:
    with pytest.raises(InvalidStage) as caught:
        whole(read_stage(folder))
    assert "\n" not in str(caught.value)
    return str(caught.value)


def test_radiance_maps_are_read_as_they_are(tmp_path: Path) -> None:
    values = pictures()
    field = read_stage(stage_of(tmp_path, values))
    assert field.shape == (5, 7) and field.camera is None and field.noise is None
    assert field.lights.names == ("0.exr", "1.exr", "2.exr")
    np.testing.assert_array_equal(whole(field), values)
    np.testing.assert_array_equal(field.block(slice(1, 3), slice(2, 4)), values[1:3, 2:4])


def test_pictures_are_divided_by_their_lights_irradiance(tmp_path: Path) -> None:
    values = pictures()
    field = read_stage(stage_of(tmp_path, values, light={"irradiance_at_normal_incidence": [1, 2, 4]}))
    np.testing.assert_allclose(whole(field), values / [1, 2, 4], rtol=1e-6)


def test_photographs_are_srgb_unless_the_stage_says_otherwise(tmp_path: Path) -> None:
    values = np.full((3, 4, 4, 3), 128, np.uint8)
    srgb = read_stage(stage_of(tmp_path / "a", values, "png"))
    np.testing.assert_allclose(whole(srgb), 0.2158605, rtol=1e-5)  # ((128/255 + 0.055)/1.055)^2.4
    linear = read_stage(stage_of(tmp_path / "b", values, "png", encoding="linear"))
    np.testing.assert_allclose(whole(linear), 128 / 255, rtol=1e-6)
    deep = read_stage(stage_of(tmp_path / "c", values.astype(np.uint16) * 257, "png"))
    np.testing.assert_allclose(whole(deep), 0.2158605, rtol=1e-5)


def test_the_steps_of_codes_are_reported_in_the_field_s_values(tmp_path: Path) -> None:
    values = np.full((3, 4, 4, 3), 128, np.uint8)
    linear = read_stage(stage_of(tmp_path / "a", values, "png", encoding="linear", light=HALF))
    assert isinstance(linear, PictureFolder) and linear.step() == pytest.approx(1 / 255 / 0.5)
    srgb = read_stage(stage_of(tmp_path / "b", values, "png"))
    # Half of the way from code 127 to 129: ((129/255 + 0.055)/1.055)^2.4 − ((127/255 + 0.055)/1.055)^2.4, 0.00729544.
    assert isinstance(srgb, PictureFolder) and srgb.step() == pytest.approx(0.00364772, rel=1e-5)
    radiance = read_stage(stage_of(tmp_path / "c", pictures()))
    assert isinstance(radiance, PictureFolder) and radiance.step() == 0


def test_a_target_is_for_an_import_and_that_is_reported(tmp_path: Path) -> None:
    folder = stage_of(tmp_path, pictures(), target={"rectangle": [0, 0, 2, 2], "reflectance": 0.5})
    with pytest.warns(UserWarning, match='"target" is passed over here; an import'):
        field = read_stage(folder)
    np.testing.assert_array_equal(whole(field), pictures())
    stage, source = find_stage_file(folder)
    assert stage.target is not None and stage.target.reflectance == 0.5 and source == folder / "stage.json"


def test_pictures_without_a_file_of_their_lights_are_reported_by_their_folder(tmp_path: Path) -> None:
    stage, source = find_stage_file(stage_of(tmp_path, pictures()))
    source.unlink()
    files.write(tmp_path / "off.exr", RadianceMap(pictures()[0]))
    np.testing.assert_array_equal(whole(open_pictures(stage, tmp_path, known=[tmp_path / "off.exr"])), pictures())
    with pytest.warns(UserWarning, match="named by none, such as off.exr"):
        open_pictures(stage, tmp_path)
    (tmp_path / "2.exr").unlink()
    with pytest.raises(InvalidStage) as caught:
        open_pictures(stage, tmp_path)
    assert str(caught.value).startswith(f"{tmp_path}: 1 of 3 pictures") and "stage.json" not in str(caught.value)


def test_a_response_beside_the_stage_linearises_its_photographs(tmp_path: Path) -> None:
    values = np.full((3, 4, 4, 3), 100, np.uint8)
    folder = stage_of(tmp_path, values, "png", encoding="camera.json")
    assert "no such response" in refusal(folder)
    response = Response(np.stack([np.arange(256) / 50.0] * 3), np.ones(3))
    (folder / "camera.json").write_text(response.to_json())
    np.testing.assert_allclose(whole(read_stage(folder)), np.exp(2.0), rtol=1e-6)
    short = Response(np.stack([np.arange(16) / 5.0] * 3), np.ones(3))
    (folder / "camera.json").write_text(short.to_json())
    assert "has 256 values a channel" in refusal(folder)


def test_reported_exposures_divide(tmp_path: Path) -> None:
    folder = stage_of(tmp_path, np.full((3, 4, 4, 3), 128, np.uint8), "png", encoding="linear")
    table = json.loads((folder / "stage.json").read_text())
    for light, seconds in zip(table["lights"], (1, 2, 0.5), strict=True):
        light["exposure"] = seconds
    (folder / "stage.json").write_text(json.dumps(table))
    np.testing.assert_allclose(whole(read_stage(folder))[:, 0, 0, 0] * 255 / 128, [1, 0.5, 2], rtol=1e-6)
    maps = stage_of(tmp_path / "maps", pictures())
    (maps / "stage.json").write_text(
        json.dumps(table | {"lights": [light | {"file": f"{i}.exr"} for i, light in enumerate(table["lights"])]})
    )
    np.testing.assert_allclose(whole(read_stage(maps)), pictures() / np.reshape([1, 2, 0.5], (3, 1, 1, 1)), rtol=1e-6)
    del table["lights"][1]["exposure"]
    (folder / "stage.json").write_text(json.dumps(table))
    assert 'the light "1.png" has no "exposure"' in refusal(folder)


def test_the_exposures_that_cameras_wrote_divide_and_the_first_counts_as_one(tmp_path: Path) -> None:
    folder = stage_of(tmp_path, np.full((3, 4, 4, 3), 128, np.uint8), "png", encoding="linear")
    for index, seconds in enumerate((0.01, 0.02, 0.005)):
        photograph = Photograph(np.full((4, 4, 3), 128, np.uint8), exposure=Exposure(seconds, 4.0, 100.0))
        files.write(folder / f"{index}.png", photograph)
    np.testing.assert_allclose(whole(read_stage(folder))[:, 0, 0, 0] * 255 / 128, [1, 0.5, 2], rtol=1e-4)
    files.write(folder / "1.png", Photograph(np.full((4, 4, 3), 128, np.uint8)))
    assert "0.png and " in refusal(folder) and "only one has an exposure time" in refusal(folder)


def bracketed(folder: Path, exposures: bool = True) -> tuple[Path, np.ndarray]:
    """Two lights, each photographed at three exposures, of light that goes over four decades."""
    light = np.geomspace(0.002, 12, 2 * 64 * 3).reshape(2, 8, 8, 3)
    seconds, lights = [0.0625, 1.0, 16.0], []
    for index in range(2):
        names = []
        for place, time in enumerate(seconds):
            codes = np.clip(np.round(light[index] * time * 255), 0, 255).astype(np.uint8)
            names.append(f"{index}_{place}.png")
            files.write(folder / names[-1], Photograph(codes, names[-1]))
        lights.append({"file": names, "direction": DIRECTIONS[index]} | ({"exposure": seconds} if exposures else {}))
    (folder / "stage.json").write_text(json.dumps({"lights": lights, "encoding": "linear"}))
    return folder, light


def test_a_bracket_of_each_light_is_merged_on_one_scale(tmp_path: Path) -> None:
    folder, light = bracketed(tmp_path)
    np.testing.assert_allclose(whole(read_stage(folder)), light, rtol=0.06)


def test_a_bracket_of_another_colour_space_is_merged_by_its_own_curve(tmp_path: Path) -> None:
    gamma, codes = 2.19921875, np.array([170, 120, 60])
    for name, share in (("single", 1), ("whole", 1), ("half", 0.5)):
        values = np.full((8, 8, 3), np.round(codes * share ** (1 / gamma)), np.uint8)
        files.write(tmp_path / f"{name}.png", Photograph(values, name, profile=adobe_rgb()))
    lights = [
        {"file": "single.png", "direction": DIRECTIONS[0], "exposure": 1.0},
        {"file": ["half.png", "whole.png"], "direction": DIRECTIONS[1], "exposure": [0.5, 1.0]},
    ]
    (tmp_path / "stage.json").write_text(json.dumps({"lights": lights, "encoding": "srgb"}))
    single, bracket = whole(read_stage(tmp_path))
    wanted = (codes / 255) ** gamma @ between(ADOBE_RGB, REC709).T
    np.testing.assert_allclose(single[0, 0], wanted, rtol=2e-3)
    # By the curve of sRGB blue would be 9 % too bright.
    np.testing.assert_allclose(bracket[0, 0], wanted, rtol=0.02)


def test_a_bracket_whose_exposures_nobody_says_is_refused(tmp_path: Path) -> None:
    folder, _ = bracketed(tmp_path, exposures=False)
    assert "0_0.png: its exposure is not known" in refusal(folder)


def test_saturated_pixels_are_reported_once_and_marked(tmp_path: Path) -> None:
    values = np.full((3, 4, 4, 3), 90, np.uint8)
    values[1:, 2, 3] = 255
    field = read_stage(stage_of(tmp_path, values, "png"))
    assert isinstance(field, PictureFolder)
    with pytest.warns(UserWarning, match=r"1\.png: 1 pixels are saturated") as caught:
        whole(field)
        assert field.saturated(2).sum() == 1 and field.saturated(2)[2, 3] and not field.saturated(0).any()
    assert len(caught) == 1


def test_roundings_below_zero_are_nothing_and_reported_once(tmp_path: Path) -> None:
    values = pictures()
    values[:, 1, 2, 0] = -1e-4
    with pytest.warns(UserWarning, match=r"0\.exr: values down to -0.0001") as caught:
        read = whole(read_stage(stage_of(tmp_path, values)))
    assert len(caught) == 1
    np.testing.assert_array_equal(read, np.maximum(values, 0))


@pytest.mark.parametrize(
    ("value", "said"),
    [
        (-0.5, "1.exr: negative radiance, -0.5 at pixel (2, 3)"),
        (np.nan, "1.exr: pixel (2, 3) is no number"),
        (np.inf, "1.exr: pixel (2, 3) is no number"),
    ],
)
def test_impossible_light_is_refused_by_file_and_pixel(tmp_path: Path, value: float, said: str) -> None:
    values = pictures()
    values[1, 3, 2, 1] = value
    assert said in refusal(stage_of(tmp_path, values))


@pytest.mark.parametrize("ending", ["exr", "png"])
def test_a_frame_that_stayed_dark_is_named(tmp_path: Path, ending: str) -> None:
    values = pictures() if ending == "exr" else np.full((3, 5, 7, 3), 99, np.uint8)
    values[2] = 0 if ending == "exr" else 2
    assert f"2.{ending}: black all over" in refusal(stage_of(tmp_path, values, ending))


def test_two_sizes_are_refused(tmp_path: Path) -> None:
    folder = stage_of(tmp_path, pictures())
    files.write(folder / "1.exr", RadianceMap(pictures(1, (5, 8))[0]))
    assert "1.exr is 8×5 pixels, the first picture 7×5" in refusal(folder)


def test_missing_pictures_are_counted_and_strangers_reported(tmp_path: Path) -> None:
    folder = stage_of(tmp_path, pictures())
    files.write(folder / "mask.exr", RadianceMap(pictures(1)[0]))
    with pytest.warns(UserWarning, match=r"1 pictures beside those of the lights are named by none, such as mask\.exr"):
        read_stage(folder)
    (folder / "mask.exr").unlink()
    (folder / "1.exr").unlink()
    assert "1 of 3 pictures are missing, the first" in refusal(folder) and "1.exr" in refusal(folder)


def test_two_lights_in_one_direction_are_refused(tmp_path: Path) -> None:
    folder = stage_of(tmp_path, pictures())
    text = (folder / "stage.json").read_text().replace("[0, 0, 1]", "[0, 2, 0]")
    (folder / "stage.json").write_text(text)
    assert 'the lights "0.exr" and "1.exr" have one direction' in refusal(folder)


def test_an_lp_of_another_computer_finds_its_pictures(tmp_path: Path) -> None:
    values = pictures()
    folder = stage_of(tmp_path, values)
    (folder / "stage.json").unlink()
    lines = ["3", "D:\\rti\\0.EXR 0 1 0", "/home/me/1.exr 0 0 1", "2.exr 1 0 0"]
    (folder / "shots.lp").write_text("\r\n".join(lines))
    for path in (folder, folder / "shots.lp"):
        field = read_stage(path)
        np.testing.assert_array_equal(whole(field), values)
        np.testing.assert_allclose(field.lights.directions, DIRECTIONS[:3], atol=1e-12)
    (folder / "other.lp").write_text("1\n0.exr 0 1 0\n")
    assert "2 lists of lights, other.lp and shots.lp; name the one meant" in refusal(folder)


def test_a_folder_that_says_nothing_is_refused_with_what_to_add(tmp_path: Path) -> None:
    files.write(tmp_path / "a.exr", RadianceMap(pictures(1)[0]))
    said = refusal(tmp_path)
    assert "stage.json" in said and ".lp" in said and "mirrored ball" in said
    assert "no such folder" in refusal(tmp_path / "nowhere")
    assert "neither a stage file" in refusal(tmp_path / "a.exr")


def test_a_store_is_a_stage_too(tmp_path: Path) -> None:
    pytest.importorskip("zarr")
    from relume.lightstage.acquire.store_building import build_store

    values = pictures()
    build_store(read_stage(stage_of(tmp_path / "stage", values)), tmp_path / "store")
    np.testing.assert_allclose(whole(read_stage(tmp_path / "store")), values, rtol=1e-3)
    with pytest.raises(InvalidStage, match="a store holds the pictures of one camera"):
        read_stage(tmp_path / "store", "left")


def test_each_camera_has_its_own_pictures(tmp_path: Path) -> None:
    values = pictures(4)
    view = {"position": [0, 0, 4], "look_at": [0, 0, 0], "hfov_deg": 90}
    cameras = {"left": view, "right": view | {"position": [4, 0, 0]}}
    folder = stage_of(tmp_path, values)
    pairs = [{"left": "0.exr", "right": "1.exr"}, {"left": "2.exr", "right": "3.exr"}]
    lights = [{"files": pair, "direction": d} for pair, d in zip(pairs, DIRECTIONS, strict=False)]
    (folder / "stage.json").write_text(json.dumps({"lights": lights, "cameras": cameras}))
    first, right = read_stage(folder), read_stage(folder, "right")
    np.testing.assert_array_equal(whole(first), values[::2])
    np.testing.assert_array_equal(whole(right), values[1::2])
    assert right.camera is not None and right.camera.focal_length == pytest.approx(3.5)
    np.testing.assert_array_equal(right.camera.position, [4, 0, 0])
    with pytest.raises(InvalidStage, match='no pictures of a camera "top"; there are left, right'):
        read_stage(folder, "top")


def test_blocks_of_rows_do_not_read_all_pictures_each_time(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    values = pictures(4)
    folder = stage_of(tmp_path, values)
    source = folder / "stage.json"
    read: list[str] = []
    original = files.read_radiance

    def counted(path: Path) -> RadianceMap:
        read.append(Path(path).name)
        return original(path)

    size = values[0].nbytes
    for kept, times in ((10 * size, 4), (2 * size, 2 + 2 * 5), (0, 4 * 5)):
        field = open_pictures(read_stage_file(source), source, kept=kept)
        with monkeypatch.context() as patch:
            patch.setattr(files, "read_radiance", counted)
            read.clear()
            rows = [field.block(slice(0, 4), slice(row, row + 1)) for row in range(5)]
        np.testing.assert_array_equal(np.concatenate(rows, axis=1), values)
        assert len(read) == times


def test_the_head_is_read_as_it_lies() -> None:
    if not HEAD.is_dir():
        pytest.skip("the head's stage is not beside the repository")
    field = read_stage(HEAD)
    assert field.shape == (256, 256) and field.lights.grid == (12, 24)
    assert field.camera is not None
    assert field.camera.project(np.array([0, -0.12, 0])) == pytest.approx((128, 128))
    with pytest.warns(UserWarning, match="a rounding below 0"):
        block = field.block(slice(0, 2), slice(100, 140))
    assert block.shape == (2, 40, 256, 3) and block.min() >= 0 and 0.05 < block.max() < 20
