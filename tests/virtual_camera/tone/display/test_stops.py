"""The sheet of one picture at several stops."""

import numpy as np
import pytest
from PIL import ImageFont

from relume.image.photograph import Photograph
from relume.image.radiance import RadianceMap
from relume.virtual_camera.film.film import Film
from relume.virtual_camera.tone.display.lettering import Words, lettered
from relume.virtual_camera.tone.display.stops import stops_sheet

PICTURE = RadianceMap(np.full((20, 30, 3), 0.05, np.float32))


def tile(sheet: Photograph, row: int, column: int, height: int = 20, width: int = 30) -> np.ndarray:
    y, x = 12 + row * (height + 26 + 12), 12 + column * (width + 12)
    return sheet.pixels[y : y + height, x : x + width]


def test_each_picture_is_a_factor_of_two_brighter():
    sheet = stops_sheet(PICTURE, (-1, 0, 1, 5), Film(), columns=2)
    # 255 · sRGB of 0.025, 0.05, 0.1 and 1.6
    for (row, column), code in zip(((0, 0), (0, 1), (1, 0), (1, 1)), (44, 63, 89, 255), strict=True):
        assert np.all(tile(sheet, row, column) == code)
    assert sheet.pixels.shape == (2 * 58 + 12, 2 * 42 + 12, 3)


def test_a_function_develops_as_well_as_a_film():
    sheet = stops_sheet(PICTURE, (0, 2), lambda radiance: Photograph(np.rint(100 * radiance).astype(np.uint8)))
    assert np.all(tile(sheet, 0, 0) == 5) and np.all(tile(sheet, 0, 1) == 20)


def test_wide_pictures_are_made_smaller_in_linear_light():
    checks = np.zeros((20, 40, 3), np.float32)
    checks[:, ::2] = 1
    sheet = stops_sheet(RadianceMap(checks), (0,), width=20)
    assert np.all(tile(sheet, 0, 0, 10, 20) == 188)  # ½ in light


def test_every_picture_has_its_stop_below_it_and_they_differ():
    sheet = stops_sheet(PICTURE, (-1, 1), columns=2).pixels
    left, right = (sheet[33:58, x : x + 30].astype(int) for x in (12, 54))
    assert (left > 150).any() and (right > 150).any()
    assert not np.array_equal(left, right)


def test_nine_stops_make_a_square():
    assert stops_sheet(PICTURE).pixels.shape == (3 * 58 + 12, 3 * 42 + 12, 3)


@pytest.mark.parametrize(
    "options, said",
    [
        ({"stops": ()}, "no stops"),
        ({"columns": 0}, "columns 0"),
        ({"film": lambda radiance: Photograph(np.zeros((2, 2, 3), np.uint8))}, r"the film gave \(2, 2, 3\)"),
        ({"film": lambda radiance: Photograph(np.zeros((20, 30, 3), np.uint16))}, "uint16; expected"),
    ],
)
def test_senseless_sheets_are_refused(options, said):
    with pytest.raises(ValueError, match=said):
        stops_sheet(PICTURE, **options)


def test_words_leave_other_pixels_as_they_are_and_stand_where_they_are_reported():
    page = np.random.default_rng(1).integers(0, 256, (60, 200, 3)).astype(np.uint8)
    changed = (lettered(page, [Words(100, 30, "HI", align="right", level="center")]) != page).any(-1)
    y, x = np.nonzero(changed)
    assert 80 < x.min() and x.max() <= 101 and 20 < y.min() and y.max() < 40
    assert np.array_equal(lettered(page, []), page)


@pytest.mark.parametrize(("align", "left"), [("left", 101), ("center", 94), ("right", 86)])
@pytest.mark.parametrize(("level", "top"), [("top", 40), ("center", 33), ("bottom", 26)])
def test_words_stand_as_their_alignment_says(align, left, level, top):
    # As matplotlib's figures set them, whose font and measures these are.
    page = np.zeros((80, 200, 3), np.uint8)
    y, x = np.nonzero(lettered(page, [Words(100, 40, "HI", 10, "#ffffff", align, level)]).max(-1) > 60)
    assert abs(x.min() - left) <= 1 and abs(x.max() - x.min() - 12) <= 1
    assert abs(y.min() - top) <= 1 and abs(y.max() - y.min() - 10) <= 1


def test_words_are_the_same_whichever_libraries_a_machine_has(monkeypatch):
    """Where FriBiDi is installed Pillow lets libraqm lay out words: they were narrower there."""
    page, words = np.zeros((40, 400, 3), np.uint8), [Words(5, 5, "GGX, α = 0.1: AVATAR", 9, "#ffffff")]
    here = lettered(page, words)
    monkeypatch.setattr(ImageFont.core, "HAVE_RAQM", not ImageFont.core.HAVE_RAQM)
    monkeypatch.setattr(ImageFont.core, "HAVE_FRIBIDI", not ImageFont.core.HAVE_FRIBIDI, raising=False)
    assert np.array_equal(lettered(page, words), here)
    # A file's name may hold what it likes.
    assert lettered(page, [Words(5, 5, "two\nlines", 9)]).any()
