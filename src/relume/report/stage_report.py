"""The report of a light stage: its lights, its reflectance functions, and an interactive relighting viewer."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from relume.errors import warn
from relume.image import files
from relume.lightstage.field.field import Pictures, ReflectanceField
from relume.lightstage.field.lights import StageLights
from relume.lightstage.relighting.low_rank import compress_low_rank
from relume.lightstage.relighting.mosaic import mosaic, mosaic_size
from relume.report import plots
from relume.report.page import figure, heading, note, page, paragraph, side_by_side, table, triple
from relume.report.relighting_viewer import interactive_basis, turning_part
from relume.sphere.environment_map import EnvironmentMap
from relume.sphere.mappings.mapping import LatLong, pixel_directions

RANK = 24
"""Pictures of the page: with 24 its size is some megabytes, and its error is written."""
WIDE = 480
"""Pixels of the page's subject, along its longer side, at most."""
LONELY = np.radians(80)
"""Beyond this, no light is near, however few they are: four that stand evenly leave nothing further than 71°."""
MEMORY = 256 << 20
"""Bytes for the pictures that the page's basis is found from: a stage of many lights gets fewer pixels."""
ODD = 4.0
"""Times brighter than the pictures of all the lights about it but one, or darker: such a picture is warned of."""


def write_stage_report(
    field: ReflectanceField, path: Path, lights: Mapping[str, EnvironmentMap] | None = None, title: str = "light stage"
) -> None:
    """Write one page: doubts, lights, the subject under even light, a mosaic of reflectance functions, a map to turn.

    lights : maps to turn, by name; even light from everywhere and from one side unless there are any
    Warns of the doubts too. Raises OutputNotWritten.
    """
    levels, even = levels_of(field)
    doubts = doubts_of(field, levels)
    for line in doubts:
        warn(line)
    functions = mosaic(field, *mosaic_size(field.shape))
    side = square_side(field)
    small = reduced(field, side)
    # In bands, for some copies of each are made.
    basis = compress_low_rank(small, rank=min(RANK, len(field.lights)), memory=MEMORY // 8)
    size_note = f"Each of its pixels is the mean of {side}×{side} of the stage's."
    if side == 1:
        size_note = f"It is shown in all of its {field.shape[1]}×{field.shape[0]} pixels."
    shown = dict(lights or {}) or {"from the upper left": _window()}
    parts = [
        *(note(line) for line in doubts),
        table(_facts(field)),
        heading("Turn the light"),
        paragraph(
            "Drag the subject or the map: the light turns about the vertical, and tips. What is shown is the sum of "
            f"{len(basis.basis)} pictures; it differs from that of all {len(field.lights)} by "
            f"{basis.error.random:.1%} under light from everywhere; mirrored lamps are left out. {size_note}"
        ),
        turning_part(interactive_basis(basis), shown),
        heading("Lights"),
        side_by_side(
            [
                figure(lights_of_stage(field.lights, levels), "Where the lights stand, as a light map shows them."),
                figure(plots.exposed(even, _white(even)), "Under even light from everywhere."),
            ]
        ),
        heading("Reflectance functions"),
        figure(
            plots.exposed(functions.radiance, _white(functions.radiance)),
            "How pixels answer to light from everywhere, each a small map of directions: in its middle the light comes "
            "from the camera, to its right from the camera's right, above from above (Debevec et al. 2000, Fig. 3).",
        ),
    ]
    files.write_text(path, page(title, parts))


def lights_of_stage(lights: StageLights, levels: np.ndarray) -> bytes:
    """The lights on a lat-long map with the cells they speak for, as bytes of PNG.

    levels : (N,) mean of each light's picture, which colours its disc
    """
    from matplotlib.figure import Figure
    from scipy.spatial import KDTree

    rows = 180
    nearest = np.asarray(KDTree(lights.directions).query(pixel_directions(LatLong(), rows))[1])
    points = LatLong().image_points(lights.directions)
    figure = Figure(figsize=(10.8, 5.6), dpi=100, layout="constrained")
    axes = figure.subplots()
    cells = np.where(plots.borders(nearest), 0.75, 1.0)
    axes.imshow(cells, cmap="gray", vmin=0, vmax=1, extent=(-180, 180, -90, 90), aspect="equal")
    dots = axes.scatter(
        360 * points[:, 0] - 180, 90 - 180 * points[:, 1], c=levels, s=36, cmap="viridis", edgecolors="black",
        linewidths=0.4, zorder=2,
    )  # fmt: skip
    axes.set(
        xlabel="degrees to the right of −Z", ylabel="degrees up", xticks=range(-180, 181, 45), yticks=range(-90, 91, 30)
    )
    figure.colorbar(dots, label="mean of the light's picture", shrink=0.85)
    return plots.encoded_figure(figure)


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


def doubts_of(field: ReflectanceField, levels: np.ndarray) -> tuple[str, ...]:
    """Lights whose pictures are dark or out of line with their neighbours', and parts of the sphere without lights."""
    from scipy.spatial import KDTree

    lines = []
    count = len(levels)
    near = KDTree(field.lights.directions).query(field.lights.directions, k=min(7, count))[1].reshape(count, -1)[:, 1:]
    if count > 6:
        # Behind the subject levels fall as fast from light to light: a good one still lies between its neighbours, or
        # these give next to nothing themselves.
        around = np.sort(levels[near], axis=1)
        telling = around[:, 1] * ODD > np.median(levels)
        odd = (levels > ODD * around[:, -2]) | (telling & (levels * ODD < around[:, 1]))
    else:
        odd = np.zeros(count, bool)
    if odd.any():
        names = ", ".join(field.lights.names[i] for i in np.flatnonzero(odd)[:4])
        which = "1 picture is" if odd.sum() == 1 else f"{odd.sum()} pictures are"
        lines.append(f"{which} {ODD:g} times brighter or darker than those of nearly all lights around: {names}")
    if gap := _gap_note(field.lights):
        lines.append(gap)
    return tuple(lines)


def _gap_note(lights: StageLights) -> str:
    """The part of the sphere that is far from every light; nothing where there is none."""
    from scipy.spatial import KDTree

    towards, areas = pixel_directions(LatLong(), 60), LatLong().solid_angles(60)
    chord, nearest = (np.asarray(found) for found in KDTree(lights.directions).query(towards))
    angle = 2 * np.arcsin(np.clip(chord / 2, 0, 1))
    # Twice the breadth of a mean cell: of even lights, and of grids by inclination and azimuth, all is nearer.
    far = min(2 * np.sqrt(4 * np.pi / len(lights)), LONELY)
    worst = np.unravel_index(int(np.argmax(angle)), angle.shape)
    if len(lights) < 4 or angle[worst] <= far:
        return ""
    return (
        f"lights do not stand all around: {areas[angle > far].sum() / (4 * np.pi):.0%} of the sphere is further than "
        f"{np.degrees(far):.0f}° from any; towards {triple(np.round(towards[worst], 2) + 0.0)} the nearest is "
        f"{lights.names[nearest[worst]]}, {np.degrees(angle[worst]):.0f}° away"
    )


def square_side(field: ReflectanceField) -> int:
    """Pixels along the smallest squares whose averages are few enough for a page: `WIDE` and `MEMORY`."""
    (height, width), side = field.shape, -(-max(field.shape) // WIDE)
    while side < max(height, width) and len(field.lights) * -(-height // side) * -(-width // side) * 3 * 4 > MEMORY:
        side += 1
    return side


def reduced(field: ReflectanceField, side: int) -> Pictures:
    """The field averaged in squares of so many pixels, cut off at the right and lower rim; read picture by picture."""
    rows, columns = (-(-length // side) for length in field.shape)
    values = np.empty((len(field.lights), rows, columns, 3), np.float32)
    for light in range(len(field.lights)):
        values[light] = plots.block_means(field.block(slice(light, light + 1), slice(0, field.shape[0]))[0], side)
    return Pictures(values, field.lights)


def _facts(field: ReflectanceField) -> Sequence[tuple[str, str]]:
    lights, camera = field.lights, field.camera
    areas = lights.solid_angles
    facts = [("lights", str(len(lights))), ("pictures", f"{field.shape[1]}×{field.shape[0]}")]
    facts.append(("cells", f"{areas.min():.3g} to {areas.max():.3g} sr, together 4π"))
    if lights.grid:
        facts.append(("grid", f"{lights.grid[0]} inclinations × {lights.grid[1]} azimuths"))
    if camera is not None:
        facts.append(("camera", "at " + ", ".join(f"{v:.3g}" for v in camera.position) + " m"))
    if field.noise is not None:
        facts.append(("noise", f"variance {field.noise.constant:.3g} + {field.noise.slope:.3g} × value"))
    return facts


def _white(radiance: np.ndarray) -> float:
    lit = radiance[radiance > 0]
    return float(np.percentile(lit, 99)) if len(lit) else 1.0


def _window() -> EnvironmentMap:
    """A soft light from the upper left and a little from everywhere, where no map is given."""
    towards = np.array([-0.6, 0.5, 0.62])
    lobe = np.maximum(pixel_directions(LatLong(), 32) @ (towards / np.linalg.norm(towards)), 0) ** 20
    return EnvironmentMap((0.1 + 4 * lobe[..., None] * [1.0, 0.9, 0.75]).astype(np.float32))
