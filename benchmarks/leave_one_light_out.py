"""Leave one light out: each set relit for the direction of a light that is left out, against that light's photograph.

Error Σ|ours − photograph| / Σ photograph over the subject's pixels, no scale fitted, of what `relume stage relight`
does from the other lights (`relight` of a parallel light of irradiance 1, no mesh), beside four simpler ways:

- nearest: the photograph under the nearest of the other lights;
- triangles: the three lights around share the light, and beyond them the nearest has it (`Barycentric`);
- polynomial: a polynomial texture map of six terms (Malzbender et al. 2001), without steadying;
- Lambertian: max(b · l, 0) with b by least squares, channel by channel, as in photometric stereo, and the same with
  shadows and highlights left out (`lambertian_lobes`); the better of the two in each case.

A light is outside when no others stand around it; how far is its angle to the cone of the others. Sets, in
../shared: uw_psm (lights from its mirrored ball), gray_balls_psdata (the set's own lights, the mean of two balls), all
lights of each in turn, and the virtual head: of its 288 lights every twelfth is left out; and as a museum's dome, 61 of
its lights over the hemisphere before the camera. With --rows each light's own line is printed.
"""

from __future__ import annotations

import argparse
import warnings
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.optimize import nnls

from relume.image.files import read_layers, read_photograph
from relume.lightstage.acquire.ball_highlights import MirrorBall, outline_of_mask, read_ball
from relume.lightstage.acquire.light_files import read_directions
from relume.lightstage.acquire.read_stage import read_stage
from relume.lightstage.field.field import Pictures, whole
from relume.lightstage.field.lights import StageLights
from relume.lightstage.relighting.interpolation import Barycentric, NearestLight
from relume.lightstage.relighting.relight import relight
from relume.lightstage.relighting.stage_lighting import StageLighting
from relume.lightstage.rti.ptm import polynomial_terms
from relume.lightstage.surface.photometric_stereo import lambertian_lobes
from relume.scene.lights import DistantLight

SHARED = Path(__file__).resolve().parents[1] / "shared"
if not SHARED.exists():
    SHARED = Path(__file__).resolve().parents[2] / "shared"
OLAT = SHARED / "data" / "olat"
WAYS = ("nearest", "triangles", "polynomial", "Lambertian", "relume")
WORSE = 0.003
"""What is worse than another way by no more than this is called as good."""
LIT = 0.02
"""Of the brightest hundredth of a mean picture, above which a pixel of a set without a mask is the subject's."""


@dataclass(frozen=True, eq=False)
class Set:
    """Pictures (N, H, W, 3) linear under lights from directions (N, 3), the subject's pixels (H, W), and the lights
    (K,) that are left out in turn."""

    name: str
    pictures: np.ndarray
    directions: np.ndarray
    subject: np.ndarray
    left_out: np.ndarray


def uw_psm(name: str) -> Set:
    """A set of the University of Washington; its pictures are linear."""
    folder = OLAT / "uw_psm"
    chrome = [read_photograph(folder / "chrome" / f"chrome.{i}.png").pixels / 255 for i in range(12)]
    mask = read_photograph(folder / "chrome" / "chrome.mask.png").pixels
    directions = read_ball(chrome, MirrorBall(outline_of_mask(mask))).directions
    pictures = np.stack([read_photograph(folder / name / f"{name}.{i}.png").pixels for i in range(12)]) / 255
    subject = read_photograph(folder / name / f"{name}.mask.png").pixels[..., 0] > 127
    return cropped(f"uw_psm {name}", pictures, directions, subject, np.arange(12))


def psdata(name: str) -> Set:
    """A set of two balls; its pictures are linear, and every second pixel is taken."""
    folder = OLAT / "gray_balls_psdata" / name
    paths = [folder / "Objects" / f"Image_{i:02d}.png" for i in range(1, 21)]
    pictures = np.stack([read_photograph(path).pixels[::2, ::2] for path in paths]) / 255
    mean = pictures.mean(axis=(0, 3))
    subject = mean > LIT * np.quantile(mean, 0.99)
    return cropped(f"psdata {name}", pictures, read_directions(folder / "light_directions.txt"), subject, np.arange(20))


def head() -> tuple[Set, Set]:
    """All lights of the virtual head, and those of a dome before the camera."""
    stage = read_stage(SHARED / "stages" / "head")
    pictures, directions = whole(stage), stage.lights.directions
    (mask,) = read_layers(SHARED / "stages" / "head" / "truth" / "mask_head.exr").values()
    subject = mask.reshape(*stage.shape, -1)[..., 0] > 0.5  # head and matte ball; the mirrored ball is a mirror
    full = cropped("head, 288 lights around", pictures, directions, subject, np.arange(5, 288, 12))
    # Every second ring from 7.5° of inclination about +Z would need another grid: lights are thinned by their distance.
    order = np.argsort(-directions[:, 2], kind="stable")
    kept: list[int] = []
    for light in order[directions[order, 2] > 0.1]:
        if all(directions[light] @ directions[other] < np.cos(np.radians(17)) for other in kept):
            kept.append(int(light))
    dome = cropped(f"head, dome of {len(kept)}", pictures[kept], directions[kept], subject, np.arange(len(kept))[::2])
    return full, dome


