"""`relume develop`: radiance in, a photograph out; frames of a sequence, and the way back."""

from __future__ import annotations

from dataclasses import dataclass
from math import radians
from pathlib import Path
from typing import Annotated, Any, Literal

from cyclopts import Parameter
from cyclopts.validators import Number

import relume as rl
from relume.cli.arguments import ClusterWord, DryRun, ReadingOptions, refuse_input, require_pictures, require_suffix
from relume.cli.console import OutputOptions, print_facts, progress, spread, version, warnings_as_notes
from relume.cli.option_types import numbers

ToneName = Literal[
    "exposure", "reinhard", "reinhard-local", "histogram", "human", "tumblin-rushmeier", "ferwerda", "pattanaik",
    "black-white", "ocio",
]  # fmt: skip
FilmName = Literal["black-and-white", "colour-negative", "slide"]
DisplayName = Literal["srgb", "p3", "pq", "hlg", "gain-map"]


@Parameter(name="*")
@dataclass(frozen=True)
class CameraOptions:
    """Lens, film, tone operator and display; each replaces what the preset says of it."""

    preset: Annotated[
        str | None,
        Parameter(help="A TOML file of a whole camera, or the name of a built-in one; see `--list-presets`."),
    ] = None
    exposure: Annotated[
        float | None, Parameter(help="Stops to brighten by; negative darkens.", allow_leading_hyphen=True)
    ] = None
    tone: Annotated[
        ToneName | None,
        Parameter(help="Tone operator; human is histogram with an eye's contrast, glare, acuity and colours."),
    ] = None
    film: Annotated[FilmName | None, Parameter(help="Develop as a film in the darkroom, in place of --tone.")] = None
    glare: Annotated[str | None, Parameter(help="Scattered light: eye, camera, or the picture of a point spread.")] = (
        None
    )
    move: Annotated[
        tuple[float, float] | None,
        numbers("DX,DY", like="12,-3", help="Pixels that the picture moves while the shutter is open."),
    ] = None
    turn: Annotated[
        tuple[float, float, float] | None,
        numbers(
            "YAW,PITCH,ROLL", like="2 or 2,0,6", filled=0.0,
            help="Degrees that the camera turns right, up, clockwise while the shutter is open; all but YAW may be "
            "left out.",
        ),
    ] = None  # fmt: skip
    focus: Annotated[float | None, Parameter(help="Metres in focus; needs --depth, --aperture and --lens.")] = None
    aperture: Annotated[
        float | None, Parameter(help="f-number: with --focus how wide the lens is, with --shutter how much it lets in.")
    ] = None
    lens: Annotated[float | None, Parameter(help="Focal length, mm; --focus needs it.")] = None
    shutter: Annotated[
        float | None,
        numbers(
            "SECONDS", like="1/60", above=0, help="Exposure time, with --aperture and --iso; for pictures in cd/m²."
        ),
    ] = None
    iso: Annotated[float | None, Parameter(help="Sensitivity, with --shutter; 100 unless given.")] = None
    soft: Annotated[float | None, Parameter(help="Soft focus: the share of the light, 0 to 1, that is spread.")] = None
    vignetting: Annotated[bool, Parameter(negative="", help="Darken the corners by cos⁴ of their angle.")] = False
    display: Annotated[
        DisplayName | None,
        Parameter(
            help="What the picture is for: sRGB or Display P3 screens; HDR screens by pq or hlg (.avif) or a "
            "gain map (.jpg)."
        ),
    ] = None
    set: Annotated[
        list[str] | None,
        Parameter(name="--set", negative="", help="KEY=VALUE of a preset, like tone.key=0.36; may be repeated."),
    ] = None

    def read(self, *, vectors: bool = False) -> rl.CameraPreset:
        """The preset with these options above it; raises InvalidShot naming a key, ValueError naming an option.

        vectors : whether --vectors is given, by which the picture moves then
        """
        if vectors and (self.move or self.turn):
            raise ValueError("--vectors, --move and --turn are all the motion; leave all but one of them out")
        if self.chooses_tone and any(word.replace(" ", "").startswith("tone.kind=") for word in self.set or ()):
            raise ValueError("--tone, --film and --shutter and a tone.kind of --set all choose the tone; leave one out")
        motion = {"motion": {"kind": "vectors"}} if vectors else {}
        return rl.CameraPreset.read(self.preset, self._tables() | motion, *(self.set or ()))

    @property
    def chooses_tone(self) -> bool:
        """Whether a tone operator, a film or an exposure is given."""
        return bool(self.tone or self.film or self.shutter)

    def _tables(self) -> dict[str, Any]:
        """The options as the tables of a preset."""
        self._refuse_contradictions()
        tables: dict[str, Any] = {} if self.exposure is None else {"exposure": self.exposure}
        # The tone, by one of three options.
        if self.tone:
            tables["tone"] = {"kind": self.tone}
        if self.film:
            tables["tone"] = {"kind": "darkroom", "stock": self.film}
        if self.shutter is not None:
            iso = 100.0 if self.iso is None else self.iso
            tables["tone"] = {"kind": "camera", "seconds": self.shutter, "f_number": self.aperture, "iso": iso}
        # The lens.
        if self.glare in ("eye", "camera"):
            tables["glare"] = {"kind": self.glare}
        elif self.glare:
            tables["glare"] = {"kind": "measured", "picture": str(Path(self.glare).resolve())}
        if self.move:
            tables["motion"] = {"kind": "straight", "pixels": self.move}
        if self.turn:
            tables["motion"] = {"kind": "turn", "degrees": self.turn}
        if self.focus is not None:
            tables["defocus"] = {"focus": self.focus, "f_number": self.aperture, "focal_length": self.lens}
        if self.soft is not None:
            tables["soft_focus"] = {"share": self.soft}
        if self.vignetting:
            tables["vignetting"] = {"kind": "natural"}
        if self.display:
            tables["display"] = {"kind": self.display}
        return tables

    def _refuse_contradictions(self) -> None:
        """Raise ValueError for options that exclude or need each other."""
        if self.tone and self.film:
            raise ValueError("--tone and --film both make the picture; leave one of them out")
        if self.move and self.turn:
            raise ValueError("--move and --turn are both the motion; leave one of them out")
        if self.focus is not None and (self.aperture is None or self.lens is None):
            raise ValueError("--focus needs --aperture, the f-number, and --lens, the focal length in mm")
        if self.lens is not None and self.focus is None:
            raise ValueError("--lens is the focal length of --focus; give that too, or leave it out")
        if self.aperture is not None and self.focus is None and self.shutter is None:
            raise ValueError("--aperture belongs to --focus or --shutter; give one of them, or leave it out")
        if self.shutter is not None and (self.tone or self.film):
            raise ValueError("--shutter exposes a camera, in place of --tone and --film; leave one of them out")
        if self.shutter is not None and self.aperture is None:
            raise ValueError("--shutter needs --aperture, the f-number, for an exposure")
        if self.iso is not None and self.shutter is None:
            raise ValueError("--iso is the sensitivity of --shutter; give that too, or leave it out")


