"""The virtual camera: everything between a scene's radiance and a picture, in the order in which light meets it."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from relume.errors import warn
from relume.image.colour import luminance
from relume.image.photograph import Photograph
from relume.image.radiance import RadianceMap
from relume.virtual_camera.protocols import Adaptation, Optics, Pixelwise, ToneOperator
from relume.virtual_camera.settling import Settled
from relume.virtual_camera.tone.display.code_table import Clipping
from relume.virtual_camera.tone.display.encoding import Display, DisplayP3, Srgb, encoded
from relume.virtual_camera.tone.display.writing import profile_of, write_display
from relume.virtual_camera.tone.metered import LinearExposure, MeteredExposure
from relume.virtual_camera.validation import validate_radiance
from relume.virtual_camera.view import FIELD_OF_VIEW, SUPPOSED_LUMINANCE, View, log_mean, require_size, seen_luminance

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
    tone: ToneOperator = MeteredExposure()
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
        return any(step.absolute for step in (*self.optics, self.tone))

    def image(self, radiance: np.ndarray, view: View) -> np.ndarray:
        """Radiance (H, W, 3) as the lens draws it on the sensor, in its unit; the input itself without optics.

        radiance : (H, W, 3) float32 in front of the lens
        view : of the picture, as `view` makes it
        """
        for part in self.optics:
            radiance = part.apply(radiance, view)
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
        """The view of a picture for this camera, its planes checked.

        picture : what will be developed
        field_of_view : horizontal, radians, below π
        luminance_scale : cd/m² per unit of a relative map. Where a step asks for cd/m² and none is given, such a map is
            taken to have the log mean 100 cd/m², as of a lit room, with a warning
        depth : (H, W) metres along the viewing axis, for blur by depth; None where unknown
        motion : (H, W, 2) pixels right and down while the shutter is open, for blur by motion; None where unknown
        seed : of grain and all else that is drawn at random

        Raises ValueError for planes of another size than the picture, for depths that are not positive, and for a scale
        with a map that is in cd/m² already.
        """
        width, height = picture.size
        if not 0 < field_of_view < np.pi:
            raise ValueError(
                f"field_of_view is {np.degrees(field_of_view):g}°; expected more than 0° and less than 180°"
            )
        if depth is not None:
            require_size(depth, (height, width))
            if not np.all(depth > 0):
                y, x = np.argwhere(~(depth > 0))[0]
                raise ValueError(f"the depth at x {x}, y {y} is {depth[y, x]}; expected metres above 0, or infinity")
        if motion is not None and (motion.shape != (height, width, 2) or not np.all(np.isfinite(motion))):
            raise ValueError(f"motion is {motion.shape}; expected finite ({height}, {width}, 2), pixels right and down")
        if picture.unit == "cd/m²" and luminance_scale is not None:
            raise ValueError("the picture is in cd/m² already; a luminance scale belongs to relative maps alone")
        scale = 1.0 if luminance_scale is None else luminance_scale
        if self.is_absolute and luminance_scale is None and picture.unit != "cd/m²":
            scale = SUPPOSED_LUMINANCE / log_mean(luminance(picture.radiance))
            warn(
                f"the picture's unit is relative: its log mean is taken to be {SUPPOSED_LUMINANCE:g} cd/m², a lit "
                "room; give cd/m² per unit if you know it (--luminance)"
            )
        focal_length = width / 2 / np.tan(field_of_view / 2)
        return View(float(focal_length), float(scale), depth, motion, seed)

    def tone_map(
        self, picture: RadianceMap, view: View | None = None, *, adaptation: Adaptation | None = None
    ) -> ToneMapped:
        """Take a radiance map through the lens and the tone operator, up to where it is encoded for a display.

        picture : radiance in front of the lens
        view : the picture's lens, depth, motion and seed; `self.view(picture)` unless given
        adaptation : what the operator has adapted to; unless given, it adapts to this picture
        Raises ValueError for radiance that is not finite or black everywhere.
        """
        picture = validate_radiance(picture)
        view = self.view(picture) if view is None else view
        image = self.image(picture.radiance, view)
        return self.tone_mapped(image, view, self.tone.adapt(image, view) if adaptation is None else adaptation)

    def tone_mapped(self, image: np.ndarray, view: View, adaptation: Adaptation) -> ToneMapped:
        """What the tone operator makes of the radiance behind the lens, as `image` returns it.

        image : (H, W, 3) radiance behind the lens
        view : of the picture, as `view` makes it
        adaptation : what the operator has adapted to
        """
        tone, factor = self.tone, 2.0**self.stops
        if isinstance(tone, LinearExposure):
            return ToneMapped(image, tone.gain(adaptation, view) * factor, self.display, adaptation)

        def shown(rows: np.ndarray) -> np.ndarray:
            return tone.display_values(rows if factor == 1 else rows * np.float32(factor), view, adaptation)

        if isinstance(tone, Pixelwise):
            return ToneMapped(image, 1.0, self.display, adaptation, shown)
        return ToneMapped(shown(image), 1.0, self.display, adaptation)

    def tone_map_frames(
        self,
        pictures: Iterable[RadianceMap],
        views: Iterable[View] | None = None,
        *,
        frames_per_second: float = 24.0,
        settling: float = 0.4,
    ) -> Iterator[ToneMapped]:
        """Tone map the frames of a sequence. The adaptation follows the light slowly, as an eye's: nothing flickers.

        pictures : the frames' radiance, in order; they may be made one by one
        views : of the frames; unless given, all have the first frame's, so that the luminance assumed for a relative
            map does not change from frame to frame. Every frame has its own grain
        frames_per_second : of the sequence, so that the adaptation knows how much time goes by
        settling : seconds after which the adaptation has gone 63 % of its way to a new light. 0.4 is slower than the
            cones (0.08 s), so that flashing lamps do not pump the picture, and fast enough to
            follow a camera that goes through a door; 0 adapts to each frame alone
        A black frame keeps the adaptation of the frames before it. Raises ValueError for a rate that is not above 0, a
        negative settling or too few views, and as `tone_map`.
        """
        settled = Settled.before(frames_per_second, settling)
        each = None if views is None else iter(views)
        view = None
        for index, frame in enumerate(pictures):
            name = f"frame {index + 1}"
            frame = validate_radiance(frame, name=name, lit=False)
            if each is not None and (view := next(each, None)) is None:
                raise ValueError(f"{name} has no view; give one for each picture, or none at all")
            if view is None:
                view = self.view(frame)
            seen = self.seen(frame, view)
            settled = settled.seeing(seen)
            now = settled.view(view, index)
            image = self.image(frame.radiance, now)
            own = self.tone.adapt(image, now)
            settled = settled.adapting(own, lit=seen is not None)
            yield self.tone_mapped(image, now, settled.adaptation or own)

    def seen(self, picture: RadianceMap, view: View) -> float | None:
        """The ln cd/m² that an eye before the lens would settle on; None where the picture is black.

        picture : radiance in front of the lens
        view : of the picture, as `view` makes it
        """
        return float(np.log(seen_luminance(picture.radiance, view))) if picture.radiance.any() else None


@dataclass(frozen=True, eq=False)
class ToneMapped:
    """A picture before it is encoded: `gain` × `values` are linear display values, Rec. 709, 1 the display's white.

    source : (H, W, 3) float32: the values, not clipped; for plain exposure the radiance itself, which is not copied
    gain : factor on them
    display : what they were made for
    adaptation : what the tone operator had adapted to
    through : what makes values of rows of `source`, where they are not yet: a file is written without all at once
    """

    source: np.ndarray
    gain: float
    display: Display
    adaptation: Adaptation
    through: Callable[[np.ndarray], np.ndarray] | None = None

    @cached_property
    def values(self) -> np.ndarray:
        """(H, W, 3) float32, not clipped."""
        return self.source if self.through is None else self.through(self.source)

    @property
    def display_values(self) -> np.ndarray:
        """The linear display values (H, W, 3) float32."""
        return self.values if self.gain == 1 else self.values * np.float32(self.gain)

    def photograph(self, name: str = "developed picture") -> Photograph:
        """The picture in memory, with its profile; what is beyond white or black saturates.

        Raises ValueError for PQ, HLG and gain maps, which only a file can hold: use `write`.
        """
        if not isinstance(self.display, Srgb | DisplayP3):
            raise ValueError(
                f"only a file can hold a picture for {type(self.display).__name__}: write "
                "camera.tone_map(picture).write(path), or choose the display Srgb"
            )
        pixels = encoded(self.source, self.display, gain=self.gain, through=self.through)
        return Photograph(
            pixels, name, profile=profile_of(self.display) if isinstance(self.display, DisplayP3) else None
        )

    def write(self, path: str | os.PathLike[str]) -> Clipping:
        """Write the picture for its display, and return how much of it is white or black; raises as `write_display`."""
        return write_display(path, self.source, self.display, gain=self.gain, through=self.through)
