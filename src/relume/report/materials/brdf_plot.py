"""A surface drawn as Lemmon's notes draw them (SIGGRAPH 2001 course 14): cross-sections of the light that a beam is
scattered into, as long as it is bright, at several angles of incidence; the share that is returned; and lit balls.

A cross-section shows π·f·cos θ of the beam's angle θ: the radiance of the surface by that of a white diffuse one that
the same beam meets head-on. A diffuse surface is a half-circle that shrinks as the beam becomes shallow.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from relume.image import files
from relume.image.colour import encode_srgb, luminance
from relume.project.scene_file.scene_file import scene_materials
from relume.renderers.mitsuba.path_tracer import Mitsuba
from relume.renderers.mitsuba.scattering import Scattering, require_brdf, scattering
from relume.renderers.results import Progress
from relume.report.plots import CHANNELS, encoded_figure
from relume.scene.cameras.camera import Camera
from relume.scene.materials.materials import Ward
from relume.scene.materials.measured import read_merl
from relume.scene.materials.presets import material_preset
from relume.scene.scene import Scene
from relume.scene.shapes.shapes import AnyMaterial, Sphere
from relume.sphere.environment_map import EnvironmentMap
from relume.sphere.mappings.mapping import LatLong, pixel_directions
from relume.virtual_camera.developing import develop
from relume.virtual_camera.film.film import Film

if TYPE_CHECKING:
    from matplotlib.figure import Figure

INCIDENCES = (15.0, 45.0, 75.0)
"""Degrees from the normal to the beams that are drawn."""
STEP = 0.25
"""Degrees between the directions of a cross-section."""
LINE = 4.0
"""Degrees between its lines."""
LINEAR = 3.0
"""Brighter than that the lengths are cube roots, so that a highlight and a diffuse part fit on one page."""
SIZE = 150
"""Pixels of a ball."""
_BALLS = (
    ("lamp above left", 0.1, (-0.5, 0.6, 0.62)),
    ("lamp behind right", 0.1, (0.8, 0.35, -0.45)),
    ("even", 1.0, None),
)
_LAMP, _WIDE = 60.0, 8.0
"""Radiance of a lamp, and degrees from its middle to its rim."""


def draw_brdf(
    material: AnyMaterial | str, path: str | os.PathLike[str], *, scene: str | os.PathLike[str] | None = None,
    title: str = "", samples: int = 64, seed: int = 0, progress: Progress | None = None, dry_run: bool = False,
) -> None:  # fmt: skip
    """Draw a surface's BRDF into a .png or .svg: cross-sections, albedo over angle, and lit balls.

    The numbers are those of the surface that Mitsuba renders. Images are drawn at their middle; what fills a body is
    seen in the balls alone. Of a surface with a direction there are cross-sections along u and along v.

    material : itself; or the name of one of the scene file's, of a preset, or of a MERL .binary file
    path : the .png or .svg
    scene : a scene file, for its materials
    title : the material's name unless given
    samples : rays a pixel of the balls
    seed : of the balls' random numbers
    progress : called with the share of the work that is done, 0 to 1
    dry_run : check everything and draw nothing
    Raises ValueError for a name that is none or another suffix, UnreadableFile, InvalidScene, UnsupportedScene for
    reflection maps and Whitted's materials.
    """
    path = Path(path)
    kind = path.suffix.lower()[1:]
    if kind not in ("png", "svg"):
        raise ValueError(f"{path}: a BRDF is drawn into .png or .svg, not {path.suffix or 'a file without a suffix'}")
    if samples < 2:
        raise ValueError(f"samples is {samples}; expected at least 2")
    if isinstance(material, str):
        title = title or material
        material = _named(material, scene)
    require_brdf(material)
    if dry_run:
        return
    figure = brdf_figure(material, title or getattr(material, "name", ""), samples, seed, progress)
    drawing = encoded_figure(figure, kind)
    with files.replacing(path) as temporary:
        temporary.write_bytes(drawing)


def _named(name: str, scene: str | os.PathLike[str] | None) -> AnyMaterial:
    """The scene file's material of that name, a measured one of a file, or a preset."""
    own = {} if scene is None else scene_materials(scene)
    if name in own:
        return own[name]
    if name.lower().endswith(".binary"):
        return read_merl(name)
    try:
        return material_preset(name)
    except ValueError as error:
        of = f"; {scene} has {', '.join(own) or 'no materials'}" if scene is not None else ""
        raise ValueError(f"{error}{of}") from None


