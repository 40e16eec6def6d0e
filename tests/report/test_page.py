"""A page holds all it shows, and words stay words whatever is in them."""

from __future__ import annotations

import base64

import numpy as np
import pytest

from parsed_page import Parsed
from relume.image import bands
from relume.image.files.photographs import png
from relume.renderers.results import Change
from relume.report import plots
from relume.report.insert_report import _taken_and_added
from relume.report.page import figure, heading, note, page, paragraph, side_by_side, slide, table, triple

NASTY = "<script>alert('1')</script> & \"2\" é 日"
PICTURE = png.encode(np.zeros((2, 3, 3), np.uint8))


def test_words_stay_words():
    for make in (
        heading, note, paragraph, lambda w: figure(PICTURE, w), lambda w: slide(PICTURE, PICTURE, w),
        lambda w: table([(w,)]), lambda w: table([("a",)], head=(w,)),
    ):  # fmt: skip
        parsed = Parsed(make(NASTY))
        assert NASTY in parsed.words
        assert "script" not in [tag for tag, _ in parsed.tags]
    images = [attributes for tag, attributes in Parsed(figure(PICTURE, NASTY)).tags if tag == "img"]
    assert [image["alt"] for image in images] == [NASTY]


def test_a_page_is_whole_and_fetches_nothing():
    text = page(NASTY, [heading("a"), figure(PICTURE, "b")])
    parsed = Parsed(text)
    assert text.startswith("<!doctype html>") and text.endswith("</html>\n")
    assert ("meta", {"charset": "utf-8"}) in parsed.tags
    title = [tag for tag, _ in parsed.tags].index("title")
    assert title >= 0 and NASTY in parsed.words
    assert not any(word in text for word in ("http:", "https:", "<link", "@import", "url("))


def test_a_picture_is_held_bit_for_bit():
    (image,) = [attributes for tag, attributes in Parsed(figure(PICTURE, "b")).tags if tag == "img"]
    kind, data = (image["src"] or "").split(",")
    assert kind == "data:image/png;base64" and base64.b64decode(data) == PICTURE


def test_a_slide_shows_the_first_left_of_its_handle():
    other = png.encode(np.ones((2, 3, 3), np.uint8))
    images = [attributes for tag, attributes in Parsed(slide(PICTURE, other, "c")).tags if tag == "img"]
    # The second image in the page lies on top and is cut off at its right.
    assert [image["alt"] for image in images] == ["right of the handle", "left of the handle"]
    assert base64.b64decode((images[1]["src"] or "").split(",")[1]) == PICTURE


def test_figures_lie_in_two_columns_or_three():
    assert 'class="two"' in side_by_side(["a", "b"])
    assert 'class="three"' in side_by_side(["a", "b", "c"])


def test_a_table_has_a_cell_for_every_word():
    parsed = Parsed(table([("a", "b"), ("c", "d")], head=("first", "second")))
    tags = [tag for tag, _ in parsed.tags]
    assert (tags.count("tr"), tags.count("th"), tags.count("td")) == (3, 2, 4)
    assert parsed.words == ["first", "second", "a", "b", "c", "d"]
    assert Parsed(table([("a",)])).tags[0][0] == "table"


def test_numbers_have_four_figures():
    assert triple(np.array([1.23456, 0.000123456, 98765.4])) == "(1.235, 0.0001235, 9.877e+04)"


@pytest.mark.parametrize("kind", [np.float32, np.uint8])
def test_a_large_picture_is_made_smaller_in_bands(monkeypatch: pytest.MonkeyPatch, kind: type):
    picture = (200 * np.random.default_rng(2).random((130, 93, 3))).astype(kind)
    monkeypatch.setattr(plots, "WIDEST", 20)
    step = 5
    whole = plots.in_squares(picture, step).mean((1, 3)).astype(kind)
    monkeypatch.setattr(plots, "BAND", 93 * 15)
    np.testing.assert_array_equal(plots.smaller(picture), whole)
    assert whole.shape == (26, 18, 3)


def test_light_taken_and_added_is_summed_by_rows_as_at_once(monkeypatch: pytest.MonkeyPatch):
    random = np.random.default_rng(4)
    difference = random.standard_normal((300, 41, 3)).astype(np.float32)
    matte = np.maximum(random.standard_normal((300, 41)), 0).astype(np.float32)
    change = Change(difference, difference, matte, matte, difference, difference, difference, difference)
    monkeypatch.setattr(bands, "BAND", 41 * 7)
    taken, added = _taken_and_added(change)
    beside = difference[matte == 0]
    np.testing.assert_array_equal(taken, -np.minimum(beside, 0).sum(0))
    np.testing.assert_array_equal(added, np.maximum(beside, 0).sum(0))
    assert np.all(taken > 0) and np.all(added > 0)
