"""Un-lighting with several photographs: one reflectance for each place of the surfaces, from all that show it.

Each photograph has its own camera and its own light: another probe, another time of day, lamps moved. Each is un-lit by
itself first (`recover_reflectance`), which gives the light that arrives in it. A place's diffuse reflectance then is
the one that explains all of them (least squares by variance): where one photograph has it in shadow, clipped or noisy,
another counts. Where they see the place from several sides its gloss follows too (`varying_gloss`).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from relume.composite.surface.clean_pixels import filled_in, trustworthy
from relume.composite.surface.gloss import Gloss
from relume.composite.surface.recovery import (
    EstimatedGloss,
    KnownMaterial,
    RecoveredLocal,
    Recovery,
    TexturedAlbedo,
    called,
)
from relume.composite.surface.reflectance import recover_reflectance
from relume.composite.surface.two_views import MOST, normals_at, shown_at, values_at
from relume.composite.surface.varying_gloss import Observations, VaryingGloss, fit_varying_gloss, gloss_lights
from relume.errors import GatheredDoubts
from relume.image.radiance import RadianceMap
from relume.renderers.mitsuba.lobes import arriving, ready
from relume.renderers.mitsuba.path_tracer import Mitsuba
from relume.renderers.raytrace.raycast import RayCaster
from relume.renderers.renderer import Renderer
from relume.scene.cameras.camera import Camera
from relume.scene.materials.checks import triple
from relume.scene.materials.materials import Diffuse, Material
from relume.scene.scene import Scene
from relume.scene.shapes.shapes import Shape

MODEL = 0.03
"""Share by which a light and a model of a place are off, beside the photograph's noise: dark places count for less."""
LIT = 0.02
"""Of the greatest light that arrives at a surface, from which on a photograph says something of its reflectance."""
DRAWS = 4
"""Sets of directions that a gloss is found with."""
SIDE = 4
"""Places along each side of a neighbourhood that shares a gloss."""
DISAGREE = 3.0
"""Errors from which on photographs do not agree about a place."""
MANY = 0.05
"""Share of a surface's places from which on that is said."""


@dataclass(frozen=True, eq=False)
class LitView:
    """A photograph of the surfaces, from somewhere and in some light.

    plate : of the camera's size, in the unit of its light; its variance weighs it where it is known
    scene : its light and the local surfaces, the same in all views and in one order
    """

    plate: RadianceMap
    camera: Camera
    scene: Scene


@dataclass(frozen=True, eq=False)
class JointRecovery:
    """The local scene, un-lit by several photographs, in the pixels of the first.

    local : as one photograph gives it; `shapes` have maps of gloss where it was found
    error : (H, W, 3) float32, standard deviation of the albedo; infinite where no photograph says it
    views : (H, W) uint8, how many photographs each pixel's place was taken from
    gloss : of each surface, None where it was not asked for
    roughness, f0 : (H, W) and (H, W, 3) float32, of the gloss, 0 where there is none
    metal : (H, W) bool
    notes : a line each
    """

    local: RecoveredLocal
    error: np.ndarray
    views: np.ndarray
    gloss: tuple[VaryingGloss | None, ...]
    roughness: np.ndarray
    f0: np.ndarray
    metal: np.ndarray
    notes: tuple[str, ...]


