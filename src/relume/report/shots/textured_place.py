"""A modelled place with its photographs on it, in one call: cameras and blocks found, baked, and written."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from relume.capture.brackets.merging import merge_brackets
from relume.capture.response.camera_profile import CameraProfile, read_profile
from relume.errors import InvalidPlace, warn
from relume.image import files
from relume.image.radiance import RadianceMap
from relume.renderers.projective.baking import BakedPlace, bake
from relume.renderers.projective.photographs import ProjectedPhotograph
from relume.renderers.projective.seams import Seams, seams
from relume.report.shots.place_files import PlaceFiles, require_place_suffix, write_place
from relume.scene.places.modelling import modelled
from relume.scene.places.place import Place, PlacePhotograph

UNEVEN = 0.15
"""Stops by which a photograph may be brighter than the others before it is said: a tenth, as exposures differ."""


@dataclass(frozen=True, eq=False)
class TexturedPlace:
    """What `texture_place` made.

    place : cameras and blocks
    baked : the blocks with their radiance
    seams : how well the photographs agree where several show one place
    files : what was written
    """

    place: Place
    baked: BakedPlace
    seams: Seams
    files: PlaceFiles

    def facts(self) -> dict[str, object]:
        """What was found of the textures, in words, for a report."""
        parts = self.baked.parts
        return {
            "textures": {
                part.mesh.name: f"{part.radiance.shape[1]}×{part.radiance.shape[0]}, {100 * part.texel:.2g} cm each, "
                f"{part.holes:.1%} seen in no photograph and filled"
                for part in parts
            },
            "filled": f"{self.baked.holes:.1%} of the surface",
            "seams": f"{self.seams.shared:.0%} is in two photographs or more, which lie {self.seams.typical:.1%} apart "
            f"(5 % of it more than {self.seams.worst:.0%})",
            "brightness": {
                name: "alone" if np.isnan(gain) else f"{gain:.3f} of the middle one"
                for name, gain in self.seams.gains.items()
            },
        }


def texture_place(
    path: str | os.PathLike[str],
    photographs: Sequence[str | os.PathLike[str]],
    export: str | os.PathLike[str],
    *,
    out: str | os.PathLike[str] | None = None,
    profile: str | os.PathLike[str] | None = None,
    texel: float | None = None,
) -> TexturedPlace:
    """Find a place from its marked edges, lay its photographs' radiance on it, and write it as glTF or USD.

    path, out : the place file and where to write it with what was found, last, as `model_place` takes them
    photographs : radiance maps, or photographs of eight bits with a profile; each is named as a photograph of the place
        or as its file is, without the suffix, and may be of another size. Those of the place that are left out are not
        used
    export : .glb or .usda; textures of full precision and masks of the holes lie beside it, as `write_place` says
    profile : of the camera, as `relume merge --save-profile` writes it; their exposures are in the photographs' EXIF
    texel : metres; as fine as the photographs show a quarter of the surface, unless given, and wider where a texture
        would have more than 2048 along a side, as `rl.renderers.bake` says

    Raises InvalidPlace, one line: what `model_place` raises, a file that is no photograph of the place or of another
    shape, and a place that none of them shows; UnreadableFile, ValueError without a profile, OutputNotWritten.
    """
    require_place_suffix(Path(export))
    if not photographs:
        raise ValueError("there are no photographs to lay on the place; give radiance maps, one of each photograph")
    known = None if profile is None else read_profile(Path(profile))
    place, text = modelled(Path(path), out)
    if not place.blocks:
        raise InvalidPlace(f"{path}: the place has no mesh to lay photographs on; name one in its file")
    taken = _projected(place, [Path(each) for each in photographs], known)
    try:
        baked = bake(place.meshes(), taken, texel=texel)
    except ValueError as error:
        raise InvalidPlace(f"{path}: {error}") from None
    agreement = seams(baked, taken)
    for name, gain in agreement.gains.items():
        if abs(np.log2(gain)) > UNEVEN:
            warn(f"{name} is {gain:.2f} times as bright as the others where they show one place; is it on their scale?")
    written = write_place(export, baked)
    if out is not None:
        files.write_text(out, text)
    return TexturedPlace(place, baked, agreement, written)


def _projected(place: Place, paths: Sequence[Path], profile: CameraProfile | None) -> list[ProjectedPhotograph]:
    """The files with the cameras that took them; raises InvalidPlace, UnreadableFile, ValueError."""
    of_place = [_photograph_of(place, path) for path in paths]
    for index, (photograph, path) in enumerate(zip(of_place, paths, strict=True)):
        if photograph in of_place[:index]:
            raise InvalidPlace(f"{path}: another file is of {photograph.name!r} already; leave one of them out")
    found = []
    for photograph, path, radiance in zip(of_place, paths, _radiance(paths, profile), strict=True):
        width, height = radiance.size
        camera = photograph.camera
        if abs(width * camera.height - height * camera.width) > max(width, height):
            raise InvalidPlace(
                f"{path}: {width}×{height} pixels; {photograph.name!r} was marked in {camera.width}×{camera.height}, "
                "another shape: give the whole picture"
            )
        found.append(ProjectedPhotograph(camera.resized(width, height), radiance, photograph.name))
    return found


def _photograph_of(place: Place, path: Path) -> PlacePhotograph:
    for each in place.photographs:
        if path.stem in (each.name, each.file.stem):
            return each
    names = ", ".join(each.name for each in place.photographs)
    raise InvalidPlace(f"{path}: no photograph of the place is called so; it has {names}")


def _radiance(paths: Sequence[Path], profile: CameraProfile | None) -> list[RadianceMap]:
    """What the files show, of photographs by the profile, together, for they share one scale."""
    plain = [path for path in paths if not files.has_radiance(path)]
    if plain and profile is None:
        raise ValueError(
            f"{plain[0]}: a photograph, whose radiance needs the camera's profile; give that, as `relume merge "
            "--save-profile` writes it, or radiance maps"
        )
    if plain and len(plain) < len(paths):
        raise ValueError(f"{plain[0]} is a photograph and others are radiance maps, on no common scale; give one kind")
    if not plain:
        return [files.read_radiance(path) for path in paths]
    merged = merge_brackets([[path] for path in paths], profile=profile)
    for message in merged.messages:
        warn(message)
    return [bracket.picture for bracket in merged.brackets]
