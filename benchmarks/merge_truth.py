"""What a merge makes of dark, middle and bright tones where the truth is known: merge_truth.py [SHOOTS [SETS …]]

Virtual cameras whose photographs go through JPEG, whose longest frame ends below white, whose blue hardly saturates or
whose sensor is noisy; the plate of the virtual shoot against its radiance, and its ball: the merged ball photographed
again through its own response and JPEG tables. SETS are folders of real brackets, whose marks and hues are compared
with their own photographs.

Dark is what the longest exposure shows below 40 of 255, bright what all but the shortest show white, by the truth and
not by the noisy values. A figure is the error of a channel's sum over such pixels, those marked as clipped left out,
in per cent; one factor for all channels is free, green's in the middle.
"""

from __future__ import annotations

import io
import sys
import warnings
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path

import numpy as np
from PIL import Image

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests" / "support"))

from camera_curves import mixed_scene
from moving_scenes import known_response
from relume.capture.brackets.merging import merge_brackets
from relume.capture.brackets.result import MergedBracket
from relume.capture.exposure.bracket import Bracket, read_bracket
from relume.capture.exposure.folder import pictures_in
from relume.image import files
from relume.image.colour import decode_srgb
from relume.image.photograph import Exposure, Photograph
from relume.image.radiance import SATURATED
from relume.image.response import Response
from synthetic import VirtualCamera

Tables = dict[int, list[int]]
ALIKE = {"toe": (0.003,) * 3, "power": (2.2,) * 3, "knee": (1.2,) * 3}
"""A camera with one curve for all channels, as most have."""


@dataclass(frozen=True, eq=False)
class Case:
    """A bracket, the radiance (H, W, 3) that it shows, and where (H, W) bool that is known; everywhere where None;
    `response` where the camera's own is given and not recovered."""

    name: str
    bracket: Bracket
    truth: np.ndarray
    known: np.ndarray | None = None
    response: Response | None = None


def through_jpeg(photograph: Photograph, quality: int | None = None, tables: Tables | None = None) -> Photograph:
    """What a JPEG with half the colour resolution leaves of a photograph."""
    if quality is None and tables is None:
        return photograph
    file = io.BytesIO()
    how = {"qtables": tables} if tables is not None else {"quality": quality}
    Image.fromarray(photograph.pixels).save(file, "JPEG", subsampling=2, **how)
    return replace(photograph, pixels=np.array(Image.open(file)))


def room(scale: float = 1.0, *, size: tuple[int, int] = (600, 400)) -> np.ndarray:
    """Coloured surfaces under their own lights, and six lamps."""
    return (mixed_scene(*size, stops=13.0, brightest=120.0) * scale).astype(np.float32)


def virtual(
    name: str,
    seconds: tuple[float, ...],
    *,
    camera: VirtualCamera | None = None,
    quality: int | None = None,
    plateau: int | None = None,
    scene: np.ndarray | None = None,
    given: bool = False,
) -> Case:
    """`plateau` : the greatest value of the longest frame, which noise and JPEG then spread."""
    camera = camera or VirtualCamera(electrons=20_000.0, read_noise=6.0)
    scene = room() if scene is None else scene
    frames = []
    for index, time in enumerate(sorted(seconds)):
        frame = camera.photograph(scene, Exposure(time), name=f"frame_{index}.jpg", seed=index)
        if plateau is not None and time == max(seconds):
            frame = replace(frame, pixels=np.minimum(frame.pixels, np.uint8(plateau)))
        frames.append(through_jpeg(frame, quality))
    return Case(name, Bracket(tuple(frames)), scene, response=known_response(camera) if given else None)


