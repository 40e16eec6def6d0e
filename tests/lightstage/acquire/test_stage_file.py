"""What a stage file says, and what is refused of it."""

import json
from pathlib import Path

import numpy as np
import pytest

from relume.errors import InvalidStage
from relume.lightstage.acquire.stage_file import TargetCard
from relume.lightstage.acquire.stage_file_reading import read_stage_file

HEAD = Path(__file__).resolve().parents[4] / "shared" / "stages" / "head" / "stage.json"
THREE = [
    {"file": "a.exr", "direction": [0, 2, 0]},
    {"file": "b.exr", "position": [0, 0, 3], "irradiance": [1, 2, 4]},
    {"file": "c.exr", "inclination": np.pi / 2, "azimuth": np.pi / 2},
]


def written(folder: Path, table: object) -> Path:
    path = folder / "stage.json"
    path.write_text(json.dumps(table), "utf-8")
    return path


def refused(folder: Path, table: object) -> str:
    with pytest.raises(InvalidStage) as caught:
        read_stage_file(written(folder, table))
    assert "\n" not in str(caught.value)
    return str(caught.value)


def test_a_light_is_given_by_direction_position_or_two_angles(tmp_path: Path) -> None:
    stage = read_stage_file(written(tmp_path, {"lights": THREE}))
    np.testing.assert_allclose(stage.stage_lights().directions, [[0, 1, 0], [0, 0, 1], [1, 0, 0]], atol=1e-15)
    assert [entry.irradiance for entry in stage.lights] == [(1, 1, 1), (1, 2, 4), (1, 1, 1)]
    assert stage.stage_lights().names == ("a.exr", "b.exr", "c.exr")


def test_a_position_is_seen_from_the_subject(tmp_path: Path) -> None:
    lights = [{"file": f"{i}.png", "position": [i, 1, 0]} for i in range(3)]
    stage = read_stage_file(written(tmp_path, {"lights": lights, "subject": [1, 0, 0]})).stage_lights()
    np.testing.assert_allclose(stage.directions[1], [0, 1, 0], atol=1e-15)
    assert stage.positions is not None
    np.testing.assert_array_equal(stage.positions[2], [2, 1, 0])


def test_the_two_angles_of_the_head_are_its_directions(tmp_path: Path) -> None:
    if not HEAD.is_file():
        pytest.skip("the head's stage is not beside the repository")
    said = json.loads(HEAD.read_text())
    by_direction = read_stage_file(HEAD).stage_lights()
    for light in said["lights"]:
        del light["direction"]
    by_angles = read_stage_file(written(tmp_path, said)).stage_lights()
    np.testing.assert_allclose(by_angles.directions, by_direction.directions, atol=1e-9)


def test_the_head_s_file_is_read_as_it_is() -> None:
    if not HEAD.is_file():
        pytest.skip("the head's stage is not beside the repository")
    stage = read_stage_file(HEAD)
    lights = stage.stage_lights()
    assert len(lights) == 288 and lights.grid == (12, 24)
    assert list(stage.cameras) == ["front", "right"]
    assert stage.angular_diameter == pytest.approx(np.radians(2))
    assert lights.solid_angles.sum() == pytest.approx(4 * np.pi, rel=1e-12)
    assert lights.solid_angles[0] == pytest.approx(0.008920597817283786, rel=1e-6)
    assert stage.cameras["front"].camera(256, 256).focal_length == pytest.approx(128 / np.tan(np.radians(14)))
    assert set(stage.others) == {"frame", "truth_points", "backdrop"}


def test_all_that_a_stage_may_say_is_read(tmp_path: Path) -> None:
    first = [{"files": {"left": ["a1.png", "a2.png"], "right": "a.exr"}, "direction": [0, 1, 0], "name": "top"}]
    rest = [
        {"files": {"left": f"{i}l.png", "right": f"{i}r.png"}, "direction": [i, 0, 1], "exposure": 0.5} for i in (1, 2)
    ]
    table = {
        "lights": first + rest,
        "cameras": {n: {"position": [1, 2, 3], "look_at": [0, 0, 0], "hfov_deg": 30} for n in ("left", "right")},
        "light": {"irradiance_at_normal_incidence": 3, "angular_diameter_deg": 2},
        "encoding": "linear",
        "subject": [0, 1, 0],
        "target": {"rectangle": [1, 2, 3, 4], "reflectance": 0.18},
        "note": "mine",
    }
    stage = read_stage_file(written(tmp_path, table))
    assert stage.lights[0].irradiance == (3, 3, 3)
    assert stage.lights[0].files["left"] == ("a1.png", "a2.png")
    assert stage.cameras["left"].field_of_view == pytest.approx(np.radians(30))
    assert stage.target == TargetCard((1, 2, 3, 4), 0.18) and stage.others == {"note": "mine"}
    assert (stage.lights[1].exposure, stage.encoding, stage.subject) == ((0.5,), "linear", (0, 1, 0))


