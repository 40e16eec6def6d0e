"""Hand-held brackets whose motions are known: a finely drawn scene, sampled where each frame's pixels look.

Nothing of relume's warping is used: a scene of twice the frames' resolution, blurred as by a lens, is a smooth
function, and cubic splines read its linear radiance at the turned and shifted positions.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import gaussian_filter, map_coordinates, spline_filter

from relume.capture.exposure.bracket import Bracket
from relume.image.photograph import Exposure, Photograph
from synthetic import VirtualCamera

FINE = 2
"""Pixels of the scene per pixel of a frame, each way, unless asked."""
MARGIN = 110
"""Pixels of a frame that the scene reaches beyond the picture on every side."""


@dataclass(frozen=True, eq=False)
class HandHeld:
    """A bracket with the truth: a point p of the still scene lies at R(angle) p + (dx, dy) in each frame.

    motions : (P, 3): dx, dy in pixels, angle in radians, of the frames in the bracket's order
    """

    bracket: Bracket
    motions: np.ndarray

    def errors(self, motions: np.ndarray, reference: int) -> tuple[np.ndarray, np.ndarray]:
        """Largest error at the corners and the root mean square over the picture, of (P, 3) motions found, pixels.

        The motions found bring the frames onto `reference`, which may itself have moved.
        """
        width, height = self.bracket.photographs[0].size
        y, x = np.meshgrid(np.linspace(-0.5, 0.5, 9) * height, np.linspace(-0.5, 0.5, 9) * width, indexing="ij")
        grid = np.stack([x.ravel(), y.ravel()], axis=-1)
        still = unplaced(grid, self.motions[reference])
        largest, typical = [], []
        for true, found in zip(self.motions, motions, strict=True):
            miss = np.hypot(*(placed(still, true) - placed(grid, found)).T)
            largest.append(miss.max())
            typical.append(np.sqrt((miss**2).mean()))
        return np.array(largest), np.array(typical)


def placed(points: np.ndarray, motion: np.ndarray) -> np.ndarray:
    """Points (N, 2) of the still scene in a frame."""
    c, s = np.cos(motion[2]), np.sin(motion[2])
    x, y = points[:, 0], points[:, 1]
    return np.stack([c * x - s * y + motion[0], s * x + c * y + motion[1]], axis=-1)


def unplaced(points: np.ndarray, motion: np.ndarray) -> np.ndarray:
    """Points (N, 2) of a frame in the still scene."""
    c, s = np.cos(motion[2]), np.sin(motion[2])
    x, y = points[:, 0] - motion[0], points[:, 1] - motion[1]
    return np.stack([c * x + s * y, c * y - s * x], axis=-1)


def luminance(width: int, height: int, generator: np.random.Generator, fine: int = FINE) -> np.ndarray:
    """A scene over 10 to 14 stops, `fine` times as fine as a frame, with a margin.

    Texture of every size (1/f), walls and windows with hard edges each with its own texture, lamps, and a shadow.
    """
    shape = (fine * (height + 2 * MARGIN), fine * (width + 2 * MARGIN))
    stops = 1.6 * _texture(shape, generator, generator.uniform(0.9, 1.3))
    small = min(shape)
    for _ in range(generator.integers(15, 50)):
        angle = generator.normal(0, 0.1) if generator.random() < 0.7 else generator.uniform(0, np.pi)
        middle, half = generator.uniform(0, shape), generator.uniform(0.01, 0.17, 2) * small
        part, down, across = _around(shape, middle, float(np.hypot(*half)))
        u, v = across * np.cos(angle) + down * np.sin(angle), down * np.cos(angle) - across * np.sin(angle)
        within = (abs(u) < half[0]) & (abs(v) < half[1])
        stops[part] = np.where(within, 0.5 * stops[part] + generator.normal(0, 2.5), stops[part])
    # A shadow over one side, its edge slanting.
    edge = generator.uniform(0.2, 0.8) * shape[1] + generator.normal(0, 0.5) * (np.arange(shape[0]) - shape[0] / 2)
    stops -= np.where(np.arange(shape[1]) > edge[:, None], np.float32(3), np.float32(0))
    scene = np.exp2(np.clip(stops - np.median(stops[::5, ::5]), -8, 6))
    for _ in range(generator.integers(0, 8)):
        middle, radius = generator.uniform(0, shape), generator.uniform(4, 30)
        part, down, across = _around(shape, middle, 3 * radius)
        scene[part] += generator.uniform(20, 300) * np.exp(-(np.minimum(np.hypot(down, across) / radius, 3.0) ** 4))
    # The lens: a blur of about half a pixel of a frame.
    return gaussian_filter(scene, max(0.55 * fine, 0.7)).astype(np.float32)


def _around(shape: tuple[int, int], middle: np.ndarray, reach: float):
    """The part of an array within `reach` of its `middle` (row, column), and how far its rows and columns lie off."""
    first = [max(0, int(m - reach)) for m in middle]
    last = [min(n, int(m + reach) + 1) for n, m in zip(shape, middle, strict=True)]
    down, across = (np.arange(a, b, dtype=np.float32) - m for a, b, m in zip(first, last, middle, strict=True))
    return (slice(first[0], last[0]), slice(first[1], last[1])), down[:, None], across[None, :]


def _texture(shape: tuple[int, int], generator: np.random.Generator, slope: float) -> np.ndarray:
    """Noise whose amplitude falls with frequency to the power `slope`, of deviation 1."""
    waves = np.fft.rfft2(generator.standard_normal(shape).astype(np.float32))
    frequency = np.hypot(np.fft.fftfreq(shape[0])[:, None], np.fft.rfftfreq(shape[1]))
    frequency[0, 0] = np.inf
    texture = np.fft.irfft2(waves / np.maximum(frequency, 2 / max(shape)) ** slope, shape)
    return (texture / texture.std()).astype(np.float32)


def stack(
    seed: int,
    *,
    size: tuple[int, int] | None = None,
    frames: int | None = None,
    scene: np.ndarray | None = None,
    fine: int = FINE,
) -> HandHeld:
    """A hand-held bracket: scene, camera, exposures and motions drawn by `seed`.

    size : (width, height) of the frames; 480×360 to 960×730 unless given
    frames : how many; 3 to 9 unless given, 1 to 2 stops apart
    scene : a luminance to look at instead of a drawn one, `fine` times as fine and with the margin of `luminance`

    Shifts are uniform within ±64 pixels and turns within ±1°; one frame in the middle is not moved. In every third
    bracket things move through the picture. As a photographer would, the bracket stops where a tenth of the scene is
    not white in the longest exposure and a tenth not black in the shortest.
    """
    generator = np.random.default_rng([77, seed])
    if size is None:
        width = int(generator.integers(480, 961))
        size = (width, int(width * generator.uniform(0.66, 0.76)))
    width, height = size
    frames = frames or int(generator.integers(3, 10))
    spacing = generator.uniform(1.0, 2.0)
    scene = luminance(width, height, generator, fine) if scene is None else scene
    coefficients = spline_filter(scene, order=3)
    curve = VirtualCamera(
        toe=tuple(generator.uniform(0.0005, 0.006, 3)),
        power=tuple(generator.uniform(1.8, 2.6) + generator.uniform(-0.1, 0.1, 3)),
        knee=tuple(generator.uniform(0.7, 3.0) * generator.uniform(0.9, 1.1, 3)),
    )
    electrons, read_noise = 10 ** generator.uniform(3.5, 4.7), generator.uniform(2, 8)
    tints = _texture((24, 32), generator, 1.0), _texture((24, 32), generator, 1.0)
    movers = [_mover(generator, size) for _ in range(generator.integers(1, 5))] if seed % 3 == 0 else []
    motions = np.column_stack([generator.uniform(-64, 64, (frames, 2)), np.radians(generator.uniform(-1, 1, frames))])
    motions[frames // 2] = 0
    seconds = _shutter(scene, frames, spacing, generator)
    y, x = np.mgrid[:height, :width]
    pixels = np.stack([(x.ravel() + 0.5) - width / 2, (y.ravel() + 0.5) - height / 2], axis=-1)
    photographs = []
    for index in range(frames):
        still = unplaced(pixels, motions[index])
        columns, rows = (still[:, i] * fine + (n / 2 + MARGIN) * fine - 0.5 for i, n in enumerate(size))
        light = np.empty(len(rows), np.float32)
        map_coordinates(coefficients, [rows, columns], light, order=3, prefilter=False, mode="mirror")
        light = np.maximum(light, 0)
        for mover in movers:
            light = mover(still, light, index)
        place = [(still[:, 1] / height + 0.7) / 1.4 * 23, (still[:, 0] / width + 0.7) / 1.4 * 31]
        red, blue = (np.exp2(0.3 * map_coordinates(tint, place, order=1, mode="nearest")) for tint in tints)
        radiance = np.stack([light * red, light, light * blue], axis=-1).astype(np.float32)
        exposure = np.minimum(radiance * np.float32(seconds[index]), 8)
        scatter = np.sqrt(exposure / np.float32(electrons) + np.float32(read_noise / electrons) ** 2)
        caught = exposure + scatter * generator.standard_normal(exposure.shape, np.float32)
        encoded = np.rint(255 * np.clip(curve.curve(caught), 0, 1)).astype(np.uint8).reshape(height, width, 3)
        photographs.append(Photograph(encoded, f"hand_{index}.jpg", Exposure(float(seconds[index]))))
    return HandHeld(Bracket(tuple(photographs)), motions)


def _shutter(scene: np.ndarray, frames: int, spacing: float, generator: np.random.Generator) -> np.ndarray:
    dark, bright = np.quantile(scene[::7, ::7], [0.1, 0.9])
    shortest, longest = 0.02 / bright, 0.6 / dark
    room = np.log2(longest / shortest)
    spacing = min(spacing, room / (frames - 1))
    first = np.log2(shortest) + generator.uniform(0, 1) * (room - spacing * (frames - 1))
    return 2.0 ** (first + spacing * np.arange(frames))


def _mover(generator: np.random.Generator, size: tuple[int, int]):
    """A textured ellipse that stands somewhere else in every frame."""
    start, way = generator.uniform(-0.4, 0.4, 2) * size, generator.normal(0, 0.06, 2) * size
    radii = generator.uniform(0.03, 0.12, 2) * size[1]
    brightness, waves = 2.0 ** generator.uniform(-4, 3), generator.normal(0, 0.25, 2)

    def over(points: np.ndarray, light: np.ndarray, index: int) -> np.ndarray:
        local = points - start - way * index
        edge = np.hypot(*(local / radii).T)
        cover = np.clip((1 - edge) * radii.min() + 0.5, 0, 1)
        return light * (1 - cover) + cover * brightness * (1.2 + np.sin(local @ waves))

    return over
