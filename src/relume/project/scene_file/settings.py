"""How a scene file is rendered: the settings, and the renderer that they allow and the scene needs."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Literal

from relume.image.radiance import RadianceMap
from relume.project.scene_file.metering import shines
from relume.project.scene_file.scene_file import SceneFile
from relume.scene.materials.whitted import WhittedMaterial

if TYPE_CHECKING:
    from relume.renderers.whitted.whitted import Whitted

RendererName = Literal["mitsuba", "prefiltered", "whitted", "radiosity", "irradiance-cache", "photon-map"]
FilterName = Literal["plain", "subdivision", "quadrilateral", "preintegrated", "mip"]
Shown = Literal["picture", "ray tree", "environment map"]
ALL: tuple[RendererName, ...] = ("mitsuba", "prefiltered", "whitted")
"""Those that may be chosen for a scene; the ones for teaching are only named."""
TAUGHT: tuple[RendererName, ...] = ("radiosity", "irradiance-cache", "photon-map")
"""Those for teaching: `rl.renderers`."""
FOR: dict[str, tuple[RendererName, ...]] = {
    "filter": ("prefiltered",),
    "plate": ("prefiltered",),
    "samples": ("mitsuba", *TAUGHT),
    "noise": ("mitsuba",),
    "denoise": ("mitsuba",),
    "seed": ("mitsuba", "whitted", *TAUGHT),
    "depth": ("mitsuba", "whitted"),
    "rays": ("whitted",),
    "contribution": ("whitted",),
    "constellation": ("whitted",),
    "subdivisions": ("whitted",),
    "tolerance": ("whitted",),
    "region": ("whitted",),
    "ray tree": ("whitted",),
    "environment map": ("mitsuba", "whitted"),
}
"""The renderers that a setting or a kind of picture means something to; what is not here means something to all."""


@dataclass(frozen=True, eq=False)
class RenderSettings:
    """How a scene file is rendered; None leaves a setting to the file, or to the renderer's own default.

    renderer : unless given, the first that the other settings allow and that can shade the scene
    filter : prefiltered: how a pixel reads the maps; preintegrated unless given
    plate : prefiltered: a radiance map of the picture's size, to matte the objects over
    samples : mitsuba: rays a pixel; 256 unless given. Those for teaching: 4 unless given, photon-map 16
    noise : mitsuba: stop earlier, once the mean error to be expected is below this share of the picture
    denoise : mitsuba: take the noise that is left out of the picture, by Open Image Denoise
    seed : of what is random; 0 unless given
    depth : mitsuba: bounces before a path ends; whitted: see `Whitted`
    rays, contribution, constellation : whitted: see `Whitted`
    subdivisions, tolerance : whitted: see `Antialiasing`
    region : whitted: left, top, right and bottom in pixels, the part of the picture that is rendered
    frames : of a scene without [sequence], or with `motion`: this many pictures of a motion. Of a sequence these of its
        frames, as "1-9x2,12"; all, or its first for one picture, unless given
    motion : of frames; a turntable unless given, or unless orbits of the file move its objects
    degrees : how far the motion goes; 360 unless given
    exposure : stops to brighten developed pictures by; at 0 they are metered by the scene's lights
    threads : all cores unless given
    """

    renderer: RendererName | None = None
    filter: FilterName | None = None
    plate: RadianceMap | None = None
    samples: int | None = None
    noise: float | None = None
    denoise: bool | None = None
    seed: int | None = None
    depth: int | None = None
    rays: int | None = None
    contribution: float | None = None
    constellation: int | None = None
    subdivisions: int | None = None
    tolerance: float | None = None
    region: tuple[int, int, int, int] | None = None
    frames: int | str | None = None
    motion: Literal["turntable", "orbit"] | None = None
    degrees: float | None = None
    exposure: float = 0.0
    threads: int | None = None

    def in_sequence(self, read: SceneFile) -> bool:
        """Whether the frames are those of the file's sequence, and not of a motion.

        read : the scene file, read
        """
        return read.sequence is not None and self.motion is None and self.degrees is None


def renderer_name(
    read: SceneFile, settings: RenderSettings, shown: Shown = "picture", *, moving: bool = False
) -> RendererName:
    """The renderer that the settings allow and the scene needs; raises ValueError where there is none.

    moving : whether it makes the frames of a motion, which are left to the faster ones where those can
    """
    from relume.renderers.mitsuba.scene import why_not

    left = _allowed(settings, shown)
    shapes = (*read.scene.local, *read.scene.objects)
    motion = moving and not settings.in_sequence(read) and len(left) > 1 and "mitsuba" in left
    if motion and not any(map(shines, shapes)) and _nothing_for_mitsuba_alone(read):
        left.remove("mitsuba")
    # What the scene needs: Whitted for its own table, materials and orbits, else light transport where that can.
    orbits = moving and read.moves and "mitsuba" not in left
    if read.asks_whitted or orbits or any(isinstance(shape.material, WhittedMaterial) for shape in shapes):
        wanted: RendererName = "whitted"
    elif why_not(read.scene) is None and "mitsuba" in left:
        wanted = "mitsuba"
    else:
        wanted = "whitted" if read.scene.lights else "prefiltered"
    # Whitted shades nearly everything in its way; the others refuse what they have no place for.
    if read.asks_whitted and "whitted" not in left and settings.renderer is None:
        raise ValueError(
            "the scene file's [whitted] table needs the renderer whitted, and a given setting is not for it; leave "
            "the setting out, or name the renderer"
        )
    if wanted not in left:
        wanted = "whitted" if "whitted" in left else left[0]
    if moving and read.moves and wanted == "prefiltered" and not settings.in_sequence(read):
        raise ValueError(
            "the scene file's orbits need the renderer whitted or mitsuba, not prefiltered; leave one of them out"
        )
    return wanted


def _nothing_for_mitsuba_alone(read: SceneFile) -> bool:
    """Whether the older renderers have a place for the scene's light and lens too."""
    from relume.scene.lights import RectangleLight, SphereLight
    from relume.scene.scene import Infinite

    scene = read.scene
    lamps = any(isinstance(light, SphereLight | RectangleLight) for light in scene.lights)
    near = not isinstance(scene.distant, Infinite)
    return not near and not lamps and scene.medium is None and read.camera.aperture == 0


