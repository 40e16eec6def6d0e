"""A film's curve: that of a profile with its colour balance, and how far off what is found by an assumed one is."""

from __future__ import annotations

import warnings
from dataclasses import replace

import cv2
import numpy as np
import pytest

pytest.importorskip("av")

from probe_films import LAMPS, place_light, truth, write_video
from relume.capture.exposure.bracket import Bracket
from relume.capture.merging import merge
from relume.capture.response.camera_profile import CameraProfile
from relume.capture.scale.readings import ChannelGains, apply_balance
from relume.image.files import read_radiance
from relume.image.photograph import Exposure, Photograph
from relume.image.response import Response, srgb_response
from relume.probe.video.calibrating import SphericalFilm
from relume.probe.video.filming import FilmSettings, probe_film
from relume.probe.video.light_tables import LightTables
from relume.sphere.mappings.mapping import LatLong, pixel_directions

ROWS = 64
VALUES = (0, 1, 10, 20, 40, 60, 80, 110, 140, 170, 200, 230, 245, 255)
# ln exposure over white of the values above, green, recovered from brackets of three cameras' JPEGs.
CAMERAS = {
    "EOS 350D": (-8.0, -7.3, -5.18, -4.35, -3.43, -2.87, -2.45, -1.93, -1.58, -1.28, -0.99, -0.5, -0.21, 0.0),
    "EOS REBEL XSi": (-8.0, -7.0, -4.96, -4.25, -3.31, -2.78, -2.41, -1.95, -1.66, -1.41, -1.14, -0.65, -0.28, 0.0),
    "PowerShot S3 IS": (-8.0, -6.8, -4.63, -3.96, -3.01, -2.42, -2.01, -1.52, -1.22, -0.96, -0.72, -0.35, -0.14, 0.0),
}


def response_of(name: str) -> Response:
    curve = np.interp(np.arange(256), VALUES, CAMERAS[name])
    return Response(np.tile(curve, (3, 1)), np.full(3, 0.7))


def shot(exposure: np.ndarray, response: Response, seed: int, jpeg: int | None = None) -> np.ndarray:
    noise = 0.7 * np.random.default_rng(seed).standard_normal(exposure.shape)
    values = np.rint(np.clip(response.pixel_values(exposure) + noise, 0, 255)).astype(np.uint8)
    if jpeg is None:
        return values
    read = cv2.imdecode(cv2.imencode(".jpg", values, [cv2.IMWRITE_JPEG_QUALITY, jpeg])[1], cv2.IMREAD_COLOR)
    assert read is not None
    return read


def film_of(path, response: Response, stops=(0, 4), count: int = 4, jpeg: int | None = None):
    light = place_light(0, LAMPS[:1] + LAMPS[3:])(pixel_directions(LatLong(), ROWS))
    return write_video(path, [shot(light * 2.0 ** -stops[k % len(stops)], response, k, jpeg) for k in range(count)])


@pytest.mark.parametrize("jpeg", [None, 90])
@pytest.mark.parametrize("name", sorted(CAMERAS))
def test_errors_of_an_assumed_curve_cover_real_cameras(name, jpeg, tmp_path):
    film = film_of(tmp_path / "film.mkv", response_of(name), jpeg=jpeg)
    made = probe_film(film, tmp_path / "maps", SphericalFilm(), FilmSettings(ROWS, keep_variance=True, half=False))
    # The exposures, and each pixel of the map: 1 is what the brightest exposure shows as white.
    found, error = made.calibration.exposures[1].stops
    assert 0.3 < abs(found + 4) < 3 * error
    picture = read_radiance(made.paths[0])
    assert picture.variance is not None and picture.clipped is not None
    true = truth(place_light(0, LAMPS[:1] + LAMPS[3:])).radiance
    sigma = np.sqrt(picture.variance)
    off = (np.abs(picture.radiance - true) / sigma)[picture.clipped == 0]
    assert np.mean(off < 3) > 0.995
    assert np.median(sigma / picture.radiance) < 0.8  # and not so large that it says nothing
    # By noise alone they would be far from it.
    tables = replace(made.calibration.tables, assumed=0.0, assumed_ratio=0.0)
    level = np.minimum(true, 1)
    noise = np.interp(level, tables.exposure[:, 1], np.sqrt(tables.variance[:, 1]))
    assert np.median(np.abs(picture.radiance - true) / noise) > 3


