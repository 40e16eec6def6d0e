"""What `relume develop` does: one picture, the frames of a sequence, or a photograph undone."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import repeat
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from relume.cli.arguments import made_folder, refuse_input, require_suffix
from relume.cli.console import version
from relume.errors import UnreadableFile
from relume.image import files
from relume.image.files.encodings import SUFFIXES
from relume.virtual_camera.film.film import Film
from relume.virtual_camera.steps import Undoable
from relume.virtual_camera.tone.display.displays import HLG, PQ, HdrGainMap, Srgb
from relume.virtual_camera.tone.display.encoding import encoded_and_clipped
from relume.virtual_camera.tone.display.writing import require_suffix_for
from relume.virtual_camera.tone.metered import Fixed, Metered
from relume.virtual_camera.validation import sound
from relume.virtual_camera.view import View
from relume.virtual_camera.virtual_camera import IN_ORDER

if TYPE_CHECKING:
    from relume.capture.response.camera_profile import CameraProfile
    from relume.cli.develop_view import ViewOptions
    from relume.image.files.read_options import ReadOptions
    from relume.image.photograph import Photograph
    from relume.image.radiance import RadianceMap
    from relume.project.presets.preset import Preset
    from relume.virtual_camera.steps import Optics
    from relume.virtual_camera.tone.display.clipping import Clipping
    from relume.virtual_camera.tone.display.displays import Display
    from relume.virtual_camera.virtual_camera import ToneMapped, VirtualCamera

Advance = Callable[[str, float], None]
_NO_VIEW = View(1.0)
PICTURES = (".png", ".jpg", ".jpeg", ".tif", ".tiff", ".avif")


@dataclass(frozen=True)
class Source:
    """The camera that the picture shall be taken by, where it is a real one.

    response : a profile or curve; None for none
    seconds : exposure per unit of radiance on it; None to meter
    match : a photograph by the camera; None for none
    """

    response: Path | None = None
    seconds: float | None = None
    match: Path | None = None


@dataclass(frozen=True)
class Extras:
    """What is written beside the picture: a contact sheet of some stops, false colour, a report; None for none."""

    sheet: Path | None
    stops: tuple[float, ...]
    false_colour: Path | None
    report: Path | None

    @property
    def any(self) -> bool:
        """Whether anything is written beside the picture."""
        return any((self.sheet, self.false_colour, self.report))

    def require(self, out: Path, pictures: Sequence[Path]) -> None:
        """Refuse, before any work is done, files of other kinds, the inputs, and two under one name."""
        pictured = (".png", ".jpg")
        kinds = {"--sheet": pictured, "--false-colour": pictured, "--report": (".html",)}
        seen = {out.resolve()}
        for (option, suffixes), extra in zip(kinds.items(), (self.sheet, self.false_colour, self.report), strict=True):
            if extra is None:
                continue
            require_suffix(extra, *suffixes, option=option)
            refuse_input(extra, pictures)
            if extra.resolve() in seen:
                raise ValueError(f"{option} {extra}: another output has that name; give each its own")
            seen.add(extra.resolve())


@dataclass(frozen=True)
class Rate:
    """Frames a second, and the seconds in which adaptation follows the light."""

    frames_per_second: float
    settling: float


def read_stops(text: str) -> tuple[float, ...]:
    """Stops from "-4,-2,0"; raises ValueError."""
    try:
        stops = tuple(float(word) for word in text.replace(",", " ").split())
        if not stops or not all(abs(stop) <= 100 for stop in stops):
            raise ValueError
    except ValueError:
        raise ValueError(f'--stops: "{text}"; write stops with commas between, like -4,-2,0,2,4') from None
    return stops


def picture(
    path: Path,
    out: Path,
    preset: Preset,
    scene: ViewOptions,
    source: Source,
    extras: Extras,
    reading: ReadOptions,
    repair: bool,
    dry_run: bool,
    advance: Advance,
) -> dict[str, object]:
    """Develop one picture, and what is written beside it; facts to tell."""
    if not out.suffix:
        raise ValueError(f"-o {out}: name a picture, like {out}.png; a folder that is there takes frames")
    require_suffix(out, *PICTURES)
    require_suffix_for(out, preset.display.made())
    advance("reading", 0.0)
    read = _read(path, reading, repair)
    camera, facts = _camera(preset, source, read)
    view = scene.view(read, camera, preset)
    facts |= _facts(camera, read, view)
    if dry_run:
        return {"would write": str(out), **facts}
    advance("reading", 1.0)
    advance("developing", 0.0)
    # The lens once, for what is written beside the picture is of the light that it drew.
    image = replace(read, radiance=camera.image(read.radiance, view)) if camera.optics else read
    sensor = replace(camera, **dict.fromkeys(IN_ORDER))
    made = sensor.tone_map(image, view)
    advance("developing", 1.0)
    clipping = made.write(out)
    if made.gain != 1:
        facts["display values per unit of radiance"] = made.gain
    facts = {"written": str(out), **facts, "white": max(clipping.above), "black": max(clipping.below)}
    if extras.any:
        _write_extras(path, extras, read, image, made, sensor, view, facts)
    return facts


def _write_extras(
    path: Path,
    extras: Extras,
    scene: RadianceMap,
    image: RadianceMap,
    made: ToneMapped,
    sensor: VirtualCamera,
    view: View,
    facts: dict[str, object],
) -> None:
    """Write the sheet, the false colours and the report: of the scene, and of the light that the lens drew."""
    from relume.image.radiance import RadianceMap
    from relume.virtual_camera.tone.display.false_colour import false_colour
    from relume.virtual_camera.tone.display.stops import stops_sheet

    if extras.sheet:
        shown_by = replace(sensor, display=Srgb())

        def at(radiance: np.ndarray) -> Photograph:
            return shown_by.tone_map(RadianceMap(radiance), view, adaptation=made.adaptation).photograph()

        files.write(extras.sheet, stops_sheet(image, extras.stops, at))
        facts["sheet"] = str(extras.sheet)
    if extras.false_colour:
        files.write(extras.false_colour, false_colour(image))
        facts["false colour"] = str(extras.false_colour)
    if extras.report:
        from relume.report.develop_report import write_develop_report

        shown = replace(made, display=Srgb()).photograph()
        made_by = {"picture": path.name, **facts, "relume": version()}
        write_develop_report(extras.report, scene, image, shown, view, facts=made_by)
        facts["report"] = str(extras.report)


def frames(
    paths: list[Path],
    out: Path,
    preset: Preset,
    scene: ViewOptions,
    source: Source,
    rate: Rate,
    reading: ReadOptions,
    repair: bool,
    dry_run: bool,
    advance: Advance,
) -> dict[str, object]:
    """Develop a sequence into numbered pictures or a movie; facts to tell."""
    movie = out.suffix.lower() == ".mp4"
    if not movie and out.suffix:
        raise ValueError(f"-o {out}: {len(paths)} pictures were given; name a folder or an .mp4 for a sequence")
    if scene.depth is not None or scene.vectors is not None:
        raise ValueError("--depth and --vectors are of one picture; develop the frames of a sequence one by one")
    targets = [] if movie else _targets(paths, out, preset.display.made())
    first = _read(paths[0], reading, repair)
    camera, facts = _camera(preset, source, first)
    if movie and camera.display != Srgb():
        raise ValueError("an .mp4 is for sRGB screens; leave --display out, or write pictures into a folder")
    if dry_run:
        return {"would write": str(out), "frames": len(paths), **facts}

    def each() -> Iterator[RadianceMap]:
        for index, path in enumerate(paths):
            advance("developing", index / len(paths))
            yield _read(path, reading, repair, lit=False)

    view = scene.view(first, camera, preset)
    fps, settling = rate.frames_per_second, rate.settling
    made = camera.tone_map_frames(each(), repeat(view), frames_per_second=fps, settling=settling)
    worst = [0.0, 0.0]
    if movie:
        from relume.image.files.video import Movie

        with Movie(out, rate.frames_per_second) as file:
            for frame in made:
                pixels, clipping = encoded_and_clipped(frame.values, frame.display, gain=frame.gain)
                file.add(pixels)
                worst = _worse(worst, clipping)
    else:
        made_folder(out)
        for count, target in enumerate(targets):
            try:
                worst = _worse(worst, next(made).write(target))
            except (ValueError, UnreadableFile) as error:
                raise type(error)(f"{error}; {count} frames before it are in {out}") from None
    advance("developing", 1.0)
    told = {"white in the worst frame": worst[0], "black in the worst frame": worst[1]}
    return {"written": str(out), "frames": len(paths), **facts, **told}


def _worse(worst: list[float], clipping: Clipping) -> list[float]:
    return [max(worst[0], *clipping.above), max(worst[1], *clipping.below)]


def _targets(paths: list[Path], folder: Path, display: Display) -> list[Path]:
    """The file of each frame; raises ValueError where two would have one name, or one is an input."""
    suffix = ".avif" if isinstance(display, PQ | HLG) else ".jpg" if isinstance(display, HdrGainMap) else ".png"
    targets = [folder / f"{path.stem}{suffix}" for path in paths]
    for index, target in enumerate(targets):
        refuse_input(target, paths)
        if target in targets[:index]:
            raise ValueError(f"{paths[index]}: another frame is called {target.name} too; rename one of them")
    return targets


def undo(
    paths: list[Path],
    out: Path,
    preset: Preset,
    scene: ViewOptions,
    source: Source,
    reading: ReadOptions,
    dry_run: bool,
) -> dict[str, object]:
    """Take a photograph's camera out of it again; facts to tell."""
    from relume.virtual_camera.film.undeveloping import undevelop
    from relume.virtual_camera.lens.undoing import undo_optics

    require_suffix(out, *SUFFIXES)
    if len(paths) != 1:
        raise ValueError(f"--undo takes one photograph, and {len(paths)} were given; merge a bracket with relume merge")
    if source.match is not None:
        raise ValueError("--undo is of IN's own camera, and --match of another's; leave one of them out")
    photograph = files.read_photograph(paths[0], reading)
    film, unit, falloff, facts = _film_of(photograph, source)
    camera = preset.camera
    if falloff is not None and camera.vignetting is None:
        camera = replace(camera, vignetting=falloff)
        facts["vignetting"] = "the profile's, divided out"
    facts["undone"] = [type(part).__name__ for part in reversed(camera.optics) if isinstance(part, Undoable)]
    facts["exposure per unit of radiance"] = film.exposure
    if dry_run:
        return {"would write": str(out), **facts}
    radiance = replace(undevelop(photograph, film), unit=unit)
    radiance = undo_optics(radiance, camera.optics, scene.view(radiance, replace(camera, tone=Fixed()), preset))
    files.write(out, radiance)
    flags = radiance.clipped
    shares = {} if flags is None else {"white": float(np.mean(flags == 1)), "black": float(np.mean(flags == 2))}
    return {"written": str(out), "unit": unit, **facts, **shares}


