"""The colour that JPEG took from lamps of a few pixels, such as the sun in a mirrored ball.

JPEG keeps colour coarsely: of a lamp of a few pixels its quantisation leaves half, and the sun comes out whiter than it
is (red 6 % low, blue 8 % high at quality 92; 1 % after this, 2 to 3 % at 4:2:2). What was done is known, because the
file holds its quantisation: here the one colour is sought that, coded as the file was, comes out as the file shows the
lamp. Where JPEG left nothing of it, as often of red at 4:2:0, the middle of all that is possible is near white.
A lamp's brightness stays as it was measured; JPEG keeps that finely.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from relume.capture.exposure.bracket import Bracket
from relume.image.colour import luminance
from relume.image.files.photographs.jpeg_coding import coded
from relume.image.photograph import Photograph
from relume.image.radiance import RadianceMap
from relume.image.response import Response

DARK = 25
"""Largest value below which what surrounds a lamp lies: JPEG rings by as much."""
LIGHT = 0.05
"""Share of such pixels from which on a photograph is no longer dark."""
BRIGHT, WHITE = 100, 250
"""Largest value of a lamp whose colour is seen well enough, and from which on it may be saturated."""
FEWEST = 4
"""Pixels of a lamp whose colour is sought: of fewer noise decides it."""
WIDEST = 8
"""Pixels along a lamp: one block. Of wider ones JPEG keeps the colour, by its low frequencies."""
UNIT = 16
"""Pixels along what JPEG codes together at half the colour resolution; at full resolution it is 8."""
BESIDE = 8
"""Pixels around a lamp that must be dark, or something else's colour is in its block."""
FAITHFUL = 2.0
"""Mean difference in pixel values from which on coding again has changed what the file shows: then the photograph was
turned, moved or edited since, and its blocks lie elsewhere. Coded once more in place, JPEGs stay within 1."""
ROUNDS, SETTLING = 40, 15
"""Steps of the search, whose luma is dithered within its rounding, and how many are left out of the mean."""
STARTS = (0.6, 1.7)
"""Red and blue beside green where the search begins: lamps from candles to a blue sky lie between."""
MOST = 64
"""Lamps whose colour is sought, the brightest first: a picture of sparkling water has thousands."""
LUMA = np.array([0.299, 0.587, 0.114])  # JFIF 1.02


def with_small_lamps(picture: RadianceMap, bracket: Bracket, response: Response) -> RadianceMap:
    """The radiance map of a bracket, small lamps on dark in the colour that they had before JPEG.

    picture : in the photographs' own channels
    bracket : as it was merged
    The shortest photograph is asked that shows a lamp below white. Unchanged where there is no such lamp, and of
    photographs that are no JPEGs, or were turned, resampled or edited since they were.
    """
    from scipy.ndimage import binary_dilation

    if response.levels != 256:
        return picture
    radiance, done = picture.radiance, np.zeros(picture.radiance.shape[:2], bool)
    for photograph in bracket.photographs:
        if photograph.jpeg is None:
            continue
        for lamp in _lamps(photograph.pixels):
            colour = None if done[lamp].any() else _colour(photograph, lamp, response)
            done[lamp] = True
            if colour is None:
                continue
            # The colour for what the lamp shines into its neighbours too; brightness as it was measured.
            rows, columns = (
                slice(max(int(at.min()) - 1, 0), min(int(at.max()) + 2, size))
                for at, size in zip(lamp, done.shape, strict=True)
            )
            part = np.zeros((rows.stop - rows.start, columns.stop - columns.start), bool)
            part[lamp[0] - rows.start, lamp[1] - columns.start] = True
            part = np.asarray(binary_dilation(part), bool)
            if radiance is picture.radiance:
                radiance = np.array(radiance)
            box = radiance[rows, columns]
            light = np.asarray(luminance(box), np.float32)[..., None]
            box[part] = (light / float(luminance(colour)) * colour).astype(np.float32)[part]
    return picture if radiance is picture.radiance else replace(picture, radiance=radiance)


