"""How long recovering a response takes; with `--accuracy SEED` also how near each method comes to true curves."""

from __future__ import annotations

import sys
import time
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "support"))

from measured import Rows, asked

from camera_curves import CurveCamera, camera_curves, exposure_error, mixed_scene
from relume.capture.exposure.bracket import Bracket
from relume.capture.response.calibration import ResponseMethod, recover_response
from relume.capture.response.debevec_malik import DebevecMalik
from relume.capture.response.other_methods import MitsunagaNayar, Robertson
from relume.image.photograph import Photograph
from synthetic import STOPS

CURVES = 201
METHODS: dict[str, ResponseMethod] = {
    "Debevec & Malik": DebevecMalik(),
    "Debevec & Malik, g''": DebevecMalik(difference=2),
    "as printed, λ = 100": DebevecMalik(100.0, power_law=False, difference=2, steepness=False),
    "Mitsunaga & Nayar": MitsunagaNayar(),
    "Robertson": Robertson(),
}


def accuracy(seed: int) -> None:
    """Root mean square error of normalised exposure, per cent, over all curves, for nine exposures a stop apart."""
    curves, scene = camera_curves(CURVES, seed), mixed_scene()
    for electrons in (20_000.0, None):
        errors: dict[str, list[float]] = {name: [] for name in METHODS}
        rising = dict.fromkeys(METHODS, True)
        for first in range(0, CURVES, 3):
            camera = CurveCamera(curves[first : first + 3], electrons)
            bracket, true = camera.bracket(scene, STOPS, seed=first), camera.true_exposure()
            for name, method in METHODS.items():
                found = recover_response(bracket, method=method).response.log_exposure
                rising[name] &= bool(np.all(np.diff(found, axis=1) > 0))
                errors[name] += [exposure_error(g, t) for g, t in zip(found, true, strict=True)]
        print(f"{CURVES} curves, seed {seed}, {'no noise' if electrons is None else f'{electrons:g} electrons'}")
        for name, each in errors.items():
            middle, high, most = 100 * np.percentile(each, [50, 95, 100])
            print(f"  {name:22} median {middle:.3f} %  P95 {high:.3f} %  most {most:.2f} %  rising {rising[name]}")


def speed(rows: Rows, rounds: int) -> None:
    """Seconds for seven photographs of 12 megapixels, the median of several."""
    small = CurveCamera(camera_curves(3)).bracket(mixed_scene(), STOPS[:7])
    frames = [np.tile(p.pixels, (15, 14, 1))[:3000, :4000] for p in small.photographs]
    bracket = Bracket(
        tuple(
            Photograph(np.ascontiguousarray(f), p.name, p.exposure)
            for f, p in zip(frames, small.photographs, strict=True)
        )
    )
    wall, cpu = [], []
    for _ in range(rounds + 1):
        start, worked = time.perf_counter(), time.process_time()
        recover_response(bracket)
        wall.append(time.perf_counter() - start)
        cpu.append(time.process_time() - worked)
    note = f"{np.median(cpu[1:]):.3f} s of processor time"
    rows.value("response, 7 × 12 megapixels", wall[1:], "s", limit="≤ 0.3", note=note)


if __name__ == "__main__":
    parser = asked(__doc__)
    parser.add_argument("--accuracy", type=int, metavar="SEED", help="also the methods' errors over all curves")
    options = parser.parse_args()
    speed(Rows(options.rows), 1 if options.quick else 5)
    if options.accuracy is not None:
        accuracy(options.accuracy)
