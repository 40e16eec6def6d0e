"""What another frame shows is moved to where the light has gone in between."""

import numpy as np

from probe_films import filmed, place_light
from relume.probe.video.light_tables import LightTables
from relume.probe.video.lookup import FrameLookup
from relume.probe.video.merging import Collected, Take
from relume.probe.video.motion import brought, flow_between
from relume.sphere.mappings.mapping import LatLong, pixel_directions

TABLES = LightTables.of(None)
WINDOW = (((0.5, 0.5, 0.6), 40.0, (0.4, 0.5, 0.6)), ((-0.8, -0.1, 0.6), 12.0, (0.5, 0.3, 0.2)))


def collected(degrees: float, gain: float) -> Collected:
    sums = Collected.nothing(64)
    exposure = place_light(degrees, WINDOW)(pixel_directions(LatLong(), 64)) * gain
    Take(0, 0, FrameLookup(64), np.full(3, gain)).collect(filmed(exposure), TABLES, sums)
    return sums


def test_light_is_brought_to_where_it_is_now():
    here, other, still = collected(0.0, 1.0), collected(8.4, 0.25), collected(0.0, 0.25)
    least = (np.full(3, 0.25), np.full(3, 1.0))
    flow = flow_between(other, here, TABLES, least)
    assert flow is not None
    # 8.4° are three pixels of 2.8°.
    bright = still.light[..., 1] > np.quantile(still.light[..., 1], 0.95)
    assert abs(abs(np.median(flow[..., 0][bright])) - 3) < 0.3
    assert abs(np.median(flow[..., 1][bright])) < 0.3

    def off(moved: Collected) -> float:
        found = moved.light[bright] / np.maximum(moved.exposure[bright], 1e-6)
        true = still.light[bright] / still.exposure[bright]
        return float(np.median(np.abs(found / true - 1)))

    assert off(brought(other, here, TABLES, least, flow)) < 0.05 < off(other)
