"""The first pages that a stranger meets can be read after seven years at school, by a measure that is checked."""

from __future__ import annotations

import pytest

from documents.pages import ROOT
from documents.reading_ease import grade, hardest, paragraphs, sentences, syllables

FIRST_PAGES = ("README.md", "docs/start.md")
HARDEST = 6.0
"""Texts for everybody are commonly held to grade 8 or 9; most of our readers read in their second language. Both pages
have less than 5: every two sentences joined would be above."""

SYLLABLES = {
    1: "the ball light made walked scenes years through lens",
    2: "photo table rendered lighting metre layer really create",
    3: "radiance exposure camera camera's reflection linear area photographs",
    4: "photography environment irradiance material calibration",
    5: "probability university",
    6: "equirectangular",
}
"""As the Carnegie Mellon pronouncing dictionary has them; of 100 running words of the pages 99 agree."""


@pytest.mark.parametrize("page", FIRST_PAGES)
def test_the_first_pages_are_plain(page: str) -> None:
    text = (ROOT / page).read_text(encoding="utf-8")
    assert len(list(sentences(text))) > 20
    found = grade(text)
    assert found <= HARDEST, f"{page} has grade {found:.1f}; its hardest passages: {hardest(text)[:3]}"


@pytest.mark.parametrize(("count", "words"), SYLLABLES.items())
def test_syllables_are_counted(count: int, words: str) -> None:
    assert {word: syllables(word) for word in words.split() if syllables(word) != count} == {}


def test_a_grade_is_what_the_formula_makes_of_counted_words() -> None:
    # Thirteen words, two sentences, seventeen syllables: 0.39 · 6.5 + 11.8 · 17 / 13 − 15.59.
    plain = "The light was measured with a mirrored ball. The camera did not move."
    assert grade(plain) == pytest.approx(0.39 * 6.5 + 11.8 * 17 / 13 - 15.59)
    hard = "Photogrammetric calibration necessitates simultaneous determination of orientation parameters."
    assert grade(hard) > HARDEST > grade(plain)


def test_only_running_text_is_read() -> None:
    page = """# A heading of many unpronounceable words

Run `relume insert` and [look](nowhere/at/all.md).
It is **done** in 0.05 s. Read it!

```sh
relume insert incomprehensible.toml
```

| a table | with cells |
|---|---|

1. Take the ball.
2. Photograph it,
   then stop.

![a picture](a.jpg)
"""
    assert list(paragraphs(page)) == [
        "Run § and look. It is **done** in 0.05 s. Read it!",
        "Take the ball.",
        "Photograph it, then stop.",
    ]
    assert len(list(sentences(page))) == 5
    assert hardest(page)[0][1] == "Photograph it, then stop."
