"""Scenes in which things move while a virtual camera takes a bracket, with the scene as it was at every instant."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from relume.capture.exposure.bracket import Bracket
from relume.image.photograph import Exposure
from relume.image.response import Response
from synthetic import VirtualCamera

CAMERA = VirtualCamera(electrons=20_000.0, read_noise=6.0)
BRIGHTEST = 30.0
"""Radiance of the brightest background."""


@dataclass(frozen=True, eq=False)
class MovingScene:
    """instants : the radiance (H, W, 3) that each of the exposures of `seconds`, shortest first, saw."""

    name: str
    instants: tuple[np.ndarray, ...]
    seconds: tuple[float, ...]

    def bracket(self, camera: VirtualCamera = CAMERA, *, seed: int = 0, quality: int | None = None) -> Bracket:
        """The photographs, with the camera's noise; `quality` sends them through a JPEG."""
        frames = [
            camera.photograph(scene, Exposure(t), name=f"frame_{i}.jpg", seed=100 * seed + i)
            for i, (scene, t) in enumerate(zip(self.instants, self.seconds, strict=True))
        ]
        for frame in frames if quality is not None else []:
            frame.pixels[:] = through_jpeg(frame.pixels, quality or 0)
        return Bracket(tuple(frames))

    def static(self) -> MovingScene:
        """The same, but nothing moves after the first instant."""
        return MovingScene(f"{self.name}, static", (self.instants[0],) * len(self.instants), self.seconds)


def through_jpeg(pixels: np.ndarray, quality: int) -> np.ndarray:
    """What a JPEG of that quality, with half the colour resolution, leaves of pixels."""
    import io

    from PIL import Image

    file = io.BytesIO()
    Image.fromarray(pixels).save(file, "JPEG", quality=quality, subsampling=2)
    return np.array(Image.open(file))


def known_response(camera: VirtualCamera = CAMERA) -> Response:
    """The camera's own curve with the noise that its photons, its electronics and rounding make at every value."""
    curve = camera.log_exposure()
    curve[:, 0] = curve[:, 1] - 1.0
    exposure, slope = np.exp(curve), np.gradient(curve, axis=1)
    electrons = camera.electrons or np.inf
    caught = exposure / electrons + (camera.read_noise / electrons) ** 2
    return Response(curve, np.sqrt(caught / (slope * exposure) ** 2 + 1 / 12))


def texture(generator: np.random.Generator, shape: tuple[int, int], coarsest: float) -> np.ndarray:
    """Noise of all sizes up to `coarsest` pixels, mean 0, deviation 1."""
    total, size = np.zeros(shape), coarsest
    while size >= 1:
        total += size**0.7 * _unit(ndimage.gaussian_filter(generator.standard_normal(shape), size))
        size /= 2
    return _unit(total)


def _unit(values: np.ndarray) -> np.ndarray:
    return (values - values.mean()) / values.std()


def background(generator: np.random.Generator, shape: tuple[int, int], stops: float) -> np.ndarray:
    """Light from a bright side to a dark one over `stops`, rough with texture, and some hard-edged walls."""
    y, x = np.mgrid[: shape[0], : shape[1]] / np.array(shape)[:, None, None]
    angle = generator.uniform(0, 2 * np.pi)
    slope = (x - 0.5) * np.cos(angle) + (y - 0.5) * np.sin(angle)
    level = stops * (slope - np.ptp(slope) / 2) + 0.35 * texture(generator, shape, 24.0)
    for _ in range(6):
        left, top = generator.uniform(-0.1, 0.9, 2)
        wall = (x > left) & (x < left + generator.uniform(0.05, 0.3)) & (y > top) & (y < top + 0.4)
        level = np.where(wall, level + generator.uniform(-1.5, 0.5), level)
    tint = 2.0 ** (0.15 * np.stack([texture(generator, shape, 40.0) for _ in range(3)], -1))
    return BRIGHTEST * 2.0 ** np.minimum(level, 0)[..., None] * tint


def person(generator: np.random.Generator, size: float) -> tuple[np.ndarray, np.ndarray]:
    """Alpha (h, w) and radiance (h, w, 3) about 1 of a textured figure `size` pixels tall: head, body, two legs."""
    height, width = round(size), round(size * 0.45)
    y, x = np.mgrid[:height, :width]
    u, v = (x + 0.5 - width / 2) / size, (y + 0.5) / size
    head = (u / 0.07) ** 2 + ((v - 0.09) / 0.085) ** 2
    body = (u / 0.16) ** 4 + ((v - 0.38) / 0.22) ** 4
    legs = np.minimum(((u - 0.07) / 0.06) ** 4, ((u + 0.07) / 0.06) ** 4) + ((v - 0.76) / 0.24) ** 4
    alpha = np.clip((1 - np.minimum(np.minimum(head, body), legs)) * 6, 0, 1)
    colours = 2.0 ** generator.uniform(-1.5, 1.5, (3, 3))
    part = np.where(v < 0.18, 0, np.where(v < 0.58, 1, 2))
    cloth = 2.0 ** (0.4 * texture(generator, (height, width), 6.0))
    return alpha, colours[part] * cloth[..., None]


