"""Radiance made into a good picture and the gains that undo it, with the losses measured.

The base is a picture as a photographer would print it: its mean at middle grey, highlights rolled off by Reinhard's
curve, colours kept. The gains are computed against the base as it comes out of its JPEG, so that what the JPEG loses
is made good; what is lost is what 8 bits of gain and the map's own JPEG cannot hold, and it is measured.
"""

from __future__ import annotations

import io
import itertools
import math
import os
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from PIL import Image, ImageCms

from relume._kernel import in_threads
from relume.image.colour import encode_srgb
from relume.image.files.encodings import GainMap
from relume.image.files.gain_map import applying as gain_map_applying
from relume.image.files.gain_map import hdrgm_xmp as gain_map_xmp
from relume.image.files.gain_map import layout as gain_map_layout
from relume.image.files.gain_map import metadata as gain_map_metadata
from relume.image.files.gain_map.applying import Pictures, luminance
from relume.image.files.gain_map.metadata import GainMapMetadata, Three, rounded
from relume.image.files.metadata import exif_attributes, icc_profile, xmp
from relume.image.files.photographs import jpeg_segments as jpeg
from relume.image.primaries import REC709
from relume.image.radiance import RadianceMap

_GREY = 0.18  # the share of light that a grey card reflects
_WHITE = 99.9  # % of pixels that the base shows darker than white: a lamp may burn out in print
_SAMPLES = 65536  # pixels by which offsets are chosen
_OFFSETS = tuple(2.0**-power for power in range(6, 21, 2))  # from that of Ultra HDR 1.1, 1/64, to its square and less
_GAMMAS = (1.0, 0.75, 0.5, 0.375, 0.25)  # fractions that both forms hold exactly
_LEAST = 1e-6  # stops
_GOOD = 0.05  # of luminance: what is aimed at, however much more is accepted
_BETTER = (98, 100)  # qualities of the gain map's JPEG that are tried where the picture's own loses too much
_MOST_PACKET = 60000  # bytes; the segment holds 65,533 with the directory
_HIGHEST = 63.0  # stops above the base's white: a gain of 64 is the most there is, and of 2¹²⁸ the squares are infinite
_LONGEST = 65500  # pixels a side that libjpeg writes
_ROWS = 64


@dataclass(frozen=True)
class Losses:
    """The error of luminance, as a share of it.

    half, most, worst : not exceeded in half of the pixels, in 99 of 100, in all that are not black
    whole : of all light together
    dark : luminance that a black pixel gets at most, in the picture's unit
    """

    half: float
    most: float
    worst: float
    whole: float
    dark: float

    @property
    def sentence(self) -> str:
        """For a warning."""
        black = f"; black becomes up to {self.dark:.2g}" if self.dark > 0 else ""
        return (
            f"a gain map keeps luminance to {_share(self.half)} in half of the pixels, {_share(self.most)} in 99 of "
            f"100, {_share(self.worst)} in all, and their sum to {_share(self.whole)}{black}"
        )


@dataclass(frozen=True)
class Encoded:
    """A file to be written.

    file : all its bytes
    losses : a sentence on what it loses
    attributes : the names of those that it keeps
    """

    file: bytes
    losses: str
    attributes: tuple[str, ...]


def encoded(path: str | os.PathLike[str], image: RadianceMap, encoding: GainMap) -> Encoded:
    """A gain-map JPEG of a radiance map.

    Raises ValueError for pixels that are negative or no numbers, and where more is lost than `encoding.tolerance`.
    """
    pixels = image.radiance
    _refuse_unusable(path, pixels)
    scale = _scale(pixels, encoding.exposure)
    if not 1 / gain_map_xmp.LARGEST_SCALE <= scale <= gain_map_xmp.LARGEST_SCALE:
        stops = math.log2(scale)
        raise ValueError(
            f"{path}: middle grey is {abs(stops):.0f} stops {'above' if stops > 0 else 'below'} this picture's mean, "
            "and a gain map holds 100; write .exr, or scale it first"
        )
    highest = math.log2(max(float(pixels.max()) * scale, 1.0))
    if highest > _HIGHEST:
        raise ValueError(
            f"{path}: the brightest pixel would be {highest:.0f} stops above the base's white, and a gain map holds "
            f"{_HIGHEST:.0f}; write .exr, or give a lower exposure"
        )
    with np.errstate(over="ignore"):
        base_jpeg = _jpeg(_base(pixels, scale), encoding.quality)
    made = _gain_map(path, pixels, scale, base_jpeg, encoding)
    if max(made.losses.most, made.losses.whole) > encoding.tolerance:
        raise ValueError(
            f"{path}: a gain map would be off by {_share(made.losses.most)} of the luminance in 1 of 100 pixels, and "
            f"by {_share(made.losses.whole)} in their sum, where {_share(encoding.tolerance)} is accepted: the picture "
            f"spans {_stops(pixels):.0f} stops; write .exr, or accept a larger tolerance"
        )
    kept = _fitting(image.attributes)
    told = {**kept, gain_map_xmp.SCALE: repr(scale), gain_map_xmp.UNIT: image.unit}
    return Encoded(_assembled(told, base_jpeg, made.jpeg, made.metadata), made.losses.sentence, tuple(kept))


