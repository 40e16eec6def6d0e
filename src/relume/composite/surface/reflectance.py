"""Recovering the reflectance of the real surfaces from the photograph and the light (Debevec 1998, §7): un-lighting.

The diffuse part varies over a surface. It lives in the photograph's own pixels, as one image for all surfaces: what
the photograph shows, less the gloss, over the light that arrives there. That light includes what the surfaces send one
another, so rendering and dividing are repeated until it stops changing (§7, steps 2–5).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from math import sqrt

import numpy as np

from relume.composite.surface.by_rows import among, change_as_share, of_rows, within
from relume.composite.surface.clean_pixels import Enlarged, filled_in, trustworthy
from relume.composite.surface.gloss import FittedGloss, Gloss, fit_gloss, glossy
from relume.composite.surface.projection import Projected, projected, shining
from relume.composite.surface.recovery import (
    ConstantAlbedo,
    EstimatedGloss,
    KnownMaterial,
    RecoveredLocal,
    RecoveredSurface,
    Recovery,
    TexturedAlbedo,
    called,
)
from relume.composite.surface.two_views import ViewOfProbe
from relume.errors import warn
from relume.image.bands import BAND
from relume.image.radiance import RadianceMap
from relume.image.resizing import resized_rows
from relume.image.texture import as_rendered
from relume.renderers.mitsuba.denoise import smoothed
from relume.renderers.mitsuba.path_tracer import Mitsuba, give_back
from relume.renderers.raytrace.raycast import RayCaster
from relume.renderers.renderer import Renderer
from relume.renderers.results import Render
from relume.scene.cameras.camera import Camera, reprojected, undistorted
from relume.scene.materials.checks import triple
from relume.scene.materials.materials import Colour, Diffuse
from relume.scene.scene import Scene
from relume.scene.shapes.shapes import Plane, Shape

STEADY = 0.005
"""Share by which the arriving light may still change when the iteration ends."""
ITERATIONS = 8
"""At most: each takes the albedo's share (at most 0.9 of a closed white box) off the error, here half or less."""
COARSE = 192
"""Pixels across of the renders where nothing shadows a lone plane and its gloss is wide: what arrives varies slowly."""
FINE = 2_000_000
"""Pixels of the other renders, at most: what arrives is smoothed over a few pixels of such a picture anyway, and a
render of a large plate takes memory and time by its pixels."""
WIDE = 0.2
"""Roughness from which on a gloss is wide: its lobe spans 2 α = 5°, some ten pixels of such a render."""
FEW = 0.05
"""Share of a surface below which albedos outside of 0 … 1 are noted and not warned of: things that really stand on a
table, and their reflections in it, are in its pixels (2.9 % of the table of examples/room), and the median stays."""
HARDLY = 1e-4
"""Of a surface's pixels: so few albedos out of range are not worth a word."""
FEWEST_PIXELS = 100
"""Of a surface, to say anything about it."""


