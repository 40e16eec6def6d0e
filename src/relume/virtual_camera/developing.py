"""Developing: `develop` makes a photograph of a radiance map, `develop_frames` those of a sequence."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np

from relume.image.bands import BAND
from relume.image.photograph import Photograph
from relume.image.radiance import RadianceMap
from relume.virtual_camera.film.film import Film
from relume.virtual_camera.protocols import ToneOperator
from relume.virtual_camera.view import View
from relume.virtual_camera.virtual_camera import VirtualCamera


def develop(
    radiance: RadianceMap | np.ndarray,
    camera: VirtualCamera | Film | ToneOperator = VirtualCamera(),
    view: View | None = None,
) -> Photograph:
    """Develop scene-linear radiance into a photograph (Debevec & Malik 1997, §2.7, eq. 1).

    radiance : a map, or an array (H, W, 3) that counts as a relative one
    camera : a `VirtualCamera`; a `Film` or a tone operator alone stands for a camera without a lens
    view : the picture's field of view, depth, motion and seed; `camera.view(picture)` unless given

    Values beyond the display's white saturate, as in a camera. A film without grain is a curve and nothing else: it
    takes negative radiance as black, and black everywhere as a black picture. All other cameras warn of negative
    radiance. Raises ValueError for radiance that is not finite or, unless a film meets it, black everywhere, and for
    displays that only a file can hold (PQ, HLG, gain maps): use `camera.tone_map(picture).write(path)` for them.
    """
    if isinstance(camera, Film) and camera.grain is None:
        return _by_curve(camera, np.asarray(radiance.radiance if isinstance(radiance, RadianceMap) else radiance))
    picture = radiance if isinstance(radiance, RadianceMap) else RadianceMap(np.asarray(radiance, np.float32))
    return _camera(camera).tone_map(picture, view).photograph()


def develop_frames(
    pictures: Iterable[RadianceMap],
    camera: VirtualCamera | Film | ToneOperator = VirtualCamera(),
    views: Iterable[View] | None = None,
    *,
    frames_per_second: float = 24.0,
    settling: float = 0.4,
) -> Iterator[Photograph]:
    """Develop the frames of a sequence one after another; the adaptation to the light carries over between them.

    pictures : the frames' radiance, in order; they may be made one by one
    camera : as in `develop`
    views : of the frames; all have the first frame's unless given
    frames_per_second : of the sequence, so that the adaptation knows how much time goes by
    settling : how many seconds the adaptation takes to go 63 % of its way to a new light
    The arguments are those of `VirtualCamera.tone_map_frames`. Raises ValueError as it does, and as `develop`.
    """
    made = _camera(camera).tone_map_frames(pictures, views, frames_per_second=frames_per_second, settling=settling)
    for count, frame in enumerate(made, start=1):
        yield frame.photograph(f"frame {count}")


def _by_curve(film: Film, radiance: np.ndarray) -> Photograph:
    """A film without grain, some rows at a time: its float64 is a dozen times as large as the picture."""

    def developed(rows: slice) -> np.ndarray:
        values = film.pixel_values(radiance[rows])
        if np.isnan(values).any():
            y, x = np.argwhere(np.isnan(values).any(-1))[0]
            raise ValueError(
                f"the radiance at x {x}, y {rows.start + y} is not a number; repair or mask it before developing"
            )
        return np.rint(values).astype(np.uint8)

    height, width = radiance.shape[:2]
    shown, step = np.empty(radiance.shape, np.uint8), max(1, BAND // max(width, 1))
    for begin in range(0, height, step):
        rows = slice(begin, min(begin + step, height))
        shown[rows] = developed(rows)
    return Photograph(shown, "developed picture")


def _camera(camera: VirtualCamera | ToneOperator) -> VirtualCamera:
    return camera if isinstance(camera, VirtualCamera) else VirtualCamera(tone=camera)
