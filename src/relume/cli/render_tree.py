"""`relume render --tree X,Y`: the ray tree of a pixel, and where the picture's time goes."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from relume.renderers.whitted.ray_tree import RayTree
    from relume.renderers.whitted.whitted import Whitted
    from relume.scene.cameras.camera import Camera
    from relume.scene.scene import Scene
    from relume.virtual_camera.film.film import Film

DRAWINGS = (".png", ".svg")


def read_pixel(text: str, camera: Camera) -> tuple[int, int]:
    """Two numbers of a pixel from text like "320,240"; raises ValueError where the picture has none such."""
    try:
        x, y = (int(word) for word in text.replace(",", " ").split())
    except ValueError:
        raise ValueError(f'--tree: "{text}" is no pixel; write X,Y from the upper left corner, like 320,240') from None
    if not (0 <= x < camera.width and 0 <= y < camera.height):
        raise ValueError(
            f"--tree {text} lies outside the picture of {camera.width}×{camera.height} pixels; "
            f"give 0,0 to {camera.width - 1},{camera.height - 1}"
        )
    return x, y


def draw_tree(
    out: Path, method: Whitted, scene: Scene, camera: Camera, pixel: tuple[int, int], *, film: Film, seed: int
) -> dict[str, object]:
    """Write the drawing of a pixel's tree; what there is to tell of it and of the picture's time (§4)."""
    from relume.image.files.atomic import replacing
    from relume.renderers.whitted.ray_tree import breakdown, ray_tree
    from relume.report.ray_tree_plot import tree_plot

    prepared = method.prepared(scene)
    tree = ray_tree(prepared, camera, (pixel[0] + 0.5, pixel[1] + 0.5), seed=seed)
    title = f"pixel {pixel[0]},{pixel[1]}: {_counted(tree)}"
    drawing = tree_plot(tree, scene, film, title, format=out.suffix.lower()[1:])
    shares = breakdown(prepared, camera, seed=seed)
    with replacing(out) as temporary:
        temporary.write_bytes(drawing)
    return {
        "pixel": f"{pixel[0]},{pixel[1]}",
        "tree": _counted(tree),
        "intensity": ", ".join(f"{value:.6g}" for value in tree.intensity[0]),
        "overhead": f"{shares.overhead:.0%}",
        "intersection": f"{shares.intersection:.0%}",
        "shading": f"{shares.shading:.0%}",
        "picture": f"{shares.seconds:.2f} s of one core, {shares.rays} rays",
    }


def _counted(tree: RayTree) -> str:
    from relume.renderers.whitted.record import REFLECTED, REFRACTED, SHADOW

    rays = "1 ray" if len(tree.kind) == 1 else f"{len(tree.kind)} rays"
    counts = {kind: int((tree.kind == kind).sum()) for kind in (REFLECTED, REFRACTED, SHADOW)}
    return f"{rays}, {counts[REFLECTED]} reflected, {counts[REFRACTED]} refracted, {counts[SHADOW]} towards lights"
