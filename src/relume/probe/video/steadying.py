"""Maps steadied over time: noise and registration make no flicker, and what moves is not smeared."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from relume.image.colour import luminance
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
    its radiance (a bilateral filter over time): what moved by as much as a pixel is another light and is left out.
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

    def steadied(self, maps: Iterable[MomentMap]) -> Iterator[MomentMap]:
        """The maps one after another, each with its neighbours; at the film's ends there are fewer."""
        if not self.before and not self.after:
            yield from maps
            return
        held: list[MomentMap] = []
        at = 0  # of the next to be given, among those held
        for each in maps:
            held.append(each)
            while len(held) - 1 - at >= self.after:
                yield self._mean(held, at)
                at += 1
                if at > self.before:
                    held.pop(0)
                    at -= 1
        while at < len(held):
            yield self._mean(held, at)
            at += 1

    def _mean(self, held: list[MomentMap], at: int) -> MomentMap:
        here = held[at]
        first, last = max(at - self.before, 0), min(at + self.after, len(held) - 1)
        radiance, total = here.radiance.copy(), np.ones((*here.clipped.shape, 1), np.float32)
        spread = here.variance.copy()
        level = luminance(here.radiance)
        noise = luminance(np.where(np.isfinite(here.variance), here.variance, 0))
        scale = 1 / (NOISY**2 * 2 * noise + (NOISY * SHARE * level) ** 2 + 1e-20)
        for number in range(first, last + 1):
            if number == at:
                continue
            other = held[number]
            reach = self.before if number < at else self.after
            near = 1 - abs(number - at) / (reach + 1)
            change = luminance(other.radiance) - level
            weight = near / (1 + (change * change * scale) ** 2)
            # A lower bound says nothing beside a measurement, and another bound as little.
            weight *= other.clipped == here.clipped
            weight = weight.astype(np.float32)[..., None]
            radiance += weight * other.radiance
            spread += weight**2 * np.where(np.isfinite(other.variance), other.variance, 0)
            total += weight
        return replace(here, radiance=radiance / total, variance=spread / total**2)
