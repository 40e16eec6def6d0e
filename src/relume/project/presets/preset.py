"""Presets: a whole virtual camera in a TOML file that a person can read, checked key by key.

Paths are relative to the file; angles are degrees, lengths as each key says. An unknown key is an error.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field

from relume.errors import InvalidShot
from relume.project.presets.optics import (
    DefocusTable,
    GeometryTable,
    GlareTable,
    MotionTable,
    SoftFocusTable,
    VignettingTable,
)
from relume.project.presets.tones import Step, ToneTable
from relume.project.schema import Positive, Table, checked, read_toml
from relume.virtual_camera.tone.display.displays import HLG, PQ, Display, DisplayP3, HdrGainMap, Srgb
from relume.virtual_camera.tone.metered import Metered
from relume.virtual_camera.view import FIELD_OF_VIEW
from relume.virtual_camera.virtual_camera import VirtualCamera

WHAT = "preset"
HERE = Path(__file__).with_name("builtin")


class DisplayTable(Step):
    """What the picture is encoded for, and the numbers of that kind."""

    kind: Literal["srgb", "p3", "pq", "hlg", "gain-map"] = "srgb"
    bits: Literal[8, 16] | None = None
    peak: Positive | None = None
    white: Positive | None = None
    headroom: Annotated[float, Field(gt=0, le=16)] | None = None
    quality: Annotated[int, Field(ge=1, le=100)] | None = None

    def made(self) -> Display:
        """The display; raises ValueError naming a key that its kind does not have."""
        kinds = {"srgb": Srgb, "p3": DisplayP3, "pq": PQ, "hlg": HLG, "gain-map": HdrGainMap}
        try:
            return kinds[self.kind](**self.given())
        except TypeError:
            known = set(kinds[self.kind].__dataclass_fields__)
            odd = next(key for key in self.given() if key not in known)
            raise ValueError(
                f"display.{odd}: not of the kind {self.kind}, which has {', '.join(sorted(known))}"
            ) from None


class ViewTable(Table):
    """Of the scene: the angle seen across, degrees; cd/m² per unit of a relative map; what is drawn at random."""

    field_of_view: Annotated[float, Field(gt=0, lt=180)] = float(round(FIELD_OF_VIEW * 57.29577951308232, 6))
    luminance: Positive | None = None
    seed: Annotated[int, Field(ge=0)] = 0


class Preset(Table):
    """A preset as it is read; `folder` is where its relative paths start."""

    title: str = ""
    exposure: Annotated[float, Field(ge=-100, le=100)] = 0.0
    view: ViewTable = ViewTable()
    motion: MotionTable | None = None
    defocus: DefocusTable | None = None
    soft_focus: SoftFocusTable | None = None
    glare: GlareTable | None = None
    geometry: GeometryTable | None = None
    vignetting: VignettingTable | None = None
    tone: ToneTable | None = None
    display: DisplayTable = DisplayTable()
    folder: Path = Field(default=Path("."), exclude=True)

    @property
    def camera(self) -> VirtualCamera:
        """The camera; reads the files that the preset names. Raises ValueError or a RelumeError in one line."""
        return VirtualCamera(
            motion=None if self.motion is None else self.motion.made(),
            defocus=None if self.defocus is None else self.defocus.made(),
            soft_focus=None if self.soft_focus is None else self.soft_focus.made(),
            glare=None if self.glare is None else self.glare.made(self.folder),
            geometry=None if self.geometry is None else self.geometry.made(),
            vignetting=None if self.vignetting is None else self.vignetting.made(self.folder),
            tone=Metered() if self.tone is None else self.tone.made(self.folder),
            stops=self.exposure,
            display=self.display.made(),
        )


def read_preset(path: str | os.PathLike[str]) -> Preset:
    """A preset from its TOML file, or one that comes along by its name, like "night"; raises InvalidShot."""
    table, place = preset_table(path)
    return preset_of(table, place)


def preset_table(path: str | os.PathLike[str]) -> tuple[dict[str, Any], Path]:
    """A preset's tables, unchecked, and the file they are from."""
    place = preset_file(path)
    return read_toml(place, WHAT, InvalidShot), place


def preset_file(path: str | os.PathLike[str]) -> Path:
    """The file itself, or that of the preset of that name which comes along; raises InvalidShot."""
    place = Path(path)
    if place.is_file() or place.suffix:
        return place
    names = builtin_presets()
    if str(path) not in names:
        raise InvalidShot(f"{path}: no such preset; give a .toml, or one of {', '.join(names)}")
    return HERE / f"{path}.toml"


def preset_of(table: Mapping[str, Any], place: Path = Path()) -> Preset:
    """The preset that tables make; raises InvalidShot naming the key.

    place : the file they are from, for messages and relative paths; none for those of the command line
    """
    return checked(
        Preset, {**table, "folder": place.parent}, place if place.name else Path("the options"), WHAT, InvalidShot
    )


def builtin_presets() -> dict[str, str]:
    """The presets that come along: name → what it is, in a line."""
    return {each.stem: read_toml(each, WHAT, InvalidShot)["title"] for each in sorted(HERE.glob("*.toml"))}