def recover_from_views(
    views: Sequence[LitView],
    wanted: Sequence[Recovery] | None = None,
    *,
    renderer: Renderer = Mitsuba(samples=64, depth=6),
    seed: int = 0,
    progress: Callable[[float], None] = lambda share: None,
) -> JointRecovery:
    """Find the reflectance of real surfaces that several photographs show, in the pixels of the first.

    wanted : one for each local surface, as for `recover_reflectance`. An `EstimatedGloss` becomes a map of F₀ and
        roughness, and of metals, where two or more photographs show the surface from several sides
    renderer : of the light that arrives; the same reasons as in `recover_reflectance`

    Albedos are Σ w L E/π over Σ w (E/π)², by the variance of what each photograph shows. Places that photographs do not
    agree about are in the notes. Raises ValueError for fewer than two views, for surfaces that differ between them, and
    what `recover_reflectance` raises for the first.
    """
    wanted = [Recovery()] * len(views[0].scene.local) if views and wanted is None else list(wanted or ())
    _require_alike(views)
    # Each photograph by itself: the light that arrives, and what of it a known gloss reflects.
    matte = [replace(each, gloss=None) if isinstance(each.gloss, EstimatedGloss) else each for each in wanted]
    alone = []
    for number, view in enumerate(views):
        # What one photograph finds too bright or too dark is no fault before the others have had their say.
        with GatheredDoubts():
            alone.append(recover_reflectance(view.plate, view.camera, view.scene, matte, renderer=renderer, seed=seed))
        progress(0.7 * (number + 1) / len(views))
    first = views[0]
    places = _Places.of(first)
    unknown = [i for i, wish in enumerate(wanted) if not isinstance(wish.albedo, KnownMaterial)]
    wants_gloss = [isinstance(wish.gloss, EstimatedGloss) and i in unknown for i, wish in enumerate(wanted)]
    # The gloss, and what each place sends of it.
    shape = places.parts.shape
    roughness, f0, metal = np.zeros(shape, np.float32), np.zeros((*shape, 3), np.float32), np.zeros(shape, bool)
    sheens = [_Sheen(np.zeros((*shape, 3)), np.ones(shape)) for _ in views]
    found: list[VaryingGloss | None] = []
    notes: list[str] = []
    for index, wish in enumerate(wants_gloss):
        fit = None
        if wish:
            fit = _gloss_of(views, places, index, seed, (roughness, f0, metal), sheens)
            notes += _about_gloss(fit, called(first.scene.local, index))
        found.append(fit)
    progress(0.9)
    # One albedo for all of them.
    albedo, error, count, off = _joined(views, alone, places, np.isin(places.parts, unknown), sheens)
    albedo[metal] = 0.0
    known = count > 0
    beyond = np.any((albedo < -MODEL) | (albedo > 1 + MODEL), axis=-1) & known & ~metal
    for index in unknown:
        seen = known & (places.parts == index)
        if (held := float((beyond & seen).sum() / max(seen.sum(), 1))) > MANY:
            notes.append(
                f"the albedo of {held:.0%} of {called(first.scene.local, index)} comes out below 0 or above 1 and is "
                "held there: are plates and lights on one scale?"
            )
        share = float((off & seen & ~metal).sum() / max(seen.sum(), 1))
        if share > MANY:
            notes.append(
                f"the photographs do not agree about {share:.0%} of {called(first.scene.local, index)}: is a light or "
                "a camera wrong, does something stand there in one of them, or is it glossy (gloss = recover)?"
            )
    whole = filled_in(np.clip(albedo, 0, 1).astype(np.float32), known, places.parts)
    local = _local_of(alone[0], places, whole, known, wanted, found, (roughness, f0, metal))
    progress(1.0)
    error = np.where(known[..., None], error, np.inf).astype(np.float32)
    return JointRecovery(local, error, count.astype(np.uint8), tuple(found), roughness, f0, metal, tuple(notes))


def _require_alike(views: Sequence[LitView]) -> None:
    if len(views) < 2:
        raise ValueError(f"{len(views)} photographs; a reflectance from several needs two or more")
    for number, view in enumerate(views[1:], 2):
        if len(view.scene.local) != len(views[0].scene.local):
            raise ValueError(
                f"photograph {number} has {len(view.scene.local)} local surfaces and the first "
                f"{len(views[0].scene.local)}; give the same ones in one order"
            )
        if view.plate.unit != view.scene.light.unit:
            raise ValueError(f"photograph {number} is in {view.plate.unit}, its light in {view.scene.light.unit}")


@dataclass(frozen=True, eq=False)
class _Sheen:
    """What the gloss of each pixel's place sends to a view (H, W, 3), and the share (H, W) the base under it sends."""

    gloss: np.ndarray
    passed: np.ndarray


