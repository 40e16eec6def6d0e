"""The ray tree of a pixel, drawn as the paper draws it (Whitted 1980): the rays in the scene, and the tree."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from relume.image.files.atomic import replacing
from relume.project.scene_file.metering import metered_scene
from relume.project.scene_file.scene_file import SceneFile
from relume.project.scene_file.settings import RenderSettings, renderer_name, whitted_of
from relume.renderers.whitted.kernel_data import EYE, REFLECTED, REFRACTED, SHADOW
from relume.renderers.whitted.ray_tree import NAMES, Breakdown, RayTree, breakdown, ray_tree
from relume.report.plots import encoded_figure
from relume.scene.scene import Scene
from relume.scene.shapes.shapes import Patches, Plane, Shape, Sphere
from relume.virtual_camera.developing import develop
from relume.virtual_camera.film.film import Film

COLOURS = {EYE: "#222222", REFLECTED: "#2c5fb3", REFRACTED: "#27803f", SHADOW: "#c98a00"}
LABELS = {EYE: "from the eye", REFLECTED: "S, reflected", REFRACTED: "T, refracted", SHADOW: "L, towards a light"}
MOST = 32
"""Nodes that are drawn; the weakest are left out."""
WIDE = 8
"""Leaves of a tree that is drawn beside the scene, at most."""
POINTS = 4000
"""Of a mesh's outline."""


@dataclass(frozen=True, eq=False)
class DrawnTree:
    """A pixel's ray tree, and where the time of the whole picture goes (Whitted 1980, §4).

    rays : the tree in words
    shares : of the picture's time
    """

    tree: RayTree
    rays: str
    shares: Breakdown


def pixel_ray_tree(read: SceneFile, pixel: tuple[int, int], settings: RenderSettings = RenderSettings()) -> RayTree:
    """The tree of rays behind the middle of a pixel of a scene file's picture (Whitted 1980, Fig. 2, 3).

    What its rays send adds up to the pixel's radiance where one ray was traced for it; an antialiased pixel is the mean
    of several trees.

    read : the scene file, read
    pixel : x, y from the upper left corner
    settings : of Whitted's renderer; the file's own unless given
    Raises ValueError for a pixel outside of the picture, or settings of another renderer than Whitted's.
    """
    _check_pixel(read, pixel, settings)
    x, y = pixel
    prepared = whitted_of(read, settings).prepared(read.scene)
    return ray_tree(prepared, read.camera, (x + 0.5, y + 0.5), seed=settings.seed or 0)


def draw_ray_tree(
    read: SceneFile, out: str | Path, pixel: tuple[int, int], settings: RenderSettings = RenderSettings(), *,
    dry_run: bool = False,
) -> DrawnTree | None:  # fmt: skip
    """Draw the tree of rays behind a pixel of a scene file's picture (.png or .svg); None on a dry run.

    read : the scene file, read
    out : .png or .svg
    pixel : x, y from the upper left corner
    settings : of Whitted's renderer; the file's own unless given
    dry_run : check everything and draw nothing
    Raises ValueError for a pixel outside of the picture, or settings of another renderer than Whitted's.
    """
    out, camera, (x, y) = Path(out), read.camera, pixel
    _check_pixel(read, pixel, settings)
    if dry_run:
        return None
    # Trace the pixel's tree, and time the whole picture.
    prepared, seed = whitted_of(read, settings).prepared(read.scene), settings.seed or 0
    tree = ray_tree(prepared, camera, (x + 0.5, y + 0.5), seed=seed)
    shares = breakdown(prepared, camera, seed=seed)
    # Draw it.
    counts = {kind: int((tree.kind == kind).sum()) for kind in (REFLECTED, REFRACTED, SHADOW)}
    rays = f"{len(tree.kind)} ray{'s' if len(tree.kind) > 1 else ''}, {counts[REFLECTED]} reflected, "
    rays += f"{counts[REFRACTED]} refracted, {counts[SHADOW]} towards lights"
    film = metered_scene(read.scene).brighter(settings.exposure)
    drawing = tree_plot(tree, read.scene, film, f"pixel {x},{y}: {rays}", format=out.suffix.lower()[1:])
    with replacing(out) as temporary:
        temporary.write_bytes(drawing)
    return DrawnTree(tree, rays, shares)