def cameras() -> list[Case]:
    """Every virtual camera."""
    four, phone = tuple(0.25 * 4.0**-k for k in range(4)), (1 / 5, 1 / 20, 1 / 80)
    found = [virtual(f"JPEG {q}, 4:2:0, four at two stops", four, quality=q) for q in (75, 85, 95)]
    found.append(virtual("JPEG 90, seven at one stop", tuple(0.25 * 2.0**-k for k in range(7)), quality=90))
    alike = VirtualCamera(**ALIKE, electrons=20_000.0, read_noise=6.0)
    found.append(virtual("longest frame ends at 237", phone, camera=alike, quality=92, plateau=237))
    tinted = (room(0.5) * np.array([1.0, 1.0, 0.05])).astype(np.float32)
    short = tuple(0.05 * 4.0**-k for k in range(4))
    found.append(virtual("blue never near white", short, camera=alike, quality=92, scene=tinted))
    tinted = (room(0.5) * np.array([1.0, 1.0, 0.15])).astype(np.float32)
    found.append(virtual("blue hardly white", short, camera=alike, quality=92, scene=tinted))
    for electrons in (60_000.0, 20_000.0, 5_000.0):
        sensor = VirtualCamera(electrons=electrons, read_noise=0.0005 * electrons)
        dim = room(0.1)
        found.append(virtual(f"{electrons:g} electrons, own response", four, camera=sensor, scene=dim, given=True))
    return found


def shoot(folder: Path) -> list[Case]:
    """The plate against its truth, and the ball photographed again."""
    plate = read_bracket(sorted((folder / "plate").glob("*.jpg")))
    cases = [Case("the room's plate", plate, files.read_radiance(folder / "truth" / "plate.exr").radiance)]
    paths = sorted((folder / "ball_0").glob("*.jpg"))
    ball = read_bracket(paths)
    merged = merge_brackets(ball)
    light, response = merged.picture.radiance, merged.response
    noise = np.random.default_rng(3)
    frames = []
    for photograph, factor in zip(ball.photographs, ball.exposures, strict=True):
        values = response.pixel_values(light * np.float32(factor))
        inner = np.clip(values.astype(int), 16, 239)
        deviation = np.stack([response.deviation[c, inner[..., c]] for c in range(3)], -1)
        # Rounding and JPEG come by themselves; half of what was measured is the sensor's.
        pixels = np.clip(np.rint(values + 0.5 * deviation * noise.standard_normal(values.shape)), 0, 255)
        tables: Tables = getattr(Image.open(photograph.name), "quantization")  # noqa: B009 as only JPEGs have it
        frames.append(through_jpeg(replace(photograph, pixels=pixels.astype(np.uint8)), tables=tables))
    known = merged.picture.clipped == 0
    return [*cases, Case("the room's ball, photographed again", Bracket(tuple(frames)), light, known)]


def level(truth: np.ndarray, values: np.ndarray, value: int, *, otherwise: float) -> float:
    """The truth at which a frame's values have the median `value`."""
    near = np.abs(values.astype(int) - value) <= 2
    return float(np.median(truth[near])) if near.sum() >= 20 else otherwise


def tones(case: Case) -> np.ndarray:
    """(H, W, 3) 0 dark, 1 middle, 2 bright."""
    frames = case.bracket.photographs
    found = np.ones(case.truth.shape, int)
    for c in range(3):
        truth = case.truth[..., c]
        found[..., c][truth < level(truth, frames[-1].pixels[..., c], 40, otherwise=0.0)] = 0
        found[..., c][truth > level(truth, frames[1].pixels[..., c], 245, otherwise=np.inf)] = 2
    return found