def brdf_figure(
    material: AnyMaterial, title: str, samples: int = 64, seed: int = 0, progress: Progress | None = None
) -> Figure:
    """The figure of `draw_brdf`."""
    from matplotlib.figure import Figure

    def after(index: int) -> Progress:
        # The balls take the time: minutes where something fills them.
        return lambda share: progress((index + share) / len(_BALLS)) if progress is not None else None

    # The planes of incidence: of a surface that looks the same whichever way it is turned, one does.
    planes = (("along u", (1.0, 0.0)), ("along v", (0.0, 1.0))) if _is_directed(material) else (("", (1.0, 0.0)),)
    angles = np.radians(np.arange(-180, 180, STEP))
    sections = [_section(material, along, angles, seed) for _, along in planes]
    balls = [
        _ball(material, ambient, towards, samples, seed, after(index))
        for index, (_, ambient, towards) in enumerate(_BALLS)
    ]
    # Cross-sections above, numbers and balls below.
    through = any(part.transmitted.max() > 1e-4 for part in sections)
    high = 4.6 if through else 2.9
    figure = Figure(figsize=(13, high * len(planes) + 3.5), dpi=100, layout="constrained")
    parts: Any = figure.subfigures(2, 1, height_ratios=[high * len(planes), 3.5])
    upper, lower = parts
    length = _length(sections, angles)
    axes = upper.subplots(len(planes), len(INCIDENCES), squeeze=False)
    for row, part, (name, _) in zip(axes, sections, planes, strict=True):
        for column, axis in enumerate(row):
            _draw_section(axis, part, column, angles, length, through)
            axis.set_title(f"light at {INCIDENCES[column]:g}° {name}".strip(), fontsize=9)
    upper.suptitle(f"{title or 'surface'}: radiance by a white diffuse surface's, {length.words}", fontsize=11)
    below = lower.subplots(1, 2 + len(balls), width_ratios=[1.35, 1.35, *([1] * len(balls))])
    _draw_profile(below[0], sections[0], angles)
    _draw_albedo(below[1], material, seed)
    for axis, (name, *_), picture in zip(below[2:], _BALLS, balls, strict=True):
        axis.imshow(picture)
        axis.set_axis_off()
        axis.set_title(f"light: {name}" if name == "even" else name, fontsize=9)
    return figure


class _Length:
    """How long a line is drawn: as bright, or the cube root of it."""

    def __init__(self, largest: float) -> None:
        self.bent, self.largest = largest > LINEAR, max(largest, 1e-3)
        self.words = "lengths are cube roots" if self.bent else "lengths in proportion"

    def __call__(self, value: Any) -> Any:
        return np.cbrt(value) if self.bent else value

    def rings(self) -> list[float]:
        """Round values up to the largest."""
        steps = 10.0 ** np.arange(-3, 7) if self.bent else np.array([0.05, 0.1, 0.2, 0.5, 1.0, 2.0])
        return [float(value) for value in steps if 0.04 * self.largest ** (1 / 3 if self.bent else 1) < self(value)][:5]


def _length(sections: list[Scattering], angles: np.ndarray) -> _Length:
    return _Length(max(float(_relative(part, i, angles).max()) for part in sections for i in range(len(INCIDENCES))))


