"""A world with much to recognise, and photographs of it in all directions: for the tests of panoramas."""

from __future__ import annotations

import numpy as np
from scipy.spatial import KDTree

from relume.capture.lens.vignetting import Vignetting
from relume.image.radiance import RadianceMap
from relume.probe.panorama.views import PanoramaView, orientation
from relume.sphere.directions import normalised
from relume.sphere.environment_map import EnvironmentMap
from relume.sphere.mappings.mapping import LatLong, pixel_points


def patchwork(rows: int = 384, patches: int = 3000, seed: int = 0) -> EnvironmentMap:
    """Patches of all brightnesses from a fifth to five times the mean, and three lamps a hundred times as bright."""
    generator = np.random.default_rng(seed)
    directions = LatLong().directions(pixel_points(LatLong(), rows))
    nearest = KDTree(normalised(generator.normal(size=(patches, 3)))).query(directions)[1]
    colours = np.exp(generator.normal(size=(patches, 1)) * 0.6 + generator.normal(size=(patches, 3)) * 0.15)
    colours[:3] = 100 * np.array([1.0, 0.9, 0.7])
    return EnvironmentMap(colours[nearest].astype(np.float32))


def photograph(
    light: EnvironmentMap,
    rotation: np.ndarray,
    *,
    focal_length: float = 160.0,
    size: tuple[int, int] = (320, 256),
    gain: float = 1.0,
    vignetting: tuple[float, ...] = (),
    distortion: float = 0.0,
    noise: float = 0.0,
    white: float | None = None,
    cells: int = 1,
    seed: int = 0,
) -> RadianceMap:
    """What a camera at the light's centre sees, cells² look-ups a pixel; values above `white` are clipped, marked."""
    width, height = size
    blank = RadianceMap(np.ones((height, width, 3), np.float32))
    view = PanoramaView(blank, focal_length, rotation, distortion=distortion)
    x, y = (np.arange(cells * width) + 0.5) / cells, (np.arange(cells * height) + 0.5) / cells
    rays = view.rays(np.stack(np.broadcast_arrays(x[None, :], y[:, None]), axis=-1)) @ rotation.T
    radiance = light.lookup(rays).reshape(height, cells, width, cells, 3).mean((1, 3))
    radiance = radiance * gain * Vignetting(vignetting).falloff(size)[..., None]
    radiance *= 1 + noise * np.random.default_rng(seed).normal(size=radiance.shape)
    clipped = None
    if white is not None:
        clipped = (radiance.max(-1) >= white).astype(np.uint8)
        radiance = np.minimum(radiance, white)
    return RadianceMap(np.maximum(radiance, 0).astype(np.float32), None, clipped)


def all_round(jitter: float = 4.0, seed: int = 0) -> list[np.ndarray]:
    """Rotations of 15 views that see all of the sphere at 90° across: rings, up and down, turned by a loose hand."""
    angles = [(72 * i, 0, 0) for i in range(5)] + [(90 * i + 20, 55 * s, 0) for s in (1, -1) for i in range(4)]
    angles += [(0, 88, 0), (30, -88, 0)]
    loose = np.random.default_rng(seed).normal(size=(len(angles), 3)) * jitter
    loose[0, 0] = 0
    return [orientation(*np.radians(np.add(angle, more))) for angle, more in zip(angles, loose, strict=True)]