def _film_of(photograph: Photograph, source: Source) -> tuple[Film, str, Optics | None, dict[str, object]]:
    """The film that a photograph was taken on, the unit of its radiance, the lens's fall-off, and what told them."""
    from relume.virtual_camera.lens.vignetting import MeasuredVignetting

    exposure = photograph.exposure
    factor = source.seconds or (1.0 if exposure is None else exposure.factor)
    told = "--seconds" if source.seconds else "1, for the photograph tells none" if exposure is None else "EXIF"
    facts: dict[str, object] = {"exposure from": told, "response": "sRGB"}
    if source.response is None:
        return Film(factor), "relative", None, facts
    from relume.virtual_camera.plate_matching.camera_profile import (
        profiled_response,
        profiled_scale,
        profiled_vignetting,
    )

    profile = _profile(source.response)
    response, vignetting = profiled_response(profile), profiled_vignetting(profile)
    facts["response"] = source.response.name
    falloff = None if vignetting is None else MeasuredVignetting(vignetting)
    scale = profiled_scale(profile, exposure)
    if scale is None and profile.scale is not None:
        facts["scale"] = "the profile's holds for exposures that tell other settings; not used"
    if scale is None or exposure is None or source.seconds:
        return Film(factor, response), "relative", falloff, facts
    return Film.of(exposure, response, scale=scale), "cd/m²", falloff, facts