def _lamps(pixels: np.ndarray) -> list[tuple[np.ndarray, np.ndarray]]:
    """Rows and columns of lamps that are small, alone in the dark and below white, the brightest first."""
    from scipy.ndimage import find_objects, label

    light = pixels.max(-1) > DARK
    if light.mean() > LIGHT:
        return []
    parts = np.zeros(light.shape, np.int32)
    label(light, np.ones((3, 3)), output=parts)
    found = []
    for number, box in enumerate(find_objects(parts), 1):
        if max(s.stop - s.start for s in box) > WIDEST:
            continue
        rows, columns = (slice(max(s.start - BESIDE, 0), s.stop + BESIDE) for s in box)
        near, lamp = parts[rows, columns], parts[rows, columns] == number
        brightest = int(pixels[rows, columns][lamp].max())
        # Lamps beside one another have their colours in one block.
        if lamp.sum() >= FEWEST and BRIGHT <= brightest < WHITE and not (near[~lamp] > 0).any():
            down, across = np.nonzero(lamp)
            found.append((brightest, (down + rows.start, across + columns.start)))
    return [place for _, place in sorted(found, key=lambda each: -each[0])[:MOST]]


def _colour(
    photograph: Photograph, lamp: tuple[np.ndarray, np.ndarray], response: Response
) -> np.ndarray | None:  # fmt: skip
    """(3,) of a lamp before JPEG, green 1; None where the photograph's blocks are not where they were coded.

    lamp : its rows and columns
    """
    coding = photograph.jpeg
    assert coding is not None  # with_small_lamps asks no other
    # The lamp's blocks and those around it, as they lie in the file.
    rows, columns = (slice(max(int(at.min()) // UNIT - 1, 0) * UNIT, (int(at.max()) // UNIT + 2) * UNIT) for at in lamp)
    shown = photograph.pixels[rows, columns]
    where = np.zeros(shown.shape[:2], bool)
    where[lamp[0] - rows.start, lamp[1] - columns.start] = True
    again = coded(shown, coding)
    if np.abs(again[where].astype(int) - shown[where]).mean() > FAITHFUL:
        return None
    linear = lambda pixels: np.exp(  # noqa: E731
        np.stack([g[pixels[..., c]] for c, g in enumerate(response.log_exposure)], axis=-1)
    )
    seen = linear(shown[where]).sum(0)
    luma = shown[where] @ LUMA
    # What surrounds the lamp is dark, and its colours there are what JPEG left of the lamp's.
    around = np.repeat(np.round(shown @ LUMA)[..., None], 3, axis=-1)
    # Steps of the quantisation leave a range of colours that look alike: its ends are met from both sides.
    ends = []
    for start in STARTS:
        colour, tried = np.array([start, 1.0, start]), []
        random = np.random.default_rng(0)
        for _ in range(ROUNDS):
            guess = around.copy()
            guess[where] = _of_luma(luma + random.uniform(-1, 1, luma.shape), colour, response)
            comes_out = linear(coded(np.clip(np.round(guess), 0, 255).astype(np.uint8), coding)[where]).sum(0)
            # Half of what is left, so that single steps do not throw it back and forth.
            colour = colour * np.sqrt(seen / seen[1] * comes_out[1] / comes_out)
            colour = colour / colour[1]
            tried.append(colour)
        ends.append(np.mean(tried[SETTLING:], axis=0))
    return np.sqrt(ends[0] * ends[1])


def _of_luma(luma: np.ndarray, colour: np.ndarray, response: Response) -> np.ndarray:
    """(N, 3) pixel values of places of one colour, as bright as their luma (N,) says; by bisection."""
    ends = response.log_exposure
    low = np.full(luma.shape, float((ends[:, 0] - np.log(colour)).min()))
    high = np.full(luma.shape, float((ends[:, -1] - np.log(colour)).max()))
    for _ in range(30):
        middle = (low + high) / 2
        above = response.pixel_values(np.exp(middle)[:, None] * colour) @ LUMA > luma
        low, high = np.where(above, low, middle), np.where(above, middle, high)
    return response.pixel_values(np.exp(low)[:, None] * colour)
