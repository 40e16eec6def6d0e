"""Photons on their way: scattered, reflected, refracted and absorbed by chance, and kept wherever they land.

Each carries power, which stays about the same: where a surface keeps half of the light, half of the photons end there
(Russian roulette; Jensen 2001, §5.2), and only their colour changes.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from relume.renderers.photon_map.stage import EVEN, NOTHING, Met, Stage
from relume.renderers.raytrace.lamps import Sent
from relume.sphere.sampling import by_cosine, shuffled, turned_evenly


class Photons(NamedTuple):
    """N photons where they landed.

    position : (N, 3) metres, world
    direction : (N, 3) unit, the way that they came
    power : (N, 3) in the light's unit times m²·sr; in a fog, of what is scattered on
    normal : (N, 3) of the surface on the side where they landed; 0 in a fog
    direct : (N,) bool, whether they came from the lamp without meeting anything
    """

    position: np.ndarray
    direction: np.ndarray
    power: np.ndarray
    normal: np.ndarray
    direct: np.ndarray

    def only(self, which: np.ndarray) -> Photons:
        """Those of a mask (N,)."""
        return Photons(*(part[which] for part in self))


@dataclass(frozen=True, eq=False)
class Flight:
    """Where photons went.

    surface, fog : landed on surfaces that scatter evenly, and in what fills space
    sent, absorbed, escaped, cut : power (3,) that was sent, absorbed on the way, left the scene, and was still on its
        way after the last bounce that is followed; what chance ends and keeps going is even only on average
    """

    surface: Photons
    fog: Photons
    sent: np.ndarray
    absorbed: np.ndarray
    escaped: np.ndarray
    cut: np.ndarray


def followed(stage: Stage, sent: Sent, random: np.random.Generator, depth: int, caustics: bool = False) -> Flight:
    """Photons followed until they end.

    depth : bounces at most
    caustics : keep only those that mirrors or glass sent to their first even surface, and end them there
    """
    origins, directions, power = sent
    direct = np.ones(len(power), bool)
    surface, fog = [_none()], [_none()]
    absorbed, escaped = np.zeros(3), np.zeros(3)
    for _ in range(depth):
        if not len(power):
            break
        # What is met first, and whether the fog or the inside of glass gets the photon before.
        met = stage.meet(origins, directions)
        clear = stage.clearness(met)
        absorbed += (power * (1 - clear)).sum(0)
        power = power * clear
        way, stopped, share = encounter(stage, origins, directions, met, random)
        if stage.medium is not None:
            lost = stopped[:, None] * power * np.subtract(stage.medium.extinction, stage.medium.scattering)
            absorbed += (lost * share / np.maximum(stage.medium.scattering, 1e-300)).sum(0)
        power = power * share
        gone, landed = ~stopped & (met.kind == NOTHING), ~stopped & (met.kind == EVEN)
        escaped += power[gone].sum(0)
        here = np.where(stopped[:, None], origins + np.where(stopped, way, 0.0)[:, None] * directions, met.point)
        at = Photons(here, directions, power, np.where(stopped[:, None], 0.0, met.true_normal), direct)
        fog.append(at.only(stopped))
        surface.append(at.only(landed & ~direct if caustics else landed))
        # Where each goes from here, and with what power.
        ways, glanced, _ = stage.glanced(directions, met, random)
        ways = np.where(landed[:, None], by_cosine(shuffled(random, len(power), 2), met.normal), ways)
        if stage.medium is not None:
            cosine = stage.medium.scattered_cosine(random.random(len(power)))
            ways = np.where(
                stopped[:, None], turned_evenly(shuffled(random, len(power), 1)[:, 0], directions, cosine), ways
            )
        share = np.where(landed[:, None], met.colour, np.where(stopped[:, None], 1.0, glanced))
        absorbed += (power * (1 - share))[~gone].sum(0)
        brightest = np.maximum(power.max(1), 1e-300)
        after = power * share
        chance = np.minimum(after.max(1) / brightest, 1)
        goes_on = ~gone & (random.random(len(power)) < chance) & ~(caustics & (landed | stopped))
        origins, directions = here[goes_on], ways[goes_on]
        power = after[goes_on] / chance[goes_on][:, None]
        direct = np.zeros(len(power), bool)
    kept, hanging = (Photons(*map(np.concatenate, zip(*parts, strict=True))) for parts in (surface, fog))
    return Flight(kept, hanging, sent.power.sum(0), absorbed, escaped, power.sum(0))


def encounter(
    stage: Stage, origins: np.ndarray, directions: np.ndarray, met: Met, random: np.random.Generator
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """How far (N,) rays go before the fog scatters them, whether it does, and what of their light is left (N, 3)."""
    if stage.medium is None:
        return met.distance, np.zeros(len(origins), bool), np.ones((len(origins), 3))
    extinction = np.asarray(stage.medium.extinction)
    begin, length = stage.hazy(origins, directions, met.distance, met.within)
    # Each channel's free paths in turn; the density of them all divides.
    way = random.exponential(size=len(origins)) / np.maximum(extinction[random.integers(0, 3, len(origins))], 1e-300)
    stopped = way < length
    left = stage.left(np.minimum(way, length))
    density = np.where(stopped[:, None], extinction * left, left).mean(1, keepdims=True)
    share = np.where(stopped[:, None], left * stage.medium.scattering, left) / np.maximum(density, 1e-300)
    return begin + way, stopped, share


def _none() -> Photons:
    empty = np.zeros((0, 3))
    return Photons(empty, empty, empty, empty, np.zeros(0, bool))
