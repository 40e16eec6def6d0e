"""Debevec 1998, Fig. 3: one object in five materials, lit by all of the light and by what one photograph holds of it.

python examples/gallery/debevec_1998_figure_3.py OUT.png
python examples/gallery/debevec_1998_figure_3.py OUT.png LIGHT.exr

Above, the full range of the light; below, the same with its brightest regions cut at 2 % of their values, as the paper
says of its single photograph. The right halves of the last three are brightened by six, as in the caption. Without a
map the light is a kitchen of our own with a window and a ceiling lamp, like the paper's Fig. 2.
"""

from __future__ import annotations

import sys

import numpy as np
from matplotlib.figure import Figure

import relume as rl
from relume.sphere.mappings.mapping import LatLong, pixel_directions
from relume.virtual_camera.film.film import Film, metered_film

CLIPPED, BRIGHTER = 0.02, 6.0
SIZE, SAMPLES = 200, 256
MATERIALS = {
    "perfectly reflective": rl.Material((1.0, 1.0, 1.0), metallic=1.0, roughness=0.0),
    "rough gold": rl.scene.Ward((1.0, 0.72, 0.34), 0.2, 0.2),
    "diffuse gray": rl.Diffuse((0.5, 0.5, 0.5)),
    # 4 % of gloss with a Gaussian roughness of 0.04, by Ward's model, as in the paper.
    "shiny green plastic": rl.scene.Ward((0.04, 0.04, 0.04), 0.04, 0.04, (0.03, 0.35, 0.08)),
    "dull orange plastic": rl.scene.Ward((0.04, 0.04, 0.04), 0.3, 0.3, (0.75, 0.25, 0.03)),
}


def kitchen(rows: int = 256) -> rl.EnvironmentMap:
    """A room of 4 by 4 by 2.6 metres seen from a table: a window of sky, a round tungsten lamp, coloured walls."""
    ways = pixel_directions(LatLong(), rows)
    low, high = np.array([-2.0, -0.8, -2.0]), np.array([2.0, 1.8, 2.0])
    with np.errstate(divide="ignore"):
        distance = np.where(ways > 0, high / ways, low / ways)
    hit = ways * distance.min(axis=-1, keepdims=True)
    wall = distance.argmin(axis=-1)
    x, y, z = np.moveaxis(hit, -1, 0)
    # Walls, ceiling and floor, the last with tiles; a shelf of dark boards on one wall.
    radiance = np.where((wall == 0)[..., None], [0.32, 0.28, 0.22], np.array([0.24, 0.26, 0.30]))
    radiance = np.where(((wall == 1) & (y > 0))[..., None], 0.5, radiance)
    tiles = (np.floor(x / 0.4) + np.floor(z / 0.4)) % 2
    radiance = np.where(((wall == 1) & (y < 0))[..., None], 0.06 + 0.1 * tiles[..., None], radiance)
    shelf = (wall == 0) & (x > 0) & (np.abs(z) < 1.2) & ((y % 0.5) < 0.06) & (y > -0.2) & (y < 1.4)
    radiance = np.where(shelf[..., None], [0.05, 0.03, 0.02], radiance)
    # Four panes of sky, and the lamp: as much brighter as a photograph cannot hold.
    pane = (wall == 2) & (z > 0) & (np.abs(x - 0.3) < 0.7) & (y > 0.0) & (y < 1.2)
    bars = (np.abs(x - 0.3) < 0.03) | (np.abs(y - 0.6) < 0.03)
    radiance = np.where((pane & ~bars)[..., None], [56.0, 72.0, 104.0], radiance)
    lamp = (wall == 1) & (y > 0) & (np.hypot(x + 0.9, z - 0.2) < 0.22)
    radiance = np.where(lamp[..., None], [1000.0, 700.0, 370.0], radiance)
    return rl.EnvironmentMap(radiance.astype(np.float32))


def shapes(material: rl.Material | rl.Diffuse | rl.scene.Ward) -> tuple[rl.Sphere, ...]:
    """A ball with knobs that shade it and that it mirrors."""
    ways = np.array(
        [[0.1, 1, 0.2], [0.9, 0.3, 0.5], [-0.8, 0.4, 0.55], [0.2, -0.5, 0.9], [-0.6, -0.75, 0.1], [0.8, -0.6, -0.2]]
    )
    ways /= np.linalg.norm(ways, axis=1, keepdims=True)
    knobs = [rl.Sphere((float(x), float(y), float(z)), 0.22, material) for x, y, z in 0.85 * ways]
    necks = [rl.Sphere((float(x), float(y), float(z)), 0.12, material) for x, y, z in 0.63 * ways]
    return rl.Sphere((0.0, 0.0, 0.0), 0.58, material), *knobs, *necks


def rendered(light: rl.EnvironmentMap, material: rl.Material | rl.Diffuse | rl.scene.Ward) -> np.ndarray:
    """The object before black (SIZE, SIZE, 3), in the light's unit."""
    camera = rl.Camera.looking_at(
        np.array([0.0, 0.6, 6.0]), np.zeros(3), width=SIZE, height=SIZE, focal_length=2.6 * SIZE
    )
    picture = rl.render(rl.Scene(light, objects=shapes(material)), camera, rl.Mitsuba(SAMPLES), seed=1)
    return picture.radiance * picture.matte[..., None]


def figure(light: rl.EnvironmentMap) -> Figure:
    """The two rows of five."""
    largest = float(light.radiance.max())
    photograph = rl.EnvironmentMap(np.minimum(light.radiance, CLIPPED * largest), light.mapping)
    film: Film = metered_film(light)
    page = Figure(figsize=(12, 5.3), dpi=100, layout="constrained", facecolor="black")
    for row, (axes, map_) in enumerate(zip(page.subplots(2, 5), (light, photograph), strict=True)):
        for column, (axis, (name, material)) in enumerate(zip(axes, MATERIALS.items(), strict=True)):
            picture = rendered(map_, material)
            letter = "abcdefghij"[5 * row + column]
            if row == 1 and column >= 2:
                picture[:, SIZE // 2 :] *= BRIGHTER
                letter += ", right ×6"
            axis.imshow(rl.develop(picture, film).pixels, interpolation="nearest")
            axis.set_title(f"({letter}) {name}", fontsize=9, color="white")
            axis.set_axis_off()
    page.suptitle(
        "above: the whole range of the light; below: what one photograph holds of it", color="white", fontsize=11
    )
    return page


if __name__ == "__main__":
    if len(sys.argv) not in (2, 3):
        raise SystemExit(__doc__)
    given = rl.as_environment(rl.read_radiance(sys.argv[2])) if len(sys.argv) == 3 else kitchen()
    figure(given).savefig(sys.argv[1])
