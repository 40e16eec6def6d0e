"""What `relume develop` is told of its camera: a preset, and single options that stand above it."""

from __future__ import annotations

import tomllib
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from cyclopts import Parameter

if TYPE_CHECKING:
    from relume.project.presets.preset import Preset

ToneName = Literal[
    "exposure", "reinhard", "reinhard-local", "histogram", "human", "tumblin-rushmeier", "ferwerda", "pattanaik",
    "black-white", "ocio",
]  # fmt: skip
PATHS = ("tone.config", "tone.response", "glare.picture", "vignetting.profile")
"""Keys of a preset that name files."""
FilmName = Literal["black-and-white", "colour-negative", "slide"]
DisplayName = Literal["srgb", "p3", "pq", "hlg", "gain-map"]


@Parameter(name="*")
@dataclass(frozen=True)
class CameraOptions:
    """Lens, film, tone and display; each replaces what the preset says of it."""

    preset: Annotated[
        str | None,
        Parameter(help="A TOML file of a whole camera, or the name of one that comes along; `--list-presets` tells."),
    ] = None
    exposure: Annotated[
        float | None, Parameter(help="Stops to brighten by; negative darkens.", allow_leading_hyphen=True)
    ] = None
    tone: Annotated[ToneName | None, Parameter(help="What makes the light fit for a display; human is histogram with "
                    "an eye's contrast, glare, acuity and colours.")] = None  # fmt: skip
    film: Annotated[FilmName | None, Parameter(help="Develop as a film in the darkroom, in place of --tone.")] = None
    glare: Annotated[
        str | None, Parameter(help="eye, camera, or the picture of a point spread: light scattered on its way.")
    ] = None
    move: Annotated[
        str | None,
        Parameter(help="DX,DY: pixels the picture moves while the shutter is open.", allow_leading_hyphen=True),
    ] = None
    turn: Annotated[
        str | None,
        Parameter(
            help="YAW[,PITCH[,ROLL]]: degrees that the camera turns right, up, clockwise.",
            allow_leading_hyphen=True,
        ),
    ] = None
    focus: Annotated[float | None, Parameter(help="Metres that are sharp; needs --depth, --aperture and --lens.")] = (
        None
    )
    aperture: Annotated[
        float | None, Parameter(help="f-number: with --focus how wide the lens is, with --shutter how much it lets in.")
    ] = None
    lens: Annotated[float | None, Parameter(help="Focal length, mm; --focus needs it.")] = None
    shutter: Annotated[
        str | None, Parameter(help="Seconds, like 1/60: the exposure with --aperture and --iso, in cd/m².")
    ] = None
    iso: Annotated[float | None, Parameter(help="Sensitivity of --shutter; 100 unless given.")] = None
    soft: Annotated[float | None, Parameter(help="Soft focus: the share of the light, 0 to 1, that is spread.")] = None
    vignetting: Annotated[
        bool, Parameter(negative="", help="Let the corners get less light, by cos⁴ of their angle.")
    ] = False
    display: Annotated[
        DisplayName | None,
        Parameter(help="What the picture is for: sRGB or Display P3 screens; HDR screens by pq or hlg (.avif) or a "
                  "gain map (.jpg)."),
    ] = None  # fmt: skip
    set: Annotated[
        list[str] | None,
        Parameter(name="--set", negative="", help="KEY=VALUE of a preset, like tone.key=0.36; again for each."),
    ] = None

    def read(self, *, vectors: bool = False) -> Preset:
        """The preset with these options above it; raises InvalidShot naming a key, ValueError naming an option.

        vectors : whether vectors were given, by which the picture moves then
        """
        from relume.project.presets.preset import preset_of, preset_table

        table, origin = preset_table(self.preset) if self.preset else ({}, Path())
        given = self._tables()
        if vectors and "motion" in given:
            raise ValueError("--vectors, --move and --turn are all the motion; leave all but one of them out")
        _merge(table, given)
        if vectors:
            _merge(table, {"motion": {"kind": "vectors"}})
        for text in self.set or ():
            setting = _setting(text)
            if "kind" in setting.get("tone", {}) and "tone" in given:
                raise ValueError(f'--set "{text}" and --tone, --film or --shutter make the picture; leave one out')
            _merge(table, setting)
        return preset_of(table, origin)

    @property
    def makes_the_picture(self) -> bool:
        """Whether a tone is asked for."""
        return bool(self.tone or self.film or self.shutter)

    def _tables(self) -> dict[str, Any]:
        """The options as the tables of a preset."""
        given: dict[str, Any] = {} if self.exposure is None else {"exposure": self.exposure}
        if self.tone and self.film:
            raise ValueError("--tone and --film both make the picture; leave one of them out")
        if self.tone:
            given["tone"] = {"kind": self.tone}
        if self.film:
            given["tone"] = {"kind": "darkroom", "stock": self.film}
        if self.glare:
            known = self.glare in ("eye", "camera")
            lamp = {"kind": "measured", "picture": str(Path(self.glare).resolve())}
            given["glare"] = {"kind": self.glare} if known else lamp
        if self.move and self.turn:
            raise ValueError("--move and --turn are both the motion; leave one of them out")
        if self.move:
            given["motion"] = {"kind": "straight", "pixels": _numbers(self.move, "--move", 2)}
        if self.turn:
            given["motion"] = {"kind": "turn", "degrees": [*_numbers(self.turn, "--turn", 1, 3), 0.0, 0.0][:3]}
        if self.focus is not None:
            if self.aperture is None or self.lens is None:
                raise ValueError("--focus needs --aperture, the f-number, and --lens, the focal length in mm")
            for option, value in (("--focus", self.focus), ("--aperture", self.aperture), ("--lens", self.lens)):
                if not value > 0:
                    raise ValueError(f"{option} is {value:g}; expected a number above 0")
            given["defocus"] = {"focus": self.focus, "f_number": self.aperture, "focal_length": self.lens}
        if self.lens is not None and self.focus is None:
            raise ValueError("--lens is the focal length of --focus; give that too, or leave it out")
        if self.aperture is not None and self.focus is None and self.shutter is None:
            raise ValueError("--aperture belongs to --focus or --shutter; give one of them, or leave it out")
        if self.shutter is not None:
            if self.tone or self.film:
                raise ValueError("--shutter exposes a camera, in place of --tone and --film; leave one of them out")
            if self.aperture is None:
                raise ValueError("--shutter needs --aperture, the f-number, for an exposure")
            from relume.cli.arguments import read_times

            (seconds,) = read_times(self.shutter, "--shutter") or [0.0]
            iso = 100.0 if self.iso is None else self.iso
            given["tone"] = {"kind": "camera", "seconds": seconds, "f_number": self.aperture, "iso": iso}
        elif self.iso is not None:
            raise ValueError("--iso is the sensitivity of --shutter; give that too, or leave it out")
        if self.soft is not None:
            given["soft_focus"] = {"share": self.soft}
        if self.vignetting:
            given["vignetting"] = {"kind": "natural"}
        if self.display:
            given["display"] = {"kind": self.display}
        return given


