"""Moving a photograph onto another: a shift and a turn of encoded pixels that lets no false mid-tone come up."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from relume.image.bands import in_threads
from relume.image.photograph import Photograph

SATURATED_SHARE = 0.98
"""The top 2 % of the values count as saturated: 250 of 255. JPEG leaves 250 to 254 where 255 was."""
STEEPEST = np.radians(20.0)
"""A hand turns a camera by a degree or two; a frame that is turned by more was not taken as one of a bracket."""


@dataclass(frozen=True)
class Motion:
    """Where a frame holds what the reference shows: p in the reference is found at R(angle) p + (dx, dy) in the frame.

    dx, dy : shift, pixels, to the right and down
    angle : turn about the picture's centre, radians; positive is clockwise as seen, since y points down

    Positions are measured from the picture's centre, (W/2, H/2) with pixel centres at ½.
    """

    dx: float = 0.0
    dy: float = 0.0
    angle: float = 0.0

    def apply(self, positions: np.ndarray) -> np.ndarray:
        """Positions (…, 2) in the frame of positions (…, 2) in the reference, pixels from the centre."""
        cosine, sine = np.cos(self.angle), np.sin(self.angle)
        x, y = positions[..., 0], positions[..., 1]
        return np.stack([cosine * x - sine * y + self.dx, sine * x + cosine * y + self.dy], axis=-1)

    def displacement(self, size: tuple[int, int]) -> float:
        """Root mean square over a picture of `size` (width, height) of how far its pixels move, pixels."""
        chord, (width, height) = 2 * np.sin(self.angle / 2), size
        # The turn moves a pixel by the chord times its distance from the centre, as often left as right.
        return float(np.sqrt(self.dx**2 + self.dy**2 + chord**2 * (width**2 + height**2) / 12))


def move(photograph: Photograph, motion: Motion, *, whole_beside_white: bool = False) -> Photograph:
    """The photograph as the reference sees it: every pixel fetched from where `motion` says it is.

    motion : of this photograph; all zero gives the same object back
    whole_beside_white : where a channel leans on a saturated value, take the nearest pixel as it is. For the shortest
        exposure of a bracket: no other measures what lies beside its lamps, which would be as bright as white there

    Encoded values are interpolated (bicubic, Catmull–Rom), channel by channel. A value that leans on a saturated one
    (the top 2 %) becomes white and one that leans on 0 becomes 0: what was clipped stays clipped. Pixels that come
    from beyond the border, or lean on one that was `outside`, are `outside`; they hold the nearest pixel's value.
    Whole pixels without a turn are copied. Raises ValueError for a turn of more than 20° or a motion that is not
    finite.
    """
    if motion == Motion():
        return photograph
    if not (np.isfinite([motion.dx, motion.dy, motion.angle]).all() and abs(motion.angle) <= STEEPEST):
        raise ValueError(f"motion is {motion}; expected finite shifts and an angle within ±20°")
    width, height = photograph.size
    if abs(motion.dx) >= 2 * width or abs(motion.dy) >= 2 * height:
        return replace(photograph, outside=np.ones((height, width), bool))
    if motion.angle == 0 and motion.dx == round(motion.dx) and motion.dy == round(motion.dy):
        return _copied(photograph, round(motion.dx), round(motion.dy))
    return _interpolated(photograph, motion, whole_beside_white)


def _copied(photograph: Photograph, dx: int, dy: int) -> Photograph:
    width, height = photograph.size
    columns, rows = np.arange(width) + dx, np.arange(height) + dy
    places = np.ix_(np.clip(rows, 0, height - 1), np.clip(columns, 0, width - 1))
    outside = ((rows < 0) | (rows >= height))[:, None] | ((columns < 0) | (columns >= width))
    if photograph.outside is not None:
        outside |= photograph.outside[places]
    return replace(photograph, pixels=photograph.pixels[places], outside=outside)


def _interpolated(photograph: Photograph, motion: Motion, whole_beside_white: bool) -> Photograph:
    # Numba is imported only where a kernel is used.
    from relume.capture.alignment.border_kernel import _beyond, _lean_outside, _take_whole
    from relume.capture.alignment.clipped_blocks import BLOCK
    from relume.capture.alignment.warping_kernel import _move

    width, height = photograph.size
    cosine, sine = np.cos(motion.angle), np.sin(motion.angle)
    corner = np.array([0.5 - width / 2, 0.5 - height / 2])
    x_start, y_start = motion.apply(corner) - corner
    pixels = np.ascontiguousarray(photograph.pixels).reshape(-1)
    columns = (np.arange(3 * width + 24) // 3).astype(np.float32)
    most = int(np.iinfo(pixels.dtype).max)
    white = int(np.ceil(SATURATED_SHARE * most))
    held = np.zeros((height, -(-3 * width // BLOCK)), np.uint8)
    moved = np.empty_like(pixels)
    outside = np.empty((height, width), bool)
    before = None if photograph.outside is None else np.ascontiguousarray(photograph.outside)
    place = cosine, sine, x_start, y_start

    def work(begin: int, end: int) -> None:
        limits = np.float32(white), np.float32(most)
        _move(pixels, held, *place, *limits, begin, end, columns, moved)
        _beyond(*place, begin, end, outside)
        if before is not None:
            _lean_outside(before, *place, begin, end, outside)
        if whole_beside_white:
            _take_whole(pixels, *place, white, begin, end, outside, moved)

    in_threads(work, height, chunk=64)
    return replace(photograph, pixels=moved.reshape(height, width, 3), outside=outside)