def test_a_known_curve_has_no_error_of_an_assumed_one(tmp_path):
    response = response_of("EOS 350D")
    film = film_of(tmp_path / "film.mkv", response)
    made = probe_film(
        film, tmp_path / "maps", SphericalFilm(), FilmSettings(ROWS), profile=CameraProfile("EOS 350D", response)
    )
    found, error = made.calibration.exposures[1].stops
    assert abs(found + 4) < 0.03 and error < 0.1
    assert made.doubts == ()
    assert LightTables.of(response).curve_variance(np.array(0.1), np.array(0.1)) == 0
    assert LightTables.of(None).curve_variance(np.array(0.0), np.array(1.0)) == pytest.approx(0.6**2)
    assert LightTables.of(None).curve_variance(np.array(1.0), np.array(np.exp(-1))) == pytest.approx(0.4**2)
    # Stops that are given are not off.
    settings = FilmSettings(ROWS, stops=(0.0, 4.0))
    given = probe_film(film, tmp_path / "given", SphericalFilm(), settings).calibration
    assert given.exposures[1].stops == (pytest.approx(-4), 0) and given.tables.assumed_ratio == 0


def test_a_film_has_the_colours_of_its_profile_as_a_merge_has(tmp_path):
    # A curve whose channels are white at other exposures: grey light is (1, 1, 0.63) of white in blue.
    curve = srgb_response().log_exposure - np.log([[1.0], [1.0], [0.63]])
    response = Response(curve, np.full(3, 0.7))
    profile = CameraProfile("a camera", response, balance=(1.0, 1.1, 1.0))
    stops = (0, 3)
    light = np.full((ROWS, 2 * ROWS, 3), 0.4) * np.linspace(0.2, 2, 2 * ROWS)[:, None]
    frames = [shot(light * 2.0 ** -stops[k % 2], response, k) for k in range(4)]
    film = write_video(tmp_path / "film.mkv", frames)
    made = probe_film(film, tmp_path / "maps", SphericalFilm(), FilmSettings(ROWS), profile=profile)
    found = read_radiance(made.paths[0]).radiance
    photographs = tuple(
        Photograph(frame, exposure=Exposure(2.0**-stop), name=str(stop))
        for frame, stop in zip(frames, stops, strict=False)
    )
    merged = apply_balance(merge(Bracket(photographs), response), ChannelGains(profile.balance)).radiance
    colour = found.mean((0, 1)) / found[..., 0].mean()
    np.testing.assert_allclose(colour, [1, 1.1, 1], rtol=0.01)
    np.testing.assert_allclose(colour, merged.mean((0, 1)) / merged[..., 0].mean(), rtol=0.01)
    # The brightest exposure's white is 1 in the channel where it is most.
    assert LightTables.of(response, profile.balance).exposure[255].max() == pytest.approx(1)


def test_what_a_profile_knows_and_films_do_not_use_is_warned_of_by_name(tmp_path):
    response = response_of("EOS 350D")
    profile = CameraProfile("EOS 350D", response, scale=120.0, vignetting={"falloff": [0.1]})
    film = film_of(tmp_path / "film.mkv", response)
    made = probe_film(film, tmp_path / "maps", SphericalFilm(), FilmSettings(ROWS), profile=profile)
    assert [doubt.line for doubt in made.doubts] == [
        "the profile of EOS 350D holds vignetting and scale, which films do not use: their light is relative, and the "
        "lens's fall-off stays in it"
    ]
    with warnings.catch_warnings(), pytest.raises(ValueError, match="is of raws, and holds no response"):
        warnings.simplefilter("ignore")
        raws = replace(profile, response=None, sensor=object(), vignetting=None)
        probe_film(film, tmp_path / "raw", SphericalFilm(), FilmSettings(ROWS), profile=raws)
