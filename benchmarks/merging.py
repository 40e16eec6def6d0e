"""Merging 7 photographs of 12 megapixels: relume against OpenCV's MergeDebevec, both given the same response.

Each five times in a row in one run, medians; and by turns, when both pay for fresh memory. Errors are against the
radiance that was photographed, where two photographs or more are well exposed. Peak memory is that of a process of its
own which merges nine of 45 megapixels.
"""

from __future__ import annotations

import resource
import statistics
import subprocess
import sys
import time
from collections.abc import Callable
from typing import Any

import cv2
import numpy as np
from scipy.ndimage import zoom

from relume.capture.exposure.bracket import Bracket
from relume.capture.merging import merge
from relume.image.colour import encode_srgb
from relume.image.photograph import Exposure, Photograph
from relume.image.response import Response

ROUNDS = 5


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


def timed(work: Callable[[], Any]) -> tuple[Any, float]:
    """What the work gives, and its seconds of wall, median of ROUNDS."""
    work()
    seconds = []
    result = None
    for _ in range(ROUNDS):
        del result
        start = time.perf_counter()
        result = work()
        seconds.append(time.perf_counter() - start)
    return result, statistics.median(seconds)


def race() -> None:
    radiance = scene(4000, 3000)
    bracket, response = bracket_of(radiance, 7), srgb_response()
    images = [p.pixels for p in bracket.photographs]
    times = bracket.exposures.astype(np.float32)
    table = np.ascontiguousarray(np.exp(response.log_exposure.T).astype(np.float32).reshape(256, 1, 3))
    peer = cv2.createMergeDebevec()
    merge(bracket, response)
    merged, ours = timed(lambda: merge(bracket, response))
    other, theirs = timed(lambda: peer.process(images, times, table))
    _, again = timed(lambda: (merge(bracket, response), peer.process(images, times, table))[0])
    stack = np.stack(images)
    where = ((stack >= 20) & (stack <= 235)).sum(0) >= 2
    print("7 × 12 megapixels, median of", ROUNDS)
    print(f"  relume, with variance and clipped mask  {ours:.3f} s  ", end="")
    print(errors(merged.radiance, radiance, where))
    print(f"  OpenCV {cv2.__version__} MergeDebevec  {theirs:.3f} s  ", end="")
    print(errors(other, radiance, where))
    print(f"  ratio  {theirs / ours:.1f} (goal 10), by turns {theirs / max(again - theirs, 1e-3):.1f}")


def memory() -> None:
    generator = np.random.default_rng(7)
    base = generator.integers(0, 256, (5504, 8256, 3), dtype=np.uint8)
    frames = tuple(Photograph(base, f"{i}.jpg", Exposure(2.0**i)) for i in range(9))
    merge(Bracket(frames), srgb_response())
    print(f"{resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20:.2f}")


if __name__ == "__main__":
    if "--memory" in sys.argv:
        memory()
    else:
        race()
        held = subprocess.run([sys.executable, __file__, "--memory"], capture_output=True, text=True, check=True).stdout
        print(f"9 × 45 megapixels, one set of pixels: most memory held {held.strip()} GiB, photographs 0.13 GiB each")
