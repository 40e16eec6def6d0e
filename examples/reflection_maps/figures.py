"""The pictures of docs/how-to/reflection-maps.md, made by relume under any illumination map.

relume demo -o out/demo
python examples/reflection_maps/figures.py out/demo/light.exr docs/images
"""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

import relume as rl
from relume.light.reflection.brdf import GGX
from relume.light.reflection.lobes import GGXLobe, Lambert, Mirror, Phong
from relume.light.reflection.reflection_map import reflection_map
from relume.light.reflection.weights import ByAngle, Even
from relume.renderers.prefiltered.filters import Filter, Mip, Plain, Preintegrated, Quadrilateral, Subdivision
from relume.renderers.prefiltered.materials import facet_albedos
from relume.scene.materials.bumps import Wrinkles
from relume.scene.materials.reflective import Layer
from relume.virtual_camera.film.film import metered_film

METHODS: dict[str, Filter] = {
    "none (§7.1)": Plain(),
    "subdivision (§8.1)": Subdivision(),
    "quadrilateral (§8.2)": Quadrilateral(),
    "pre-integrated (§8.3)": Preintegrated(),
    "MIP (Williams 1983)": Mip(),
}


def shown(axis, radiance: np.ndarray, film: rl.Film, title: str = "") -> None:
    """One developed picture, without axes."""
    axis.imshow(rl.develop(radiance, film).pixels, interpolation="nearest")
    axis.set_title(title, fontsize=9)
    axis.set_axis_off()


def tables(light: rl.EnvironmentMap, film: rl.Film) -> Figure:
    """The illumination map and the tables made of it."""
    figure = Figure(figsize=(10, 5.4), dpi=100, layout="constrained")
    axes = figure.subplots(2, 2).flat
    shown(next(axes), light.radiance, film, "I, the illumination map")
    for title, lobe in (
        ("D, Lambert, 36×72", Lambert()),
        ("S, Phong, n = 10", Phong(10)),
        ("S, Phong, n = 200", Phong(200)),
    ):
        shown(next(axes), reflection_map(light, lobe).table, film, title)
    return figure


def ball(
    material: rl.scene.Reflective | rl.Material, size: int, shift: tuple[float, float] = (0.0, 0.0)
) -> tuple[rl.Sphere, rl.Camera]:
    """A ball and a camera that sees it about `size` pixels wide, moved by a share of a pixel."""
    camera = rl.Camera.looking_at(np.array([0.0, 0, 8]), np.zeros(3), width=size, height=size, focal_length=size * 3.7)
    x, y = np.asarray(shift) * 8 / camera.focal_length
    return rl.Sphere((float(x), float(y), 0.0), 1.0, material), camera


def antialiasing(light: rl.EnvironmentMap, film: rl.Film) -> Figure:
    """A small wrinkled mirror in five positions a fifth of a pixel apart, by every method and by 1,024 samples."""
    mirror = rl.scene.Reflective((Layer(Mirror()),), Wrinkles(0.02, 0.5))
    figure = Figure(figsize=(11, 8.2), dpi=100, layout="constrained")
    axes = figure.subplots(5, len(METHODS) + 1)
    size, fine = 28, 32
    for row, step in zip(axes, np.arange(5) / 5, strict=True):
        shape, camera = ball(mirror, size, (step, step))
        scene = rl.Scene(light, objects=(shape,))
        for axis, (name, method) in zip(row, METHODS.items(), strict=False):
            picture = rl.render(scene, camera, rl.Prefiltered(method, background=False))
            shown(axis, picture.radiance, film, name if step == 0 else "")
        many = replace(camera, width=size * fine, height=size * fine, focal_length=camera.focal_length * fine)
        truth = rl.render(scene, many, rl.Prefiltered(Plain(), background=False)).radiance
        mean = truth.reshape(size, fine, size, fine, 3).mean((1, 3))
        shown(row[-1], mean, film, "1,024 samples" if step == 0 else "")
    return figure


def dimensions(light: rl.EnvironmentMap, film: rl.Film) -> Figure:
    """A ball of rough metal by the two-dimensional approximation, by the three-dimensional map and by path tracing."""
    alpha, size = 0.25, 240
    white, _ = facet_albedos(alpha)
    flat = rl.scene.Reflective((Layer(GGXLobe(alpha), weight=ByAngle(tuple(white))),))
    whole = rl.scene.Reflective((Layer(GGX(alpha), weight=Even(1.0)),))
    metal = rl.Material((1.0, 1.0, 1.0), 1.0, float(np.sqrt(alpha)))
    figure = Figure(figsize=(10, 3.6), dpi=100, layout="constrained")
    axes = figure.subplots(1, 3)
    for axis, title, material, renderer in (
        (axes[0], "D and S alone (N = V = R)", flat, rl.Prefiltered(background=False)),
        (axes[1], "three-dimensional map", whole, rl.Prefiltered(background=False)),
        (axes[2], "path tracing, 1,024 rays a pixel", metal, rl.Mitsuba(1024)),
    ):
        shape, camera = ball(material, size)
        picture = rl.render(rl.Scene(light, objects=(shape,)), camera, renderer)
        shown(axis, picture.radiance * picture.matte[..., None], film, title)
    return figure


def main(map_path: str, folder: str) -> None:
    """Write every figure as a JPEG."""
    light = rl.as_environment(rl.read_radiance(map_path))
    film = metered_film(light)
    for name, draw in (("tables", tables), ("antialiasing", antialiasing), ("dimensions", dimensions)):
        draw(light, film).savefig(Path(folder) / f"reflection_{name}.jpg", pil_kwargs={"quality": 88})


if __name__ == "__main__":
    main(*sys.argv[1:])