def encoded_rendition(path: str | os.PathLike[str], bright: np.ndarray, base: np.ndarray, quality: int) -> Encoded:
    """A gain-map JPEG of two renditions of a picture, both made for displays: nothing of it is measured light.

    bright : (H, W, 3) float32, linear Rec. 709, 1 = the base's white, at least 0
    base : (H, W, 3) uint8 sRGB, what every program shows
    returns : losses are told where they are above 5 % of the luminance, in 1 pixel of 100 or in all light together
    Raises ValueError for pixels that are negative or no numbers, and for a size that no JPEG has.
    """
    _refuse_unusable(path, bright)
    base_jpeg = _jpeg(base, quality)
    made = _gain_map(path, bright, 1.0, base_jpeg, GainMap(quality))
    # Of what is for the eye, as much is expected to be lost as a JPEG loses.
    told = made.losses.sentence if max(made.losses.most, made.losses.whole) > _GOOD else ""
    return Encoded(_assembled({}, base_jpeg, made.jpeg, made.metadata), told, ())


@dataclass(frozen=True)
class _Made:
    """A gain map as it goes into the file, what its codes mean, and what it loses."""

    jpeg: bytes
    metadata: GainMapMetadata
    losses: Losses


def _gain_map(
    path: str | os.PathLike[str], pixels: np.ndarray, scale: float, base_jpeg: bytes, encoding: GainMap
) -> _Made:
    """The gains from the base as it comes out of its JPEG, in the least quality that loses little."""
    base = _decoded(base_jpeg)
    linear = icc_profile.srgb().curves[:, 0]
    metadata = _metadata(path, pixels, scale, base, linear)
    wanted = _codes(pixels, scale, base, linear, metadata)
    map_jpeg, losses = b"", Losses(math.inf, math.inf, math.inf, math.inf, math.inf)
    for quality in (encoding.quality, *(better for better in _BETTER if better > encoding.quality)):
        map_jpeg = _jpeg(wanted, quality)
        codes = _decoded(map_jpeg)
        given = Pictures(base, codes, icc_profile.srgb().curves, REC709, REC709, metadata)
        losses = _losses(given, pixels, scale)
        if max(losses.most, losses.whole) <= min(encoding.tolerance, _GOOD):
            break
    return _Made(map_jpeg, metadata, losses)


def _refuse_unusable(path: str | os.PathLike[str], pixels: np.ndarray) -> None:
    """ValueError for pixels that no gain map holds, counted, and for sides that no JPEG has."""
    height, width = pixels.shape[:2]
    if max(height, width) > _LONGEST or min(height, width) < 1:
        raise ValueError(f"{path}: the picture is {width} x {height}; a JPEG has 1 to {_LONGEST} a side: write .exr")

    def work(begin: int, end: int) -> list[int]:
        rows = pixels[begin:end]
        return [int(np.count_nonzero(marked.any(-1))) for marked in (rows < 0, np.isnan(rows), np.isinf(rows))]

    counts = np.sum(in_threads(work, height, chunk=_ROWS), axis=0)
    if counts.any():
        told = ", ".join(f"{count} {name}" for count, name in zip(counts, ("negative", "NaN", "infinite"), strict=True))
        raise ValueError(f"{path}: a gain map holds no such pixels: {told}; write .exr, or mend them first")


def _scale(pixels: np.ndarray, exposure: float | None) -> float:
    """What radiance is multiplied by: stops given, or the mean of the logarithms of luminance to middle grey."""
    if exposure is not None:
        return 2.0**exposure

    def work(begin: int, end: int) -> tuple[float, int]:
        seen = luminance(pixels[begin:end])
        seen = seen[seen > 0]
        return float(np.log2(seen, dtype=np.float64).sum()), seen.size

    total, count = np.sum(in_threads(work, len(pixels), chunk=_ROWS), axis=0)
    return float(_GREY / 2 ** (total / count)) if count else 1.0