def _check_pixel(read: SceneFile, pixel: tuple[int, int], settings: RenderSettings) -> None:
    renderer_name(read, settings, "ray tree")
    (x, y), (width, height) = pixel, (read.camera.width, read.camera.height)
    if not (0 <= x < width and 0 <= y < height):
        last = f"{width - 1},{height - 1}"
        raise ValueError(f"pixel {x},{y} lies outside the picture of {width}×{height} pixels; give 0,0 to {last}")


def tree_plot(tree: RayTree, scene: Scene, film: Film, title: str = "", *, format: str = "png") -> bytes:
    """The rays seen from the side that shows most of them (Fig. 2), and the tree with the intensity at each node
    (Fig. 3); a file of this format, "png" or "svg"."""
    from matplotlib.figure import Figure

    kept = _kept(tree)
    position = _laid_out(tree, kept)
    wide = max(x for x, _ in position.values()) + 1
    across = max(6, 1.2 * wide)
    # A wide tree goes below the scene, a narrow one beside it.
    size = (across, 10) if wide > WIDE else (6 + across, 6)
    figure = Figure(figsize=size, dpi=110, layout="constrained")
    place, diagram = figure.subplots(2, 1) if wide > WIDE else figure.subplots(1, 2, width_ratios=[6, across])
    _draw_rays(place, tree, kept, (*scene.local, *scene.objects))
    _draw_tree(diagram, tree, position, (*scene.local, *scene.objects), film)
    left_out = len(tree.kind) - len(kept)
    figure.suptitle(title + (f"; the {left_out} weakest of {len(tree.kind)} rays left out" if left_out else ""))
    return encoded_figure(figure, format)


def _kept(tree: RayTree) -> np.ndarray:
    """The nodes that send the pixel most, with all that lies between them and the eye, in the tree's order."""
    # A node is as strong as all that comes through it, so a parent is never weaker than its child.
    through = tree.weight.max(axis=1) * tree.intensity.max(axis=1)
    through[tree.kind == SHADOW] = tree.sent[tree.kind == SHADOW].max(axis=1)
    through[0] = np.inf
    strongest = np.argsort(-through, kind="stable")[:MOST]
    kept = set()
    for node in strongest:
        while node >= 0 and node not in kept:
            kept.add(int(node))
            node = tree.parent[node]
    return np.array(sorted(kept))


def _draw_rays(axis: Any, tree: RayTree, kept: np.ndarray, shapes: Sequence[Shape]) -> None:
    """Fig. 2: everything projected along the direction in which the rays spread least, +Y kept upwards."""
    from matplotlib.patches import FancyArrowPatch

    # The window is about the places where light is reflected or refracted, whatever lies far beyond.
    ahead = tree.end[0] - tree.start[0]
    alone = np.stack([tree.start[0], tree.start[0] + ahead / max(float(np.linalg.norm(ahead)), 1e-30)])
    points = tree.start[kept][1:] if len(kept) > 1 else alone
    level = points[:, [0, 2]] - points[:, [0, 2]].mean(axis=0)
    across = np.linalg.svd(level, full_matrices=False)[2][0] if np.any(level) else np.array([1.0, 0.0])
    right = np.array([across[0], 0.0, across[1]])
    right *= np.sign(right[np.argmax(np.abs(right))])
    basis = np.stack([right, [0.0, 1.0, 0.0]])
    flat = points @ basis.T
    low, high = flat.min(axis=0), flat.max(axis=0)
    far = float(np.linalg.norm(ahead)) if tree.shape[0] >= 0 else 1.0
    margin = max(0.35 * float((high - low).max()), 0.1 * far)
    for index in sorted({int(s) for s in tree.shape[kept] if s >= 0}):
        _draw_shape(axis, shapes[index], basis, low[0] - margin, high[0] + margin)
    for node in kept:
        start, end = tree.start[node] @ basis.T, tree.end[node] @ basis.T
        if tree.shape[node] < 0:
            # What leaves the scene, or goes to a far light, is drawn a short way.
            end = start + (end - start) * (0.7 * margin / max(float(np.linalg.norm(end - start)), 0.7 * margin))
        colour = COLOURS[int(tree.kind[node])]
        ends = {"posA": tuple(start), "posB": tuple(end), "shrinkA": 0, "shrinkB": 0}
        axis.add_patch(FancyArrowPatch(**ends, arrowstyle="->", mutation_scale=9, color=colour, lw=1.1))
    for kind, label in LABELS.items():
        axis.plot([], [], color=COLOURS[kind], label=label)
    axis.legend(fontsize=8, loc="best")
    axis.set_xlim(low[0] - margin, high[0] + margin)
    axis.set_ylim(low[1] - margin, high[1] + margin)
    axis.set_aspect("equal")
    axis.set_title("rays in the scene, from the side (metres)", fontsize=10)
    axis.tick_params(labelsize=7)


