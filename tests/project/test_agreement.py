"""Plate and light on one scale, with one white, of one place: found from what both show, doubted where they differ."""

from __future__ import annotations

import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from relume.capture.brackets.result import MergedCamera
from relume.capture.exposure.bracket import Bracket
from relume.errors import GatheredDoubts, InvalidShot
from relume.image.photograph import Exposure, Photograph, Settings
from relume.image.radiance import SATURATED, RadianceMap
from relume.probe.ball.blending import Probe
from relume.project.insertion.agreement import on_one_scale, seen_by_both
from relume.project.insertion.photographs import Calibrated
from relume.project.insertion.place import bare_place
from relume.project.shot_file.shot import Shot
from relume.scene.cameras.camera import Camera
from relume.sphere.directions import UP
from relume.sphere.environment_map import EnvironmentMap
from relume.sphere.mappings.mapping import LatLong, pixel_directions
from toml_files import shot_of

PROBE, RADIUS = (0.2, 0.1, -0.3), 3.0
CAMERA = Camera.looking_at(np.array([0.0, 0.4, 1.5]), np.array([0.0, 0.2, -2.0]), width=128, height=96, focal_length=90)
GAINS = np.array([0.9, 0.6, 0.45])
SHOT = """
local = []
[plate]
photographs = "plate.jpg"
[camera]
pose = { position = [0.0, 0.4, 1.5], look_at = [0.0, 0.2, -2.0] }
[light]
map = "light.exr"
probe = [0.2, 0.1, -0.3]
distant = { shape = "dome", radius = 3.0 }
"""


def painted(seed: int = 3) -> EnvironmentMap:
    """Patches of light of other colours and brightness."""
    directions = pixel_directions(LatLong(), 128)
    spots = np.random.default_rng(seed).normal(size=(600, 3))
    spots /= np.linalg.norm(spots, axis=1, keepdims=True)
    generator = np.random.default_rng(seed + 1)
    colours = np.exp(generator.normal(0, 1.2, (600, 1)) + generator.normal(0, 0.3, (600, 3)))
    nearness = np.exp(120 * (directions @ spots.T - 1))
    return EnvironmentMap((nearness @ colours / nearness.sum(-1, keepdims=True)).astype(np.float32))


def seen_on_the_dome(light: EnvironmentMap, camera: Camera = CAMERA) -> np.ndarray:
    """What the camera sees of it: each ray ends on the dome, which the probe sees from where it stands."""
    rays, stood = camera.rays(), camera.position
    along = -(rays @ stood)
    ends = stood + (along + np.sqrt(along**2 - stood @ stood + RADIUS**2))[..., None] * rays
    towards = ends - np.array(PROBE)
    return light.lookup(towards / np.linalg.norm(towards, axis=-1, keepdims=True)).astype(np.float32)


def calibrated(plate: np.ndarray, light: EnvironmentMap, untied: str | None) -> Calibrated:
    clipped = np.zeros(plate.shape[:2], np.uint8)
    probe = Probe(light, (), 0.0, 0.0, np.ones(light.radiance.shape[:2], np.float32))
    return Calibrated(RadianceMap(plate.astype(np.float32), clipped=clipped), None, None, probe, {}, untied)


