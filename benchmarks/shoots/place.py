"""What a place to photograph is, and what places are built from; objects stand on z = 0.

Frame: metres, Z up, origin below the middle of the calibration board on what the objects stand on. A `Place` says what
is really there; `tape` says what a tape measure said of it, in relume's frame (+Y up), to half a centimetre.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from blender import quad
from materials import Triple, image, painted, principled
from radiosity import Lamp, lit, walls_of


@dataclass(frozen=True)
class View:
    """A camera: where it stands, what it looks at, its horizontal field of view in degrees."""

    position: Triple
    look_at: Triple
    field_of_view: float


@dataclass(frozen=True)
class Place:
    """A place to photograph.

    build, things : make the surroundings, and the objects
    plate, size : the plate's camera and its pixels
    region : left, bottom, right and top of what the objects change, as shares of the plate
    ball, ball_cameras : the mirrored ball's radius, and where its cameras stood
    ball_reflectance : of the ball
    board : the board's thickness
    tape : what was measured there, for the photographer
    """

    build: Callable[[], None]
    things: Callable[[], list[Any]]
    plate: View
    size: tuple[int, int]
    ball: float
    ball_cameras: dict[str, Triple]
    board: float
    region: tuple[float, float, float, float]
    ball_reflectance: float = 1.0
    squares: tuple[int, int] = (9, 6)
    square: float = 0.03
    tape: dict[str, Any] = field(default_factory=dict)

    def ball_view(self, name: str) -> View:
        """The ball fills 0.88 of the picture."""
        position = self.ball_cameras[name]
        distance = math.dist(position, (0, 0, self.ball))
        half = math.atan(math.tan(math.asin(self.ball / distance)) / 0.88)
        return View(position, (0, 0, self.ball), 2 * math.degrees(half))


def plain(name: str, colour: Triple, roughness: float = 0.9) -> Any:
    return principled(name, colour, roughness=roughness)


def painted_box(low: Triple, high: Triple, albedo: dict[str, np.ndarray], lamps: list[Lamp]) -> None:
    """Six walls painted with the light that falls on them."""
    walls = walls_of(low, high)
    for name, radiance in lit(walls, albedo, lamps).items():
        wall = walls[name]
        quad(name, tuple(wall.centre), tuple(wall.across), tuple(wall.up), painted(name, radiance))


def wall_colours(
    colour: Triple, things: Sequence[tuple[float, float, float, float, Triple]] = (), seed: int = 0
) -> np.ndarray:
    """The albedo of a wall, a little uneven, with rectangles on it: left, bottom, right, top as shares, colour."""
    generator = np.random.default_rng(seed)
    pixels = np.ones((192, 192, 3)) * colour
    for left, bottom, right, top, shade in things:
        rows = slice(round(192 * (1 - top)), round(192 * (1 - bottom)))
        columns = slice(round(192 * left), round(192 * right))
        lines = generator.normal(size=(1, columns.stop - columns.start, 1))
        pixels[rows, columns] = np.array(shade) * (1 + 0.1 * lines)
    return np.clip(pixels * (1 + 0.015 * generator.normal(size=(192, 192, 1))), 0, 0.95)


def streaks(colour: Triple, amount: float, seed: int, shape: tuple[int, int] = (512, 1024)) -> Any:
    """Wood: lines along the image's width."""
    generator = np.random.default_rng(seed)
    lines = generator.normal(size=(shape[0], 1)) + 0.6 * np.repeat(generator.normal(size=(shape[0] // 16, 1)), 16, 0)
    waves = 0.5 * np.sin(np.linspace(0, 9, shape[1]) + np.linspace(0, 40, shape[0])[:, None])
    return image("wood", np.clip(np.array(colour) * (1 + amount * (lines + waves))[..., None], 0, 1))


def stones(rows: int, seed: int, shape: int = 2048) -> Any:
    """Paving: stones of one shade each with dark joints, every second row by half a stone aside."""
    generator = np.random.default_rng(seed)
    y, x = np.mgrid[:shape, :shape] * (rows / shape)
    row = np.floor(y).astype(int)
    x = x / 1.5 + 0.5 * (row % 2)
    column = np.floor(x).astype(int)
    shade = generator.normal(0, 0.05, (rows, rows + 1))[row, column]
    tint = generator.normal(0, 0.012, (rows, rows + 1, 3))[row, column]
    joint = np.minimum(np.minimum(y % 1, 1 - y % 1), 1.5 * np.minimum(x % 1, 1 - x % 1)) < 0.025
    grain = generator.normal(0, 0.025, (shape, shape))
    colour = np.array([0.62, 0.59, 0.54]) + (shade + grain)[..., None] + tint
    return image("stones", np.clip(np.where(joint[..., None], colour * 0.55, colour), 0, 1))