class _Work:
    """Renders of the model, at the plate's size or, where nothing in them is sharp or the plate is large, smaller."""

    def __init__(
        self, renderer: Renderer, camera: Camera, scene: Scene, seed: int, whole: np.ndarray, fine: bool
    ) -> None:
        shrunk = min(1.0, sqrt(FINE / (camera.width * camera.height)))
        wide = round(camera.width * shrunk) if fine else min(camera.width, COARSE)
        self.camera = camera.resized(wide, max(1, round(camera.height * wide / camera.width)))
        self.renderer, self.scene, self.seed, self.full = renderer, scene, seed, camera
        self.smaller = self.camera.width != camera.width
        # Which surface the pixels show, of the plate and of the renders.
        self.whole, self.apart = whole, fine
        self.parts = _parts(scene, self.camera) if self.smaller else whole

    def render(self, local: Sequence[Shape]) -> Render:
        # Renderers have pinholes: what such a one sees is bent afterwards as the lens bends it.
        straight = undistorted(self.camera)
        rendered = self.renderer.render(self.scene.with_local(local), straight, seed=self.seed)
        give_back()  # the plate as the surfaces' texture
        if straight is self.camera:
            return rendered
        planes = ("radiance", "variance", "matte", "depth", "normal", "albedo")
        bent = {name: np.nan_to_num(reprojected(getattr(rendered, name), straight, self.camera)) for name in planes}
        return replace(rendered, rays=None, **bent)

    def enlarged(self, picture: np.ndarray, inside: np.ndarray) -> np.ndarray | Enlarged:
        """A smooth picture (h, w, 3) at the plate's size; what is not `inside` (h, w) does not bleed in."""
        if not self.smaller:
            return picture

        def filled(known: np.ndarray) -> np.ndarray:
            return filled_in(picture, known, np.zeros(inside.shape, int))

        if not self.apart:
            return Enlarged([(None, filled(inside))], self.whole)
        # Nor does a surface into one that hides it. One too thin for the small picture gets what is beside it.
        shown = np.unique(self.parts)
        thin = not among(self.whole, shown).all()
        pictures: list[tuple[int | None, np.ndarray]] = [(None, filled(inside))] if thin else []
        pictures += [(int(part), filled(inside & (self.parts == part))) for part in np.unique(self.parts[inside])]
        return Enlarged(pictures, self.whole)

    def shrunk(self, rows: Callable[[slice], np.ndarray]) -> np.ndarray:
        """A picture (H, W, 3) of the plate's size, given by its rows, as the renders show it."""
        height, width = self.whole.shape
        if not self.smaller:
            return rows(slice(0, height))
        return resized_rows(rows, (width, height), self.camera.width, self.camera.height)