def leaf(generator: np.random.Generator, size: float) -> tuple[np.ndarray, np.ndarray]:
    """Alpha and radiance of one ellipse `size` pixels long."""
    side = int(size) + 3
    y, x = np.mgrid[:side, :side] - (side - 1) / 2
    angle = generator.uniform(0, np.pi)
    along, across = x * np.cos(angle) + y * np.sin(angle), y * np.cos(angle) - x * np.sin(angle)
    alpha = np.clip((1 - np.hypot(along / (size / 2), across / (size / 4))) * 4, 0, 1)
    return alpha, np.full((side, side, 3), 1.0) * 2.0 ** generator.uniform(-0.6, 0.6) * np.array([0.7, 1.1, 0.5])


def put(scene: np.ndarray, sprite: tuple[np.ndarray, np.ndarray], place: np.ndarray, light: float) -> None:
    """Lay a figure over the scene with its upper left corner at (row, column) `place`."""
    alpha, radiance = sprite
    top, left = (int(v) for v in np.round(place))
    rows = slice(max(top, 0), min(top + alpha.shape[0], scene.shape[0]))
    columns = slice(max(left, 0), min(left + alpha.shape[1], scene.shape[1]))
    if rows.start >= rows.stop or columns.start >= columns.stop:
        return
    own = np.s_[rows.start - top : rows.stop - top, columns.start - left : columns.stop - left]
    cover = alpha[own][..., None]
    scene[rows, columns] = cover * light * radiance[own] + (1 - cover) * scene[rows, columns]


def moving_scene(seed: int, *, leaves: bool = False, shape: tuple[int, int] = (320, 480)) -> MovingScene:
    """People crossing, or leaves in the wind, before a background of 5 to 8 stops; 3 to 7 exposures 1 to 2 EV apart."""
    generator = np.random.default_rng([seed, leaves])
    frames, step = ((3, 2.0), (5, 1.0), (4, 1.5), (7, 1.0), (3, 1.0))[seed % 5]
    behind = background(generator, shape, generator.uniform(5, 8))
    # The exposures lie about the background's middle.
    middle = 0.25 / float(np.exp(np.median(np.log(behind))))
    seconds = tuple(middle * 2.0 ** (step * (i - (frames - 1) / 2)) for i in range(frames))
    instants = [behind.copy() for _ in range(frames)]
    level = float(np.exp(np.log(behind).mean()))
    order = generator.permutation(frames)
    if leaves:
        for _ in range(350):
            sprite, place = leaf(generator, generator.uniform(6, 16)), generator.uniform(0, 1, 2) * np.array(shape)
            light = level * 2.0 ** generator.uniform(-1.5, 1.5)
            for scene in instants:
                put(scene, sprite, place + generator.normal(0, 5, 2), light)
    else:
        for _ in range(int(generator.integers(2, 5))):
            size = generator.uniform(0.3, 0.7) * shape[0]
            sprite, light = person(generator, size), level * 2.0 ** generator.uniform(-1.5, 1.0)
            place = np.array(
                [generator.uniform(0.1, 0.9) * shape[0] - size / 2, generator.uniform(0.1, 0.8) * shape[1]]
            )
            step_across = np.array([0.0, generator.choice([-1, 1]) * generator.uniform(0.05, 0.15) * shape[1]])
            for time, scene in zip(order, instants, strict=True):
                put(scene, sprite, place + (time - frames / 2) * step_across, light)
    kind = "leaves" if leaves else "people"
    return MovingScene(f"{kind} {seed}", tuple(s.astype(np.float32) for s in instants), seconds)


def pu21(luminance: np.ndarray) -> np.ndarray:
    """PU21 of luminance, cd/m², for banding and glare (Mantiuk & Azimi 2021, doi 10.1109/PCS50896.2021.9477471)."""
    p = (0.353487901, 0.3734658629, 8.277049286e-05, 0.9062562627, 0.09150303166, 0.9099517204, 596.3148142)
    power = np.clip(luminance, 0.005, 10_000.0) ** p[3]
    return np.maximum(p[6] * (((p[0] + p[1] * power) / (1 + p[2] * power)) ** p[4] - p[5]), 0)


def pu_psnr(radiance: np.ndarray, truth: np.ndarray) -> float:
    """PSNR, dB, of PU21-encoded RGB with a peak of 256, the code of 100 cd/m²; the scene's white is 1000 cd/m²."""
    scale = 1000.0 / BRIGHTEST
    error = pu21(radiance * scale) - pu21(truth * scale)
    return float(20 * np.log10(256 / np.sqrt(np.mean(error.astype(np.float64) ** 2))))