def _relative(part: Scattering, index: int, angles: np.ndarray) -> np.ndarray:
    """π·f·cos θ of the beam (A, 3); at the horizon, where f·cos is 0 by 0, nothing."""
    cosine = np.abs(np.cos(angles))
    beam = np.cos(np.radians(INCIDENCES[index]))
    return np.where(cosine[:, None] > 0.01, np.pi * beam * part.values[index] / np.maximum(cosine, 0.01)[:, None], 0.0)


def _section(material: AnyMaterial, along: tuple[float, float], angles: np.ndarray, seed: int) -> Scattering:
    """What beams from the side of −x of this plane do, seen all around in it."""

    def directions(theta: np.ndarray) -> np.ndarray:
        return np.stack([np.sin(theta) * along[0], np.sin(theta) * along[1], np.cos(theta)], axis=-1)

    return scattering(material, directions(-np.radians(INCIDENCES)), directions(angles), seed)


def _draw_section(axis: Any, part: Scattering, index: int, angles: np.ndarray, length: _Length, through: bool) -> None:
    """One cross-section: lines in the light's colour, their outline, and the beam that comes in from the left."""
    from matplotlib.collections import LineCollection

    values = _relative(part, index, angles)
    radius = length(values.max(axis=1))
    x, y = radius * np.sin(angles), radius * np.cos(angles)
    every = round(LINE / STEP)
    tips = np.stack([x[::every], y[::every]], axis=-1)
    # The highlight between two lines gets one of its own.
    best = int(np.argmax(radius))
    tips = np.concatenate([tips, [[x[best], y[best]]]])
    colours = np.concatenate([_hue(values[::every]), _hue(values[best : best + 1])])
    lines = np.stack([np.zeros_like(tips), tips], axis=1)
    axis.add_collection(LineCollection(list(lines), colors=colours, linewidths=1.3))
    axis.plot(x, y, color="#222222", lw=0.8)
    # Smooth rays have no width: they are drawn as arrows with their share.
    reach = length(length.largest)
    for direction, share in part.smooth[index]:
        end = reach * np.array([np.hypot(direction[0], direction[1]), direction[2]]) * share.max() ** 0.5
        axis.annotate("", end, (0, 0), arrowprops={"arrowstyle": "->", "color": "#2c5fb3", "lw": 1.6})
        axis.annotate(f"{100 * luminance(share):.1f} %", end, fontsize=7, color="#2c5fb3", ha="center")
    for value in length.rings():
        if length(value) <= 1.05 * reach:
            sweep = np.linspace(-np.pi, np.pi, 200) if through else np.linspace(-np.pi / 2, np.pi / 2, 100)
            axis.plot(length(value) * np.sin(sweep), length(value) * np.cos(sweep), color="#bbbbbb", lw=0.5, zorder=0)
            axis.text(0, length(value), f"{value:g}", fontsize=6, color="#888888", ha="center", zorder=0)
    beam = np.radians(INCIDENCES[index])
    start = 1.12 * reach * np.array([-np.sin(beam), np.cos(beam)])
    axis.annotate("", (0, 0), start, arrowprops={"arrowstyle": "-|>", "color": "#d79a00", "lw": 2})
    axis.plot([-1.15 * reach, 1.15 * reach], [0, 0], color="#555555", lw=1.2)
    axis.set_xlim(-1.18 * reach, 1.18 * reach)
    axis.set_ylim(-1.18 * reach if through else -0.06 * reach, 1.18 * reach)
    axis.set_aspect("equal")
    axis.set_axis_off()


def _hue(values: np.ndarray) -> np.ndarray:
    """Colours (N, 3) to draw by: as bright as a screen has them, darker for white so that they show on paper."""
    largest = np.maximum(values.max(axis=1, keepdims=True), 1e-12)
    return encode_srgb(np.clip(0.5 * values / largest, 0, 1))