def recover_reflectance(
    plate: RadianceMap,
    camera: Camera,
    scene: Scene,
    wanted: Sequence[Recovery] | None = None,
    *,
    probe: ViewOfProbe | None = None,
    renderer: Renderer = Mitsuba(samples=64, depth=6),
    seed: int = 0,
    progress: Callable[[float], None] = lambda share: None,
) -> RecoveredLocal:
    """Find the reflectance of the scene's real surfaces, so that the model without objects looks like the plate.

    plate, camera : in the unit of the scene's light, and what took it, of the same size
    scene : its light, distant scene, lights and local surfaces; objects are left out
    wanted : one for each local surface; a matte surface of varying albedo each unless given
    probe : how well the light's map shows the surfaces themselves, for an estimated gloss; None where it does not
    renderer : 64 rays a pixel, as the light is smoothed; its six bounces leave out less than 0.5 % for albedos to 0.4
    seed : of the renders; the same gives the same reflectance
    progress : called with the share of the work that is done, 0 to 1

    Albedos above 1 and below 0 are reported with their place: in the notes where they are few, else by a warning.
    Raises ValueError where a surface is hardly seen or not lit. Source: Debevec 1998, §7.
    """
    # Which pixels of the plate show which surface.
    wanted = [Recovery()] * len(scene.local) if wanted is None else wanted
    scene = scene.without_objects()
    parts = _parts(scene, camera)
    usable = [trustworthy(parts == index, plate.clipped) for index in range(len(wanted))]
    _require_seen(plate, camera, scene, wanted, usable)
    unknown = [i for i, wish in enumerate(wanted) if not isinstance(wish.albedo, KnownMaterial)]
    looks = _Looks.of_scene(scene, camera, wanted)

    # The gloss of each surface.
    fits = [
        fit_gloss(plate, camera, _lit_by_others(scene, index, camera, plate, parts), 0, usable[index], probe, seed=seed)
        if isinstance(wish.gloss, EstimatedGloss) and not isinstance(wish.albedo, KnownMaterial) else None
        for index, wish in enumerate(wanted)
    ]  # fmt: skip
    given = [None if isinstance(wish.gloss, EstimatedGloss) else wish.gloss for wish in wanted]
    glosses = [known if fit is None else fit.gloss for fit, known in zip(fits, given, strict=True)]
    notes = [f"{called(scene.local, i)}: {note}" for i, fit in enumerate(fits) if fit for note in fit.notes]
    progress(0.2)

    # The model in grey, and in black: what is left when nothing is diffuse is gloss, and all that is not recovered.
    grey, none = (np.broadcast_to(np.float32(value), plate.radiance.shape) for value in (0.5, 0.0))
    black = [(0.0, 0.0, 0.0)] * len(wanted)
    even = [(0.5, 0.5, 0.5)] * len(wanted)
    alone = _alone(scene)
    fine = not alone or any(gloss is not None and gloss.roughness < WIDE for gloss in glosses)
    work = _Work(renderer, camera, scene, seed, parts, fine)
    recovered, inside = among(parts, unknown), among(work.parts, unknown)
    first = work.render(looks.shapes(grey, even, glosses))
    dark = np.zeros_like(first.radiance)
    if len(unknown) < len(wanted) or any(gloss is not None for gloss in glosses) or scene.medium is not None:
        dark = work.render(looks.shapes(none, black, glosses)).radiance
    sheen = work.enlarged(smoothed(dark, first.normal, work.parts), inside)

    def arriving(radiance: np.ndarray, shown: np.ndarray | float) -> np.ndarray:
        """π · diffuse radiance / albedo, smoothed, where surfaces are to be recovered; 0 elsewhere."""
        light = np.where(inside[..., None], np.pi * (radiance - dark) / np.maximum(shown, 0.01), 0)
        light = work.enlarged(smoothed(light, first.normal, work.parts), inside)
        return of_rows(within, recovered[..., None], light)

    # Divide the plate by the light that arrives and render again, until that light stops changing.
    light, iterations, change = arriving(first.radiance, 0.5), 1, 0.0
    progress(0.5)
    while True:
        for index in unknown:
            _require_lit(scene.local, index, light, usable[index])
        raw = of_rows(_unlit, plate.radiance, sheen, light)
        albedo, colours = _albedo(raw, light, parts, usable, wanted)
        if not unknown or alone or iterations >= ITERATIONS or (iterations > 1 and change < STEADY):
            break
        picture = work.render(looks.shapes(albedo, colours, glosses))
        shown = work.shrunk(partial(_shown, albedo, parts, wanted, colours))
        del raw, albedo  # hundreds of megabytes each
        again = arriving(picture.radiance, shown)
        iterations += 1
        change, light = change_as_share(again, light, recovered), again
        progress(min(0.5 + 0.1 * iterations, 0.95))
    if iterations >= ITERATIONS and change >= STEADY:
        notes.append(f"the light between the surfaces still changed by {change:.1%} after {iterations} rounds")
    notes += _doubts(scene.local, wanted, raw, usable)

    # What was found of each surface, and the model's picture.
    surfaces = []
    for index in range(len(wanted)):
        shapes = looks.of(index, albedo, colours[index], glosses[index])
        lit = usable[index] & _lit(light, usable[index]) if index in unknown else None
        surfaces.append(_surface(raw, lit, colours[index], glosses[index], fits[index], shapes))
    del raw  # hundreds of megabytes
    model = partial(_lit_again, wanted, colours)
    without = of_rows(model, recovered[..., None], sheen, albedo, parts, light, work.enlarged(first.radiance, ~inside))
    progress(1.0)
    textured = among(parts, [i for i, wish in enumerate(wanted) if isinstance(wish.albedo, TexturedAlbedo)])
    return RecoveredLocal(tuple(surfaces), albedo, without, textured, light, iterations, change, tuple(notes))


def _unlit(shown: np.ndarray, gloss: np.ndarray, arrives: np.ndarray) -> np.ndarray:
    return np.pi * (shown - gloss) / np.maximum(arrives, 1e-30)


def _lit_again(
    wanted: Sequence[Recovery], colours: Sequence[Colour], recovered: np.ndarray, gloss: np.ndarray, albedo: np.ndarray,
    parts: np.ndarray, arrives: np.ndarray, elsewhere: np.ndarray,
) -> np.ndarray:  # fmt: skip
    return np.where(recovered, gloss + _with_even(albedo, parts, wanted, colours) * arrives / np.pi, elsewhere)


def _lit_by_others(scene: Scene, index: int, camera: Camera, plate: RadianceMap, parts: np.ndarray) -> Scene:
    """The scene for the gloss of one surface, its first, which the others light: they shine as the plate shows them."""
    return scene.with_local(shining(scene.local, index, camera, plate.radiance, parts))


