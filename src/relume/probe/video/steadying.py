"""Maps steadied over time: noise and registration make no flicker, and what moves is not smeared."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace

import cv2
import numpy as np

from relume.image.colour import luminance
from relume.probe.video.light_tables import LightTables
from relume.probe.video.merging import MomentMap

NOISY = 3.0
"""Standard deviations by which a pixel may change from frame to frame and still be the same light."""
SHARE = 0.01
"""Share of its radiance that a pixel is off by beside its noise: compression and the looking up between pixels."""


@dataclass(frozen=True)
class Steadying:
    """A mean over neighbouring frames that leaves out what has changed.

    before, after : frames that count beside each, the farther the less. After it none count in a live picture: the
        filter's latency is `after` frames. One each unless given, which halves noise and waits for one frame
    A pixel of a neighbour counts by 1/(1 + d⁴), d its difference in units of three deviations of its noise and 1 % of
    its radiance (a bilateral filter over time). What moved by as much as a pixel is another light and is left out.
    """

    before: int = 1
    after: int = 1

    def __post_init__(self) -> None:
        if not (0 <= self.before <= 30 and 0 <= self.after <= 30):
            raise ValueError(f"{self.before} frames before and {self.after} after; expected 0 to 30 each")

    @property
    def latency(self) -> int:
        """Frames by which a map comes later than its frame."""
        return self.after

    def steadied(self, maps: Iterable[MomentMap], tables: LightTables) -> Iterator[Callable[[], MomentMap]]:
        """What makes each map with its neighbours, one after another; at the film's ends there are fewer.

        maps : of the film, frame by frame
        tables : that turn pixel values to light
        """
        held: list[MomentMap] = []
        at = 0  # of the next to be given, among those held
        for each in maps:
            held.append(each)
            while len(held) - 1 - at >= self.after:
                yield self._later(held, at, tables)
                at += 1
                if at > self.before:
                    held.pop(0)
                    at -= 1
        while at < len(held):
            yield self._later(held, at, tables)
            at += 1

    def _later(self, held: list[MomentMap], at: int, tables: LightTables) -> Callable[[], MomentMap]:
        first = max(at - self.before, 0)
        part = held[first : at + self.after + 1]
        return lambda: self._mean(part, at - first, tables)

    def _mean(self, part: list[MomentMap], at: int, tables: LightTables) -> MomentMap:
        """The mean of a few maps about the one at `at`."""
        here = part[at]
        if len(part) == 1:
            return here
        level, exposure = luminance(here.radiance), here.exposure[..., 1]
        total = np.ones_like(level)
        radiance = here.radiance.copy()
        noise = np.interp(np.minimum(level * exposure, 1), tables.exposure[:, 1], tables.variance[:, 1])
        # Where nothing is measured the exposure is 0, and the neighbours say nothing.
        scale = 1 / (NOISY**2 * 2 * noise.astype(np.float32) + (NOISY * SHARE * level * exposure) ** 2 + 1e-12)
        for number, other in enumerate(part):
            if number == at:
                continue
            near = 1 - abs(number - at) / ((self.before if number < at else self.after) + 1)
            change = (luminance(other.radiance) - level) * exposure
            weight = near / (1 + (change * change * scale) ** 2)
            weight *= other.clipped == here.clipped
            weight = weight.astype(np.float32)
            cv2.accumulateProduct(other.radiance, cv2.merge([weight] * 3), radiance)
            total += weight
        return replace(here, radiance=cv2.divide(radiance, cv2.merge([total] * 3)))