def whitted_of(read: SceneFile, settings: RenderSettings) -> Whitted:
    """The scene file's Whitted renderer with the given settings; subdivisions bring antialiasing back."""
    from relume.renderers.whitted.antialiasing import Antialiasing

    def given(*names: str) -> dict[str, Any]:
        return {name: value for name in names if (value := getattr(settings, name)) is not None}

    method, finer = read.whitted, given("subdivisions", "tolerance")
    antialiasing = replace(method.antialiasing or Antialiasing(), **finer) if finer else method.antialiasing
    changed = given("depth", "rays", "contribution", "constellation", "threads")
    return replace(method, antialiasing=antialiasing, **changed)


def check_region(read: SceneFile, settings: RenderSettings) -> None:
    """Raises ValueError for a region that is no part of the picture."""
    if settings.region is not None:
        (left, top, right, bottom), camera = settings.region, read.camera
        if not (0 <= left < right <= camera.width and 0 <= top < bottom <= camera.height):
            raise ValueError(
                f"region {left},{top},{right},{bottom} is not a part of a picture of {camera.width}×{camera.height} "
                f"pixels; left and top begin at 0, right and bottom end at {camera.width} and {camera.height}"
            )


def check_plate(read: SceneFile, settings: RenderSettings) -> None:
    """Raises ValueError for a plate of another size than the picture."""
    camera, plate = read.camera, settings.plate
    if plate is not None and plate.size != (camera.width, camera.height):
        raise ValueError(
            f"the plate is {plate.size[0]}×{plate.size[1]} pixels, the picture {camera.width}×{camera.height}; "
            f"give the picture the size {plate.size[0]}x{plate.size[1]}"
        )


def _allowed(settings: RenderSettings, shown: Shown) -> list[RendererName]:
    """The renderers that every given setting is for, the preferred one first."""
    left: list[RendererName] = list(ALL) if settings.renderer is None else [settings.renderer]
    against = f"the renderer {settings.renderer} is given"
    for name, allowed in FOR.items():
        given = getattr(settings, name, None)
        if name != shown and (given is None or given is False):
            continue
        both: list[RendererName] = [each for each in left if each in allowed]
        whose = f"{name} is for the renderer {' or '.join(allowed)}"
        if not both:
            see = " (a plate under light transport: relume insert)" if name == "plate" else ""
            raise ValueError(f"{whose}, but {against}; leave one of them out{see}")
        if len(both) < len(left):
            left, against = both, whose
    return left