@Parameter(name="*")
@dataclass(frozen=True)
class SceneOptions:
    """What the picture's file does not say of the scene."""

    field_of_view: Annotated[
        float | None, Parameter(help="Horizontal, degrees; the preset's, or 50, unless given.")
    ] = None
    luminance: Annotated[
        float | None, Parameter(help="cd/m² per unit of a relative map, for glare and tones that model the eye.")
    ] = None
    depth: Annotated[
        Path | None, Parameter(help="An EXR with a depth layer, metres, as `relume insert` writes (layers.exr).")
    ] = None
    depth_along: Annotated[
        Literal["axis", "rays"] | None,
        Parameter(help="What the depth is along: the axis, as most programs write, or rays, as relume's layers are; "
                  "chosen by the file unless given."),
    ] = None  # fmt: skip
    vectors: Annotated[
        Path | None, Parameter(help="An EXR of motion, pixels right in R and down in G while the shutter is open.")
    ] = None
    seed: Annotated[int | None, Parameter(help="Of grain and needles; the same seed gives the same picture.")] = None

    def settings(self) -> dict[str, Any]:
        """The same by name, for `DevelopSettings`; raises ValueError."""
        if self.depth_along is not None and self.depth is None:
            raise ValueError("--depth-along is of --depth; give that too, or leave it out")
        given = dict(vars(self))
        if self.field_of_view is not None:
            given["field_of_view"] = radians(self.field_of_view)
        return given