def test_given_cells_that_do_not_fill_the_sphere_are_not_believed(tmp_path: Path) -> None:
    lights = [dict(light, solid_angle=1.0) for light in THREE]
    assert read_stage_file(written(tmp_path, {"lights": lights})).stage_lights().solid_angles.sum() == pytest.approx(
        4 * np.pi
    )


def test_a_grid_out_of_order_is_no_grid(tmp_path: Path) -> None:
    lights = [{"file": f"{i}", "direction": d} for i, d in enumerate([[1, -1, 0], [-1, -1, 0], [1, 1, 0], [-1, 1, 0]])]
    table = {"lights": lights, "grid": {"inclination": 2, "azimuth": 2}}
    assert read_stage_file(written(tmp_path, table)).stage_lights().grid is None
    assert read_stage_file(written(tmp_path, table | {"lights": lights[::-1]})).stage_lights().grid == (2, 2)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"directoin": [0, 0, 1]}, 'unknown key "directoin"; did you mean direction?'),
        ({"direction": None}, "expected three numbers"),
        ({"direction": [0, 0, 0]}, "has no length"),
        ({"direction": [0, 0, float("nan")]}, "expected a finite number"),
        ({"position": [0, 0, 1]}, 'both "direction" and "position"'),
        ({"files": {"a": "x"}}, 'both "file" and "files"'),
        ({"irradiance": 0}, "above 0"),
        ({"exposure": [1, 2]}, "2 exposures"),
        ({"file": "../secret.exr"}, "not inside the stage's folder"),
        ({"file": "b.exr"}, "two lights are called"),
    ],
)
def test_a_wrong_light_is_named(tmp_path: Path, change: dict[str, object], said: str) -> None:
    text = refused(tmp_path, {"lights": [THREE[0] | change, *THREE[1:]]})
    assert said in text and ("lights[0]" in text or "b.exr" in text)


VIEW = {"position": [0, 0, 1], "look_at": [0, 0, 0], "hfov_deg": 30}


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (
            {"light": {"irradiance": 10}},
            'light: unknown key "irradiance"; did you mean irradiance_at_normal_incidence?',
        ),
        ({"light": {"diameter": 2}}, 'light: unknown key "diameter"'),
        ({"grid": {"inclination": 1, "azimuth": 3, "azimut": 3}}, 'grid: unknown key "azimut"; did you mean azimuth?'),
        ({"camera_front": VIEW | {"fov": 30}}, 'camera front: unknown key "fov"; expected position, look_at, hfov_deg'),
        ({"cameras": {"left": VIEW | {"hfov": 3}}}, 'camera left: unknown key "hfov"; did you mean hfov_deg?'),
        ({"encodng": "linear"}, 'unknown key "encodng"; did you mean encoding?'),
        ({"camra_front": VIEW}, 'unknown key "camra_front"; did you mean camera_front?'),
        ({"camera": VIEW}, 'unknown key "camera"; did you mean cameras?'),
        ({"Target": {}}, 'unknown key "Target"; did you mean target?'),
        ({"gird": {}}, 'unknown key "gird"; did you mean grid?'),
        ({"mehs": "a.obj"}, 'unknown key "mehs"; did you mean mesh?'),
        # What is no stage.
        ({"lights": []}, 'has no "lights"'),
        ({"lights": [THREE[0], {"file": "d.png"}]}, "lights[1] (d.png): no direction"),
        (
            {"lights": [THREE[0] | {"name": "top"}, *THREE[1:], {"file": "a.exr", "position": [1, 1, 1]}]},
            'a.exr is the picture of two lights, "top" and "a.exr"',
        ),
        ({"grid": {"inclination": 2, "azimuth": 2}}, "a grid of 2 × 2 lights, but it lists 3"),
        ({"camera_x": {"position": [0, 0, 1], "look_at": [0, 0, 0]}}, 'no "hfov_deg"'),
        ({"target": {"rectangle": [0, 0, 1, 1], "reflectance": 2}}, "at most 1"),
    ],
)
def test_a_misspelt_key_or_a_wrong_stage_is_refused(tmp_path: Path, change: dict[str, object], said: str) -> None:
    assert said in refused(tmp_path, {"lights": THREE} | change)


def test_keys_of_other_programs_are_kept(tmp_path: Path) -> None:
    others = {"frame": "+Y up", "truth_points": [], "backdrop": {}, "object": "cat", "note": 1, "mesh": "a.obj"}
    assert read_stage_file(written(tmp_path, {"lights": THREE} | others)).others == others


def test_what_is_no_table_is_refused(tmp_path: Path) -> None:
    assert "expected a table" in refused(tmp_path, [])
    (tmp_path / "stage.json").write_text('{"lights": [}')
    with pytest.raises(InvalidStage, match="line 1 column 13"):
        read_stage_file(tmp_path / "stage.json")