def _base(pixels: np.ndarray, scale: float) -> np.ndarray:
    """(H, W, 3) uint8 sRGB, the picture that every program shows."""
    height, width = pixels.shape[:2]
    lights = np.empty((height, width), np.float32)

    def measure(begin: int, end: int) -> None:
        lights[begin:end] = luminance(pixels[begin:end]) * np.float32(scale)

    in_threads(measure, height, chunk=_ROWS)
    white = max(1.0, float(np.percentile(lights, _WHITE)))
    codes = np.empty((height, width, 3), np.uint8)

    def develop(begin: int, end: int) -> None:
        light = lights[begin:end, :, None]
        # Reinhard 2002, eq. 4: light of `white` becomes 1; with a white of 1 it is the identity.
        toned = np.minimum(light * (1 + light / np.float32(white**2)) / (1 + light), 1)
        rows = pixels[begin:end] * (np.float32(scale) * toned / np.maximum(light, np.float32(1e-30)))
        # A colour too bright for its primary is mixed with white of the same luminance until it fits.
        excess = np.maximum(rows.max(-1, keepdims=True) - toned, np.float32(1e-30))
        rows = toned + (rows - toned) * np.minimum((1 - toned) / excess, 1)
        codes[begin:end] = np.rint(255 * np.clip(encode_srgb(rows), 0, 1))

    in_threads(develop, height, chunk=_ROWS)
    return codes


