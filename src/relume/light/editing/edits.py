"""Edits of radiance maps in linear light, as frozen values: crop, resize, arithmetic, gain, balance, blur.

A map whose attributes say its mapping is an environment map: it is resized and blurred on the sphere. Variance, marks
of clipped pixels, unit and attributes go along. `edit` applies several edits and measures the energy before and after.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from relume.capture.scale.readings import ChannelGains, apply_balance, balance_from_luminaire
from relume.capture.scale.regions import disc
from relume.errors import warn
from relume.image import arithmetic
from relume.image.blurring import motion_blurred, soft_blurred
from relume.image.primaries import gains_from_temperature
from relume.image.radiance import RadianceMap
from relume.image.resizing import cropped, resized
from relume.sphere.audit import Audit
from relume.sphere.environment_files import LAYOUT, as_environment, as_radiance_map
from relume.sphere.environment_map import EnvironmentMap
from relume.sphere.mappings.mapping import Mapping
from relume.sphere.resampling.blur import blurred, spun

Colour = tuple[float, float, float]


class Edit(Protocol):
    """One edit of a radiance map; `str` says what it does."""

    @property
    def name(self) -> str:
        """The name by which messages call the edit."""
        ...

    def __call__(self, picture: RadianceMap) -> RadianceMap:
        """The edited map; raises ValueError where it cannot be."""
        ...


@dataclass(frozen=True)
class Crop:
    """A rectangle of the map, in pixels; a part of an environment map is no longer one.

    left, top, width, height : of the rectangle, pixels from the upper left corner
    """

    name = "crop"
    left: int
    top: int
    width: int
    height: int

    def __str__(self) -> str:
        return f"crop {self.left},{self.top},{self.width},{self.height}"

    def __call__(self, picture: RadianceMap) -> RadianceMap:
        part = cropped(picture, self.left, self.top, self.width, self.height)
        lost = [key for key in part.attributes if key in LAYOUT or key.startswith("view-")]
        if not lost or part.size == picture.size:
            return part
        if "mapping" in lost:
            warn("a part of an environment map is not one; the file no longer says its mapping")
        elif any(key.startswith("view-") for key in lost):
            warn("a part of a view; the file no longer says where in its map that lay")
        return replace(part, attributes={key: text for key, text in part.attributes.items() if key not in lost})


@dataclass(frozen=True)
class Resize:
    """Another size: an environment map by solid angle, its total kept; any other by area, its mean kept.

    width, height : pixels; a height of None follows from the width
    percent : of the present size, instead of both
    """

    name = "resize"
    width: int | None = None
    height: int | None = None
    percent: float | None = None

    def __str__(self) -> str:
        if self.percent is not None:
            return f"resize {self.percent:g}%"
        return f"resize {self.width}" + (f",{self.height}" if self.height else "")

    def __call__(self, picture: RadianceMap) -> RadianceMap:
        width, height = self._size(picture.size)
        if "mapping" not in picture.attributes or min(width, height) < 1:
            return resized(picture, width, height)
        light = _in_file_layout(picture)
        if light.mapping.shape(height) != (height, width):
            expected = light.mapping.shape(height)[1]
            raise ValueError(
                f"{width}×{height} does not fit a {light.mapping.name} map; one of {height} rows is {expected} pixels "
                "wide"
            )
        if picture.variance is not None:
            warn("an environment map that is resized loses its variance")
        smaller = light.remapped(light.mapping, height)
        return replace(picture, radiance=smaller.radiance, variance=None, clipped=smaller.clipped)

    def _size(self, size: tuple[int, int]) -> tuple[int, int]:
        def whole(length: float) -> int:
            # What is negative or 0 is refused where the map is resized.
            return max(1, round(length)) if length > 0 else 0

        if self.percent is not None:
            return whole(size[0] * self.percent / 100), whole(size[1] * self.percent / 100)
        width = self.width or 0
        return width, whole(size[1] * width / size[0]) if self.height is None else self.height


@dataclass(frozen=True)
class Gain:
    """The map times a factor above 0.

    factor : of all channels
    """

    name = "gain"
    factor: float

    def __post_init__(self) -> None:
        if not 0 < self.factor < np.inf:
            raise ValueError(f"the gain is {self.factor:g}; it must be above 0")

    @classmethod
    def of_stops(cls, stops: float) -> Gain:
        """2 to the power of the stops, −100 to 100."""
        if not abs(stops) <= 100:
            raise ValueError(f"stops are {stops:g}; expected −100 to 100")
        return cls(2.0**stops)

    def __str__(self) -> str:
        return f"gain × {self.factor:g}"

    def __call__(self, picture: RadianceMap) -> RadianceMap:
        return arithmetic.multiplied(picture, self.factor)


@dataclass(frozen=True)
class NeutralAt:
    """White balance by which a disc of the map is grey, as bright as it is. Column, row and radius in pixels.

    x, y : of the middle, pixels from the upper left corner
    radius : pixels; 5 takes some eighty of them
    """

    name = "grey"
    x: int
    y: int
    radius: float = 5.0

    def __str__(self) -> str:
        return f"grey at {self.x},{self.y}"

    def __call__(self, picture: RadianceMap) -> RadianceMap:
        return apply_balance(picture, balance_from_luminaire(picture, disc(picture.size, self.x, self.y, self.radius)))


@dataclass(frozen=True)
class Balance:
    """The channels times their gains.

    gains : of red, green and blue
    """

    name = "balance"
    gains: Colour

    def __str__(self) -> str:
        return f"balance × {','.join(f'{gain:g}' for gain in self.gains)}"

    def __call__(self, picture: RadianceMap) -> RadianceMap:
        return apply_balance(picture, ChannelGains(self.gains))


@dataclass(frozen=True)
class NeutralUnder:
    """White balance by which light of a colour temperature is neutral.

    kelvin : of that light
    """

    name = "temperature"
    kelvin: float

    def __str__(self) -> str:
        return f"light of {self.kelvin:g} K neutral"

    def __call__(self, picture: RadianceMap) -> RadianceMap:
        return apply_balance(picture, ChannelGains(gains_from_temperature(self.kelvin)))


@dataclass(frozen=True)
class MotionBlur:
    """Motion blur of a flat picture along a line.

    length : pixels
    angle : radians, anticlockwise from the right
    """

    name = "motion"
    length: float
    angle: float = 0.0

    def __str__(self) -> str:
        return f"motion blur {self.length:g},{np.degrees(self.angle):g}"

    def __call__(self, picture: RadianceMap) -> RadianceMap:
        _refuse_environment_map(picture, "spin it about the vertical (--spin DEGREES)")
        return motion_blurred(picture, self.length, self.angle)


@dataclass(frozen=True)
class SoftBlur:
    """Soft blur of a flat picture.

    sigma : pixels
    share : of the light that is blurred; the rest stays sharp
    """

    name = "blur"
    sigma: float
    share: float = 1.0

    def __str__(self) -> str:
        return f"soft blur {self.sigma:g} pixels{_of_the_light(self.share)}"

    def __call__(self, picture: RadianceMap) -> RadianceMap:
        _refuse_environment_map(picture, "blur it on the sphere (--spherical-blur DEGREES)")
        return soft_blurred(picture, self.sigma, share=self.share)


@dataclass(frozen=True)
class Spin:
    """Motion blur of an environment map that turns about the vertical while the shutter is open; it stays in our frame.

    angle : radians
    """

    name = "spin"
    angle: float

    def __str__(self) -> str:
        return f"spin {np.degrees(self.angle):g}°"

    def __call__(self, picture: RadianceMap) -> RadianceMap:
        light = _environment(picture, as_environment)
        warn_of_frame(picture)
        return as_radiance_map(spun(light, self.angle))


@dataclass(frozen=True)
class SphericalBlur:
    """Soft blur of an environment map on the sphere.

    sigma : radians
    share : of the light that is blurred; the rest stays sharp
    """

    name = "spherical blur"
    sigma: float
    share: float = 1.0

    def __str__(self) -> str:
        return f"soft blur {np.degrees(self.sigma):g}°{_of_the_light(self.share)}"

    def __call__(self, picture: RadianceMap) -> RadianceMap:
        result = blurred(_environment(picture, _in_file_layout), self.sigma, share=self.share)
        made = replace(picture, radiance=result.radiance, variance=None, clipped=result.clipped)
        return _with_mapping(made, result.mapping.name)


@dataclass(frozen=True, eq=False)
class Edited:
    """An edited map, with what it was.

    picture : the result
    before : the map, with its mapping where the edits needed it
    edits : what was done, for a person
    """

    picture: RadianceMap
    before: RadianceMap
    edits: tuple[str, ...]

    def facts(self) -> dict[str, object]:
        """Edits, size, unit, and the energy before and after."""
        facts = {"edits": list(self.edits), "size": list(self.picture.size), "unit": self.picture.unit}
        return facts | energy(self.before, "before") | energy(self.picture, "after")


def edit(picture: RadianceMap, edits: Sequence[Edit], mapping: Mapping | None = None) -> Edited:
    """Apply edits one after the other.

    picture : the map
    edits : in the order in which they are made
    mapping : of an environment map that does not say its own

    Warns of light that a resize alone lost. Raises ValueError naming the edit that cannot be done.
    """
    before = picture if mapping is None else _with_mapping(picture, mapping.name)
    after = before
    for each in edits:
        try:
            after = each(after)
        except ValueError as error:
            raise ValueError(f"{each.name}: {error}") from None
    # What was blurred as an environment map is one, and was one before.
    if "mapping" in after.attributes and "mapping" not in before.attributes:
        before = _with_mapping(before, after.attributes["mapping"])
    audits = _audit(before), _audit(after)
    if all(isinstance(each, Resize) for each in edits) and audits[0] is not None and audits[1] is not None:
        for line in audits[0].losses(audits[1]):
            warn(line)
    return Edited(after, before, tuple(map(str, edits)))


def energy(picture: RadianceMap, when: str) -> dict[str, object]:
    """Total and peak of an environment map, else the mean of the pixels; `when` ends the names."""
    light = _audit(picture)
    if light is not None:
        return {f"{key} {when}": value for key, value in light.facts().items() if key in ("total", "peak")}
    finite = np.where(np.isfinite(picture.radiance), picture.radiance, 0)
    return {f"mean {when}": [float(f"{value:.6g}") for value in finite.mean((0, 1), dtype=np.float64)]}


def _audit(picture: RadianceMap) -> Audit | None:
    """The energy of an environment map; None for any other map, and one with pixels that cannot be light."""
    if "mapping" not in picture.attributes:
        return None
    try:
        return as_environment(picture).audit()
    except ValueError:
        return None


def _with_mapping(picture: RadianceMap, name: str) -> RadianceMap:
    return replace(picture, attributes={**picture.attributes, "mapping": name})


def warn_of_frame(picture: RadianceMap) -> None:
    """Warn that an edited map is written in our frame where it was laid out for another program."""
    program, axis = picture.attributes.get("orientation"), picture.attributes.get("mirror")
    if program is not None:
        warn(f"laid out for {program}; written in our frame: convert --for {program} again")
    elif axis is not None:
        warn(f"mirrored in {axis}; written in our frame: convert --mirror {axis} again")


def _in_file_layout(picture: RadianceMap) -> EnvironmentMap:
    """The light as it stands in the file, whatever program it is for: enough for what is alike in all directions."""
    # Turned back, it would have to be resampled, and the file would no longer be for that program.
    attributes = {key: text for key, text in picture.attributes.items() if key not in ("orientation", "mirror")}
    return as_environment(replace(picture, attributes=attributes))


def _environment(picture: RadianceMap, read: Callable[[RadianceMap], EnvironmentMap]) -> EnvironmentMap:
    """A picture that is to be blurred as an environment map; raises ValueError with what helps."""
    dark = int((picture.radiance < 0).any(-1).sum())
    if dark:
        raise ValueError(f"{dark} pixels are negative, which is not light; --max 0 sets them to 0")
    try:
        light = read(picture)
    except ValueError as error:
        remedy = "" if "mapping" in picture.attributes else "; give it with --from"
        raise ValueError(f"{error}{remedy}") from None
    if picture.variance is not None:
        warn("an environment map that is blurred loses its variance")
    return light


def _refuse_environment_map(picture: RadianceMap, remedy: str) -> None:
    mapping = picture.attributes.get("mapping")
    if mapping is not None:
        raise ValueError(f"pixels of a {mapping} map are not of one size, and its borders are none; {remedy}")


def _of_the_light(share: float) -> str:
    return "" if share == 1 else f" of {share:g} of the light"
