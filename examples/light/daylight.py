"""The pictures of skies and joined maps in docs/how-to/light/sky.md.

python examples/light/daylight.py docs/images
"""

from __future__ import annotations

import sys
from dataclasses import replace
from datetime import datetime
from pathlib import Path

import numpy as np
import trimesh
from matplotlib.figure import Figure

import relume as rl
from relume.image.colour import luminance
from relume.light.daylight.sky import Sky, sky
from relume.light.editing.joining import Mask, join_maps
from relume.renderers.environment_probe import environment
from relume.scene.shapes.shapes import Mesh
from relume.sphere.directions import rotation_about
from relume.sphere.mappings.discs import Fisheye

BERLIN = 52.5, 13.4
HOURS = ("05:30", "07:30", "13:00", "18:00", "20:45")
HAZES = (2.0, 4.0, 8.0)
PITCHED = rotation_about(np.array([1.0, 0.0, 0.0]), np.pi / 2)
"""What came from −Z comes from +Y."""


def at(hour: str, turbidity: float = 3.0) -> Sky:
    """The sky of Berlin at midsummer, seen looking south."""
    time = datetime.fromisoformat(f"2026-06-21T{hour}+02:00")
    return Sky.at(*BERLIN, time, turbidity, heading=np.pi)


def shown(axis, radiance: np.ndarray, film: rl.Film, title: str = "") -> None:
    """One developed picture, without axes."""
    axis.imshow(rl.develop(radiance, film).pixels, interpolation="nearest")
    axis.set_title(title, fontsize=9)
    axis.set_axis_off()


def day() -> Figure:
    """Hours across, haze down; each developed so that level ground of 18 % is middle grey."""
    figure = Figure(figsize=(12, 4.3), dpi=100, layout="constrained")
    axes = figure.subplots(len(HAZES), len(HOURS))
    for row, turbidity in zip(axes, HAZES, strict=True):
        for axis, hour in zip(row, HOURS, strict=True):
            description = at(hour, turbidity)
            level = float(luminance(description.sun_illuminance + description.sky_illuminance))
            title = f"{hour}, {np.degrees(description.sun.elevation):.0f}°, {level / 1000:.0f} klx"
            shown(
                axis, sky(description, 128).radiance, rl.Film(1.2 * np.pi / level), f"{title}, turbidity {turbidity:g}"
            )
    return figure


def ground() -> rl.EnvironmentMap:
    """A rendered courtyard under the same sky, from its middle."""
    light = sky(at("18:00"), 256)
    stone = rl.Material(base_color=(0.35, 0.3, 0.25), roughness=1.0)
    paving = rl.Material(base_color=(0.25, 0.24, 0.22), roughness=1.0)
    walls = [((-7.0, 2.2), (1.0, 8.0)), ((6.0, 1.5), (1.0, 8.0)), ((0.0, 1.0), (14.0, 1.0))]
    boxes = []
    for (x, high), (wide, deep) in walls:
        box = trimesh.creation.box((wide, high, deep)).apply_translation((x, high / 2, -6.0))
        boxes.append(Mesh(np.asarray(box.vertices, np.float32), np.asarray(box.faces, np.int32), stone))
    scene = rl.Scene(light, (rl.Plane(paving),), tuple(boxes))
    return environment(scene, (0.0, 1.6, 0.0), rl.Mitsuba(64), size=256)


def joined() -> Figure:
    """A fisheye sky, a rendered ground, and both in one map."""
    film = rl.Film(1.2 * np.pi / float(luminance(at("18:00").sun_illuminance + at("18:00").sky_illuminance)))
    figure = Figure(figsize=(11, 2.6), dpi=100, layout="constrained")
    axes = figure.subplots(1, 3, width_ratios=(1, 2, 2))
    fisheye = sky(at("18:00"), 512).remapped(Fisheye(np.pi), 512, PITCHED.T)
    rendered = ground()
    upright = fisheye.remapped(rl.mappings.LatLong(), 256, PITCHED)
    # Where the sky is seen behind the walls: what is there is the light itself, but for the noise.
    behind = sky(at("18:00"), 256).radiance
    mask = np.all(np.abs(rendered.radiance - behind) < 0.1 * behind, axis=-1)
    mask |= np.all(rendered.radiance > 1e5, axis=-1)  # the sun
    mask[128:] = False
    bare = replace(rendered, radiance=np.where(mask[..., None], np.float32(0), rendered.radiance))
    whole = join_maps(upright, bare, Mask(mask.astype(float)))
    shown(axes[0], fisheye.radiance, film, "a sky through a fisheye")
    shown(axes[1], bare.radiance, film, "a rendered ground")
    shown(axes[2], whole.radiance, film, "joined by a mask")
    return figure


if __name__ == "__main__":
    folder = Path(sys.argv[1])
    day().savefig(folder / "light_sky.jpg", pil_kwargs={"quality": 88})
    joined().savefig(folder / "light_joined.jpg", pil_kwargs={"quality": 88})
