"""`relume sky`: a map in cd/m² by place and time, the parts of it, and what is refused."""

from pathlib import Path

import numpy as np
import pytest

from command_line import refused, reported
from relume.sphere.environment_files import read_environment

BERLIN = ["--latitude", "52.5", "--longitude", "13.4"]
NOON = ["--date", "2026-06-21T13:06+02:00"]


def test_a_place_and_a_time_make_a_map_in_candelas(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    out = tmp_path / "sky.exr"
    facts = reported(["sky", *BERLIN, *NOON, "--size", "32", "-o", out], capsys)
    assert facts["sun elevation"] == pytest.approx(60.94, abs=0.05)
    light = read_environment(out)
    assert light.unit == "cd/m²"
    assert light.attributes["sky"].startswith("Hosek-Wilkie")
    level = light.irradiance(np.array([0.0, 1.0, 0.0]))
    given = facts["sun on level ground, lux"] + facts["sky on level ground, lux"]
    assert level @ [0.2126, 0.7152, 0.0722] == pytest.approx(given, rel=0.02)


def test_sky_and_sun_can_be_had_apart(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    totals = []
    for word in ([], ["--only", "sky"], ["--only", "sun"]):
        out = tmp_path / "part.exr"
        reported(["sky", "--sun", "40,90", "--size", "32", "--ground", "0.3,0.2,0.1", *word, "-o", out], capsys)
        totals.append(read_environment(out).total())
    np.testing.assert_allclose(totals[0], totals[1] + totals[2], rtol=1e-5)


def test_a_heading_puts_the_sun_ahead(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    words = ["sky", "--sun", "10,200", "--heading", "200", "--to", "angular", "--size", "16"]
    facts = reported([*words, "-o", tmp_path / "a.exr"], capsys)
    np.testing.assert_allclose(facts["sun direction"], [0, 0.17365, -0.98481], atol=1e-5)
    assert read_environment(tmp_path / "a.exr").mapping.name == "angular"


def test_a_dry_run_writes_nothing(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    facts = reported(["sky", "--sun", "10", "--dry-run", "-o", tmp_path / "a.exr"], capsys)
    assert facts["would write"] == str(tmp_path / "a.exr")
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("words", "part"),
    [
        ([*BERLIN, "--date", "2026-06-21T01:00+02:00"], "below the horizon"),
        ([*BERLIN, "--date", "2026-06-21T13:00"], "no offset from UTC"),
        ([*BERLIN, "--date", "noon"], "no date and time"),
        (BERLIN, "give --latitude, --longitude and --date"),
        ([*BERLIN, "--sun", "30"], "leave --latitude"),
        (["--sun", "-3"], "above 0 to 90"),
        (["--sun", "30", "--turbidity", "12"], "turbidity is 12"),
        (["--sun", "30", "--size", "0"], "0 rows"),
        (["--sun", "30", "--to", "map"], 'no mapping "map"'),
    ],
)
def test_what_cannot_be_is_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str], words: list[str], part: str):
    assert part in refused(["sky", *words, "-o", tmp_path / "a.exr"], capsys)
    assert not list(tmp_path.iterdir())
