"""Options of `relume develop`: its camera, and what is known of the scene."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from cyclopts import Parameter

from relume.cli.option_types import numbers

if TYPE_CHECKING:
    from relume import Preset

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

    def read(self, *, vectors: bool = False) -> Preset:
        """The preset with these options above it; raises InvalidShot naming a key, ValueError naming an option.

        vectors : whether --vectors is given, by which the picture moves then
        """
        import relume as rl

        if vectors and (self.move or self.turn):
            raise ValueError("--vectors, --move and --turn are all the motion; leave all but one of them out")
        if self.chooses_tone and any(word.replace(" ", "").startswith("tone.kind=") for word in self.set or ()):
            raise ValueError("--tone, --film and --shutter and a tone.kind of --set all choose the tone; leave one out")
        motion = {"motion": {"kind": "vectors"}} if vectors else {}
        return rl.Preset.read(self.preset, self._tables() | motion, *(self.set or ()))

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