def heard(shot: Shot, given: Calibrated, camera: Camera = CAMERA) -> tuple[np.ndarray, list[str]]:
    """The factors on the light's channels, and what was warned of."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        found = on_one_scale(shot, given, camera)
    factors = np.median(found.probe.light.radiance / given.probe.light.radiance, axis=(0, 1))
    lines = [str(each.message) for each in caught]
    assert all("\n" not in line for line in lines)
    return factors, [line for line in lines if "no local surface" not in line]


@pytest.fixture
def shot(tmp_path: Path) -> Shot:
    return shot_of(tmp_path, SHOT)


def test_scale_and_white_are_those_that_make_plate_and_light_alike(shot: Shot) -> None:
    light = painted()
    factors, lines = heard(shot, calibrated(GAINS * seen_on_the_dome(light), light, "light.exr is a finished map"))
    assert factors == pytest.approx(GAINS, rel=0.01)
    assert len(lines) == 2
    assert lines[0].startswith("light: light.exr is a finished map, so no exposure gives its scale; it is made 0.65")
    assert "give light.scale" in lines[0] and "white is another than the light's (red +0.4" in lines[1]


def test_a_light_that_is_on_the_scale_is_left_to_the_bit(shot: Shot) -> None:
    light = painted()
    factors, lines = heard(shot, calibrated(1.2 * seen_on_the_dome(light), light, "light.exr is a finished map"))
    assert np.all(factors == 1) and len(lines) == 1 and "it is taken as it is, as plate and light" in lines[0]
    factors, lines = heard(shot, calibrated(1.2 * seen_on_the_dome(light), light, None))
    assert np.all(factors == 1) and lines == []


def test_a_scale_by_exposures_that_the_plate_contradicts_is_kept_and_doubted(shot: Shot) -> None:
    light = painted()
    factors, (line,) = heard(shot, calibrated(seen_on_the_dome(light) / 8, light, None))
    file = shot.path("light.exr")
    assert np.all(factors == 1) and line.startswith(
        f"light: the plate shows the same places 8 times as dark as {file}; are both on one scale"
    )


def test_the_scale_of_the_shot_file_counts(tmp_path: Path) -> None:
    light = painted()
    shot = shot_of(tmp_path, SHOT + "scale = 2.5\n")
    factors, lines = heard(shot, calibrated(seen_on_the_dome(light), light, "light.exr is a finished map"))
    assert factors == pytest.approx(2.5) and lines == []


def test_a_light_of_another_place_is_doubted(shot: Shot) -> None:
    for other in (painted(seed=11), painted().rotated(np.diag([-1.0, 1.0, -1.0]))):
        _, lines = heard(shot, calibrated(seen_on_the_dome(painted()), other, None))
        assert any("of another place or time, or is its frame turned" in line for line in lines), lines


DOWN = Camera.looking_at(np.array([0.0, 2.0, 0.5]), np.zeros(3), width=128, height=96, focal_length=90)
TABLE = SHOT.replace("local = []\n", "") + "\n[[local]]\nshape = 'plane'\nsize = [20, 20]\n"
UNTIED = "P.jpg holds no exposure"


@pytest.mark.parametrize(("dark", "light", "white"), [(0.4, 0.4, 0.4), (0.1, 0.9, 0.3), (0.8, 0.8, 0.8)])
def test_without_anything_in_common_the_plate_reflects_what_usual_places_do(
    tmp_path: Path, dark: float, light: float, white: float
) -> None:
    """Of a table of `dark`, and something of `light` on it: known within a factor of two, whatever the two are."""
    even = EnvironmentMap(np.full((64, 128, 3), 50.0, np.float32))
    plate = np.full((96, 128, 3), 7 * 50 * dark)
    plate[:, ::4] *= np.exp(np.linspace(-1, 0, 32))[None, :, None]  # of no map: a pattern
    plate[:20, :40] = 7 * 50 * light
    factors, lines = heard(shot_of(tmp_path, TABLE), calibrated(plate, even, UNTIED), DOWN)
    assert 3.5 <= factors[1] <= 14.1
    (line,) = [each for each in lines if "no exposure gives its scale" in each]
    assert "a guess" in line and "give light.surface_reflectance, the share of light" in line
    assert f"light.scale: {factors[1] / 2:.3g} makes the objects half as bright" in line


def test_a_guessed_scale_is_a_doubt_that_stops_and_a_reflectance_for_it_none(tmp_path: Path) -> None:
    even = EnvironmentMap(np.full((64, 128, 3), 50.0, np.float32))
    plate = np.exp(np.linspace(-6, -2, 128))[None, :, None] * np.ones((96, 128, 3))
    given = calibrated(plate, even, UNTIED)
    with GatheredDoubts() as gathered:
        on_one_scale(shot_of(tmp_path, TABLE), given, DOWN)
    (doubt,) = [each for each in gathered.doubts if "a guess" in each.line]
    assert doubt.wrong
    # Literals: the median and the 97th percentile of the plate are e⁻⁴ and e⁻²·¹², and √(L₁ L₂) is 0.4 E/π.
    factors, _ = heard(shot_of(tmp_path, TABLE), given, DOWN)
    assert factors == pytest.approx(np.exp((-4 - 2.12) / 2) / (0.4 * 50), rel=0.03)
    known = TABLE.replace('map = "light.exr"', 'map = "light.exr"\nsurface_reflectance = 0.6')
    for untied in (UNTIED, None):
        factors, lines = heard(shot_of(tmp_path, known), replace(given, untied=untied), DOWN)
        assert factors == pytest.approx(np.exp(-4) / (0.6 * 50), rel=0.01)
        assert any("by light.surface_reflectance 0.6: give light.scale if" in each for each in lines) is bool(untied)
    up = Camera.looking_at(np.array([0.0, 1.0, 0.5]), np.array([0, 3.0, 0]), width=128, height=96, focal_length=90)
    with pytest.raises(InvalidShot, match=r"^light\.surface_reflectance: the plate hardly shows a real surface"):
        heard(shot_of(tmp_path, known), given, up)
    with pytest.raises(InvalidShot, match="scale and surface_reflectance both say how bright"):
        shot_of(tmp_path, known.replace("surface_", "scale = 2\nsurface_"))


def test_whites_of_the_plate_say_that_a_table_is_dark_or_white(tmp_path: Path) -> None:
    """One table twice, beside paper as bright as it and eight times as bright: its light is brighter then."""
    even = EnvironmentMap(np.full((64, 128, 3), 50.0, np.float32))
    found = []
    for times in (1, 8):
        plate = np.full((96, 128, 3), 900.0)
        plate[:24] *= times
        marks = np.zeros((96, 128), np.uint8)
        marks[:24] = SATURATED  # what is white in the photograph counts as that
        given = replace(calibrated(plate, even, UNTIED), plate=RadianceMap(plate.astype(np.float32), clipped=marks))
        found.append(heard(shot_of(tmp_path, TABLE), given, DOWN)[0][1])
    assert found == pytest.approx([45, 45 * np.sqrt(8)], rel=1e-3)


def test_a_little_likeness_that_contradicts_usual_places_is_not_believed(shot: Shot) -> None:
    """The map has a lamp overhead that makes all of it far too bright for what the plate shows."""
    light = painted()
    above = pixel_directions(LatLong(), 128)[..., 1:2] > 0.95
    other = seen_on_the_dome(painted(seed=11))
    for likeness, lamp, believed in ((0.3, 0, True), (0.3, 500, False), (1.0, 500, True)):
        lit = replace(light, radiance=(light.radiance + lamp * above).astype(np.float32))
        mixed = seen_on_the_dome(light) ** likeness * other ** (0.6 if likeness < 1 else 0.0)
        _, lines = heard(shot, calibrated(mixed, lit, "light.exr is a finished map"))
        assert ("show the same places alike" in lines[0]) is believed, lines


def test_a_reflectance_that_is_given_gives_the_scale(tmp_path: Path) -> None:
    light = painted()
    table = (
        SHOT.replace("local = []\n", "")
        + "\n[[local]]\nshape = 'plane'\nsize = [20, 20]\nreflectance = [0.4, 0.4, 0.4]"
    )
    down = Camera.looking_at(np.array([0.0, 2.0, 0.5]), np.zeros(3), width=128, height=96, focal_length=90)
    luminances = np.array([0.2126, 0.7152, 0.0722])
    arriving = float(light.irradiance(UP) @ luminances)
    plate = np.full((96, 128, 3), 7 * 0.4 * arriving / np.pi)
    factors, (line,) = heard(shot_of(tmp_path, table), calibrated(plate, light, "P.jpg holds no exposure"), down)
    assert factors == pytest.approx(7, rel=1e-4) and "by the reflectance given" in line


def test_what_was_not_measured_is_not_compared(shot: Shot) -> None:
    light = painted()
    given = calibrated(seen_on_the_dome(light), light, None)
    spoilt = given.plate.radiance.copy()
    spoilt[:48] *= 100
    marks = np.zeros(spoilt.shape[:2], np.uint8)
    marks[:48] = SATURATED
    with pytest.warns(UserWarning, match="no local surface"):
        place = bare_place(shot, given.probe)
    plate = RadianceMap(spoilt, clipped=marks)
    seen = seen_by_both(replace(given, plate=plate), CAMERA, place)
    assert seen is not None and seen.scale == pytest.approx(1, rel=0.01) and seen.share == pytest.approx(0.5)
    marks[:] = SATURATED
    assert seen_by_both(replace(given, plate=plate), CAMERA, place) is None


BALL = SHOT.replace(
    'map = "light.exr"\nprobe = [0.2, 0.1, -0.3]',
    'balls = [ { photographs = "b.jpg", camera = [0.2, 0.1, 1] } ]\n'
    "ball = { centre = [0.2, 0.1, -0.3], radius = 0.05 }",
)


def test_light_that_the_ball_took_is_named(tmp_path: Path) -> None:
    """A ball of chrome whose reflectance was not given: the plate shows all 1/0.8 times as bright."""
    light = painted()
    dark = replace(light, radiance=np.float32(0.8) * light.radiance)
    factors, lines = heard(shot_of(tmp_path, BALL), calibrated(seen_on_the_dome(light), dark, None))
    assert np.all(factors == 1) and len(lines) == 1
    assert "1.25 times as bright as the ball does; a ball that reflects 0.80 of the light would" in lines[0]


def test_a_fixed_white_balance_of_one_camera_is_left(tmp_path: Path) -> None:
    light, seen = painted(), seen_on_the_dome(painted())
    given = calibrated(seen * [1.2, 1, 0.9], light, None)
    for automatic, changed in ((True, True), (None, True), (False, False)):
        settings = Settings(automatic_white=automatic)
        shown = Photograph(np.zeros((96, 128, 3), np.uint8), exposure=Exposure(1.0), settings=settings)
        one = replace(given, bracket=Bracket((shown,)), cameras={"": MergedCamera("", None)})
        factors, _ = heard(shot_of(tmp_path, BALL), one)
        assert bool(np.any(factors != 1)) is changed
    # Its colour changes, not its brightness.
    assert heard(shot_of(tmp_path, BALL), given)[0] @ [0.2126, 0.7152, 0.0722] == pytest.approx(1, abs=0.01)


def test_a_white_that_differs_from_place_to_place_is_left(shot: Shot) -> None:
    """Behind a ball the light is smeared: on a real desk a lamp over a cream wall made the light 0.8 stops redder."""
    light, seen = painted(), seen_on_the_dome(painted())
    for scatter, changed in ((0.1, True), (0.5, False)):
        hues = np.random.default_rng(2).normal([0.15, 0, -0.15], scatter, (12, 16, 3))
        plate = seen * np.exp(np.repeat(np.repeat(hues, 8, 0), 8, 1))
        factors, lines = heard(shot, calibrated(plate, light, None))
        (line,) = lines
        assert bool(np.any(factors != 1)) is changed and ("it is given the plate's" in line) is changed
        assert changed or ("stops from place to place, so it is left as it is" in line)
        if changed:
            assert factors / factors[1] == pytest.approx(np.exp([0.15, 0, -0.15]), rel=0.05)


def test_what_the_table_hides_from_the_ball_is_not_compared(tmp_path: Path) -> None:
    """The dome below the table's edge shines in another colour, and the ball sees the table instead."""
    light = painted()
    below = pixel_directions(LatLong(), 128)[..., 1] < 0
    light = replace(light, radiance=np.where(below[..., None], [9.0, 0.1, 0.1], light.radiance).astype(np.float32))
    camera = Camera.looking_at(CAMERA.position, np.array([0, -0.9, -2.0]), width=128, height=96, focal_length=90)
    table = SHOT.replace("local = []\n", "") + "\n[[local]]\nshape = 'plane'\nsize = [1.5, 1.5]\nheight = 0.05\n"
    given = calibrated(seen_on_the_dome(painted(), camera), light, None)
    seen = seen_by_both(given, camera, bare_place(shot_of(tmp_path, table), given.probe))
    assert seen is not None and seen.distant and seen.ratio == pytest.approx([1, 1, 1], rel=0.02)


def test_a_surface_that_reflects_nothing_gives_no_scale(tmp_path: Path) -> None:
    black = "\n[[local]]\nshape = 'plane'\nsize = [20, 20]\nreflectance = [0, 0, 0]"
    down = Camera.looking_at(np.array([0.0, 2.0, 0.5]), np.zeros(3), width=128, height=96, focal_length=90)
    plate = np.full((96, 128, 3), 0.02)
    given = calibrated(plate, painted(), "P.jpg holds no exposure")
    _, lines = heard(shot_of(tmp_path, SHOT.replace("local = []\n", "") + black), given, down)
    assert lines and not any("by the reflectance given" in line for line in lines)
