"""What a stage's LEDs are to a camera: primaries measured from photographs or spectra, and how they are confused.

A lamp's colour is what a camera makes of it, and two lights that look alike on white differ on other surfaces where
their spectra do (metamerism). So what is measured is a chart: what the camera sees of each of its patches under each
LED alone. The white patch gives the primaries that `drive` takes; the others say what a mix does to other colours.
"""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from relume.errors import warn
from relume.image import files
from relume.image.colour_space import decoded
from relume.light.spectra.reflectance import colour_of
from relume.light.spectra.spectrum import Spectrum, illuminant, rgb_matching, visible
from relume.lightstage.driving.driving import LampPrimaries

_ILL = 30.0
"""The condition number from which on a warning is due: an error of a hundredth in the wish is a third in a lamp."""


@dataclass(frozen=True, eq=False)
class PrimaryPatches:
    """What a camera sees of surfaces under each LED alone, at intensity 1.

    names : of the P primaries
    values : (P, K, 3) float64, linear, of K surfaces; all in one unit
    white : which of the K is white, or grey
    reflectance : of that surface

    Raises ValueError for other shapes, and for a white that an LED leaves dark.
    """

    names: tuple[str, ...]
    values: np.ndarray
    white: int = 0
    reflectance: float = 1.0

    def __post_init__(self) -> None:
        shape = self.values.shape
        if len(shape) != 3 or shape[0] != len(self.names) or shape[2] != 3 or 0 in shape:
            raise ValueError(f"patches are {shape}; expected ({len(self.names)} primaries, surfaces, 3)")
        if not 0 <= self.white < shape[1] or not 0 < self.reflectance <= 1:
            raise ValueError(
                f"white is surface {self.white} of {shape[1]} and reflects {self.reflectance}; expected one of them, "
                "and a share above 0 to 1"
            )
        dark = [name for name, seen in zip(self.names, self.values[:, self.white], strict=True) if seen.sum() <= 0]
        if dark or not np.all(np.isfinite(self.values)):
            raise ValueError(
                f"the white surface is dark under {', '.join(dark) or 'an LED'}, or not finite; was the LED on, and "
                "does the camera see it?"
            )


@dataclass(frozen=True, eq=False)
class LampCalibration:
    """The primaries of a stage's lamps as a camera sees them, and their confusion.

    primaries : as `drive` takes them
    mixing : (P, 3) float64, intensities = wanted irradiance @ mixing.T, the least that make it; of three primaries the
        only ones. Below 0 where no mix of light makes the colour; `LampPrimaries.nearest` then is the nearest
    condition : of the primaries' colours, each of length 1: by how much an error of the wanted colour grows in the
        lamps. 1 where each LED is one channel's alone, infinite where the camera sees fewer than three colours
    crosstalk : (P,) the share of each primary that is not in its strongest channel
    twins : the two primaries that are most alike, and the angle between their colours, radians; None of a single one
    """

    primaries: LampPrimaries
    mixing: np.ndarray
    condition: float
    crosstalk: np.ndarray
    twins: tuple[str, str, float] | None


@dataclass(frozen=True, eq=False)
class PatchMatch:
    """Surfaces under a mix of the LEDs beside the same under the light that it stands for.

    intensities : (P,) float64, 0 or more
    values : (K, 3) what the camera sees of them under the mix
    errors : (K,) how far each is off: the length of the difference as a share of the white's; of a mix whose white is
        right this is metamerism
    """

    intensities: np.ndarray
    values: np.ndarray
    errors: np.ndarray


def calibrate_primaries(
    patches: PrimaryPatches, to_rec709: np.ndarray | None = None, *, maximum: float = np.inf
) -> LampCalibration:
    """The primaries of lamps from what a camera sees of white under each, E = π·L/ρ.

    patches : what the camera sees of white, and of others, under each LED alone
    to_rec709 : (3, 3) from the camera's colours to linear Rec. 709, as `camera_to_rec709` finds it; none unless given,
        as pictures that relume reads are in Rec. 709 already
    maximum : as of `LampPrimaries`
    Warns of primaries that are nearly alike. Raises ValueError for primaries that give no light in Rec. 709.
    """
    seen = patches.values[:, patches.white].astype(np.float64)
    turned = seen if to_rec709 is None else seen @ np.asarray(to_rec709, np.float64).T
    primaries = LampPrimaries(patches.names, np.pi / patches.reflectance * turned, maximum)
    colours = primaries.irradiance / np.linalg.norm(primaries.irradiance, axis=1, keepdims=True)
    lengths = np.linalg.svd(colours, compute_uv=False)
    condition = float(lengths[0] / lengths[-1]) if len(lengths) == 3 and lengths[-1] > 1e-9 * lengths[0] else np.inf
    strength = np.abs(primaries.irradiance)
    pairs = [
        (first, second, float(np.arccos(np.clip(colours[first] @ colours[second], -1, 1))))
        for first, second in combinations(range(len(primaries)), 2)
    ]
    nearest = min(pairs, key=lambda pair: pair[2]) if pairs else None
    twins = None if nearest is None else (patches.names[nearest[0]], patches.names[nearest[1]], nearest[2])
    if condition > _ILL:
        alike = f"; {twins[0]} and {twins[1]} are {np.degrees(twins[2]):.1f} degrees apart" if twins else ""
        warn(
            f"the camera hardly distinguishes {', '.join(patches.names)} (condition {condition:.3g}){alike}; some "
            "colours need far more light than others, or cannot be made"
        )
    return LampCalibration(
        primaries,
        np.linalg.pinv(primaries.irradiance.T),
        condition,
        1 - strength.max(axis=1) / strength.sum(axis=1),
        twins,
    )


