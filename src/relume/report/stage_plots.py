"""Pictures that show a light stage: where its lights are, what they give, how pixels answer to them."""

from __future__ import annotations

import io

import numpy as np

from relume.lightstage.field.field import ReflectanceField
from relume.lightstage.field.lights import StageLights
from relume.sphere.mappings.mapping import LatLong, pixel_directions


def lights_of_stage(lights: StageLights, levels: np.ndarray) -> bytes:
    """The lights on a lat-long map with the cells they speak for, as bytes of PNG.

    levels : (N,) mean of each light's picture, which colours its disc
    """
    from matplotlib.figure import Figure
    from scipy.spatial import KDTree

    rows = 180
    nearest = np.asarray(KDTree(lights.directions).query(pixel_directions(LatLong(), rows))[1])
    border = np.zeros(nearest.shape, bool)
    border[:, :-1] |= nearest[:, :-1] != nearest[:, 1:]
    border[:-1] |= nearest[:-1] != nearest[1:]
    points = LatLong().image_points(lights.directions)
    figure = Figure(figsize=(10.8, 5.6), dpi=100, layout="constrained")
    axes = figure.subplots()
    axes.imshow(np.where(border, 0.75, 1.0), cmap="gray", vmin=0, vmax=1, extent=(-180, 180, -90, 90), aspect="equal")
    dots = axes.scatter(
        360 * points[:, 0] - 180, 90 - 180 * points[:, 1], c=levels, s=36, cmap="viridis", edgecolors="black",
        linewidths=0.4, zorder=2,
    )  # fmt: skip
    axes.set(
        xlabel="degrees to the right of −Z", ylabel="degrees up", xticks=range(-180, 181, 45), yticks=range(-90, 91, 30)
    )
    figure.colorbar(dots, label="mean of the light's picture", shrink=0.85)
    stream = io.BytesIO()
    figure.savefig(stream, format="png", metadata={"Software": None})
    return stream.getvalue()


def levels_of(field: ReflectanceField) -> tuple[np.ndarray, np.ndarray]:
    """The mean (N,) of every light's picture, and the picture (H, W, 3) float32 under even light."""
    levels = np.zeros(len(field.lights))
    total = np.zeros((*field.shape, 3))
    for light, area in enumerate(field.lights.solid_angles):
        picture = field.block(slice(light, light + 1), slice(0, field.shape[0]))[0]
        # Without the lamps' own mirrored pictures, which say nothing of a light's strength.
        levels[light] = np.minimum(picture, np.quantile(picture, 0.995)).mean(dtype=np.float64)
        total += area * picture
    return levels, total.astype(np.float32)
