"""The virtual camera: everything between a scene's radiance and a picture, in the order in which light meets it."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from relume.develop.display.clipping import Clipping
from relume.develop.display.displays import Display, Srgb
from relume.develop.display.encoding import encoded
from relume.develop.display.writing import write_display
from relume.develop.soundness import sound
from relume.develop.steps import Adaptation, Optics, Tone
from relume.develop.tone.metered import Linear, Metered
from relume.develop.view import FIELD_OF_VIEW, View, view_of
from relume.image.photograph import Photograph
from relume.image.radiance import RadianceMap

IN_ORDER = ("motion", "defocus", "soft_focus", "glare", "geometry", "vignetting")
"""Where light meets what: the world moves before the lens, the lens draws it out of focus, scatters and bends it, and
the sensor's corners get less of it."""


@dataclass(frozen=True, eq=False)
class VirtualCamera:
    """A lens, and what the light behind it falls on: a film, a sensor, or an eye.

    motion : while the shutter is open, as `StraightMotion`, `TurningCamera`, `MotionVectors`
    defocus : by depth, as `Defocus`
    soft_focus : of the whole picture, as `SoftFocus`, or the sharpness of a plate
    glare : scattered and diffracted light, as `EyeGlare`, `CameraGlare`, `MeasuredGlare`
    geometry : distortion and lateral colour, as `LensGeometry`
    vignetting : as `CosineFourth`, `PolynomialVignetting`, `MeasuredVignetting`
    tone : what makes the light a picture: a camera's `Film`, a `Darkroom`, or a model of the eye as
        `HistogramAdjustment`; plain exposure unless given, because it changes nothing else
    stops : by which the light is brighter than the tone settled for; negative darkens
    display : what the picture is encoded for

    All is done in linear light up to the tone, whatever order it is written in: what saturates does so last.
    """

    motion: Optics | None = None
    defocus: Optics | None = None
    soft_focus: Optics | None = None
    glare: Optics | None = None
    geometry: Optics | None = None
    vignetting: Optics | None = None
    tone: Tone = Metered()
    stops: float = 0.0
    display: Display = Srgb()

    def __post_init__(self) -> None:
        if not abs(self.stops) <= 100:
            raise ValueError(f"stops is {self.stops}; expected −100 to 100")

    @property
    def optics(self) -> tuple[Optics, ...]:
        """What the light passes, in order."""
        parts = (getattr(self, name) for name in IN_ORDER)
        return tuple(part for part in parts if part is not None)

    @property
    def is_absolute(self) -> bool:
        """Whether any step asks for luminances in cd/m², as models of the eye do."""
        return any(getattr(step, "absolute", False) for step in (*self.optics, self.tone))

    def image(self, radiance: np.ndarray, view: View) -> np.ndarray:
        """Radiance (H, W, 3) as the lens draws it on the sensor, in its unit; the input itself without optics."""
        for part in self.optics:
            radiance = part.applied(radiance, view)
        return radiance

    def view(
        self,
        picture: RadianceMap,
        *,
        field_of_view: float = FIELD_OF_VIEW,
        luminance_scale: float | None = None,
        depth: np.ndarray | None = None,
        motion: np.ndarray | None = None,
        seed: int = 0,
    ) -> View:
        """The view of a picture for this camera: `view_of`, which warns where a relative map has to be absolute."""
        return view_of(
            picture,
            field_of_view=field_of_view,
            luminance_scale=luminance_scale,
            depth=depth,
            motion=motion,
            seed=seed,
            absolute=self.is_absolute,
        )