def _merge(table: dict[str, Any], given: dict[str, Any]) -> None:
    """Put `given` above a table: a table of another kind replaces the one that stands there, else keys are added."""
    for key, value in given.items():
        there = table.get(key)
        if (
            isinstance(there, dict)
            and isinstance(value, dict)
            and value.get("kind", there.get("kind")) == there.get("kind")
        ):
            _merge(there, value)
        else:
            table[key] = value


def _setting(text: str) -> dict[str, Any]:
    """KEY=VALUE as tables; a value that is no TOML is a word."""
    key, equals, value = text.partition("=")
    if not equals or not key.strip():
        raise ValueError(f'--set "{text}": expected KEY=VALUE, like tone.key=0.36')
    for written in (value, f'"{value}"'):
        try:
            table = tomllib.loads(f"{key} = {written}")
        except tomllib.TOMLDecodeError:
            continue
        return _from_here(table) if key.strip() in PATHS else table
    raise ValueError(f'--set "{text}": expected KEY=VALUE, like tone.key=0.36')


def _from_here(table: dict[str, Any]) -> dict[str, Any]:
    """Tables whose one path starts at the working folder, not at the preset's."""
    ((part, inner),) = table.items()
    ((key, value),) = inner.items()
    named = isinstance(value, str) and not value.startswith("ocio://")
    return {part: {key: str(Path(value).resolve())}} if named else table


def _numbers(text: str, option: str, *counts: int) -> list[float]:
    try:
        numbers = [float(word) for word in text.replace(",", " ").split()]
        if not min(counts) <= len(numbers) <= max(counts):
            raise ValueError
    except ValueError:
        many = " to ".join(str(count) for count in sorted(set(counts)))
        raise ValueError(f'{option}: "{text}"; write {many} numbers, with commas between') from None
    return numbers
