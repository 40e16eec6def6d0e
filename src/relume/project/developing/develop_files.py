"""Developing files: `develop_file` for a picture, `undevelop_file` for the way back; frames are in `sequence`."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from relume.image import files
from relume.image.colour_space import name_of
from relume.image.files.read_options import ReadOptions
from relume.image.photograph import Photograph
from relume.image.radiance import BLACK, SATURATED, RadianceMap
from relume.project.developing.depth_and_motion import Along, read_depth, read_motion
from relume.project.presets.preset import CameraPreset
from relume.virtual_camera.film.film import Film
from relume.virtual_camera.film.undeveloping import undevelop
from relume.virtual_camera.lens.undoing import undo_optics
from relume.virtual_camera.lens.vignetting import MeasuredVignetting
from relume.virtual_camera.protocols import Optics, Undoable
from relume.virtual_camera.tone.display.encoding import Srgb
from relume.virtual_camera.tone.display.stops import stops_sheet
from relume.virtual_camera.tone.display.writing import require_suffix_for
from relume.virtual_camera.tone.metered import FixedExposure, MeteredExposure
from relume.virtual_camera.validation import validate_radiance
from relume.virtual_camera.view import View
from relume.virtual_camera.virtual_camera import IN_ORDER, ToneMapped, VirtualCamera

if TYPE_CHECKING:
    from relume.capture.response.camera_profile import CameraProfile

# What cameras' profiles and plates are read with is imported where it is used: few pictures are developed by them, and
# it would take a tenth of the time of all others.

Progress = Callable[[str, float], None]
"""Called with the name of a stage and the share of it that is done."""
Facts = dict[str, Any]


@dataclass(frozen=True, eq=False)
class DevelopSettings:
    """How files are developed.

    preset : lens, film or tone operator, and display
    field_of_view : horizontal, radians; the preset's unless given
    luminance : cd/m² per unit of a relative map; the preset's unless given
    depth, depth_along : an EXR with a layer of metres, and what they are along: the ray or the axis
    vectors : an EXR of motion in pixels, right and down
    seed : of grain and needles; the preset's unless given
    response : a camera's profile or response, in place of a tone operator
    exposure : per unit of radiance on that response, seconds × ISO/100 / N²; metered unless given
    match : a photograph whose camera it shall be: exposure, vignetting, sharpness, grain
    options : how files are read
    repair : replace NaN and infinite radiance by the pixels around it, with a warning
    frames_per_second, settling : of sequences, with the defaults of `VirtualCamera.tone_map_frames`
    """

    preset: CameraPreset = field(default_factory=CameraPreset)
    field_of_view: float | None = None
    luminance: float | None = None
    depth: str | os.PathLike[str] | None = None
    depth_along: Along | None = None
    vectors: str | os.PathLike[str] | None = None
    seed: int | None = None
    response: str | os.PathLike[str] | None = None
    exposure: float | None = None
    match: str | os.PathLike[str] | None = None
    options: ReadOptions = ReadOptions()
    repair: bool = False
    frames_per_second: float = 24.0
    settling: float = 0.4

    def view(self, picture: RadianceMap, camera: VirtualCamera) -> View:
        """The view of a picture; raises ValueError for planes of another size, UnreadableFile.

        picture : what will be developed
        camera : the one that develops the picture; what it needs decides which planes are read
        """
        preset = self.preset.view
        across = float(np.radians(preset.field_of_view)) if self.field_of_view is None else self.field_of_view
        # A preset knows nothing of the picture; what is in cd/m² needs no scale.
        preset_scale = None if picture.unit == "cd/m²" else preset.luminance
        focal_length = picture.size[0] / 2 / np.tan(across / 2) if 0 < across < np.pi else 1.0
        return camera.view(
            picture,
            field_of_view=across,
            luminance_scale=preset_scale if self.luminance is None else self.luminance,
            depth=None if self.depth is None else read_depth(Path(self.depth), float(focal_length), self.depth_along),
            motion=None if self.vectors is None else read_motion(Path(self.vectors)),
            seed=preset.seed if self.seed is None else self.seed,
        )


@dataclass(frozen=True, eq=False)
class DevelopedFile:
    """What `develop_file` made, for sheets and reports beside the picture.

    name : of the file that was read
    scene : its radiance
    image : the radiance that the lens drew on the sensor; `scene` itself without a lens
    camera : the camera without its lens
    view : the picture's lens, unit, depth and motion
    tone_mapped : the picture before it was encoded; None of a dry run
    facts : what was done, by name; lists, numbers and words
    """

    name: str
    scene: RadianceMap
    image: RadianceMap
    camera: VirtualCamera
    view: View
    tone_mapped: ToneMapped | None
    facts: Facts

    def photograph(self) -> Photograph:
        """The picture as an sRGB screen shows it, whatever display it was developed for."""
        return replace(self._developed, display=Srgb()).photograph()

    def stops_sheet(self, stops: Sequence[float] = (-4, -2, 0, 2, 4)) -> Photograph:
        """A contact sheet of the picture at several stops, with the adaptation of the picture."""
        camera, adaptation = replace(self.camera, display=Srgb()), self._developed.adaptation

        def shown(radiance: np.ndarray) -> Photograph:
            return camera.tone_map(RadianceMap(radiance), self.view, adaptation=adaptation).photograph()

        return stops_sheet(self.image, stops, shown)

    @property
    def _developed(self) -> ToneMapped:
        if self.tone_mapped is None:
            raise ValueError(f"{self.name} was not developed: it was a dry run")
        return self.tone_mapped


def develop_file(
    path: str | os.PathLike[str],
    out: str | os.PathLike[str] | None,
    settings: DevelopSettings = DevelopSettings(),
    *,
    dry_run: bool = False,
    progress: Progress = lambda stage, share: None,
) -> DevelopedFile:
    """Develop a file of radiance into a picture.

    path : radiance, in any format that holds it
    settings : lens, film or tone operator, display
    out : the picture; its suffix fits the display: .png, .jpg or .tif, .avif for PQ and HLG, .jpg for gain maps. None
        writes nothing
    dry_run : reads and checks everything, and develops and writes nothing
    progress : called with the name of each step and the share of it that is done, 0 to 1

    Raises ValueError, UnreadableFile, OutputNotWritten.
    """
    path = Path(path)
    out = None if out is None else Path(out)
    if out is not None:
        require_suffix_for(out, settings.preset.camera.display)
    # Read, and choose the camera.
    progress("reading", 0.0)
    scene = read_scene_light(path, settings)
    camera, facts = camera_for(settings, scene)
    view = settings.view(scene, camera)
    facts |= _camera_facts(camera, scene, view)
    progress("reading", 1.0)
    sensor = replace(camera, **dict.fromkeys(IN_ORDER))
    if dry_run:
        return DevelopedFile(path.name, scene, scene, sensor, view, None, {"would write": str(out), **facts})
    # The lens once: what is written beside the picture is of the light that it drew.
    progress("developing", 0.0)
    image = replace(scene, radiance=camera.image(scene.radiance, view)) if camera.optics else scene
    # What was read is valid, and need not be looked through again.
    adaptation = sensor.tone.adapt(scene.radiance, view) if image is scene else None
    made = sensor.tone_map(image, view) if adaptation is None else sensor.tone_mapped(scene.radiance, view, adaptation)
    progress("developing", 1.0)
    if made.gain != 1:
        facts["display values per unit of radiance"] = made.gain
    # Write, and count what came out white or black.
    if out is not None:
        clipping = made.write(out)
        facts = {"written": str(out), **facts, "white": max(clipping.above), "black": max(clipping.below)}
    return DevelopedFile(path.name, scene, image, sensor, view, made, facts)


def undevelop_file(
    path: str | os.PathLike[str],
    out: str | os.PathLike[str] | None,
    settings: DevelopSettings = DevelopSettings(),
    *,
    dry_run: bool = False,
) -> Facts:
    """Take a photograph's film and lens out of it again, and write its radiance; returns facts by name.

    path : the photograph
    out : the radiance map; None writes nothing
    settings : its preset's lens is undone; exposure and response are the photograph's own unless given
    dry_run : read and check everything, and write nothing
    Raises ValueError, UnreadableFile, OutputNotWritten.
    """
    path = Path(path)
    out = None if out is None else Path(out)
    if settings.match is not None:
        raise ValueError("a photograph is undeveloped by its own camera; leave match out")
    photograph = files.read_photograph(path, settings.options)
    film, unit, falloff, facts = _film_of(photograph, settings)
    camera = replace(settings.preset.camera, tone=FixedExposure())
    if falloff is not None and camera.vignetting is None:
        camera = replace(camera, vignetting=falloff)
        facts["vignetting"] = "the profile's, divided out"
    facts["undone"] = [type(part).__name__ for part in reversed(camera.optics) if isinstance(part, Undoable)]
    facts["exposure per unit of radiance"] = film.exposure
    if dry_run or out is None:
        return {"would write": str(out), **facts}
    radiance = replace(undevelop(photograph, film), unit=unit)
    radiance = undo_optics(radiance, camera.optics, settings.view(radiance, camera))
    files.write(out, radiance)
    flags = radiance.clipped
    if flags is not None:
        facts |= {"white": float(np.mean(flags == SATURATED)), "black": float(np.mean(flags == BLACK))}
    return {"written": str(out), "unit": unit, **facts}


def read_scene_light(path: Path, settings: DevelopSettings, *, lit: bool = True) -> RadianceMap:
    """The radiance of a file as it can be developed; raises UnreadableFile, ValueError."""
    return validate_radiance(
        files.read_radiance(path, settings.options), repair=settings.repair, name=path.name, lit=lit
    )


def camera_for(settings: DevelopSettings, picture: RadianceMap) -> tuple[VirtualCamera, Facts]:
    """The preset's camera, or the real one that is asked for; facts on it.

    Without an exposure the picture is metered as for plain exposure, whose white is the response's value 248 of 255.
    """
    camera, preset = settings.preset.camera, settings.preset
    if settings.match is not None:
        from relume.capture.response.camera_profile import read_profile
        from relume.virtual_camera.plate_matching.camera_matching import Softness, match_camera

        profile = None if settings.response is None else read_profile(Path(settings.response))
        match = match_camera(files.read_photograph(settings.match), picture, profile)
        for part in match.optics:
            camera = replace(camera, **{"soft_focus" if isinstance(part, Softness) else "vignetting": part})
        return replace(camera, tone=match.film), {"matched": list(match.facts)}
    if settings.response is None:
        if settings.exposure is not None:
            raise ValueError("an exposure needs a response; give the camera's response too, or leave the exposure out")
        return camera, {}
    if preset.has_tone:
        raise ValueError("a response takes the place of tone, film and shutter; leave them and the preset's tone out")
    from relume.virtual_camera.plate_matching.camera_matching import profiled_response

    curve = profiled_response(_profile(Path(settings.response)))
    exposure = settings.exposure
    if exposure is None:
        gain = float(np.exp(MeteredExposure().adapt(picture.radiance, View(1.0)).values[0]))
        exposure = gain * float(np.exp(curve.log_exposure[:, 248 * curve.levels // 256].mean()))
    return replace(camera, tone=Film(exposure, curve)), {"exposure": exposure * 2.0**camera.stops}


def _film_of(photograph: Photograph, settings: DevelopSettings) -> tuple[Film, str, Optics | None, Facts]:
    """The film that a photograph was taken on, the unit of its radiance, the lens's vignetting, and their sources."""
    exposure = photograph.exposure
    factor = settings.exposure or (1.0 if exposure is None else exposure.factor)
    source = "given" if settings.exposure else "1: the photograph has none" if exposure is None else "EXIF"
    facts: Facts = {"exposure from": source, "response": name_of(photograph)}
    if settings.response is None:
        return Film(factor), "relative", None, facts
    from relume.virtual_camera.plate_matching.camera_matching import (
        profiled_response,
        profiled_scale,
        profiled_vignetting,
    )

    profile = _profile(Path(settings.response))
    response, vignetting = profiled_response(profile), profiled_vignetting(profile)
    facts["response"] = Path(settings.response).name
    falloff = None if vignetting is None else MeasuredVignetting(vignetting)
    scale = profiled_scale(profile, exposure)
    if scale is None and profile.scale is not None:
        facts["scale"] = "the profile's needs f-number and ISO as it was measured with; not used"
    if scale is None or exposure is None or settings.exposure:
        return Film(factor, response), "relative", falloff, facts
    return Film.of(exposure, response, scale=scale), "cd/m²", falloff, facts


def _profile(path: Path) -> CameraProfile:
    """A camera's profile that holds a response; raises ValueError naming the file of one of raws."""
    from relume.capture.response.camera_profile import read_profile

    profile = read_profile(path)
    if profile.response is None:
        raise ValueError(f"{path.name}: a profile of camera raws, which holds no response; give another")
    return profile


def _camera_facts(camera: VirtualCamera, picture: RadianceMap, view: View) -> Facts:
    """What stands between the file's radiance and the picture."""
    facts: Facts = {"lens": [type(part).__name__ for part in camera.optics], "tone": type(camera.tone).__name__}
    if camera.is_absolute:
        facts["cd/m² per unit"] = view.luminance_scale
    return facts | {"unit": picture.unit, "stops": camera.stops, "seed": view.seed}
