"""Constellations in the files of other programs, one module a program."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from relume.export import json_lights, radiance
from relume.export.blender import lights as blender
from relume.export.gltf import lights as gltf
from relume.export.mitsuba import lights as mitsuba_xml
from relume.export.usd import lights as usd
from relume.light.constellations.constellation import Constellation
from relume.light.constellations.placement import PlacedLights

__all__ = ["FORMATS", "Format"]


class _Text(Protocol):
    def __call__(
        self,
        lights: Constellation,
        *,
        unit: str,
        background: str | None = None,
        angles: np.ndarray | None = None,
        points: PlacedLights | None = None,
    ) -> str: ...


@dataclass(frozen=True)
class Format:
    """A kind of file that holds lights.

    name : what a person asks for
    suffix : of its files
    background_suffix : of the lat-long file with the light that the lights do not carry, as the program reads it
    text : writes it: lights, unit, the background's file name, the lights' apparent diameters in radians and the lights
        that have a place to a text
    """

    name: str
    suffix: str
    background_suffix: str
    text: _Text


FORMATS: dict[str, Format] = {
    form.name: form
    for form in (
        Format("json", ".json", ".exr", json_lights.text),
        Format("usd", ".usda", ".exr", usd.text),
        Format("gltf", ".gltf", ".exr", gltf.text),
        Format("blender", ".py", ".exr", blender.text),
        Format("radiance", ".rad", ".hdr", radiance.text),
        Format("mitsuba", ".xml", ".exr", mitsuba_xml.text),
    )
}
"""Every kind of file a constellation can be written to, by its name."""