def cropped(name: str, pictures: np.ndarray, directions: np.ndarray, subject: np.ndarray, left_out: np.ndarray) -> Set:
    rows, columns = np.flatnonzero(subject.any(axis=1)), np.flatnonzero(subject.any(axis=0))
    box = slice(rows[0], rows[-1] + 1), slice(columns[0], columns[-1] + 1)
    return Set(name, pictures[:, *box].astype(np.float32), directions, subject[box], left_out)


def linear_sets() -> list[Set]:
    return [*(uw_psm(name) for name in ("buddha", "cat", "gray")), *(psdata(name) for name in ("cat", "frog")), *head()]


def outside(directions: np.ndarray, towards: np.ndarray) -> float:
    """Degrees from a direction to the cone that these directions (N, 3) span; 0 within it."""
    return float(np.degrees(np.arcsin(np.clip(nnls(directions.T, towards)[1], 0, 1))))


def errors(given: Set, light: int) -> dict[str, float]:
    """The error of each way for one light that is left out."""
    others = np.delete(np.arange(len(given.directions)), light)
    lights, towards = StageLights.towards(given.directions[others]), given.directions[light]
    values = np.where(given.subject[..., None], given.pictures[others], np.float32(0))
    truth, shown = given.pictures[light][given.subject], values[:, given.subject]

    def error(picture: np.ndarray) -> float:
        return float(np.abs(picture - truth).sum(dtype=np.float64) / truth.sum(dtype=np.float64))

    def shared(by: NearestLight | Barycentric) -> float:
        return error(np.einsum("npc,n->pc", shown, by.weights(lights, towards[None])[0]))

    terms = polynomial_terms(lights.directions)
    polynomial = np.einsum("n,npc->pc", polynomial_terms(towards) @ np.linalg.pinv(terms), shown)
    plain = np.einsum("n,npc->pc", towards @ np.linalg.pinv(lights.directions), shown)
    even = StageLights(lights.directions, np.ones(len(others)), lights.names)
    robust = np.stack([lambertian_lobes(shown[..., c], even).vectors @ towards for c in range(3)], axis=-1)
    light_on = StageLighting(lamps=(DistantLight(tuple(towards), (1.0, 1.0, 1.0)),))
    relit = relight(Pictures(values, lights), light_on).radiance[given.subject]
    return {
        "nearest": shared(NearestLight()),
        "triangles": shared(Barycentric()),
        "polynomial": error(polynomial),
        "Lambertian": min(error(np.maximum(each, 0)) for each in (plain, robust)),
        "relume": error(relit),
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--rows", action="store_true", help="print each light's own line")
    parser.add_argument("--only", default="", help="sets whose names hold this word")
    asked = parser.parse_args()
    print(f"{'':26s}{'lights':>8s}  " + "".join(f"{way:>12s}" for way in WAYS))
    for given in linear_sets():
        if asked.only not in given.name:
            continue
        found = [errors(given, int(light)) for light in given.left_out]
        table = np.array([[each[way] for way in WAYS] for each in found])
        away = np.array([outside(np.delete(given.directions, k, 0), given.directions[k]) for k in given.left_out])
        within = away < 1e-4
        if asked.rows:
            for light, angle, line in zip(given.left_out, away, table, strict=True):
                print(f"  {light:4d} {angle:5.1f}° outside" + " " * 16 + "".join(f"{value:12.3f}" for value in line))
        lines = {"mean of all": (within | ~within, np.mean), "between the others, median": (within, np.median)}
        lines |= {"outside, median": (~within, np.median)}
        lines |= {"outside, worst": (~within, np.max), "worst of all": (within | ~within, np.max)}
        if not within.all():
            lines["outermost"] = (away == away.max(), np.max)
        print(given.name)
        for name, (chosen, of) in lines.items():
            if chosen.any():
                values = of(table[chosen], axis=0)
                print(f"  {name:26s}{int(chosen.sum()):6d}  " + "".join(f"{value:12.3f}" for value in values))
        over = table[:, WAYS.index("relume")] - table[:, [WAYS.index("nearest"), WAYS.index("Lambertian")]].min(axis=1)
        print(
            f"  worse than the better of nearest and Lambertian by more than {WORSE}: {(over > WORSE).sum()}, ", end=""
        )
        print(f"the worst of them by {over.max():.3f}")


if __name__ == "__main__":
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        main()
