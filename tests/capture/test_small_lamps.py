"""The colour that JPEG takes from lamps of a few pixels is found again."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from PIL import Image

from relume.capture.exposure.bracket import Bracket
from relume.capture.merging import merge
from relume.capture.response.small_lamps import with_small_lamps
from relume.image import files
from relume.image.photograph import Exposure
from relume.image.response import Response

SUN = np.array([1.164, 1.0, 0.788])
"""Of a noon sun, green 1."""
SPOT = np.array([[0.07, 0.53, 0.06], [0.17, 1.0, 0.1], [0.0, 0.02, 0.0]])
"""What a mirrored ball shows of the sun, a pixel or two wide."""
VALUES = np.arange(256) / 255
SRGB = Response(
    np.log(np.tile(np.where(VALUES <= 0.04045, VALUES / 12.92, ((VALUES + 0.055) / 1.055) ** 2.4), (3, 1)) + 1e-5),
    np.full(3, 0.5),
)
AT = np.s_[37:40, 50:53]


def bracket(folder, *, suffix="jpg", subsampling=0, light=0.85, spot=SPOT):
    """Photographs, the longest of which shows the dark too, of a spot of the sun's colour on dark."""
    scene = np.full((96, 96, 3), 0.0005)
    top, left = AT[0].start, AT[1].start
    scene[top : top + len(spot), left : left + spot.shape[1]] += light / 1.164 * spot[..., None] * SUN
    photographs = []
    for number, seconds in enumerate((1.0, 4.0, 256.0)):
        path = folder / f"{number}.{suffix}"
        values = np.round(SRGB.pixel_values(np.minimum(scene * seconds, 1))).astype(np.uint8)
        if suffix == "jpg":
            Image.fromarray(values).save(path, quality=92, subsampling=subsampling)
        else:
            Image.fromarray(values).save(path)
        photograph = files.read_photograph(path)
        photographs.append(replace(photograph, exposure=Exposure(seconds)))
    return Bracket(tuple(photographs))


def colour(picture):
    whole = picture.radiance[AT].sum((0, 1))
    return whole / whole[1]


def test_a_sun_of_a_few_pixels_gets_its_colour_back(tmp_path):
    shot = bracket(tmp_path)
    merged = merge(shot, SRGB)
    found = with_small_lamps(merged, shot, SRGB)
    # Without this step the sun is too white.
    assert np.abs(colour(merged) / SUN - 1).max() > 0.08
    assert np.abs(colour(found) / SUN - 1).max() < 0.06
    # Nothing else changed, and the brightness stayed.
    beside = np.ones(merged.radiance.shape[:2], bool)
    beside[AT[0].start - 2 : AT[0].stop + 2, AT[1].start - 2 : AT[1].stop + 2] = False
    np.testing.assert_array_equal(found.radiance[beside], merged.radiance[beside])
    luminance = np.array([0.2126, 0.7152, 0.0722])
    np.testing.assert_allclose(found.radiance @ luminance, merged.radiance @ luminance, rtol=1e-4, atol=1e-6)


@pytest.mark.parametrize(("subsampling", "before", "after"), [(0, 0.05, 0.02), (1, 0.1, 0.05)])
def test_wherever_it_lies_in_its_block(tmp_path, subsampling, before, after):
    errors: list[list[np.ndarray]] = [[], []]
    for down, across in ((0.4, -0.1), (-0.3, 0.3), (0.0, 0.45), (-0.5, -0.2), (0.2, 0.1), (0.1, -0.4)):
        y, x = np.mgrid[-1:2, -1:2]
        spot = np.exp(-((y - down) ** 2 + (x - across) ** 2) / (2 * 0.6**2))
        shot = bracket(tmp_path, subsampling=subsampling, spot=spot / spot.max())
        merged = merge(shot, SRGB)
        for each, picture in zip(errors, (merged, with_small_lamps(merged, shot, SRGB)), strict=True):
            each.append(colour(picture) / SUN - 1)
    left = [np.sqrt(np.mean(np.square(each), axis=0)) for each in errors]
    assert left[0][[0, 2]].min() > before
    assert left[1].max() < after


@pytest.mark.parametrize(
    "other",
    [{"suffix": "png"}, {"light": 4.0}, {"spot": np.ones((12, 12))}, {"spot": np.ones((1, 1))}],
    ids=["no JPEG", "white in every photograph", "a wide lamp", "a pixel"],
)
def test_what_jpeg_took_nothing_from_or_is_not_known_stays(tmp_path, other):
    shot = bracket(tmp_path, **other)
    merged = merge(shot, SRGB)
    assert with_small_lamps(merged, shot, SRGB) is merged


def test_a_photograph_that_was_moved_since_keeps_its_lamps(tmp_path):
    shot = bracket(tmp_path)
    moved = [replace(p, pixels=np.roll(p.pixels, (3, 5), (0, 1))) for p in shot.photographs]
    shot = Bracket(tuple(moved))
    merged = merge(shot, SRGB)
    assert with_small_lamps(merged, shot, SRGB) is merged


def test_a_jpeg_knows_how_it_was_coded(tmp_path):
    shot = bracket(tmp_path, subsampling=2)
    coding = shot.photographs[0].jpeg
    assert coding is not None
    assert coding.subsampling == 2
    # The first steps of quality 92: round(16 · 16 %) and round(17 · 16 %).
    assert (coding.quantisation[0][0], coding.quantisation[1][0]) == (3, 3)
