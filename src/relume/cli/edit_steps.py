"""What each edit of `relume edit` does to a map: the flat ones, and those of light maps on the sphere."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from relume.image.radiance import RadianceMap
    from relume.sphere.audit import Audit
    from relume.sphere.environment_map import EnvironmentMap

_LOOKS = ("mapping", "envmap", "orientation", "mirror", "face", "view")
"""Attributes that tell where the pixels of a whole file look."""


@dataclass(frozen=True)
class Step:
    """One edit.

    option : that asks for it, for messages
    words : what it does, for a person
    """

    option: str
    words: str
    apply: Callable[[RadianceMap], RadianceMap]

    def __call__(self, picture: RadianceMap) -> RadianceMap:
        """The edited map; raises ValueError naming the option."""
        try:
            return self.apply(picture)
        except ValueError as error:
            raise ValueError(f"{self.option}: {error}") from None


def with_mapping(picture: RadianceMap, name: str) -> RadianceMap:
    """The map as a light map that tells its mapping."""
    return replace(picture, attributes={**picture.attributes, "mapping": name})


def crop(picture: RadianceMap, left: int, top: int, width: int, height: int) -> RadianceMap:
    """A rectangle of the map, which no longer tells where its pixels look unless it is the whole."""
    from relume.image.resizing import cropped

    part = cropped(picture, left, top, width, height)
    lost = [key for key in part.attributes if key in _LOOKS or key.startswith("view-")]
    if not lost or part.size == picture.size:
        return part
    if "mapping" in lost:
        warnings.warn("a part of a light map is no light map; the file no longer tells its mapping", stacklevel=2)
    elif any(key.startswith("view-") for key in lost):
        warnings.warn("a part of a view; the file no longer tells where in its light map that lay", stacklevel=2)
    return replace(part, attributes={key: text for key, text in part.attributes.items() if key not in lost})


def resize(picture: RadianceMap, width: int, height: int) -> RadianceMap:
    """The map at another size: a light map by solid angle, any other by area."""
    from relume.image.resizing import resized

    if "mapping" not in picture.attributes or min(width, height) < 1:
        return resized(picture, width, height)
    light = _as_laid_out(picture)
    if light.mapping.shape(height) != (height, width):
        expected = light.mapping.shape(height)[1]
        raise ValueError(
            f"{width}×{height} is no {light.mapping.name} map; one of {height} rows is {expected} pixels wide"
        )
    if picture.variance is not None:
        warnings.warn("a light map that is resized loses its variance", stacklevel=2)
    smaller = light.remapped(light.mapping, height)
    return replace(picture, radiance=smaller.radiance, variance=None, clipped=smaller.clipped)


def gain(picture: RadianceMap, factor: float) -> RadianceMap:
    """The map times a factor."""
    from relume.image.arithmetic import multiplied

    return multiplied(picture, factor)


def neutral_at(picture: RadianceMap, x: int, y: int, radius: float = 5.0) -> RadianceMap:
    """The map balanced so that a disc of it is grey."""
    from relume.capture.scale.luminaire import balance_from_luminaire, balanced
    from relume.capture.scale.regions import disc

    return balanced(picture, balance_from_luminaire(picture, disc(picture.size, x, y, radius)))


def balance(picture: RadianceMap, gains: list[float]) -> RadianceMap:
    """The channels times their gains."""
    from relume.capture.scale.luminaire import Balance, balanced

    return balanced(picture, Balance((gains[0], gains[1], gains[2])))


def neutral_under(picture: RadianceMap, kelvin: float) -> RadianceMap:
    """The map balanced for light of a colour temperature."""
    from relume.capture.scale.luminaire import Balance, balanced
    from relume.image.white_point import gains_from_temperature

    return balanced(picture, Balance(gains_from_temperature(kelvin)))


def streak(picture: RadianceMap, length: float, angle: float) -> RadianceMap:
    """Motion blur along a line."""
    from relume.image.blurring import motion_blurred

    _refuse_light_map(picture, "--spin DEGREES")
    return motion_blurred(picture, length, angle)


def soften(picture: RadianceMap, sigma: float, share: float) -> RadianceMap:
    """Soft blur of a flat picture."""
    from relume.image.blurring import soft_blurred

    _refuse_light_map(picture, "--spherical-blur DEGREES")
    return soft_blurred(picture, sigma, share=share)


def spin(picture: RadianceMap, angle: float) -> RadianceMap:
    """Motion blur of a light map, turned by `angle` in radians, in our frame: only there the vertical is upright."""
    from relume.sphere.environment_files import as_environment, as_radiance_map
    from relume.sphere.resampling.blur import spun

    light = _light(picture, as_environment)
    told = picture.attributes.get("orientation")
    if told is not None:
        warnings.warn(f"laid out for {told}; written in our frame: convert --for {told} again", stacklevel=2)
    elif "mirror" in picture.attributes:
        axis = picture.attributes["mirror"]
        warnings.warn(f"mirrored in {axis}; written in our frame: convert --mirror {axis} again", stacklevel=2)
    return as_radiance_map(spun(light, angle))


def blur_sphere(picture: RadianceMap, sigma: float, share: float) -> RadianceMap:
    """Soft blur of a light map, `sigma` in radians."""
    from relume.sphere.resampling.blur import blurred

    result = blurred(_light(picture, _as_laid_out), sigma, share=share)
    made = replace(picture, radiance=result.radiance, variance=None, clipped=result.clipped)
    return with_mapping(made, result.mapping.name)


def _as_laid_out(picture: RadianceMap) -> EnvironmentMap:
    """The light as it stands in the file, whatever program it is for: enough for what is alike in all directions."""
    from relume.sphere.environment_files import as_environment

    # Turned back, it would have to be resampled, and the file would no longer be for that program.
    attributes = {key: text for key, text in picture.attributes.items() if key not in ("orientation", "mirror")}
    return as_environment(replace(picture, attributes=attributes))


def _light(picture: RadianceMap, read: Callable[[RadianceMap], EnvironmentMap]) -> EnvironmentMap:
    """A picture that is to be blurred as light; raises ValueError with the option that helps."""
    dark = int((picture.radiance < 0).any(-1).sum())
    if dark:
        raise ValueError(f"{dark} pixels are negative, which no light is; --max 0 takes them for 0")
    try:
        light = read(picture)
    except ValueError as error:
        told = "" if "mapping" in picture.attributes else "; tell it with --from"
        raise ValueError(f"{error}{told}") from None
    if picture.variance is not None:
        warnings.warn("a light map that is blurred loses its variance", stacklevel=2)
    return light


def _refuse_light_map(picture: RadianceMap, remedy: str) -> None:
    mapping = picture.attributes.get("mapping")
    if mapping is not None:
        raise ValueError(f"pixels of a {mapping} map are not alike, and its borders are no borders; give {remedy}")


def energy(picture: RadianceMap, when: str) -> dict[str, object]:
    """The light in a light map, else the mean of the pixels."""
    import numpy as np

    light = _audit(picture)
    if light is not None:
        return {f"{key} {when}": value for key, value in light.facts().items() if key in ("total", "peak")}
    finite = np.where(np.isfinite(picture.radiance), picture.radiance, 0)
    return {f"mean {when}": [float(f"{value:.6g}") for value in finite.mean((0, 1), dtype=np.float64)]}


def note_losses(before: RadianceMap, after: RadianceMap) -> None:
    """Warn of light that a step lost which should have lost none."""

    audits = _audit(before), _audit(after)
    if audits[0] is not None and audits[1] is not None:
        for line in audits[0].losses(audits[1]):
            warnings.warn(line, stacklevel=2)


def _audit(picture: RadianceMap) -> Audit | None:
    """The energy of a light map; None for any other map, and one that holds what is no light."""
    from relume.sphere.environment_files import as_environment

    if "mapping" not in picture.attributes:
        return None
    try:
        return as_environment(picture).audit()
    except ValueError:
        return None