@dataclass(frozen=True, eq=False)
class _Places:
    """What the pixels of the first view show.

    parts : (H, W) int, the local surface; −1 for none
    points : (H, W, 3), metres
    """

    parts: np.ndarray
    points: np.ndarray

    @staticmethod
    def of(view: LitView) -> _Places:
        rays, eyes = view.camera.rays(), view.camera.eyes(view.camera.middles())
        hits = RayCaster.of(view.scene.local).nearest(eyes.reshape(-1, 3), rays.reshape(-1, 3))
        parts = hits.shape.reshape(rays.shape[:2])
        distance = np.where(parts >= 0, hits.distance.reshape(parts.shape), 0.0)
        return _Places(parts, eyes + distance[..., None] * rays)

    def shown_by(self, view: LitView, index: int, chosen: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Of places chosen (N,) of a surface, where a view has them, shares of its picture (N, 2); which it shows."""
        camera, points = view.camera, self.points.reshape(-1, 3)[chosen]
        caster = RayCaster.of(view.scene.local)
        usable = trustworthy(_Places.of(view).parts == index, view.plate.clipped)
        at = camera.project(points)
        shown = shown_at(camera, caster, points, at, usable, index)
        return np.nan_to_num(at) / [camera.width, camera.height], shown


def _joined(
    views: Sequence[LitView], alone: Sequence[RecoveredLocal], places: _Places, wanted: np.ndarray,
    sheens: Sequence[_Sheen],
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:  # fmt: skip
    """Albedo, its error, how many views say it, and where they do not agree, at the first view's pixels."""
    size = places.parts.size
    above, below, square = (np.zeros((size, 3)) for _ in range(3))
    count = np.zeros(size, int)
    for index in np.unique(places.parts[wanted]):
        chosen = np.flatnonzero((places.parts == index).ravel())
        for view, un_lit, sheen in zip(views, alone, sheens, strict=True):
            at, shown = places.shown_by(view, int(index), chosen)
            mirrored = un_lit.without - un_lit.albedo * un_lit.irradiance / np.pi
            radiance = values_at(view.plate.radiance - mirrored, at) - sheen.gloss.reshape(-1, 3)[chosen]
            arrives = values_at(un_lit.irradiance, at) / np.pi * sheen.passed.reshape(-1, 1)[chosen]
            # The most light on what this view shows: elsewhere its pixels are of other surfaces.
            greatest = arrives[shown].max(axis=0, initial=0.0)
            # The noise, and a light that is off by a few per cent; of shadows both say little.
            whole = values_at(view.plate.radiance, at)
            variance = (MODEL * whole) ** 2 + (MODEL * LIT * greatest) ** 2
            if view.plate.variance is not None:
                variance += values_at(view.plate.variance, at)
            shown &= np.all(arrives > LIT * greatest, axis=-1)
            weight = shown[:, None] / np.maximum(variance, 1e-30)
            above[chosen] += weight * radiance * arrives
            below[chosen] += weight * arrives**2
            square[chosen] += weight * radiance**2
            count[chosen] += shown
    albedo = above / np.maximum(below, 1e-30)
    # χ² per freedom: what the best albedo leaves.
    left = np.maximum(square - above * albedo, 0).mean(axis=-1) / np.maximum(count - 1, 1)
    error = np.sqrt(np.maximum(left, 1))[:, None] / np.sqrt(np.maximum(below, 1e-30))
    shape = places.parts.shape
    off = (count > 1) & (left > DISAGREE**2)
    return albedo.reshape(*shape, 3), error.reshape(*shape, 3), count.reshape(shape), off.reshape(shape)


def _gloss_of(
    views: Sequence[LitView], places: _Places, index: int, seed: int,
    maps: tuple[np.ndarray, np.ndarray, np.ndarray], sheens: Sequence[_Sheen],
) -> VaryingGloss | None:  # fmt: skip
    """The gloss of a surface, put into maps of roughness, F₀ and metal, and what it sends to each view into `sheens`.

    None where fewer than two views show it.
    """
    shape = places.parts.shape
    mine = places.parts == index
    step = max(1, int(np.sqrt(mine.sum() / MOST)))
    row, column = np.nonzero(mine)
    chosen = np.flatnonzero(mine.ravel())[(row % step == step // 2) & (column % step == step // 2)]
    points = places.points.reshape(-1, 3)[chosen]
    seen = [places.shown_by(view, index, chosen) for view in views]
    several = np.sum([shown for _, shown in seen], axis=0) >= 2
    if several.sum() < SIDE**2:
        return None
    chosen, points = chosen[several], points[several]
    seen = [(at[several], shown[several]) for at, shown in seen]
    normals = normals_at(views[0].scene, index, views[0].camera.eyes_towards(points), points)
    radiance, variance, drawn = [], [], []
    for number, (view, (at, shown)) in enumerate(zip(views, seen, strict=True)):
        radiance.append(np.where(shown[:, None], values_at(view.plate.radiance, at), np.nan))
        noise = view.plate.variance
        variance.append(np.zeros((len(points), 3)) if noise is None else values_at(noise, at))
        drawn.append(_lights_of(view, index, points, normals, seed + DRAWS * number))
    rows, columns = np.unravel_index(chosen, shape)
    cells = (rows // (SIDE * step)) * shape[1] + columns // (SIDE * step)
    groups = np.unique(cells, return_inverse=True)[1].reshape(-1)
    fit = fit_varying_gloss(Observations(np.stack(radiance), np.stack(variance), groups), [light for light, _ in drawn])
    # Over all of the surface, smoothly between the places.
    at_places = np.concatenate(
        [fit.roughness[groups, None], fit.f0[groups], fit.metal[groups, None].astype(float),
         *(_sent(light, even, fit, groups) for light, even in drawn)], axis=-1,
    )  # fmt: skip
    picture, known = np.zeros((places.parts.size, at_places.shape[1]), np.float32), np.zeros(places.parts.size, bool)
    picture[chosen], known[chosen] = at_places, True
    picture = filled_in(picture.reshape(*shape, -1), known.reshape(shape), np.where(mine, 0, -1))
    maps[0][mine], maps[1][mine], maps[2][mine] = picture[mine, 0], picture[mine, 1:4], picture[mine, 4] > 0.5
    for number, sheen in enumerate(sheens):
        sheen.gloss[mine] = picture[mine, 5 + 4 * number : 8 + 4 * number]
        sheen.passed[mine] = picture[mine, 8 + 4 * number]
    return fit


def _lights_of(
    view: LitView, index: int, points: np.ndarray, normals: np.ndarray, seed: int
) -> tuple[Callable[[Gloss], tuple[np.ndarray, np.ndarray]], np.ndarray]:  # fmt: skip
    """The gloss and the base that places send to a view, and (N, 3) what white matte ones would: means over several
    sets of directions."""
    surface = view.scene.local[index]
    scene = ready(view.scene.with_local([surface, *(each for each in view.scene.local if each is not surface)]))
    eyes = view.camera.eyes_towards(points)
    arrived = [arriving(scene, points, normals, eyes, seed=seed + k) for k in range(DRAWS)]
    drawn = [gloss_lights(each.gloss_and_base) for each in arrived]
    even = np.mean([each.reflected(Diffuse((1.0, 1.0, 1.0))) for each in arrived], axis=0)

    @lru_cache(64)
    def mean(gloss: Gloss) -> tuple[np.ndarray, np.ndarray]:
        parts = [light(gloss) for light in drawn]
        return np.mean([part[0] for part in parts], axis=0), np.mean([part[1] for part in parts], axis=0)

    return mean, even


def _sent(
    light: Callable[[Gloss], tuple[np.ndarray, np.ndarray]], even: np.ndarray, fit: VaryingGloss, groups: np.ndarray
) -> np.ndarray:
    """(N, 4) what places of the fitted gloss send of it, linear in F₀, and the share that the base under it sends."""
    tried = np.linspace(0.1, 0.85, 16)
    nearest = np.argmin(np.abs(fit.roughness[groups][:, None] - tried), axis=-1)
    result = np.zeros((len(groups), 4))
    for number in np.unique(nearest):
        some = nearest == number
        low, high = (light(Gloss(f0, float(tried[number]))) for f0 in (0.02, 0.06))
        result[some, :3] = low[0][some] + (fit.f0[groups][some] - 0.02) * (high[0][some] - low[0][some]) / 0.04
        passed = (low[1] + high[1])[some].sum(axis=-1) / np.maximum(2 * even[some].sum(axis=-1), 1e-30)
        result[some, 3] = np.clip(passed, 0, 1)
    return result


def _about_gloss(fit: VaryingGloss | None, name: str) -> list[str]:
    if fit is None:
        return [f"fewer than two photographs show {name}, so its gloss is not determined and it is taken as matte"]
    lines = []
    if not fit.determined.all():
        lines.append(
            f"the gloss of {1 - fit.determined.mean():.0%} of {name} is not determined by these photographs and is "
            "partly what surfaces usually have; take them from more sides, or where a lamp is mirrored"
        )
    if fit.metal.any():
        colour = triple(np.median(fit.f0[fit.metal], axis=0))
        error = float(np.median(fit.f0_error[fit.metal]))
        words = ", ".join(f"{value:.2f}" for value in colour)
        lines.append(f"{fit.metal.mean():.0%} of {name} is metal, of F₀ {words} ± {error:.2f}")
    return lines


def _local_of(
    alone: RecoveredLocal, places: _Places, albedo: np.ndarray, known: np.ndarray, wanted: Sequence[Recovery],
    found: Sequence[VaryingGloss | None], maps: tuple[np.ndarray, np.ndarray, np.ndarray],
) -> RecoveredLocal:  # fmt: skip
    """The first photograph's recovery with what all of them say."""
    surfaces = []
    for index, (surface, wish) in enumerate(zip(alone.surfaces, wanted, strict=True)):
        mine = known & (places.parts == index)
        if isinstance(wish.albedo, KnownMaterial) or not mine.any():
            surfaces.append(surface)
            continue
        low, middle, high = np.percentile(albedo[mine].astype(np.float64), [16, 50, 84], axis=0)
        image = albedo if isinstance(wish.albedo, TexturedAlbedo) else triple(middle)
        shapes = tuple(_with(shape, image, triple(middle), found[index], maps) for shape in surface.shapes)
        surfaces.append(
            replace(
                surface,
                reflectance=triple(middle),
                measured=triple(middle),
                spread=triple((high - low) / 2),
                pixels=int(mine.sum()),
                shapes=shapes,
            )
        )
    return replace(alone, surfaces=tuple(surfaces), albedo=albedo, notes=alone.notes)


def _with(
    shape: Shape, image: np.ndarray | tuple[float, float, float], middle: tuple[float, float, float],
    fit: VaryingGloss | None, maps: tuple[np.ndarray, np.ndarray, np.ndarray],
) -> Shape:  # fmt: skip
    """A piece of a surface with another reflectance: the piece with an image with images, the other with medians."""
    old = shape.material
    if not isinstance(old, Diffuse | Material):
        return shape
    pictured = isinstance(old.reflectance if isinstance(old, Diffuse) else old.base_color, np.ndarray)
    colour = image if pictured else middle
    if fit is None:
        material = Diffuse(colour) if isinstance(old, Diffuse) else replace(old, base_color=colour)
        return replace(shape, material=material)
    roughness, f0, metal = maps
    if not pictured:
        share = float(np.median(fit.f0[~fit.metal])) / 0.04 if not fit.metal.all() else 1.0
        usual = Material(colour, roughness=float(np.median(fit.roughness)), specular_color=(share, share, share))
        return replace(shape, material=usual)
    base = np.where(metal[..., None], f0, np.broadcast_to(np.asarray(colour, np.float32), f0.shape)).astype(np.float32)
    share = np.where(metal[..., None], 1.0, f0 / 0.04).astype(np.float32)
    made = Material(base, metallic=metal.astype(np.float32), roughness=roughness, specular_color=share)
    return replace(shape, material=made)
