"""Merging 7 photographs of 12 megapixels: relume against OpenCV's MergeDebevec, both given the same response.

Each some times in a row in one run; and by turns, so that what one leaves in memory and caches is the other's. Errors
are against the radiance that was photographed, where two photographs or more are well exposed. Peak memory is that of a
process of its own which merges nine of 45 megapixels.
"""

from __future__ import annotations

import resource
import subprocess
import sys
from collections.abc import Callable
from typing import Any

import cv2
import numpy as np
from measured import Rows, asked
from rounds import turns
from scipy.ndimage import zoom

from relume.capture.exposure.bracket import Bracket
from relume.capture.merging import merge
from relume.image.colour import encode_srgb
from relume.image.photograph import Exposure, Photograph
from relume.image.response import Response

ROUNDS = 7


def scene(width: int, height: int) -> np.ndarray:
    """Ten stops of coloured detail at all scales, at most 60."""
    generator = np.random.default_rng(5)
    logarithm = np.zeros((height, width, 3), np.float32)
    for cells in (4, 16, 64, 256):
        coarse = generator.normal(size=(cells * 3 // 4 + 1, cells + 1, 3))
        factor = (height / coarse.shape[0], width / coarse.shape[1], 1)
        logarithm += zoom(coarse, factor, order=1)[:height, :width].astype(np.float32) * cells**-0.5  # pyright: ignore[reportAttributeAccessIssue]
    logarithm -= logarithm.min()
    return np.exp(logarithm * (10 * np.log(2) / logarithm.max())).astype(np.float32) * (60 / 1024)


def bracket_of(radiance: np.ndarray, count: int) -> Bracket:
    """Photographs one stop apart through the sRGB curve, with photon noise as of 20,000 electrons at white."""
    generator = np.random.default_rng(6)
    frames = []
    for index in range(count):
        exposed = radiance * np.float32(2.0 ** -(index + 1))
        exposed += generator.standard_normal(exposed.shape, np.float32) * np.sqrt(exposed / 20_000)
        pixels = np.rint(255 * encode_srgb(np.clip(exposed, 0, 1))).astype(np.uint8)
        frames.append(Photograph(pixels, f"{index}.jpg", Exposure(2.0 ** -(index + 1))))
    return Bracket(tuple(frames))


def srgb_response() -> Response:
    """The true curve; value 0 stands for half of value 1."""
    values = np.arange(256) / 255
    linear = np.where(values <= 0.04045, values / 12.92, ((values + 0.055) / 1.055) ** 2.4)
    linear[0] = linear[1] / 2
    return Response(np.tile(np.log(linear), (3, 1)), np.full(3, 1.0))


def errors(found: np.ndarray, radiance: np.ndarray, where: np.ndarray) -> str:
    difference = np.log(found[where] / radiance[where])
    median = np.median(difference)  # one scale is free: OpenCV's is another
    spread = np.abs(difference - median)
    return f"median |error| {100 * np.median(spread):.3f} %, 99th percentile {100 * np.percentile(spread, 99):.2f} %"


def race(rows: Rows, width: int, rounds: int) -> None:
    radiance = scene(width, width * 3 // 4)
    bracket, response = bracket_of(radiance, 7), srgb_response()
    images = [p.pixels for p in bracket.photographs]
    times = bracket.exposures.astype(np.float32)
    table = np.ascontiguousarray(np.exp(response.log_exposure.T).astype(np.float32).reshape(256, 1, 3))
    peer = cv2.createMergeDebevec()
    works: dict[str, Callable[[], Any]] = {
        "ours": lambda: merge(bracket, response),
        "theirs": lambda: peer.process(images, times, table),
    }
    what, name = f"merge of 7 × {radiance.size / 3e6:.0f} megapixels", f"OpenCV {cv2.__version__} MergeDebevec"
    alone = {each: turns({each: work}, rounds)[each] for each, work in works.items()}
    rows.ratio(f"{what}, each in a row", alone["ours"], name, alone["theirs"], limit="≥ 10")
    alternating = turns(works, rounds)
    rows.ratio(f"{what}, by turns", alternating["ours"], name, alternating["theirs"], goal="merge")
    stack = np.stack(images)
    where = ((stack >= 20) & (stack <= 235)).sum(0) >= 2
    print("ours  ", errors(merge(bracket, response).radiance, radiance, where))
    print("OpenCV", errors(peer.process(images, times, table), radiance, where))


def memory() -> None:
    generator = np.random.default_rng(7)
    base = generator.integers(0, 256, (5504, 8256, 3), dtype=np.uint8)
    frames = tuple(Photograph(base, f"{i}.jpg", Exposure(2.0**i)) for i in range(9))
    merge(Bracket(frames), srgb_response())
    print(f"{resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20:.2f}")


if __name__ == "__main__":
    parser = asked(__doc__)
    parser.add_argument("--memory", action="store_true", help="only print what a merge of nine large ones holds, GiB")
    options = parser.parse_args()
    if options.memory:
        memory()
    else:
        table = Rows(options.rows)
        race(table, 1200 if options.quick else 4000, 2 if options.quick else ROUNDS)
        if not options.quick:
            words = [sys.executable, __file__, "--memory"]
            held = subprocess.run(words, capture_output=True, text=True, check=True).stdout
            note = "one set of pixels; photographs have 0.13 GiB each"
            table.value("memory of merging 9 × 45 megapixels", float(held), "GiB", limit="≤ 3", note=note)