def errors(case: Case, merged: MergedBracket) -> str:
    """A line a channel: the error of dark, middle and bright sums, and of what is worst in the dark."""
    picture, tone = merged.picture, tones(case)
    found = picture.radiance.astype(np.float64)
    assert picture.variance is not None and picture.clipped is not None
    known = np.ones(case.truth.shape[:2], bool) if case.known is None else case.known
    measured = np.isfinite(picture.variance) & known[..., None]
    middle = measured[..., 1] & (tone[..., 1] == 1)
    found *= np.median(case.truth[..., 1][middle] / found[..., 1][middle])
    lines = []
    for c, name in enumerate(("red", "green", "blue")):
        words = []
        for each in range(3):
            at = measured[..., c] & (tone[..., c] == each)
            words.append("–" if at.sum() < 50 else f"{100 * (found[at, c].sum() / case.truth[at, c].sum() - 1):+.2f}")
        dark = np.sort(case.truth[..., c][(tone[..., c] == 0) & known])
        steps = np.quantile(dark, np.linspace(0, 1, 11)) if len(dark) > 1000 else ()
        ranges = [
            (found[at, c].mean() / case.truth[at, c].mean() - 1, at.sum() / all_of.sum())
            for low, high in pairwise(steps)
            if (all_of := (case.truth[..., c] >= low) & (case.truth[..., c] < high) & known).sum()
            and (at := all_of & measured[..., c]).sum() > 30
        ]
        worst, share = max(ranges, key=lambda each: abs(each[0]), default=(0.0, 1.0))
        bright = measured[..., c] & (tone[..., c] == 2)
        lost = float((found[bright, c] < 0.5 * case.truth[bright, c]).mean()) if bright.any() else 0.0
        lines.append(
            f"  {name:5} dark {words[0]:>6}  middle {words[1]:>6}  bright {words[2]:>6}   darkest tenths at worst "
            f"{100 * worst:+.1f} ({100 * share:.0f} % measured)   bright a stop too dark {100 * lost:.1f} %"
        )
    return "\n".join(lines)


def marks(merged: MergedBracket, bracket: Bracket) -> str:
    """How much is marked as saturated, and for how much of it some photograph is far from white in every channel."""
    frames = merged.aligned.bracket.photographs if merged.aligned else bracket.photographs
    picture = merged.picture
    assert picture.clipped is not None
    marked = picture.clipped == SATURATED
    if not marked.any():
        return "  nothing is marked as saturated"
    clear = [
        (p.pixels[marked].max(-1) < 225) & ~(np.False_ if p.outside is None else p.outside[marked]) for p in frames
    ]
    return f"  {100 * marked.mean():.2f} % marked as saturated, {100 * np.any(clear, 0).mean():.0f} % of it falsely"


def hues(merged: MergedBracket, bracket: Bracket) -> str:
    """Red and blue against green, merged, beyond what the photographs themselves show as sRGB; stops, medians."""
    frames = merged.aligned.bracket.photographs if merged.aligned else bracket.photographs
    light = merged.picture.radiance
    apart = []
    for frame in frames:
        values = frame.pixels[::4, ::4].reshape(-1, 3)
        seen = light[::4, ::4].reshape(-1, 3)
        well = (values.min(-1) > 30) & (values.max(-1) < 225) & (seen.min(-1) > 0)
        shown = np.log2(decode_srgb(values[well] / np.float32(255)))
        found = np.log2(seen[well])
        apart.append((found - found[:, 1:2]) - (shown - shown[:, 1:2]))
    red, _, blue = np.median(np.concatenate(apart), axis=0)
    return f"  hue against the photographs' own: red {red:+.2f}, blue {blue:+.2f} stops"


def main() -> None:
    shoots = Path(sys.argv[1]) if len(sys.argv) > 1 else None
    shoots = None if shoots == Path("-") else shoots
    cases = [] if len(sys.argv) > 2 else cameras() + (shoot(shoots / "room") if shoots is not None else [])
    for case in cases:
        result = merge_brackets(case.bracket, profile=case.response)
        print(case.name)
        print(errors(case, result.bracket))
        print(marks(result.bracket, case.bracket))
        print(hues(result.bracket, case.bracket), flush=True)
    for folder in map(Path, sys.argv[2:]):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            # One set holds its plate and crops too.
            paths = [path for path in pictures_in(folder) if path.name[:4] not in ("raw0", "rec1", "rec2", "rec3")]
            bracket = read_bracket(paths)
        result = merge_brackets(bracket)
        print(folder.name)
        print(marks(result.bracket, bracket))
        print(hues(result.bracket, bracket), flush=True)
        for line in (*result.warnings, *result.notes):
            print("   ", line)


if __name__ == "__main__":
    main()
