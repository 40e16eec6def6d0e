"""Clean straight edges of a picture and how blurred each of them is: the slanted edge of ISO 12233, found and fitted.

Where a straight edge crosses the pixel grid aslant, each pixel beside it samples the same profile at another distance;
together they give a profile finer than the pixels.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from relume.image.bands import in_bands

RADIUS = 5
"""Pixels from an edge to each side that are fitted: a profile of up to 1.5 pixels deviation reaches its plateaus there,
and textures and corners rarely are so near."""
CELL = 12
"""Side, in pixels, of the cells of which the strongest edge each is looked at."""
MOST = 300
"""Edges that are fitted, the strongest; more would not make the result surer."""
CONTRAST = 0.15
"""Least difference of the two plateaus over their sum: weaker edges are of texture, and noise widens them."""
MISFIT = 0.05
"""Greatest root mean square misfit, in edge heights, of an edge that is straight, alone and between even plateaus."""
UNSURE = 0.15
"""Greatest standard error of a deviation, in pixels, that is still of use."""
SLOPE, REACH = 1.0, 4
"""σ in pixels of the Gaussian whose slope is looked for, and how far SciPy lets it reach."""
PIXEL = 1 / 12
"""Variance of where light falls within one pixel, across an edge of any direction."""


@dataclass(frozen=True, eq=False)
class Edges:
    """Fitted edges, N of them.

    points : (N, 2) x and y in pixels from the corner
    spread : (N,) standard deviation in pixels of the point spread across the edge, the pixel's own width taken out
    error : (N,) standard error of what was fitted, the deviation of the profile with the pixel's width in it
    contrast : (N,) difference of the plateaus over their sum
    """

    points: np.ndarray
    spread: np.ndarray
    error: np.ndarray
    contrast: np.ndarray


def clean_edges(light: np.ndarray, scale: int = 1) -> Edges:
    """The clean edges of a scene-linear grey picture (H, W); none where there are none.

    light : radiance; NaN where nothing was measured. Encoded values would make one side of each edge look wider
    scale : of the pixels that are looked at, each the mean of scale² ones: 2 and 4 see edges of 2 to 6 pixels and
        hardly any noise. The results are in the picture's own pixels
    """
    height, width = (n // scale for n in light.shape)
    coarse = light
    if scale > 1:
        coarse = light[: height * scale, : width * scale].reshape(height, scale, width, scale).mean((1, 3))
    found = [fit for x, y in _candidates(coarse) if (fit := _fitted(coarse, x, y)) is not None]
    table = np.array(found, np.float64).reshape(-1, 5)
    spread = np.sqrt(np.maximum(table[:, 2] ** 2 - PIXEL, 0))
    return Edges((table[:, :2] + 0.5) * scale, scale * spread, scale * table[:, 3], table[:, 4])


def _candidates(light: np.ndarray) -> np.ndarray:
    """(N, 2) x, y of the strongest slope of each cell, the strongest first."""
    relative = _relative_slope(light)
    margin = RADIUS + 1
    inner = relative[margin:-margin, margin:-margin]
    height, width = (n // CELL * CELL for n in inner.shape)
    if not (height and width):
        return np.zeros((0, 2), int)
    cells = inner[:height, :width].reshape(height // CELL, CELL, width // CELL, CELL).swapaxes(1, 2)
    cells = cells.reshape(height // CELL, width // CELL, CELL * CELL)
    strength, place = cells.max(-1).ravel(), cells.argmax(-1).ravel()
    row, column = np.divmod(np.arange(strength.size), width // CELL)
    points = np.stack([column * CELL + place % CELL + margin, row * CELL + place // CELL + margin], axis=-1)
    # The slope of a step of that contrast, blurred by 1 pixel of the filter and 1.5 of its own.
    strong = strength > 0.5 * CONTRAST / np.sqrt(2 * np.pi * (1 + 1.5**2))
    order = np.argsort(-strength[strong])[:MOST]
    return points[strong][order]


def _relative_slope(light: np.ndarray) -> np.ndarray:
    """(H, W) the slope as a share of what lies about it; 0 near pixels of which nothing is known.

    Of a large plate's planes in double no more than two are made: filters of sums go on in place.
    """
    from scipy.ndimage import gaussian_gradient_magnitude, uniform_filter

    height, width = light.shape
    relative = np.empty(light.shape)

    def work(rows: slice) -> None:
        # With the rows that reach into the band; the picture's own border is the only one.
        larger = slice(max(rows.start - REACH, 0), rows.stop + REACH)
        filled = np.nan_to_num(light[larger], posinf=0.0, neginf=0.0)
        top = rows.start - larger.start
        relative[rows] = gaussian_gradient_magnitude(filled, SLOPE)[top : top + rows.stop - rows.start]

    in_bands(height, width, work)
    plane = np.nan_to_num(light, posinf=0.0, neginf=0.0)
    uniform_filter(plane, 2 * RADIUS + 1, output=plane)
    relative /= np.maximum(plane, 1e-30, out=plane)
    plane[...] = ~np.isfinite(light)
    uniform_filter(plane, 2 * RADIUS + 3, output=plane)
    relative[plane > 1e-9] = 0
    return relative


def _fitted(light: np.ndarray, x: int, y: int) -> tuple[float, float, float, float, float] | None:
    """x, y, deviation, its error and contrast of the edge at a pixel; None where it is not a clean one."""
    from scipy.optimize import least_squares
    from scipy.special import ndtr

    window = light[y - RADIUS : y + RADIUS + 1, x - RADIUS : x + RADIUS + 1].astype(np.float64)
    places = np.arange(-RADIUS, RADIUS + 1, dtype=np.float64)
    rows, columns = np.meshgrid(places, places, indexing="ij")
    disc = np.hypot(rows, columns) <= RADIUS + 0.5
    values, right, down = window[disc], columns[disc], rows[disc]
    gx, gy = np.gradient(window, axis=1)[disc], np.gradient(window, axis=0)[disc]
    # Both directions of the slope count alike: the structure tensor's main axis.
    angle = 0.5 * np.arctan2(2 * (gx * gy).sum(), (gx**2 - gy**2).sum())
    if np.cos(angle) * gx.sum() + np.sin(angle) * gy.sum() < 0:
        angle += np.pi
    across = right * np.cos(angle) + down * np.sin(angle)
    low, high = np.median(values[across < -RADIUS / 2]), np.median(values[across > RADIUS / 2])
    if not high - low > CONTRAST * (high + low) > 0:
        return None
    scaled = (values - low) / (high - low)

    def misfit(p: np.ndarray) -> np.ndarray:
        angle, place, deviation, bottom, top, bent = p
        along = right * -np.sin(angle) + down * np.cos(angle)
        distance = right * np.cos(angle) + down * np.sin(angle) - place - bent * along**2
        return bottom + (top - bottom) * ndtr(distance / np.maximum(deviation, 1e-3)) - scaled

    fit = least_squares(
        misfit, [angle, 0.0, 0.8, 0.0, 1.0, 0.0], x_scale=[0.05, 0.2, 0.2, 0.05, 0.05, 0.01], max_nfev=30
    )
    _, place, deviation, bottom, top, _ = fit.x
    rms = float(np.sqrt(np.mean(fit.fun**2)))
    if not (rms <= MISFIT and abs(place) <= RADIUS / 2 and 0.05 < deviation <= RADIUS / 3 and top - bottom > 0.5):
        return None
    try:
        covariance = np.linalg.inv(fit.jac.T @ fit.jac) * rms**2
    except np.linalg.LinAlgError:
        return None
    error = float(np.sqrt(max(covariance[2, 2], 0)))
    if not 0 < error <= UNSURE:
        return None
    return float(x), float(y), float(deviation), error, float((high - low) / (high + low))