def _draw_shape(axis: Any, shape: Shape, basis: np.ndarray, left: float, right: float) -> None:
    from matplotlib.patches import Circle
    from scipy.spatial import ConvexHull, QhullError

    if isinstance(shape, Sphere):
        centre = np.asarray(shape.centre) @ basis.T
        axis.add_patch(Circle(tuple(centre), shape.radius, fc="#dddddd", ec="#777777", alpha=0.6))
    elif isinstance(shape, Plane):
        half = float(np.abs(basis[0, [0, 2]]) @ shape.extent) / 2
        axis.plot([max(left, -half), min(right, half)], [shape.height] * 2, color="#777777", lw=2)
    else:
        points = shape.control.reshape(-1, 3) if isinstance(shape, Patches) else shape.vertices
        flat = points[:: max(1, len(points) // POINTS)] @ basis.T
        try:
            outline = flat[ConvexHull(flat).vertices]
        except QhullError:
            axis.plot(flat[:, 0], flat[:, 1], color="#777777", lw=2)
            return
        axis.fill(outline[:, 0], outline[:, 1], fc="#dddddd", ec="#777777", alpha=0.4)


def _draw_tree(
    axis: Any, tree: RayTree, position: dict[int, tuple[float, float]], shapes: Sequence[Shape], film: Film
) -> None:
    """Fig. 3: each node below its parent, painted as its intensity would be developed."""
    for node, (x, y) in position.items():
        parent = int(tree.parent[node])
        if parent in position:
            axis.plot([position[parent][0], x], [position[parent][1], y], color=COLOURS[int(tree.kind[node])], lw=1.1)
    wide = max(x for x, _ in position.values()) + 1
    for node, (x, y) in position.items():
        pixel = develop(tree.intensity[node].reshape(1, 1, 3), film).pixels[0, 0] / 255
        dark = pixel @ [0.2126, 0.7152, 0.0722] < 0.5
        axis.text(
            x, y, _caption(tree, node, shapes), ha="center", va="center", fontsize=6.5,
            color="white" if dark else "black",
            bbox={"boxstyle": "round,pad=0.25", "fc": tuple(pixel), "ec": COLOURS[int(tree.kind[node])]},
        )  # fmt: skip
    axis.set_xlim(-0.7, wide - 0.3)
    axis.set_ylim(min(y for _, y in position.values()) - 0.5, 0.5)
    axis.set_axis_off()
    axis.set_title("the tree, with the intensity at each node", fontsize=10)


def _caption(tree: RayTree, node: int, shapes: Sequence[Shape]) -> str:
    kind, shape = int(tree.kind[node]), int(tree.shape[node])
    red, green, blue = tree.intensity[node]
    value = f"{red:.3g}" if red == green == blue else f"{red:.2g}, {green:.2g}, {blue:.2g}"
    if kind == SHADOW:
        through = f": {getattr(shapes[shape], 'name', 'plane')}" if shape >= 0 else ""
        return f"L{int(tree.light[node]) + 1}{through}\n{value}"
    where = "sky" if shape < 0 else getattr(shapes[shape], "name", "plane")
    return f"{NAMES[kind]}: {where}\n{value}"


def _laid_out(tree: RayTree, kept: np.ndarray) -> dict[int, tuple[float, float]]:
    """Where each node stands: leaves one beside the other, parents above the middle of their children."""
    children: dict[int, list[int]] = {int(node): [] for node in kept}
    level = {int(kept[0]): 0}
    for node in kept[1:]:
        children[int(tree.parent[node])].append(int(node))
        level[int(node)] = level[int(tree.parent[node])] + 1
    across: dict[int, float] = {}
    leaves = 0
    for node in _leaves_first(int(kept[0]), children):
        if children[node]:
            across[node] = (across[children[node][0]] + across[children[node][-1]]) / 2
        else:
            across[node], leaves = float(leaves), leaves + 1
    return {node: (place, -float(level[node])) for node, place in across.items()}


def _leaves_first(root: int, children: dict[int, list[int]]) -> list[int]:
    """All nodes, each after its children, from left to right."""
    order, waiting = [], [root]
    while waiting:
        node = waiting.pop()
        order.append(node)
        waiting += children[node]
    return order[::-1]