@dataclass(frozen=True, eq=False)
class Developed:
    """A picture before it is encoded: `gain` × `values` are linear display values, Rec. 709, 1 the display's white.

    values : (H, W, 3) float32, not clipped; of plain exposure the radiance itself, so that it is not copied
    gain : factor on them
    display : what they were made for
    adaptation : what the tone had settled on
    """

    values: np.ndarray
    gain: float
    display: Display
    adaptation: Adaptation

    @property
    def displayed(self) -> np.ndarray:
        """The linear display values (H, W, 3) float32."""
        return self.values if self.gain == 1 else self.values * np.float32(self.gain)

    def photograph(self, name: str = "developed picture") -> Photograph:
        """The picture in memory; what is beyond white or black saturates. Raises ValueError for HDR displays."""
        return Photograph(encoded(self.values, self.display, gain=self.gain), name)

    def written(self, path: str | os.PathLike[str]) -> Clipping:
        """Write the picture for its display, and tell how much of it is white or black; raises as `write_display`."""
        return write_display(path, self.values, self.display, gain=self.gain)


def developed(
    picture: RadianceMap, camera: VirtualCamera, view: View | None = None, *, adaptation: Adaptation | None = None
) -> Developed:
    """Take a radiance map through a virtual camera, up to where it is encoded for a display or a file.

    view : the picture's lens, depth, motion and seed; `camera.view(picture)` unless given
    adaptation : what the tone has settled on; what it settles on before this picture unless given
    Raises ValueError for radiance that is not finite or black everywhere.
    """
    picture = sound(picture)
    view = camera.view(picture) if view is None else view
    image = camera.image(picture.radiance, view)
    return _toned(image, camera, view, camera.tone.adapted(image, view) if adaptation is None else adaptation)


def _toned(image: np.ndarray, camera: VirtualCamera, view: View, settled: Adaptation) -> Developed:
    """What the tone makes of the light behind the lens."""
    tone, stops = camera.tone, 2.0**camera.stops
    if isinstance(tone, Linear):
        return Developed(image, tone.gain(settled, view) * stops, camera.display, settled)
    brighter = image if stops == 1 else image * np.float32(stops)
    return Developed(tone.displayed(brighter, view, settled), 1.0, camera.display, settled)


def photograph(picture: RadianceMap, camera: VirtualCamera = VirtualCamera(), view: View | None = None) -> Photograph:
    """Photograph a radiance map by a virtual camera, in one call (Debevec & Malik 1997, §2.7).

    view : the picture's lens, depth, motion and seed; `camera.view(picture)` unless given
    Values beyond the display's white saturate, as in a camera. Raises ValueError as `developed`, and for the displays
    that only a file can hold: write `developed(picture, camera)` for them.
    """
    return developed(picture, camera, view).photograph()


def developed_frames(
    pictures: Iterable[RadianceMap],
    camera: VirtualCamera,
    views: Iterable[View] | None = None,
    *,
    frames_per_second: float = 24.0,
    settling: float = 0.4,
) -> Iterator[Developed]:
    """Develop frame after frame, with an adaptation that follows the light as steadily as an eye's: nothing flickers.

    views : of the frames; the first frame's own for all unless given, so that a relative map's supposed luminance does
        not change from frame to frame. Every frame draws other grain
    settling : seconds after which the adaptation has gone 63 % of its way to a new light. 0.4 is of the order of the
        cones' neural adaptation and of a video camera's exposure control; 0 settles on each frame alone
    Raises ValueError for a rate that is not above 0 or a negative settling, and as `developed`.
    """
    if not frames_per_second > 0 or not settling >= 0:
        raise ValueError(
            f"frames_per_second {frames_per_second} and settling {settling}; expected above 0, and 0 or more"
        )
    share = 1.0 if settling == 0 else 1 - float(np.exp(-1 / (frames_per_second * settling)))
    each = None if views is None else iter(views)
    view, settled = None, None
    for index, frame in enumerate(pictures):
        frame = sound(frame, name=f"frame {index + 1}")
        if each is not None:
            view = next(each)
        elif view is None:
            view = camera.view(frame)
        now = replace(view, seed=view.seed + index)
        image = camera.image(frame.radiance, now)
        own = camera.tone.adapted(image, now)
        settled = own if settled is None else settled.mixed(own, share)
        yield _toned(image, camera, now, settled)
