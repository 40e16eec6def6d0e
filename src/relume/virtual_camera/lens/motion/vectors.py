"""Motion blur by a vector for each pixel: things that move each on their own, before and behind each other."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from relume.image.bands import in_threads
from relume.virtual_camera.lens.motion.shutter import Shutter
from relume.virtual_camera.protocols import Relative
from relume.virtual_camera.view import View


@dataclass(frozen=True)
class MotionVectors(Relative):
    """Every pixel moves by its vector of `View.motion`, from half of it before the picture given to half of it after.

    shutter : how the light is shared out over that time

    At steps of at most half a pixel's way all pixels are carried to where they are, the nearest by `View.depth` before
    the others, and the pictures are averaged. Where no depth is known the faster of two is taken to be nearer, as it
    is behind a camera that moves, and as things that move before a background are. So a still thing stays as it is to
    the bit and sheds no light over what moves behind it, while a moving one spreads over both.

    Behind a moving thing the picture does not show what comes into sight: it is taken from the first pixel farther
    back on the way, as in McGuire et al. 2012, §2; where there is none, a pixel is averaged over the time known.
    Where all vectors are alike light is kept as by StraightMotion; elsewhere things cover each other, and the sum of
    light does change, as it does on a sensor. Raises ValueError for a view without motion, and for motion or depth of
    another size than the picture.
    """

    shutter: Shutter = field(default_factory=Shutter)

    def apply(self, radiance: np.ndarray, view: View) -> np.ndarray:
        """Radiance (H, W, 3) float32 that the sensor gathers.

        radiance, view : (H, W, 3) float32 in the picture's unit, and the picture's view (`VirtualCamera.view`)
        """
        return _carried(self.shutter, radiance, view)[0]

    def coverage(self, shape: tuple[int, int], view: View) -> np.ndarray:
        """The share (H, W) float32 of a pixel's light that a picture of that shape shows, without guesses.

        view : the picture's view (`VirtualCamera.view`)
        """
        return _carried(self.shutter, np.zeros((*shape, 3), np.float32), view)[1]


def _carried(shutter: Shutter, radiance: np.ndarray, view: View) -> tuple[np.ndarray, np.ndarray]:
    from relume.virtual_camera.lens.motion.splats import TILE, carried_tile, reaches

    height, width = radiance.shape[:2]
    if view.motion is None:
        raise ValueError("the view has no motion; give it a vector for each pixel, pixels right and down")
    for name, plane, shape in (
        ("motion", view.motion, (height, width, 2)),
        ("depth", view.depth, (height, width)),
    ):
        if plane is not None and plane.shape != shape:
            raise ValueError(f"the view's {name} is {plane.shape} and the picture {height}×{width}; expected {shape}")
    motion = np.ascontiguousarray(view.motion, np.float32)
    radiance = np.ascontiguousarray(radiance, np.float32)
    # Orders and separates layers by ratios, of distance or of speed.
    if view.depth is None:
        remoteness = -np.log1p(np.hypot(motion[..., 0], motion[..., 1]))
    else:
        remoteness = np.minimum(np.log(view.depth), 80).astype(np.float32)
    rows, columns = -(-height // TILE), -(-width // TILE)
    boxes = np.empty((rows, columns, 4), np.float32)
    in_threads(lambda begin, end: reaches(motion, boxes, begin, end), rows, chunk=4)
    shown, known = np.empty_like(radiance), np.empty((height, width), np.float32)

    def carry(begin: int, end: int) -> None:
        for tile in range(begin, end):
            carried_tile(radiance, motion, remoteness, boxes, shutter.opening, shown, known, tile)

    in_threads(carry, rows * columns, chunk=4)
    return shown, known