@Parameter(name="*")
@dataclass(frozen=True)
class RealCameraOptions:
    """A real camera in place of a tone operator."""

    response: Annotated[
        Path | None,
        Parameter(help="A profile or response that merge or insert wrote, or a curve of pfstools or hdrgen."),
    ] = None
    seconds: Annotated[
        float | None,
        Parameter(help="With --response: exposure per unit of radiance; metered from the picture unless given."),
    ] = None
    match: Annotated[
        Path | None, Parameter(help="Match this photograph's camera: its exposure, vignetting, sharpness and grain.")
    ] = None

    def refuse_contradictions(self, camera: CameraOptions, *, undo: bool) -> None:
        """Raise ValueError for options that exclude or need each other."""
        if self.match is not None and self.seconds is not None:
            raise ValueError("--match takes the plate's exposure; leave --seconds out")
        if self.match is not None and (camera.chooses_tone or camera.soft is not None or camera.vignetting):
            raise ValueError("--match is a whole camera; leave --tone, --film, --shutter, --soft and --vignetting out")
        if self.response is None and self.seconds is not None and not undo:
            raise ValueError("--seconds is the exposure on --response; give that too, or leave it out")


@Parameter(name="*")
@dataclass(frozen=True)
class BesideOptions:
    """What is written beside the picture."""

    sheet: Annotated[Path | None, Parameter(help="Also write a contact sheet at several --stops.")] = None
    stops: Annotated[
        tuple[float, ...] | None,
        numbers("STOPS,…", like="-4,-2,0,2,4", help="Stops of --sheet; -4,-2,0,2,4 unless given."),
    ] = None
    false_colour: Annotated[
        Path | None, Parameter(help="Also write the luminances in false colour, with their scale.")
    ] = None
    report: Annotated[Path | None, Parameter(help="Also write a report with a wipe, stops and facts, .html.")] = None

    def refuse_contradictions(self, out: Path, pictures: list[Path], *, several: bool) -> None:
        """Raise ValueError for files of other kinds, the inputs, and two of one name."""
        if self.stops is not None and self.sheet is None:
            raise ValueError("--stops are of --sheet; give that too, or leave them out")
        if several and (self.sheet or self.false_colour or self.report):
            raise ValueError("--sheet, --false-colour and --report are of one picture; leave them out")
        seen = {out.resolve()}
        for option, path in (("--sheet", self.sheet), ("--false-colour", self.false_colour), ("--report", self.report)):
            if path is None:
                continue
            require_suffix(path, *((".html",) if option == "--report" else (".png", ".jpg")), option=option)
            refuse_input(path, pictures)
            if path.resolve() in seen:
                raise ValueError(f"{option} {path}: another output has that name; give each its own")
            seen.add(path.resolve())

    def write(self, made: Any) -> dict[str, str]:
        """Write what is asked for; the files by what they are."""
        files: dict[str, str] = {}
        if self.sheet:
            rl.write(self.sheet, made.stops_sheet(self.stops or (-4, -2, 0, 2, 4)))
            files["sheet"] = str(self.sheet)
        if self.false_colour:
            rl.write(self.false_colour, rl.tone.false_colour(made.image))
            files["false colour"] = str(self.false_colour)
        if self.report:
            rl.report.write_develop_report(self.report, made, facts={**made.facts, **files, "relume": version()})
            files["report"] = str(self.report)
        return files


@Parameter(name="*")
@dataclass(frozen=True)
class SequenceOptions:
    """How the frames of a sequence are developed."""

    fps: Annotated[
        float | None, Parameter(help="Frames per second of a sequence; 24 unless given.", validator=Number(gt=0))
    ] = None
    settling: Annotated[
        float | None,
        Parameter(
            help="Seconds in which a sequence's adaptation follows the light, 0.4; 0 takes each frame alone.",
            validator=Number(gte=0),
        ),
    ] = None

    def refuse_single_picture(self, sequence: bool) -> None:
        """Raise ValueError for options of a sequence with a single picture."""
        for option, value in (("--fps", self.fps), ("--settling", self.settling)):
            if value is not None and not sequence:
                raise ValueError(f"{option} is of a sequence; give several pictures, or leave it out")


PICTURES = (".png", ".jpg", ".jpeg", ".tif", ".tiff", ".avif")