def _metadata(
    path: str | os.PathLike[str], pixels: np.ndarray, scale: float, base: np.ndarray, linear: np.ndarray
) -> GainMapMetadata:
    """Gains from the least to the greatest of each channel, with the offset and the exponent that lose least.

    A large offset makes the gains of dark pixels even, and so their range small, but a step of gain then is a large
    part of what little light they have; a small one gives black a gain far below all others. An exponent below 1
    makes the steps of small gains fine and those of great ones coarse: right where a lamp stands alone far above all
    else. What costs least depends on the picture: the loss is foretold for a sample of its pixels.
    """
    step = max(1, math.isqrt(pixels.shape[0] * pixels.shape[1] // _SAMPLES))
    wanted, shown = pixels[::step, ::step] * np.float32(scale), linear[base[::step, ::step]]
    light = luminance(wanted).astype(float)  # the loss of light of 1e-40 is beyond float32
    seen = light > 0

    def foretold(choice: tuple[float, float]) -> float:
        offset, gamma = choice
        gains = np.log2((wanted[seen] + offset) / (shown[seen] + offset))
        low, high = gains.min(0), gains.max(0)
        steps = (high - low) / gamma * ((gains - low) / np.maximum(high - low, _LEAST)) ** (1 - gamma)
        return float(np.percentile(luminance((wanted[seen] + offset) * steps) / light[seen], 99))

    offset, gamma = min(itertools.product(_OFFSETS, _GAMMAS), key=foretold) if seen.any() else (_OFFSETS[0], 1.0)

    def work(begin: int, end: int) -> tuple[np.ndarray, np.ndarray]:
        gains = _gains(pixels[begin:end], scale, linear[base[begin:end]], offset)
        return gains.min((0, 1)), gains.max((0, 1))

    parts = in_threads(work, len(pixels), chunk=_ROWS)
    low, high = np.min([part[0] for part in parts], axis=0), np.max([part[1] for part in parts], axis=0)
    # Outwards to a fraction that both forms hold, so that no gain is beyond the codes.
    least, most = (
        _three(rounded(float(gain) - _LEAST) for gain in low),
        _three(rounded(float(gain) + _LEAST) for gain in high),
    )
    headroom = rounded(max(math.log2(max(float(pixels.max(initial=0)) * scale, 1.0)), 2**-10))
    offsets = (offset, offset, offset)
    try:
        return GainMapMetadata(least, most, (gamma, gamma, gamma), offsets, offsets, 0.0, headroom)
    except ValueError:
        raise ValueError(f"{path}: no gain map holds a range of {_stops(pixels):.0f} stops; write .exr") from None


def _gains(pixels: np.ndarray, scale: float, shown: np.ndarray, offset: float) -> np.ndarray:
    """Stops from the base as it is `shown` (linear) to the radiance, per channel."""
    return np.log2((pixels * np.float32(scale) + np.float32(offset)) / (shown + np.float32(offset)))


def _three(values: object) -> Three:
    red, green, blue = values  # pyright: ignore[reportGeneralTypeIssues]
    return red, green, blue


def _codes(
    pixels: np.ndarray, scale: float, base: np.ndarray, linear: np.ndarray, metadata: GainMapMetadata
) -> np.ndarray:
    """(H, W, 3) uint8 gain map."""
    low, high = np.array(metadata.low, np.float32), np.array(metadata.high, np.float32)
    codes = np.empty(pixels.shape, np.uint8)

    def work(begin: int, end: int) -> None:
        gains = _gains(pixels[begin:end], scale, linear[base[begin:end]], metadata.base_offset[0])
        codes[begin:end] = np.rint(255 * np.clip((gains - low) / (high - low), 0, 1) ** np.float32(metadata.gamma[0]))

    in_threads(work, len(pixels), chunk=_ROWS)
    return codes


def _jpeg(codes: np.ndarray, quality: int) -> bytes:
    file = io.BytesIO()
    Image.fromarray(codes).save(file, "JPEG", quality=quality, subsampling=0)
    return file.getvalue()


def _decoded(data: bytes) -> np.ndarray:
    """What a reader sees of a JPEG that was just made, and so is whole."""
    with Image.open(io.BytesIO(data)) as image:
        return np.asarray(image)


def _losses(given: Pictures, pixels: np.ndarray, scale: float) -> Losses:
    shares, whole, dark = gain_map_applying.losses(given, pixels, scale)
    half, most, worst = np.percentile(shares, (50, 99, 100)) if shares.size else (0.0, 0.0, 0.0)
    return Losses(float(half), float(most), float(worst), whole, dark)


def _share(value: float) -> str:
    """In per cent; as a factor where that would be a long number."""
    if value > 1e38:
        return "more than 1e38 times"
    return f"{value:.1%}" if value < 10 else f"{value:.2g} times"


def _stops(pixels: np.ndarray) -> float:
    """From the darkest light, but for one pixel of a hundred, to the brightest."""
    light = luminance(pixels)
    light = light[light > 0]
    return math.log2(light.max()) - math.log2(np.percentile(light, 1)) if light.size else 0.0


def _fitting(attributes: Mapping[str, str]) -> dict[str, str]:
    """As many attributes, the shortest first, as one segment holds beside the directory; none with a name of ours."""
    kept: dict[str, str] = {}
    free = [item for item in attributes.items() if item[0] not in (gain_map_xmp.SCALE, gain_map_xmp.UNIT)]
    for name, value in sorted(free, key=lambda item: len(item[0]) + len(item[1])):
        if len(xmp.packet({**kept, name: value})) > _MOST_PACKET:
            break
        kept[name] = value
    return kept


def _assembled(told: Mapping[str, str], base: bytes, gain_map: bytes, metadata: GainMapMetadata) -> bytes:
    """Both JPEGs with all that tells what they are, in the order of Ultra HDR 1.1, figure 1."""
    block = jpeg.segment(jpeg.APP2, jpeg.ISO_GAIN_MAP + gain_map_metadata.to_iso(metadata))
    parameters = gain_map_xmp.with_description(xmp.packet({}), gain_map_xmp.description(metadata))
    gain_map = jpeg.with_segments(gain_map, [jpeg.segment(jpeg.APP1, jpeg.XMP + parameters), block])
    packet = gain_map_xmp.with_description(xmp.packet(told), gain_map_xmp.directory(len(gain_map)))
    heads = [
        jpeg.segment(jpeg.APP1, jpeg.XMP + packet),
        jpeg.segment(jpeg.APP2, jpeg.ICC + b"\x01\x01" + _profile()),
        jpeg.segment(jpeg.APP2, jpeg.ISO_GAIN_MAP + gain_map_metadata.VERSION),
    ]
    if exif := exif_attributes.encoded(told):
        heads.insert(0, jpeg.segment(jpeg.APP1, exif))
    return gain_map_layout.assembled(base, gain_map, heads)


def _profile() -> bytes:
    """sRGB; the day it was made is left out, so that the same radiance makes the same file."""
    profile = ImageCms.ImageCmsProfile(ImageCms.createProfile("sRGB")).tobytes()
    return profile[:24] + bytes(12) + profile[36:]
