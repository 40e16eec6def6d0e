"""A reflectance field: a subject's pictures under one light at a time, each per unit of that light's irradiance.

R_i(x, y) is the radiance of pixel (x, y) when light i alone shines with irradiance 1 on a surface that faces it
(Debevec et al. 2000, eq. 2). What a field holds may be larger than memory: it is asked for blocks.
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from relume.lightstage.field.lights import StageLights
from relume.scene.cameras.camera import Camera


@dataclass(frozen=True)
class Noise:
    """The variance of a field's values R: `constant` + `slope` · R, as of a sensor's reading and of its photons.

    constant : squared unit of the field
    slope : unit of the field
    """

    constant: float
    slope: float = 0.0

    def __post_init__(self) -> None:
        if not (0 <= self.constant < np.inf and 0 <= self.slope < np.inf):
            raise ValueError(f"{self}: expected two finite numbers that are not below 0")


class ReflectanceField(Protocol):
    """A reflectance field: what can be relit (Debevec et al. 2000, §2.1).

    lights : the lights its pictures were taken under
    shape : rows and columns of every picture
    camera : where they were taken from; None where unknown
    noise : of its values; None where unknown
    """

    @property
    def lights(self) -> StageLights:
        """Where the lights stand, and their names."""
        ...

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns of its pictures."""
        ...

    @property
    def camera(self) -> Camera | None:
        """The camera that took it, world, metres; None where it is not known."""
        ...

    @property
    def noise(self) -> Noise | None:
        """How noisy its values are; None where nothing is known."""
        ...

    def block(self, lights: slice, rows: slice) -> np.ndarray:
        """Values (lights, rows, columns, 3) float32 of these lights and rows; slices have a step of 1."""
        ...


class Derived:
    """A field that is made of another, `field`, with its lights, size, camera and noise."""

    field: ReflectanceField

    @property
    def lights(self) -> StageLights:
        return self.field.lights

    @property
    def shape(self) -> tuple[int, int]:
        return self.field.shape

    @property
    def camera(self) -> Camera | None:
        return self.field.camera

    @property
    def noise(self) -> Noise | None:
        return self.field.noise


@dataclass(frozen=True, eq=False)
class Pictures:
    """A reflectance field held in memory.

    values : (N, H, W, 3); float32 or float16, or uint8 that `scale` turns into values
    lights : N of them
    camera, noise : as of every `ReflectanceField`
    scale : (N,) float32, what the value 1 of each picture stands for; 1 unless given
    """

    values: np.ndarray
    lights: StageLights
    camera: Camera | None = None
    noise: Noise | None = None
    scale: np.ndarray | None = None

    def __post_init__(self) -> None:
        shape = self.values.shape
        if len(shape) != 4 or shape[3] != 3 or shape[0] != len(self.lights) or 0 in shape:
            raise ValueError(f"values are {shape}; expected ({len(self.lights)} lights, rows, columns, 3)")
        if self.values.dtype not in (np.float32, np.float16, np.uint8):
            raise ValueError(f"values are {self.values.dtype}; expected float32, float16 or uint8")
        if self.scale is not None and self.scale.shape != (shape[0],):
            raise ValueError(f"scale is {self.scale.shape}; expected one number a light, ({shape[0]},)")
        if self.camera is not None and (self.camera.height, self.camera.width) != shape[1:3]:
            raise ValueError(
                f"the camera takes pictures of {self.camera.width}×{self.camera.height}, but they are "
                f"{shape[2]}×{shape[1]}"
            )

    @property
    def shape(self) -> tuple[int, int]:
        """The rows and columns of every picture."""
        return self.values.shape[1], self.values.shape[2]

    def block(self, lights: slice, rows: slice) -> np.ndarray:
        """Values (lights, rows, columns, 3) float32 of these lights and rows; slices have a step of 1."""
        part = self.values[lights, rows].astype(np.float32)
        return part if self.scale is None else part * self.scale[lights, None, None, None].astype(np.float32)


def whole(field: ReflectanceField) -> np.ndarray:
    """All values of a field at once, (N, H, W, 3) float32."""
    return field.block(slice(0, len(field.lights)), slice(0, field.shape[0]))


@dataclass(frozen=True)
class Work:
    """What reading a whole field takes.

    lights, shape : how many lights, and (rows, columns)
    allowed : bytes of memory
    seconds : about; None where it was not measured
    """

    lights: int
    shape: tuple[int, int]
    allowed: int
    seconds: float | None

    @property
    def value_bytes(self) -> int:
        """The bytes of all values as floats."""
        return self.lights * self.shape[0] * self.shape[1] * 3 * 4

    @property
    def memory(self) -> int:
        """The bytes of the values that are held at once."""
        return min(self.value_bytes, self.allowed)


def estimate_work(field: ReflectanceField, memory: int, more_seconds: float = 0.0) -> Work:
    """What reading the field takes; the time is that of some rows, times the rest.

    field : whose pictures would be read
    memory : bytes that may be used
    more_seconds : of other work
    """
    rows = field.shape[0]
    some = min(rows, 4)
    first = _seconds(field, slice(0, some))
    # The first rows of a folder cost reading its pictures, which those after them may find in memory.
    after = _seconds(field, slice(some, 2 * some)) if rows > some else 0.0
    return Work(len(field.lights), field.shape, memory, first + after * (rows / some - 1) + more_seconds)


def _seconds(field: ReflectanceField, rows: slice) -> float:
    begin = time.perf_counter()
    field.block(slice(0, len(field.lights)), rows)
    return time.perf_counter() - begin
