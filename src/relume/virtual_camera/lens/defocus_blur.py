"""Defocus blur and depth of field: a lens of a given aperture, focused at a distance.

Thin lens with the image plane at distance v behind it, focused on s in front: a point at d is drawn as a disc of
diameter c = A v |1/d − 1/s|, by similar triangles behind the lens and 1/v = 1/f − 1/s (Potmesil & Chakravarty 1981).
With v in pixels, as cameras are calibrated, c is in pixels.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from relume.image.bands import in_threads
from relume.image.photograph import Photograph
from relume.virtual_camera.lens.blades import Blades
from relume.virtual_camera.protocols import Relative
from relume.virtual_camera.view import View, require_size

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

    aperture : diameter of the lens, metres
    focus : distance of the plane in focus, metres
    focal_length : pixels
    acceptable : diameter of a disc that still looks like a point; 1 pixel
    The farthest is infinity from the hyperfocal distance A v / c on.
    Raises ValueError where one of them is not above 0.
    """
    if not (aperture > 0 and focal_length > 0 and acceptable > 0 and focus > 0):
        raise ValueError(f"aperture {aperture}, focus {focus}, focal_length {focal_length}: all must be positive")
    play = acceptable / (aperture * focal_length)
    far = 1 / focus - play
    return 1 / (1 / focus + play), 1 / far if far > 0 else np.inf


TILE = 256
"""Pixels along each side of what is spread at once: its sums stay in the processor's cache."""
BAND = 64
"""Rows whose discs are computed at once."""


@dataclass(frozen=True)
class Defocus(Relative):
    """A thin lens's discs of confusion, by depth (Potmesil & Chakravarty 1981).

    aperture : diameter of the entrance pupil, metres: the focal length over the f-number
    focus : distance that is sharp, metres; infinity too
    blades : of the iris; a round opening if not given

    Every pixel is spread over its own disc, within a sixteenth of a pixel of its radius, and all discs are added front
    to back. So nothing sharp is smeared over what is behind it, while what is blurred before it covers it softly.
    Behind near things the background goes on as beside them: a picture does not show what they hide. A plane at one
    depth keeps its light, lamps and all; near an edge some is covered and some uncovered, as by a lens, so the sum may
    change. At the border the picture goes on as its mirror image, so no dark frame appears.

    Pixels that an edge crosses are spread with its near side; mirrors and glass are spread by the depth of their
    surface, not of what is seen in them.
    """

    aperture: float
    focus: float
    blades: Blades = Blades()

    def __post_init__(self) -> None:
        if not (np.isfinite(self.aperture) and self.aperture > 0):
            raise ValueError(f"the aperture is {self.aperture}; expected its diameter in metres, above 0")
        if not self.focus > 0:
            raise ValueError(f"the focus is {self.focus}; expected metres above 0, or infinity")

    def radius(self, depth: np.ndarray, focal_length: float) -> np.ndarray:
        """The radius of each point's disc, pixels, float32: below 0 before the focus, where the opening is inverted.

        depth : metres; infinity is a value like any other
        focal_length : pixels
        """
        disc = disc_of_confusion(depth, self.aperture, self.focus, focal_length) / 2
        return np.where(depth < self.focus, -disc, disc).astype(np.float32)

    def apply(self, radiance: np.ndarray, view: View) -> np.ndarray:
        """Radiance (H, W, 3) float32 with what is out of focus blurred.

        radiance, view : (H, W, 3) float32 in the picture's unit, and the picture's view (`VirtualCamera.view`)
        Raises ValueError without a depth map, and for discs that are wider than the picture.
        """
        # Numba is imported only where a kernel is used.
        from relume.virtual_camera.lens.defocus_kernels import _defocus
        from relume.virtual_camera.lens.disc_table import disc_table, size_of
        from relume.virtual_camera.lens.disocclusion import hidden_background, unmixed

        height, width = radiance.shape[:2]
        radius = unmixed(self._radii(view, (height, width)))
        size = np.empty((height, width), np.int16)
        for top in range(0, height, BAND):
            size[top : top + BAND] = size_of(radius[top : top + BAND])
        behind, opening = hidden_background(radiance, radius)
        del radius
        table = disc_table(self.blades, int(size.min()), int(size.max()))
        edge = max(TILE, 4 * table.widest)
        across = -(-width // edge)
        out = np.empty_like(radiance)

        def work(begin: int, _: int) -> None:
            top, left = begin // across * edge, begin % across * edge
            place = (top, min(top + edge, height), left, min(left + edge, width))
            _defocus(
                radiance, size, behind, opening, table.deepest, table.lowest, table.first, table.down, table.right,
                table.change, table.reach, table.widest, *place, out,
            )  # fmt: skip

        in_threads(work, across * -(-height // edge), chunk=1)
        return out

    def _radii(self, view: View, shape: tuple[int, int]) -> np.ndarray:
        if view.depth is None:
            raise ValueError("defocus: a depth map of the picture is needed; give one, or blur it all by a soft focus")
        require_size(view.depth, shape)
        radius = np.empty(shape, np.float32)
        for top in range(0, shape[0], BAND):
            radius[top : top + BAND] = self.radius(view.depth[top : top + BAND], view.focal_length)
        widest = float(np.abs(radius).max())
        if 2 * widest > max(shape):
            y, x = np.unravel_index(np.argmax(np.abs(radius)), shape)
            endless = np.isinf(view.depth[y, x])
            away = "infinitely far away" if endless else f"{view.depth[y, x]:g} m away"
            nearer = "" if endless else ", or focus nearer to it"
            raise ValueError(
                f"the disc of confusion at x {x}, y {y}, {away}, is {2 * widest:.0f} pixels wide, wider than the "
                f"picture; stop the aperture of {self.aperture:g} m down, use a shorter lens{nearer}"
            )
        return radius