def match_patches(patches: PrimaryPatches, wanted: np.ndarray, *, others: float = 0.0) -> PatchMatch:
    """The mix of LEDs under which surfaces look most as under another light, by non-negative least squares.

    patches : what the camera sees of surfaces under each LED alone
    wanted : (K, 3) what the camera sees of the same surfaces under the light that is to be shown
    others : how much a surface other than white counts beside it. 0 unless given: the white alone is matched, as
        `drive` does, and `errors` is what that costs. 1 is the mix for a whole chart, which four and more LEDs need
    Raises ValueError for another number of surfaces.
    """
    from scipy.optimize import nnls

    target = np.asarray(wanted, np.float64)
    if target.shape != patches.values.shape[1:]:
        raise ValueError(f"wanted is {target.shape}; expected {patches.values.shape[1:]}, a colour a surface")
    weights = np.full(len(target), others, np.float64)
    weights[patches.white] = 1
    seen = (patches.values * weights[:, None]).reshape(len(patches.names), -1).T
    intensities = nnls(seen, (target * weights[:, None]).ravel())[0]
    values = np.einsum("p,pkc->kc", intensities, patches.values)
    length = float(np.linalg.norm(target[patches.white]))
    return PatchMatch(intensities, values, np.linalg.norm(values - target, axis=1) / length)


def patches_from_spectra(
    spectra: Mapping[str, Spectrum],
    reflectances: Sequence[Spectrum],
    sensitivities: Sequence[Spectrum] | None = None,
    *,
    white: int = 0,
) -> PrimaryPatches:
    """Patches from the spectrum of each LED, of each surface and of each channel of the camera.

    spectra : power at intensity 1, by the LED's name
    reflectances : of the surfaces, 0 to 1; `white` is one of them
    sensitivities : of the camera's red, green and blue; the CIE 1931 observer in linear Rec. 709 unless given
    """
    light = np.array([spectrum.at(visible()) for spectrum in spectra.values()])
    share = np.array([surface.at(visible()) for surface in reflectances])
    values = np.einsum("pw,kw,wc->pkc", light, share, _matching(sensitivities))
    seen = light @ _matching(sensitivities).sum(axis=1)
    reflectance = float(np.clip((light * share[white]).sum() / light.sum(), 1e-6, 1)) if seen.any() else 1.0
    return PrimaryPatches(tuple(spectra), values, white, reflectance)


def patches_from_photographs(
    pictures: Mapping[str, str | os.PathLike[str]],
    rectangles: Sequence[tuple[int, int, int, int]],
    *,
    white: int = 0,
    reflectance: float = 0.9,
) -> PrimaryPatches:
    """Patches from a photograph, or radiance map, of one chart under each LED alone; the median of each patch.

    pictures : by the LED's name; of one camera, exposure and place
    rectangles : left, top, width and height of each surface, pixels, the same in all
    white, reflectance : which of them is white, and what it reflects; 0.9 as of a chart's white
    Raises ValueError for rectangles outside of a picture, UnreadableFile.
    """
    values = []
    for path in pictures.values():
        has_radiance = files.has_radiance(path)
        pixels = files.read_radiance(path).radiance if has_radiance else decoded(files.read_photograph(path))
        row = []
        for left, top, width, height in rectangles:
            if (
                min(left, top) < 0
                or min(width, height) < 1
                or top + height > len(pixels)
                or (left + width > pixels.shape[1])
            ):
                raise ValueError(
                    f"{path}: no patch at {left},{top},{width},{height} in {pixels.shape[1]}×{len(pixels)} pixels"
                )
            row.append(np.median(pixels[top : top + height, left : left + width], axis=(0, 1)))
        values.append(row)
    return PrimaryPatches(tuple(pictures), np.array(values, np.float64), white, reflectance)


def camera_to_rec709(
    sensitivities: Sequence[Spectrum], reflectances: Sequence[Spectrum], light: Spectrum | None = None
) -> np.ndarray:
    """The matrix (3, 3) from a camera's own colours to linear Rec. 709, by least squares over surfaces under a light.

    sensitivities : of the camera's red, green and blue
    reflectances : of the surfaces, three at least
    light : D65 unless given, under which Rec. 709's white is white
    No camera is a linear map of the eye's, so what remains is the camera's own metamerism. Raises ValueError for fewer
    than three surfaces.
    """
    if len(reflectances) < 3:
        raise ValueError(f"{len(reflectances)} surfaces; give three or more of different colours")
    power = (illuminant("D65") if light is None else light).at(visible())
    share = np.array([surface.at(visible()) for surface in reflectances])
    seen = (share * power) @ _matching(sensitivities)
    white = power @ rgb_matching()
    wanted = colour_of(share) if light is None else (share * power) @ rgb_matching() / white.max()
    return np.linalg.lstsq(seen, wanted, rcond=None)[0].T


def _matching(sensitivities: Sequence[Spectrum] | None) -> np.ndarray:
    """(401, 3) what each visible wavelength gives in the three channels."""
    if sensitivities is None:
        return rgb_matching()
    if len(sensitivities) != 3:
        raise ValueError(f"{len(sensitivities)} sensitivities; give those of red, green and blue")
    return np.stack([channel.at(visible()) for channel in sensitivities], axis=-1)