def _draw_profile(axis: Any, part: Scattering, angles: np.ndarray) -> None:
    """The same in logarithms: luminance over the angle to the normal, one curve an incidence."""
    above = np.abs(angles) < np.radians(89)
    for index, degrees in enumerate(INCIDENCES):
        values = luminance(_relative(part, index, angles))[above]
        axis.semilogy(np.degrees(angles[above]), np.maximum(values, 1e-6), lw=1.2, label=f"{degrees:g}°")
    # Without anything to scale by, as of a mirror, the axis shows a span of its own.
    every = [luminance(_relative(part, index, angles))[above] for index in range(len(INCIDENCES))]
    largest, least = float(np.max(every)), float(np.min(every))
    axis.set_ylim(*((1e-4, 1.0) if largest < 1e-5 else (max(0.5 * least, 1e-6 * largest, 1e-4), 2 * largest)))
    axis.set_xlim(-90, 90)
    axis.set_xticks([-90, -45, 0, 45, 90])
    axis.set_title("cross-sections, luminance", fontsize=9)
    if largest < 1e-5:
        axis.text(0, 1e-2, "smooth rays alone", ha="center", fontsize=8, color="#888888")
    else:
        axis.legend(fontsize=7, loc="upper left")
    axis.set_xlabel("degrees to the normal", fontsize=8)
    axis.tick_params(labelsize=7)
    axis.grid(alpha=0.25)


def _draw_albedo(axis: Any, material: AnyMaterial, seed: int) -> None:
    """How much of even light is seen, and of a beam goes through, over the angle to the normal."""
    degrees = np.array([0, 10, 20, 30, 40, 50, 60, 65, 70, 75, 80, 84, 87, 89.0])
    lights = np.stack([-np.sin(np.radians(degrees)), 0 * degrees, np.cos(np.radians(degrees))], axis=-1)
    found = scattering(material, lights, lights[:1], seed)
    for channel, (name, colour) in enumerate(CHANNELS):
        axis.plot(degrees, found.reflected[:, channel], color=colour, lw=1.3, label=f"{name} reflected")
        if found.transmitted.max() > 1e-4:
            axis.plot(degrees, found.transmitted[:, channel], "--", color=colour, lw=1.3, label=f"{name} let through")
    axis.axhline(1, color="#888888", lw=0.8)
    axis.set_ylim(0, max(1.05, 1.05 * float(found.reflected.max())))
    axis.set_xlim(0, 90)
    axis.set_title("albedo", fontsize=9)
    axis.set_xlabel("degrees to the normal", fontsize=8)
    axis.legend(fontsize=6)
    axis.tick_params(labelsize=7)
    axis.grid(alpha=0.25)


def _ball(
    material: AnyMaterial, ambient: float, towards: tuple[float, float, float] | None, samples: int, seed: int,
    progress: Progress,
) -> np.ndarray:  # fmt: skip
    """A ball of it (SIZE, SIZE, 3) uint8 under even light, with a round lamp in it or none."""
    directions = pixel_directions(LatLong(), 64)
    radiance = np.full((*directions.shape[:2], 3), ambient, np.float32)
    exposure = 0.8
    if towards is not None:
        radiance[directions @ np.array(towards) > np.cos(np.radians(_WIDE)) * np.linalg.norm(towards)] = _LAMP
        exposure = 0.8 / (0.7 * _LAMP * np.sin(np.radians(_WIDE)) ** 2 + ambient)
    camera = Camera.looking_at(np.array([0.0, 0.0, 8.0]), np.zeros(3), width=SIZE, height=SIZE, focal_length=3.6 * SIZE)
    scene = Scene(EnvironmentMap(radiance), objects=(Sphere((0.0, 0.0, 0.0), 1.0, material),))
    made = Mitsuba(samples=max(samples, 2)).render(scene, camera, seed=seed, progress=progress)
    # On grey paper, whatever the light behind it is.
    shown = made.radiance * made.matte[..., None] + 0.18 / exposure * (1 - made.matte[..., None])
    return develop(shown.astype(np.float32), Film(exposure)).pixels


def _is_directed(material: AnyMaterial) -> bool:
    return material.is_directed if isinstance(material, Ward) else bool(getattr(material, "anisotropy", 0.0))