def _require_seen(
    plate: RadianceMap, camera: Camera, scene: Scene, wanted: Sequence[Recovery], usable: Sequence[np.ndarray]
) -> None:  # fmt: skip
    if len(wanted) != len(scene.local):
        raise ValueError(f"{len(wanted)} choices for {len(scene.local)} local surfaces; give one for each")
    if plate.size != (camera.width, camera.height):
        raise ValueError(f"a plate of {plate.size} for a camera of {camera.width}×{camera.height}; give one size")
    for index, wish in enumerate(wanted):
        if not isinstance(wish.albedo, KnownMaterial) and usable[index].sum() < FEWEST_PIXELS:
            raise ValueError(
                f"the camera sees {usable[index].sum()} measured pixels of {called(scene.local, index)}; "
                "give its reflectance instead"
            )


def _surface(
    raw: np.ndarray, lit: np.ndarray | None, colour: Colour, gloss: Gloss | None, fit: FittedGloss | None,
    shapes: tuple[Shape, ...],
) -> RecoveredSurface:  # fmt: skip
    """What was found of a surface, from the albedos (H, W, 3) where it is lit; `lit` is None for one that was given."""
    if lit is None:
        return RecoveredSurface(None, None, None, 0, None, None, shapes)
    # A channel at a time: a whole plate's values are copied and ordered for it.
    each = [
        np.percentile(raw[..., channel][lit].astype(np.float64), [16, 50, 84], overwrite_input=True)
        for channel in range(3)
    ]
    low, middle, high = np.stack(each, axis=-1)
    return RecoveredSurface(colour, triple(middle), triple((high - low) / 2), int(lit.sum()), gloss, fit, shapes)


@dataclass(frozen=True, eq=False)
class _Looks:
    """The local scene's shapes for albedos and glosses."""

    local: tuple[Shape, ...]
    wanted: Sequence[Recovery]
    pieces: list[Projected]

    @staticmethod
    def of_scene(scene: Scene, camera: Camera, wanted: Sequence[Recovery]) -> _Looks:
        pieces = [
            Projected(None, None) if isinstance(wish.albedo, KnownMaterial)
            else projected(shape, camera, [other for other in scene.local if other is not shape])
            for shape, wish in zip(scene.local, wanted, strict=True)
        ]  # fmt: skip
        return _Looks(scene.local, wanted, pieces)

    def of(self, index: int, albedo: np.ndarray, mean: Colour, gloss: Gloss | None) -> tuple[Shape, ...]:
        if isinstance(self.wanted[index].albedo, KnownMaterial):
            return (self.local[index],)
        piece = self.pieces[index]
        image = mean if isinstance(self.wanted[index].albedo, ConstantAlbedo) else albedo
        return tuple(
            replace(mesh, material=Diffuse(value) if gloss is None else glossy(value, gloss))
            for mesh, value in ((piece.seen, image), (piece.unseen, mean))
            if mesh is not None
        )

    def shapes(self, albedo: np.ndarray, means: Sequence[Colour], glosses: Sequence[Gloss | None]) -> list[Shape]:
        return [shape for i in range(len(self.local)) for shape in self.of(i, albedo, means[i], glosses[i])]


