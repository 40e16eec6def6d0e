"""Crop and resize: against a slow twin, the mean kept, nothing beyond the picture's own range, planes carried."""

from __future__ import annotations

import numpy as np
import pytest

from relume.image import resizing
from relume.image.radiance import BLACK, OUTSIDE, SATURATED, RadianceMap
from relume.image.resizing import cropped, resized, resized_rows


def naive_axis(values: np.ndarray, new: int, cells: int) -> np.ndarray:
    """One axis resized by looking at fine cells: small squares smoothed by a box, then averaged, ends mirrored."""
    old = len(values)
    pixel = old / new
    smoothing = min(1.0, max(0.0, 2 * (1 - pixel)))
    result = np.zeros((new, *values.shape[1:]))
    steps = (np.arange(cells) + 0.5) / cells
    for target in range(new):
        places = (target + steps[:, None]) * pixel + (steps - 0.5) * smoothing
        sources = np.floor(places).astype(int) % (2 * old)
        result[target] = values[np.minimum(sources, 2 * old - 1 - sources)].mean((0, 1))
    return result


@pytest.mark.parametrize(("old", "new"), [((6, 5), (3, 2)), ((5, 4), (7, 9)), ((4, 6), (6, 5)), ((3, 2), (8, 2))])
def test_resizing_is_the_slow_twin(old: tuple[int, int], new: tuple[int, int]) -> None:
    field = np.random.default_rng(5).random((*old, 3)).astype(np.float32)
    twin = naive_axis(np.moveaxis(naive_axis(field, new[0], 300), 1, 0), new[1], 300)
    made = resized(RadianceMap(field), new[1], new[0]).radiance
    assert made.shape == (*new, 3)
    assert np.abs(made - np.moveaxis(twin, 0, 1)).max() < 2e-3


def test_literals() -> None:
    row = RadianceMap(np.repeat(np.array([[0.0, 4.0]], np.float32)[..., None], 3, axis=2))
    assert resized(row, 1, 1).radiance[0, 0, 0] == 2.0
    # At twice the size, linear interpolation's mean over each new pixel.
    assert resized(row, 4, 1).radiance[0, :, 0].tolist() == pytest.approx([0, 1, 3, 4], abs=1e-6)
    assert resized(row, 2, 1) is row


@pytest.mark.parametrize("size", [(64, 33), (20, 20), (7, 3), (100, 90), (46, 31), (200, 31)])
def test_the_mean_is_kept_and_nothing_rings(size: tuple[int, int]) -> None:
    rng = np.random.default_rng(7)
    field = rng.random((31, 46, 3)).astype(np.float32) * 1e-3
    field[15, 20] = field[0, 0] = 1e5
    made = resized(RadianceMap(field), *size).radiance
    means = [pixels.mean((0, 1), dtype=np.float64) for pixels in (field, made)]
    assert means[1] == pytest.approx(means[0], rel=1e-7)
    assert made.min() >= field.min() and made.max() <= field.max()


def test_variance_and_marks_are_resized_too() -> None:
    variance = np.full((4, 4, 3), 8.0, np.float32)
    variance[0, 0] = np.inf
    clipped = np.zeros((4, 4), np.uint8)
    clipped[:2, 2:], clipped[2, 0], clipped[2:, 2:], clipped[3, 3] = BLACK, SATURATED, OUTSIDE, 0
    made = resized(RadianceMap(np.ones((4, 4, 3), np.float32), variance, clipped, "cd/m²", {"a": "b"}), 2, 2)
    assert made.variance is not None and made.clipped is not None
    assert made.variance[..., 0].tolist() == [[np.inf, 2.0], [2.0, 2.0]]
    assert made.clipped.tolist() == [[0, BLACK], [SATURATED, OUTSIDE]]
    assert (made.unit, made.attributes) == ("cd/m²", {"a": "b"})


def test_a_crop_keeps_every_plane_of_its_rectangle() -> None:
    field = np.arange(60, dtype=np.float32).reshape(4, 5, 3)
    clipped = np.arange(20, dtype=np.uint8).reshape(4, 5) % 4
    part = cropped(RadianceMap(field, field * 2, clipped, "cd/m²", {"a": "b"}), 1, 2, 3, 1)
    assert part.size == (3, 1) and part.unit == "cd/m²" and part.attributes == {"a": "b"}
    assert part.radiance.tolist() == field[2:3, 1:4].tolist()
    assert part.variance is not None and part.variance.tolist() == (field * 2)[2:3, 1:4].tolist()
    assert part.clipped is not None and part.clipped.tolist() == clipped[2:3, 1:4].tolist()


@pytest.mark.parametrize("box", [(-1, 0, 2, 2), (0, 0, 6, 1), (4, 3, 1, 2), (0, 0, 0, 1)])
def test_a_crop_beyond_the_frame_is_refused(box: tuple[int, int, int, int]) -> None:
    with pytest.raises(ValueError, match="not in a picture of 5×4"):
        cropped(RadianceMap(np.zeros((4, 5, 3), np.float32)), *box)


def test_sizes_and_pixels_that_cannot_be_resized_are_refused() -> None:
    picture = RadianceMap(np.zeros((4, 5, 3), np.float32))
    with pytest.raises(ValueError, match="0×4"):
        resized(picture, 0, 4)
    picture.radiance[1, 1, 0] = np.nan
    with pytest.raises(ValueError, match="1 pixels are NaN"):
        resized(picture, 2, 2)


@pytest.mark.parametrize("size", [(100, 77), (200, 31), (150, 299), (46, 62)])
def test_a_field_that_is_given_by_its_rows_has_the_same_bits(monkeypatch: pytest.MonkeyPatch, size: tuple[int, int]):
    field = np.random.default_rng(3).random((120, 92, 3)).astype(np.float32)
    asked: list[slice] = []

    def rows(part: slice) -> np.ndarray:
        asked.append(part)
        return field[part]

    monkeypatch.setattr(resizing, "BAND", 1500)
    made = resized_rows(rows, (92, 120), *size)
    assert made.dtype == np.float32 and np.array_equal(made, resized(RadianceMap(field), *size).radiance)
    # Never more than some rows of it, and the last as well.
    assert max(part.stop - part.start for part in asked) < 30 and asked[-1].stop == 120
    field[100, 3] = np.nan
    with pytest.raises(ValueError, match="NaN or infinite"):
        resized_rows(rows, (92, 120), *size)
