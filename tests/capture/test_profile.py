"""Camera profiles are written and read back whole, and other programs' curves are understood."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from relume.capture.raw.sensor import Sensor, SensorNoise
from relume.capture.response.calibration import recover_response
from relume.capture.response.camera_profile import CameraProfile, profile_of, read_profile, write_profile
from relume.image.response import Response
from synthetic import NOISY, wide_scene

HDRGEN = """3 1.43595 -0.797421 0.366855 -0.00538145
3 1.36782 -0.747398 0.38487 -0.00529511
3 1.50535 -0.976516 0.471376 -0.000206902
"""
"""What hdrgen writes: the order and the coefficients from the highest, red, green and blue."""


SENSOR = Sensor((512.0, 513.0, 514.0, 515.0), 16383.0, 0.875, SensorNoise(5e-5, 2e-4, 200.0))


def curves(path: Path) -> np.ndarray:
    response = read_profile(path).response
    assert response is not None
    return response.log_exposure


def power(exponent: float) -> np.ndarray:
    return (np.arange(256) / 255) ** exponent


def matrix(name: str, exposure: np.ndarray) -> str:
    """What pfshdrcalibrate writes of one channel."""
    rows = [f" {np.log10(x) if x > 0 else -6:e} {m:4d} {x:e}" for m, x in enumerate(exposure)]
    head = [f"# Camera response curve, channel {name}", "# data layout: log10(response) | camera output | response"]
    return "\n".join(
        [*head, f"# name: {name}", "# type: matrix", f"# rows: {len(rows)}", "# columns: 3", *rows, "", ""]
    )


def test_a_profile_is_read_back_as_it_was_written(tmp_path):
    calibration = recover_response(NOISY.bracket(wide_scene(96, 64)))
    made = profile_of(calibration, "Maker One", brackets=1)
    profile = replace(made, vignetting={"radial": [1, 2]}, scale=179.0, balance=(1.1, 1.0, 0.9))
    write_profile(tmp_path / "one.json", profile)
    again = read_profile(tmp_path / "one.json")
    assert again.response is not None and profile.response is not None
    np.testing.assert_array_equal(again.response.log_exposure, profile.response.log_exposure)
    np.testing.assert_array_equal(again.response.noise, profile.response.noise)
    assert vars(replace(again, response=profile.response)) == vars(profile)
    assert again.camera == "Maker One" and again.pixels == calibration.pixels.max() and again.shot is not None


def test_a_profile_of_raws_holds_a_sensor_and_no_response(tmp_path):
    path = tmp_path / "raw.json"
    profile = CameraProfile("Maker One", sensor=SENSOR, scale=179.0, scale_deviation=0.05, balance=(1.1, 1.0, 0.9))
    write_profile(path, profile)
    table = json.loads(path.read_text())
    assert table["sensor"] == {
        "black": [512, 513, 514, 515], "white": 16383, "saturation": 0.875,
        "noise": {"shot": 5e-5, "read": 2e-4, "iso": 200},
    }  # fmt: skip
    assert table["version"] == 1 and "log_exposure" not in table
    assert vars(read_profile(path)) == vars(profile)
    silent = replace(profile, sensor=replace(SENSOR, noise=None))
    write_profile(path, silent)
    assert vars(read_profile(path)) == vars(silent)


def test_a_profile_of_before_there_were_sensors_is_read(tmp_path):
    path = tmp_path / "old.json"
    curve = np.log(np.arange(1, 257) / 128).tolist()
    old = {"relume": "camera profile", "version": 1, "camera": "Maker One", "log_exposure": [curve] * 3}
    path.write_text(json.dumps(old | {"noise": [0.7] * 3, "black": None, "white": None, "scale": 7.0}))
    profile = read_profile(path)
    assert profile.response is not None and profile.sensor is None and profile.scale == 7.0
    assert profile.response.log_exposure[1].tolist() == curve and profile.balance == (1.0, 1.0, 1.0)


def test_a_profile_is_of_photographs_or_of_raws():
    response = Response(np.log(np.arange(1, 257)) * np.ones((3, 1)), np.ones(3))
    for halves in ({}, {"response": response, "sensor": SENSOR}):
        with pytest.raises(ValueError, match="or the sensor of raws, and not both"):
            CameraProfile("x", **halves)


@pytest.mark.parametrize(
    "fields",
    [
        {"black": (512.0,) * 3}, {"black": (1.0, 2.0, 3.0, np.nan)}, {"black": (512.0, 512.0, 512.0, 16383.0)},
        {"white": np.inf}, {"saturation": 0.0}, {"saturation": 1.01},
    ],
)  # fmt: skip
def test_wrong_sensors_are_refused(fields):
    with pytest.raises(ValueError, match="expected"):
        replace(SENSOR, **fields)


def test_sensors_differ_by_more_than_a_thousandth_of_their_range():
    # The range is 15 871 levels.
    for fields, differs in (
        ({"white": 16383.0 + 15}, False),
        ({"white": 16383.0 + 17}, True),
        ({"black": (512.0, 513.0, 514.0, 515.0 + 15)}, False),
        ({"black": (512.0, 513.0, 514.0, 515.0 - 17)}, True),
        ({"saturation": 0.5, "noise": None}, False),
    ):
        assert SENSOR.differs(replace(SENSOR, **fields)) is differs


def test_the_response_that_relume_wrote_before_is_a_profile(tmp_path):
    response = Response(np.log(np.arange(1, 257) / 128) * np.ones((3, 1)), np.full(3, 0.7))
    (tmp_path / "response.json").write_text(response.to_json())
    profile = read_profile(tmp_path / "response.json")
    assert profile.response is not None
    np.testing.assert_array_equal(profile.response.log_exposure, response.log_exposure)
    assert profile.camera == "" and profile.scale is None


def test_hdrgen_s_polynomials(tmp_path):
    (tmp_path / "camera.rsp").write_text(HDRGEN)
    g = curves(tmp_path / "camera.rsp")
    v = np.array([128, 255]) / 255
    red = 1.43595 * v**3 - 0.797421 * v**2 + 0.366855 * v - 0.00538145
    assert g[0, 255] - g[0, 128] == pytest.approx(np.log(red[1] / red[0]))
    assert g[0, 255] - g[0, 128] == pytest.approx(1.8360, abs=1e-4)
    assert np.all(np.diff(g, axis=1) > 0) and np.all(g[:, 127] == 0)


def test_pfstools_matrices_of_three_channels_and_of_one(tmp_path):
    three = "".join(matrix(n, power(e)) for n, e in zip(("IR", "IG", "IB"), (2.0, 2.2, 2.4), strict=True))
    (tmp_path / "three.m").write_text(three)
    g = curves(tmp_path / "three.m")
    for channel, exponent in enumerate((2.0, 2.2, 2.4)):
        np.testing.assert_allclose(g[channel, 1:], exponent * np.log(np.arange(1, 256) / 127), atol=1e-5)
    (tmp_path / "one.m").write_text(matrix("IY", power(2.0)))
    np.testing.assert_allclose(curves(tmp_path / "one.m")[2], g[0], atol=1e-12)


def test_luminance_hdr_s_seven_columns(tmp_path):
    rows = [
        f" {m:4d} " + " ".join(f"{np.log10(x) if x > 0 else -6:15.9f} {x:15.9f}" for x in (r, gr, b))
        for m, (r, gr, b) in enumerate(zip(power(2.0), power(2.2), power(1.8), strict=True))
    ]
    text = "\n".join(["# Camera response curve", "# type: matrix", "# rows: 256", "# columns: 7", *rows, ""])
    (tmp_path / "l.m").write_text(text)
    g = curves(tmp_path / "l.m")
    assert g[:, 254] - g[:, 127] == pytest.approx(np.array([2.0, 2.2, 1.8]) * np.log(2), abs=1e-6)


@pytest.mark.parametrize("columns", ["one", "three", "value and three"])
def test_tables(tmp_path, columns):
    table = {
        "one": power(2.0)[:, None],
        "three": np.stack([power(2.0)] * 3, 1),
        "value and three": np.column_stack([np.arange(256), *[power(2.0)] * 3]),
    }[columns]
    text = "# exposure\n" + "\n".join(",".join(f"{x:.9g}" for x in row) for row in table)
    (tmp_path / "t.csv").write_text(text)
    g = curves(tmp_path / "t.csv")
    np.testing.assert_allclose(g[1, 1:], 2 * np.log(np.arange(1, 256) / 127), atol=1e-5)


@pytest.mark.parametrize(
    "text, word",
    [
        ("no curve at all", "not a response curve"),
        ("{", "not a camera profile"),
        ('{"relume": "shot", "version": 1}', "not a camera profile"),
        ('{"relume": "camera profile", "version": 1, "camera": "x"}', "log_exposure"),
        ('{"relume": "camera profile", "version": 1, "camera": "x", "sensor": {"black": [1, 2]}}', "not a sensor"),
        ('{"relume": "camera profile", "version": 1, "camera": "x", "sensor": 3}', "not a sensor"),
        ('{"relume": "camera profile", "version": 2, "camera": "x"}', "update relume"),
        ("1 2 3\n4 5 6\n", "2 rows of 3 numbers"),
        ("\n".join(str(255 - i) for i in range(256)), "a response rises"),
        ("\n".join("0" for _ in range(256)), "not positive"),
        (matrix("IR", power(2.0)) + matrix("IG", power(2.0)), "2 curves; expected one"),
        (matrix("IR", power(2.0)).replace("columns: 3", "columns: 4"), "damaged"),
    ],
)
def test_other_files_are_refused_in_one_line(tmp_path, text, word):
    (tmp_path / "wrong.txt").write_text(text)
    with pytest.raises(ValueError, match=r"wrong\.txt") as caught:
        read_profile(tmp_path / "wrong.txt")
    assert word in str(caught.value) and "\n" not in str(caught.value)


def test_a_missing_file_and_wrong_numbers_are_refused(tmp_path):
    with pytest.raises(ValueError, match=r"none\.json: no camera profile"):
        read_profile(tmp_path / "none.json")
    response = Response(np.log(np.arange(1, 257)) * np.ones((3, 1)), np.ones(3))
    with pytest.raises(ValueError, match="scale is -1"):
        CameraProfile("x", response, scale=-1.0)
    with pytest.raises(ValueError, match="balance"):
        CameraProfile("x", response, balance=(1.0, 0.0, 1.0))
