"""How near alignment comes on synthetic hand-held brackets whose motions are known."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter, zoom

from handheld import FINE, MARGIN, HandHeld, stack
from relume.capture.alignment.alignment import Aligned, align
from relume.image import files

WITHIN = 0.25
"""Pixels at the worst corner of the worst frame."""


def missed(held: HandHeld) -> tuple[float, float, Aligned]:
    """The worst frame's error: largest over the corners, and root mean square over the picture; pixels."""
    aligned = align(held.bracket)
    found = np.array([(motion.dx, motion.dy, motion.angle) for motion in aligned.motions])
    largest, typical = held.errors(found, aligned.reference)
    return float(largest.max()), float(typical.max()), aligned


def small_brackets_lie_within_a_quarter_pixel(count: int) -> None:
    corners = []
    for seed in range(count):
        corner, _, aligned = missed(stack(900 + seed, size=(420, 300), frames=3 + seed % 3))
        corners.append(corner)
        assert aligned.moved
    assert max(corners) < WITHIN and np.median(corners) < 0.06


def test_two_brackets_lie_within_a_quarter_pixel() -> None:
    small_brackets_lie_within_a_quarter_pixel(2)


@pytest.mark.slow  # the first two are the test above
def test_four_brackets_lie_within_a_quarter_pixel() -> None:
    small_brackets_lie_within_a_quarter_pixel(4)


@pytest.mark.slow  # the first two are the test above
def test_twelve_brackets_lie_within_a_quarter_pixel() -> None:
    small_brackets_lie_within_a_quarter_pixel(12)


@pytest.mark.slow
def test_two_hundred_brackets_lie_within_a_quarter_pixel() -> None:
    corners, typical, covered = [], [], []
    for seed in range(200):
        held = stack(seed)
        corner, average, aligned = missed(held)
        corners.append(corner)
        typical.append(average)
        found = np.array([(motion.dx, motion.dy, motion.angle) for motion in aligned.motions])
        covered.append(np.delete(held.errors(found, aligned.reference)[0] < aligned.errors, aligned.reference))
    corners, typical = np.array(corners), np.array(typical)
    print(
        f"corners: {np.mean(corners <= WITHIN):.1%} within {WITHIN} px, median {np.median(corners):.3f}, "
        f"worst {corners.max():.3f}; RMS: {np.mean(typical <= WITHIN):.1%}, median {np.median(typical):.3f}, "
        f"worst {typical.max():.3f}; within their error {np.concatenate(covered).mean():.1%}"
    )
    assert np.mean(corners <= WITHIN) >= 0.98
    assert np.concatenate(covered).mean() > 0.6


@pytest.mark.slow
def test_large_frames_lie_within_a_quarter_pixel() -> None:
    # These are reduced before they are aligned: a quarter pixel is a ninth of one there.
    corners = [missed(stack(300 + seed, size=(3000, 2000), frames=3, fine=1))[0] for seed in range(5)]
    assert max(corners) < WITHIN


@pytest.mark.slow
def test_measured_light_lies_within_a_quarter_pixel(shared: Path) -> None:
    folder = shared / "data/hdri"
    for seed, name in enumerate(("three/venice_sunset_1k.hdr", "three/royal_esplanade_1k.hdr", "pmndrs/studio.exr")):
        radiance = files.read_radiance(folder / name).radiance.mean(-1)
        size = (480, 320)
        shape = [FINE * (n + 2 * MARGIN) for n in size[::-1]]
        enlarged = zoom(radiance, max(s / n for s, n in zip(shape, radiance.shape, strict=True)), order=1)
        scene = gaussian_filter(enlarged[: shape[0], : shape[1]], 0.55 * FINE)
        # Air light, so that no pixel is without any.
        scene = (scene + 1e-3 * np.median(scene)).astype(np.float32)
        assert missed(stack(400 + seed, size=size, frames=5, scene=scene))[0] < WITHIN, name