def develop(
    pictures: Annotated[
        list[Path] | None,
        Parameter(
            name="IN",
            negative="",
            help="The radiance map, .exr, .hdr or another format; several are the frames of a sequence, in that order, "
            "or with --each pictures of their own.",
        ),
    ] = None,
    /,
    *,
    out: Annotated[
        Path | None,
        Parameter(
            alias="-o",
            help="The picture to write: .png or .jpg, .avif for --display pq and hlg; for a sequence a folder or an "
            ".mp4; with --undo an .exr.",
        ),
    ] = None,
    camera: CameraOptions = CameraOptions(),
    scene: SceneOptions = SceneOptions(),
    real: RealCameraOptions = RealCameraOptions(),
    undo: Annotated[
        bool, Parameter(negative="", help="The way back: IN is a photograph, OUT its radiance before the camera.")
    ] = False,
    repair: Annotated[
        bool, Parameter(negative="", help="Replace NaN and infinite pixels by their neighbours, with a warning.")
    ] = False,
    beside: BesideOptions = BesideOptions(),
    frames: SequenceOptions = SequenceOptions(),
    each: Annotated[
        bool,
        Parameter(
            negative="",
            help="Develop every file, and all pictures in folders, by itself and no sequence, to -o FOLDER/name.png; "
            "one that cannot be developed is named, and the others are written.",
        ),
    ] = False,
    cluster: ClusterWord = None,
    list_presets: Annotated[bool, Parameter(negative="", help="List the built-in presets, and stop.")] = False,
    show_preset: Annotated[
        str | None, Parameter(help="Print a preset's TOML, to start one's own from, and stop.")
    ] = None,
    reading: ReadingOptions = ReadingOptions(),
    dry_run: DryRun = False,
    output: OutputOptions = OutputOptions(),
) -> None:
    """Develop radiance into a photograph: lens, glare, tone mapping or film, display; or undo a photograph.

    Everything happens in linear light and in physical order, whatever order the options are in: motion, defocus, soft
    focus, glare, distortion, vignetting, then the tone operator or film, then the display.
    """
    with warnings_as_notes(output):
        # Presets are shown without a picture.
        if list_presets:
            print_facts(output, rl.CameraPreset.builtin())
            return
        if show_preset is not None:
            print(rl.CameraPreset.text(show_preset), end="")
            return
        # Refuse what contradicts, before any work is done.
        if not pictures or out is None:
            raise ValueError("give a radiance map and -o, a picture, like: relume develop room.exr -o room.png")
        require_pictures(pictures, out, each=each)
        sequence = not each and (len(pictures) > 1 or out.suffix.lower() == ".mp4" or out.is_dir())
        if cluster is not None and not (sequence or each or undo):
            raise ValueError("--cluster is for many pictures; give several, or leave it out")
        real.refuse_contradictions(camera, undo=undo)
        beside.refuse_contradictions(out, pictures, several=undo or sequence or each)
        frames.refuse_single_picture(sequence)
        if undo and (camera.tone or camera.film or camera.exposure is not None or repair):
            raise ValueError("--undo has no tone, film, exposure or repair of its own; leave them out")
        settings = rl.DevelopSettings(
            preset=camera.read(vectors=scene.vectors is not None), **scene.settings(), response=real.response,
            exposure=real.seconds, match=real.match, options=reading.reading(), repair=repair,
            frames_per_second=frames.fps or 24.0, settling=0.4 if frames.settling is None else frames.settling,
        )  # fmt: skip
        # One of the three jobs.
        if undo:
            if each or cluster is not None:
                raise ValueError("--undo is of one photograph; leave --each and --cluster out")
            if len(pictures) != 1:
                raise ValueError(f"--undo takes one photograph, not {len(pictures)}; merge a bracket with relume merge")
            print_facts(output, rl.undevelop_file(pictures[0], out, settings, dry_run=dry_run))
            return
        if sequence or each:
            if out.suffix and out.suffix.lower() != ".mp4" and not each:
                raise ValueError(f"-o {out}: {len(pictures)} pictures are given; name a folder or an .mp4 for them")
            with spread(None if dry_run else cluster, output) as (workers, advance):
                chosen: dict[str, Any] = {"each": each, "dry_run": dry_run, "cluster": workers, "progress": advance}
                print_facts(output, rl.develop_sequence(pictures, out, settings, **chosen))
            return
        if not out.suffix:
            raise ValueError(f"-o {out}: name a picture, like {out}.png; several frames need a folder")
        require_suffix(out, *PICTURES)
        with progress(output) as advance:
            made = rl.develop_file(pictures[0], out, settings, dry_run=dry_run, progress=advance)
        facts = made.facts if dry_run else made.facts | beside.write(made)
        print_facts(output, facts)