def _parts(scene: Scene, camera: Camera) -> np.ndarray:
    """(H, W) int: which local surface the middle of each pixel shows; −1 for none."""
    caster = RayCaster.of(scene.local)
    parts, across = np.empty((camera.height, camera.width), np.int32), np.arange(camera.width) + 0.5
    step = max(1, BAND // camera.width)
    for top in range(0, camera.height, step):
        down = np.arange(top, min(top + step, camera.height)) + 0.5
        points = np.stack(np.broadcast_arrays(across[None, :], down[:, None]), axis=-1)
        hits = caster.nearest(camera.eyes(points).reshape(-1, 3), camera.rays_through(points).reshape(-1, 3))
        parts[top : top + step] = hits.shape.reshape(points.shape[:2])
    return parts


def _alone(scene: Scene) -> bool:
    """Whether the surfaces cannot light one another: a single plane, which sees none of itself."""
    return scene.medium is None and len(scene.local) == 1 and isinstance(scene.local[0], Plane)


def _lit(light: np.ndarray, usable: np.ndarray) -> np.ndarray:
    """Where enough light arrives to divide by: a fiftieth of the surface's median in every channel."""
    return np.all(light > 0.02 * _medians(light, usable), axis=-1)


def _medians(picture: np.ndarray, chosen: np.ndarray) -> np.ndarray:
    """(3,) of the chosen pixels, a channel at a time: a whole plate's values are copied and ordered for it."""
    return np.array(
        [np.median(picture[..., channel][chosen], overwrite_input=True) for channel in range(3)], picture.dtype
    )


def _require_lit(local: Sequence[Shape], index: int, light: np.ndarray, usable: np.ndarray) -> None:
    if not np.all(_medians(light, usable) > 0):
        raise ValueError(
            f"no light arrives at {called(local, index)} in the model, so its reflectance cannot be recovered; "
            "check that the light's map is turned the right way up, or give the reflectance"
        )


def _albedo(
    raw: np.ndarray, light: np.ndarray, parts: np.ndarray, usable: list[np.ndarray], wanted: Sequence[Recovery]
) -> tuple[np.ndarray, list[Colour]]:
    """The image of albedos, complete, and each surface's median."""
    known, colours = np.zeros(parts.shape, bool), []
    for index, wish in enumerate(wanted):
        if isinstance(wish.albedo, KnownMaterial):
            colours.append((0.0, 0.0, 0.0))
            continue
        lit = usable[index] & _lit(light, usable[index])
        known |= lit
        middle = [np.median(raw[..., channel][lit].astype(np.float64), overwrite_input=True) for channel in range(3)]
        colours.append(triple(np.clip(middle, 0, 1)))
    return filled_in(np.clip(raw, 0, 1).astype(np.float32, copy=False), known, parts, own=True), colours


def _shown(
    albedo: np.ndarray, parts: np.ndarray, wanted: Sequence[Recovery], colours: Sequence[Colour], rows: slice
) -> np.ndarray:
    """Rows of the albedos as a render of them shows them."""
    larger = slice(max(rows.start - 1, 0), rows.stop + 1)
    soft = as_rendered(albedo[larger])[rows.start - larger.start :][: rows.stop - rows.start]
    return _with_even(soft, parts[rows], wanted, colours)


def _with_even(
    albedo: np.ndarray, parts: np.ndarray, wanted: Sequence[Recovery], colours: Sequence[Colour]
) -> np.ndarray:
    result = albedo
    for index, wish in enumerate(wanted):
        if isinstance(wish.albedo, ConstantAlbedo):
            result = np.where((parts == index)[..., None], np.array(colours[index], np.float32), result)
    return result


def _doubts(local: Sequence[Shape], wanted: Sequence[Recovery], raw: np.ndarray, usable: list[np.ndarray]) -> list[str]:
    """Warn of albedos that cannot be where they are many; notes of them where they are few."""
    notes = []
    for index, wish in enumerate(wanted):
        if isinstance(wish.albedo, KnownMaterial):
            continue
        above = usable[index] & np.any(raw > 1, axis=-1)
        below = usable[index] & np.any(raw < 0, axis=-1)
        for where, fault, why in (
            (above, f"comes out above 1, up to {raw[above].max(initial=1):.2f}", "is the light underestimated there "
             "(a lamp clipped in the probe, another unit), or does the plate show something that shines?"),
            (below, "comes out below 0", "probably something stands there, or is reflected there, that the shot file "
             "does not describe; describe it as [[local]]"),
        ):  # fmt: skip
            # A pixel or two of thousands are noise.
            if where.sum() <= HARDLY * usable[index].sum():
                continue
            rows, columns = np.nonzero(where)
            box = f"x {columns.min()}–{columns.max()}, y {rows.min()}–{rows.max()}"
            share = where.sum() / usable[index].sum()
            place = f"{where.sum()} pixels ({share:.1%} of it) within {box}"
            line = f"the albedo of {called(local, index)} {fault}, in {place}, and is held to 0 … 1: {why}"
            if share < FEW:
                notes.append(line)
            else:
                # What it is held by, of the light that this surface sends on.
                held = np.maximum(raw[where] - 1, -raw[where]).clip(0, 1).max(-1)
                warn(line, float(share * held.mean()))
    return notes
