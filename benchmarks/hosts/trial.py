"""One trial for every host: a labelled probe to be found the right way round, and lights whose irradiance is known.

The host scripts beside this one write these files, let the host's own interpreter or program render them and compare.
Each wants the host in an environment of its own and says in one line what to install where it is missing.
"""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np

from relume.image import files
from relume.light.constellations.constellation import Constellation
from relume.light.constellations.placement import PlacedLights
from relume.sphere.directions import normalised
from relume.sphere.environment_files import as_radiance_map
from relume.sphere.environment_map import EnvironmentMap
from relume.sphere.mappings.mapping import LatLong, pixel_directions
from relume.sphere.mappings.orientation import ORIENTATIONS, orient_for
from relume.sphere.mappings.orientation_chart import LABELS, orientation_chart

NORMALS = np.array([label.towards for label in LABELS.values()])
"""The six axes, as surfaces' normals."""
LIGHTS = Constellation(
    normalised([[1.0, 2.0, 0.5], [-2.0, 1.0, -1.0], [0.3, -1.0, 2.0], [0.0, 0.0, -1.0]]),
    np.array([[3.0, 2.5, 1.0], [0.2, 0.5, 2.0], [0.5, 0.4, 0.3], [0.0, 0.7, 0.1]]),
)
POINTS = PlacedLights(
    np.array([[2.0, 1.5, -2.5], [-1.0, -2.0, 1.5]]),
    np.array([[20.0, 12.0, 5.0], [2.0, 6.0, 9.0]]),
    np.array([0.0, 0.1]),
)
"""A point and a sphere, to be seen from the origin."""


def background(size: int = 64) -> EnvironmentMap:
    """A smooth map, of another gradient in each channel."""
    directions = pixel_directions(LatLong(), size)
    slopes = np.array([[0.8, 0.3, 0.1], [-0.2, 0.7, 0.4], [0.1, -0.5, -0.7]])
    return EnvironmentMap((0.5 * (1.05 + directions @ slopes.T)).astype(np.float32))


def expected_irradiance() -> np.ndarray:
    """Of LIGHTS, POINTS and the background together on the six normals at the origin, (6, 3)."""
    placed = POINTS.seen_from((0, 0, 0))
    return LIGHTS.irradiance_on(NORMALS) + placed.irradiance_on(NORMALS) + background().irradiance(NORMALS)


def write_oriented_probe(host: str, path: Path, size: int = 256) -> None:
    """The labelled probe as the host reads it."""
    files.write(path, as_radiance_map(orient_for(orientation_chart(size), ORIENTATIONS[host])))


def report_axes(host: str, seen: np.ndarray, tolerance: float = 0.02) -> bool:
    """Print the colours (6, 3) seen along +X, −X, +Y, −Y, +Z, −Z; whether they are the labels' own."""
    right = True
    for (name, label), found in zip(LABELS.items(), seen, strict=True):
        met = min(LABELS, key=lambda other: float(np.abs(np.subtract(LABELS[other].colour, found)).max()))
        fits = bool(np.abs(np.subtract(label.colour, found)).max() < tolerance)
        right &= fits
        print(f"{host}: along {name} it shows {met}, {np.round(found, 3)}{'' if fits else '   WRONG'}")
    return right


def report_irradiance(host: str, found: np.ndarray, tolerance: float) -> bool:
    """Print irradiances (6, 3) beside ours; whether the worst differs by less than `tolerance` of the largest."""
    wanted = expected_irradiance()
    for name, ours, theirs in zip(LABELS, wanted, found, strict=True):
        print(f"{host}: on {name} ours {np.round(ours, 4)}, there {np.round(theirs, 4)}")
    worst = float((np.abs(found - wanted) / wanted).max())
    print(f"{host}: irradiance differs by {worst:.2%} at most; {tolerance:.1%} is allowed")
    return worst <= tolerance


def run_inside(python: str, script: Path, *arguments: str, needs: str, package: str = "") -> None:
    """Run a script with the host's interpreter; ends the program with one line where the host is missing."""
    try:
        subprocess.run([python, "-c", f"import {needs}"], check=True, capture_output=True)
    except (OSError, subprocess.CalledProcessError):
        sys.exit(f"{python} has no {needs}; make an environment with `pip install {package or needs}`, name its python")
    done = subprocess.run([python, str(script), *arguments], capture_output=True, text=True)
    if done.returncode:
        sys.exit(done.stdout + done.stderr)


def finish(*right: bool) -> None:
    """End the program: 0 where everything was right."""
    print("right" if all(right) else "WRONG")
    sys.exit(0 if all(right) else 1)
