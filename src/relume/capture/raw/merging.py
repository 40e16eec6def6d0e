"""Merging camera raws: every photosite by itself, before any colour is made of it.

A sensor's values are linear in the light and their noise is known, so the merge is the mean of value / exposure with
weights of one over the variance; for photon noise alone that is the sum of the values over the sum of the exposures.
Nothing that a weight or a verdict depends on may depend on the photosite's own noise, or the mean would be drawn to one
side. So weights come from the eight nearest photosites of its colour, and near saturation so does the verdict whether
it is saturated, from theirs in the same frame and in the next shorter one. (Detail sharper than that, five deviations
above their mean just below saturation, is judged by its own value; that frame's share of it then comes out up to 0.8 of
a deviation too dark.)
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path

import numpy as np

from relume.capture.exposure.bracket import require_facts_of_all
from relume.capture.merging import refuse_unlit
from relume.capture.raw.sensor import Sensor, SensorNoise, fitted_noise, noise_between, noise_within
from relume.errors import NotABracket, warn
from relume.image import files
from relume.image.photograph import Exposure, RawPhotograph
from relume.image.radiance import SATURATED, RadianceMap

_SAMPLES = 2**18
"""Photosites of each frame that the survey keeps."""
_DOUBTFUL_STOPS = 0.2
"""Nominal shutter speeds are up to 0.1 of a stop from the true ones (1/30 s is 1/32 s)."""
_MARKED_STOPS = 0.06
"""Standard deviation of the ratio of two marked speeds about that of the true ones, where pixels show nothing of it."""

RawSource = str | os.PathLike[str] | RawPhotograph


@dataclass(frozen=True, eq=False)
class RawCalibration:
    """What a bracket of raws shows of its exposures and of its sensor, frame by frame in the order they were given.

    names : of the files
    exposures : as their EXIF has them or the caller gives them
    factors : (P,) float64, light per unit of radiance that is merged with: `Exposure.factor`, its ratios refined from
        the pixels where that was asked for, its geometric mean kept
    noise : of the sensor
    saturation : the signal, as a share of white above black, at which photosites are seen to be saturated
    errors : (P,) standard error of ln `factors` about their mean: by the photons they were refined from, ratios of
        neighbours taken as independent, and by the rounding of marked speeds where no pixels showed them; 0 if not
        refined
    sensor : what holds for other photographs of the camera too, the levels being those of the first of these
    """

    names: tuple[str, ...]
    exposures: tuple[Exposure, ...]
    factors: np.ndarray
    noise: SensorNoise
    saturation: float
    errors: np.ndarray
    sensor: Sensor

    def corrections(self) -> dict[str, tuple[float, float]]:
        """By how many stops each exposure was corrected, and the standard error, by its name; none that stands."""
        stated = np.array([exposure.factor for exposure in self.exposures])
        stops, errors = np.log2(self.factors / stated), self.errors / np.log(2)
        return {
            name: (float(stop), float(error))
            for name, stop, error in zip(self.names, stops, errors, strict=True)
            if abs(stop) > 1e-9
        }


def opened(photographs: Sequence[RawSource], order: Sequence[int] | None = None) -> Iterator[RawPhotograph]:
    """The raws one at a time, each read when it is its turn, in the order given or in that of the indices `order`."""
    for index in range(len(photographs)) if order is None else order:
        source = photographs[index]
        yield source if isinstance(source, RawPhotograph) else files.read_raw(Path(source))


def merge_raw(
    photographs: Sequence[RawSource],
    *,
    times: Sequence[float] | None = None,
    calibration: RawCalibration | None = None,
    balance: Sequence[float] | np.ndarray | None = None,
) -> RadianceMap:
    """Merge camera raws of one scene from one place into relative radiance; 1 saturates green at 1 s, f/1, ISO 100.

    photographs : raw files, opened one at a time, or raws already read; their order does not matter
    times : exposure time of each in seconds, in place of the whole EXIF exposure
    calibration : what `calibrate_raw` found of the same photographs, where it has been asked before
    balance : multipliers of red, green and blue; the camera's for daylight unless given, so that every bracket of a
        camera is on one scale and lamplight keeps its colour. A raw that is read holds the camera's own
        choice as `as_shot`

    Values below black stay negative, and so may the darkest radiance. The variance holds through interpolation and
    colour matrix. Where a nearest sample of a pixel is saturated in all photographs its variance is infinite and its
    radiance, in camera colours, a lower bound. Raises UnreadableFile, NotABracket.
    Raises ValueError for a calibration of other photographs, or multipliers that are not above 0.
    """
    # Numba is imported only where a kernel is used.
    from relume.capture.raw.demosaic import developed_mosaic
    from relume.capture.raw.kernel import Frame, accumulate, concluded

    if balance is not None and (np.shape(balance) != (3,) or not np.all(np.asarray(balance) > 0)):
        raise ValueError(f"balance is {balance}; expected three positive multipliers, of red, green and blue")
    known = calibration or calibrate_raw(photographs, times=times)
    if len(known.factors) != len(photographs):
        raise ValueError(f"the calibration is of {len(known.factors)} photographs; {len(photographs)} were given")
    order = np.argsort(known.factors, kind="stable").tolist()
    first, shorter, sums = None, None, np.empty(0)
    for index, raw in zip(order, opened(photographs, order), strict=True):
        if first is None:
            # Only its colours and its corner are needed later: its mosaic goes.
            first = replace(raw, mosaic=raw.mosaic[:6, :6].copy())
            sums = np.zeros((4, *raw.mosaic.shape), np.float32)
        noise = known.noise.at(known.exposures[index].iso)
        factor, scatter = float(known.factors[index]), (noise.shot, noise.read)
        frame = Frame(raw.mosaic, raw.black, raw.white, factor, scatter, known.saturation)
        del raw
        accumulate(sums, frame, shorter)
        shorter = frame
    del shorter, frame
    assert first is not None
    mosaic, variance, clipped = concluded(sums, first.black)
    _require_light(known, mosaic, variance, clipped)
    del sums
    multipliers = first.daylight if balance is None else np.asarray(balance, np.float64)
    return RadianceMap(*developed_mosaic(mosaic, variance, clipped, first.pattern, multipliers, first.matrix))


def calibrate_raw(
    photographs: Sequence[RawSource],
    *,
    times: Sequence[float] | None = None,
    sensor: Sensor | None = None,
    refine_exposures: bool = True,
) -> RawCalibration:
    """Exposures, noise and saturation of a bracket of raws, from a sample of rows of each.

    photographs : raw files, opened one at a time, or raws already read
    times : exposure time of each in seconds, in place of the whole EXIF exposure
    sensor : what was measured of it before. Its noise is used as it is, at the photographs' sensitivity, else it is
        measured from how they differ; its saturation, at its own sensitivity, unless they show a lower one
    refine_exposures : take the ratios of exposures from the pixels, which know them better than nominal times do

    Warns where exposures differ otherwise than they claim, where the sensor saturates below its white, where noise
    cannot be measured, and where the levels in the files are not those of `sensor`. Raises UnreadableFile, NotABracket.
    """
    if not photographs:
        raise NotABracket("no raw photographs were given; name at least one file")
    if times is not None and len(times) != len(photographs):
        raise NotABracket(f"{len(times)} times were given for {len(photographs)} photographs; give one a photograph")
    # What each file says, and a sample of its rows.
    facts: list[RawPhotograph] = []
    samples, sensitivities = [], []
    for position, raw in enumerate(opened(photographs)):
        given = raw if times is None else replace(raw, exposure=Exposure(float(times[position])))
        facts.append(_fitting(given, facts[0] if facts else None))
        samples.append(_sample(raw))
        # Times that are given replace the whole exposure, but the noise stays that of the gain.
        sensitivities.append((raw.exposure.iso if raw.exposure else None) or 100.0)
        del raw, given
    # Exposures: as the files say, then as the pixels do.
    require_facts_of_all(facts)
    exposures = tuple(raw.exposure for raw in facts if raw.exposure is not None)
    nominal = np.array([exposure.factor for exposure in exposures])
    order = np.argsort(nominal, kind="stable")
    names = tuple(raw.name for raw in facts)
    factors, errors = nominal, np.zeros(len(nominal))
    if refine_exposures:
        factors, errors = _refined(names, nominal, samples, order)
    # Saturation and noise: as measured before, or from these photographs.
    first, iso = facts[0], max(sorted(set(sensitivities)), key=sensitivities.count)
    known = None if sensor is None else sensor.noise
    full = sensor.saturation if sensor and known and set(sensitivities) == {known.iso} else 1.0
    saturation = _saturation(names, factors, samples, order, full)
    if known is not None:
        noise = known.at(iso)
    else:
        alike = [index for index in order.tolist() if sensitivities[index] == iso]
        noise = _noise([(samples[index], float(factors[index])) for index in alike], iso, saturation)
    # The sensor so found, against the one that was given.
    a, b, c, d = (float(level) for level in first.black.ravel())
    found = Sensor((a, b, c, d), float(first.white), saturation, noise)
    if sensor is not None and sensor.differs(found):
        warn(
            f"{names[0]}: its black is {_words(found.black)} and its white {found.white:g}, those of the profile "
            f"{_words(sensor.black)} and {sensor.white:g}; scale and noise may be wrong, so measure them anew"
        )
    if noise is None:
        warn(f"{names[0]}: its noise cannot be measured; taken as one electron a value")
        noise = SensorNoise(1 / (first.white - first.black.mean()), 0.0, iso)
    return RawCalibration(names, exposures, factors, noise, saturation, errors, found)


def _words(levels: Sequence[float]) -> str:
    """One number where all are alike."""
    return ", ".join(f"{level:g}" for level in (levels[:1] if len(set(levels)) == 1 else levels))


def _fitting(raw: RawPhotograph, first: RawPhotograph | None) -> RawPhotograph:
    """The facts of a photograph, without its pixels but for a corner; refuses one that does not go with the first."""
    facts = replace(raw, mosaic=np.broadcast_to(raw.mosaic[0, 0], raw.mosaic.shape))
    if raw.exposure is None:
        raise NotABracket(f"{raw.name}: no exposure time in its EXIF; give one per photograph with --times")
    if first is None:
        return facts
    for what, mine, other in (
        ("camera", raw.camera, first.camera),
        ("size", f"{raw.size[0]}×{raw.size[1]}", f"{first.size[0]}×{first.size[1]}"),
        ("filter pattern", raw.pattern.tolist(), first.pattern.tolist()),
    ):
        if mine != other:
            raise NotABracket(f"{raw.name}: its {what} is {mine}, that of {first.name} {other}; merge them apart")
    return facts


def _sample(raw: RawPhotograph) -> np.ndarray:
    """(R, W) float32 signals of pairs of rows spread over the picture."""
    height, width = raw.mosaic.shape
    pairs = int(np.clip(_SAMPLES // (2 * width), 1, height // 2))
    starts = 2 * np.linspace(0, height // 2 - 1, pairs).round().astype(int)
    rows = np.unique((starts[:, None] + [0, 1]).ravel())
    level = raw.black[rows % 2][:, np.arange(width) % 2]
    return ((raw.mosaic[rows] - level) / (raw.white - level)).astype(np.float32)


def _refined(
    names: Sequence[str], nominal: np.ndarray, samples: Sequence[np.ndarray], order: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """The factors with ratios between neighbouring exposures as the pixels have them, where enough of them show it.

    The second is the standard error of each logarithm.
    """
    logarithm, square = np.log(nominal), np.zeros(len(nominal))
    for position, (short, long) in enumerate(pairwise(order.tolist()), 1):
        found, stated = _ratio(samples[short].ravel(), samples[long].ravel()), nominal[long] / nominal[short]
        ratio, error = found or (stated, _MARKED_STOPS * np.log(2))
        if abs(np.log2(ratio / stated)) > _DOUBTFUL_STOPS:
            warn(
                f"{names[long]}: it got {ratio:.3g} times the light of {names[short]}, not {stated:.3g} times as its "
                "exposure says; merged as the pixels have it"
            )
        # All longer exposures move with this one.
        later = order[position:]
        logarithm[later] += np.log(ratio / stated)
        # About the mean, which is kept, the earlier exposures move against the later ones.
        moved = np.isin(np.arange(len(nominal)), later) - len(later) / len(nominal)
        square += (moved * error) ** 2
    return np.exp(logarithm - logarithm.mean() + np.log(nominal).mean()), np.sqrt(square)


def _ratio(first: np.ndarray, second: np.ndarray) -> tuple[float, float] | None:
    """How many times the light of `first` `second` got, and the standard error of its logarithm.

    None where fewer than 1000 photosites can be used.

    The ratio of sums over photosites chosen by the sum of both: how the photons of a sum were shared out between two
    exposures does not depend on it, so the choice favours neither.
    """
    total = first + second
    used = (total > 0.02) & (total < 0.8)
    ratio, error = 1.0, 0.0
    for _ in range(4):
        if used.sum() < 1000 or first[used].sum(dtype=np.float64) <= 0:
            return None
        ratio = float(second[used].sum(dtype=np.float64) / first[used].sum(dtype=np.float64))
        difference = second - ratio * first
        error = float(np.linalg.norm(difference[used]) / second[used].sum(dtype=np.float64))
        # What moved between the two says nothing of the exposures.
        misfit = difference / np.sqrt(np.maximum(total, 0.02))
        limit = 5 * 1.4826 * np.median(np.abs(misfit[used])) + 1e-6
        used = (total > 0.02) & (total < 0.8) & (np.abs(misfit) < limit)
    return ratio, error


def _saturation(
    names: Sequence[str], factors: np.ndarray, samples: Sequence[np.ndarray], order: np.ndarray, known: float
) -> float:
    """The signal that photosites show which, by a shorter exposure, must be saturated; `known` where none is lower."""
    seen = known
    for short, long in pairwise(order.tolist()):
        expected = samples[short] * (factors[long] / factors[short])
        values = samples[long][(expected > 1.25) & (samples[short] < 0.8)]
        if len(values) < 100:
            continue
        level = float(np.median(values))
        level -= 4 * 1.4826 * float(np.median(np.abs(values - level)))
        # Much lower ones are not saturated: something moved.
        if 0.5 < level < seen:
            seen = level
            if level < 0.97 * known:
                warn(f"{names[long]}: saturated at {level:.0%} of the white its file states; taken as saturated there")
    return seen


def _noise(frames: Sequence[tuple[np.ndarray, float]], iso: float, saturation: float) -> SensorNoise | None:
    """From pairs of neighbouring exposures (samples, factor) of one sensitivity; from single frames without a pair."""
    rows = [
        noise_between(first.ravel(), second.ravel(), longer / shorter, saturation)
        for (first, shorter), (second, longer) in pairwise(frames)
    ]
    found = fitted_noise(np.concatenate(rows), iso) if rows else None
    return found or fitted_noise(np.concatenate([noise_within(sample) for sample, _ in frames]), iso)


def _require_light(known: RawCalibration, mosaic: np.ndarray, variance: np.ndarray, clipped: np.ndarray) -> None:
    """Refuse a bracket in which less than one photosite in a thousand is measured and lit."""
    some = (slice(None, None, 7), slice(None, None, 5))
    lit = (clipped[some] == 0) & (mosaic[some] > 3 * np.sqrt(variance[some]))
    if lit.mean() >= 1e-3:
        return
    name = known.names[0] if len(known.names) == 1 else f"{known.names[0]} … {known.names[-1]}"
    refuse_unlit(name, bool((clipped[some] == SATURATED).mean() > 0.5))
