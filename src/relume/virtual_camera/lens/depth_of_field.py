"""Depth of field: the aperture of a lens, how large it draws a point that is out of focus, and how deep its focus is.

Thin lens with the image plane at distance v behind it, focused on s in front: a point at d is drawn as a disc of
diameter c = A v |1/d − 1/s|, by similar triangles behind the lens and 1/v = 1/f − 1/s (Potmesil & Chakravarty 1981).
With v in pixels, as cameras are calibrated, c is in pixels.
"""

from __future__ import annotations

import numpy as np

from relume.image.photograph import Photograph

ACCEPTABLE = 1.0
"""Pixels: a disc as wide as a pixel is sharp in the picture at hand, whatever its print."""


def aperture_of(f_number: float, focal_length: float) -> float:
    """The diameter of a lens' entrance pupil, metres: A = f / N (ISO 517).

    f_number : N, as EXIF has it
    focal_length : f, mm, of the lens itself and not its 35 mm equivalent
    Raises ValueError unless both are positive.
    """
    for name, value in (("f_number", f_number), ("focal_length", focal_length)):
        if not (np.isfinite(value) and value > 0):
            raise ValueError(f"{name} is {value}; expected a positive number")
    return focal_length / 1000 / f_number


def aperture_from(photograph: Photograph) -> float | None:
    """The aperture by a photograph's EXIF, metres; None without f-number or focal length in mm."""
    f_number = None if photograph.exposure is None else photograph.exposure.f_number
    focal_length = photograph.settings.focal_length
    return None if f_number is None or focal_length is None else aperture_of(f_number, focal_length)


def disc_of_confusion(distance: np.ndarray | float, aperture: float, focus: float, focal_length: float) -> np.ndarray:
    """Diameter in pixels of the disc as which a point is drawn.

    distance : of the point, metres along the view; infinity is a value like any other
    aperture : diameter, metres
    focus : distance that is sharp, metres; infinity too
    focal_length : v, pixels, of the calibrated camera
    Raises ValueError for a focus or distance that is not positive.
    """
    if not focus > 0 or not np.all(np.asarray(distance) > 0):
        raise ValueError(f"focus {focus} and distance must be positive metres, before the camera")
    return aperture * focal_length * np.abs(1 / np.asarray(distance, np.float64) - 1 / focus)


def depth_of_field(
    aperture: float, focus: float, focal_length: float, *, acceptable: float = ACCEPTABLE
) -> tuple[float, float]:
    """The nearest and the farthest distance, metres, that are drawn with discs of at most `acceptable` pixels.

    The farthest is infinity from the hyperfocal distance A v / c on.
    """
    if not (aperture > 0 and focal_length > 0 and acceptable > 0 and focus > 0):
        raise ValueError(f"aperture {aperture}, focus {focus}, focal_length {focal_length}: all must be positive")
    play = acceptable / (aperture * focal_length)
    far = 1 / focus - play
    return 1 / (1 / focus + play), 1 / far if far > 0 else np.inf