def _read(path: Path, reading: ReadOptions, repair: bool, *, lit: bool = True) -> RadianceMap:
    return sound(files.read_radiance(path, reading), repair=repair, name=path.name, lit=lit)


def _camera(preset: Preset, source: Source, picture: RadianceMap) -> tuple[VirtualCamera, dict[str, object]]:
    """The preset's camera, or the real one that is asked for; facts on it.

    Without --seconds the picture is metered as for plain exposure, whose white is the response's value 248 of 255.
    """
    camera = preset.camera
    if source.match is not None:
        return _matched(camera, source, picture)
    if source.response is None:
        if source.seconds is not None:
            raise ValueError("--seconds is the exposure on --response; give that too, or leave it out")
        return camera, {}
    if preset.tone is not None:
        raise ValueError("--response is a tone of its own; leave --tone, --film, --shutter and the preset's tone out")
    from relume.virtual_camera.plate_matching.camera_profile import profiled_response

    curve = profiled_response(_profile(source.response))
    seconds = source.seconds
    if seconds is None:
        gain = float(np.exp(Metered().adapted(picture.radiance, _NO_VIEW).values[0]))
        seconds = gain * float(np.exp(curve.log_exposure[:, 248 * curve.levels // 256].mean()))
    return replace(camera, tone=Film(seconds, curve)), {"exposure": seconds * 2.0**camera.stops}


def _matched(camera: VirtualCamera, source: Source, picture: RadianceMap) -> tuple[VirtualCamera, dict[str, object]]:
    """The camera with the film, fall-off and sharpness of a plate in its places."""
    from relume.capture.response.camera_profile import read_profile
    from relume.virtual_camera.plate_matching.matched_film import Softness, matched_film

    assert source.match is not None
    plate = files.read_photograph(source.match)
    match = matched_film(plate, picture, None if source.response is None else read_profile(source.response))
    for part in match.optics:
        camera = replace(camera, **{"soft_focus" if isinstance(part, Softness) else "vignetting": part})
    return replace(camera, tone=match.film), {"matched": list(match.facts)}


def _profile(path: Path) -> CameraProfile:
    """A camera's profile that holds a response; raises ValueError naming the file of one of raws."""
    from relume.capture.response.camera_profile import read_profile

    profile = read_profile(path)
    if profile.response is None:
        raise ValueError(f"{path.name}: a profile of camera raws, which holds no response; give another")
    return profile


def _facts(camera: VirtualCamera, picture: RadianceMap, view: View) -> dict[str, object]:
    """What stands between the file's radiance and the picture."""
    told: dict[str, object] = {
        "lens": [type(part).__name__ for part in camera.optics],
        "tone": type(camera.tone).__name__,
    }
    if camera.is_absolute:
        told["cd/m² per unit"] = view.luminance_scale
    return told | {"unit": picture.unit, "stops": camera.stops, "seed": view.seed}
