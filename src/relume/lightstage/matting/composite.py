"""Environment mattes over new backdrops: pictures, environment maps, and what relighting then has to leave out.

A backdrop stands in the world as a rectangle; its u runs along `right`, its v against `up`. Wide areas are means over
boxes of the backdrop from its summed-area table, exact at any width, so that nothing aliases (Crow 1984).
"""

from __future__ import annotations

import os
from dataclasses import dataclass, replace

import numpy as np

from relume.image import files
from relume.image.bands import in_threads
from relume.image.colour_space import decoded
from relume.image.radiance import RadianceMap
from relume.lightstage.field.field import ReflectanceField
from relume.lightstage.matting import kernel as matte_kernel
from relume.lightstage.matting.environment_matte import EnvironmentMatte
from relume.lightstage.relighting.relighting import weighted_sum
from relume.lightstage.relighting.stage_lighting import irradiances
from relume.scene.cameras.camera import Camera
from relume.sphere.directions import look_at, normalised
from relume.sphere.environment_map import EnvironmentMap
from relume.sphere.mappings.mapping import pixel_directions, pixel_points

_LARGEST = 4096
"""Texels along a side of a backdrop made of an environment map; finer is smoothed away by any camera."""


@dataclass(frozen=True, eq=False)
class Backdrop:
    """Where a backdrop stands: a rectangle in the world.

    centre : (3,) metres
    right, up : (3,) unit vectors along its sides, as the camera sees them
    width, height : metres
    """

    centre: np.ndarray
    right: np.ndarray
    up: np.ndarray
    width: float
    height: float

    def __post_init__(self) -> None:
        sides = np.stack([self.right, self.up])
        if not np.allclose(sides @ sides.T, np.eye(2), atol=1e-6):
            raise ValueError(f"a backdrop along {self.right} and {self.up}; expected two unit vectors at a right angle")
        if not (0 < self.width < np.inf and 0 < self.height < np.inf):
            raise ValueError(f"a backdrop {self.width} × {self.height} m; expected lengths above 0")

    @staticmethod
    def facing(centre: np.ndarray, towards: np.ndarray, width: float, height: float) -> Backdrop:
        """An upright backdrop whose face points at a place.

        centre, towards : (3,) metres, its middle and that place
        width, height : metres
        Raises ValueError where that place is straight above or below: "upright" says nothing there.
        """
        middle = np.asarray(centre, np.float64)
        axes = look_at(np.asarray(towards, np.float64), middle)
        return Backdrop(middle, axes[:, 0], axes[:, 1], width, height)

    def points(self, places: np.ndarray) -> np.ndarray:
        """World points (…, 3) of `places` (…, 2) on it: u to the right and v down, both 0 to 1."""
        across = (places[..., :1] - 0.5) * self.width * self.right
        return self.centre + across + (0.5 - places[..., 1:]) * self.height * self.up

    def covers(self, directions: np.ndarray) -> np.ndarray:
        """Whether rays from the origin in `directions` (…, 3) meet it, (…,) bool, from whichever side."""
        face = np.cross(self.right, self.up)
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            distance = (self.centre @ face) / (directions @ face)
            hit = distance[..., None] * directions - self.centre
            inside = (np.abs(hit @ self.right) <= self.width / 2) & (np.abs(hit @ self.up) <= self.height / 2)
        return inside & (distance > 0)


def composite_matte(matte: EnvironmentMatte, backdrop: np.ndarray, foreground: np.ndarray | None = None) -> np.ndarray:
    """The subject before another backdrop, (H, W, 3) float32.

    matte : as `environment_matte` found it
    backdrop : (h, w, 3) of any size, as wide and high as that the matte was taken with; 1 as bright as its white
    foreground : (H, W, 3) radiance of all other light, such as the subject relit without what stands behind it; that
        of the picture before black unless given

    Raises ValueError for a backdrop without three channels or with NaN or infinity, which would spread everywhere.
    """
    return _summed(matte, _table(backdrop), _table(backdrop), foreground)


def read_backdrop(path: str | os.PathLike[str]) -> np.ndarray:
    """A backdrop's linear values (H, W, 3): a radiance map as it is, a photograph by its profile, else sRGB.

    path : a radiance map or a photograph
    """
    if files.has_radiance(path):
        return files.read_radiance(path).radiance
    return decoded(files.read_photograph(path))


def over_environment(
    matte: EnvironmentMatte,
    backdrop: Backdrop,
    camera: Camera,
    illumination: EnvironmentMap,
    *,
    foreground: np.ndarray | None = None,
) -> np.ndarray:
    """The subject before an environment far away, (H, W, 3) float32, in the map's unit.

    What is seen straight through is seen in the camera's own directions. What is refracted or reflected left the
    subject, at the origin, towards a point of the backdrop, and shows the environment in that direction: exact for a
    small subject, and off by its size over the backdrop's distance for a large one.
    """
    seen = _table(environment_on(backdrop, illumination, camera.position))
    return _summed(matte, seen, _table(environment_on(backdrop, illumination, np.zeros(3))), foreground)


def place_in_environment(
    matte: EnvironmentMatte, stage: ReflectanceField, environment: EnvironmentMap, backdrop: Backdrop
) -> RadianceMap:
    """The subject in an environment: light from beside the backdrop relights it, what stands behind is seen through it.

    matte : as `environment_matte` found it
    stage : the subject's reflectance field, by the camera that took the matte
    environment : the light all round
    backdrop : where the backdrop of the matte stood
    Raises ValueError for a stage without a camera, or with pictures of another size.
    """
    if stage.camera is None:
        raise ValueError("the stage has no camera, which the environment needs; add it to stage.json")
    if stage.shape != matte.shape:
        raise ValueError(
            f"the stage has pictures of {stage.shape[1]}×{stage.shape[0]}, but the matte has "
            f"{matte.shape[1]}×{matte.shape[0]}; give the stage of the camera that took the patterns"
        )
    beside = illumination_without_backdrop(environment, backdrop)
    rest = weighted_sum(stage, irradiances(stage.lights, beside))
    picture = over_environment(matte, backdrop, stage.camera, environment, foreground=rest.radiance)
    return RadianceMap(picture, unit=environment.unit)


def environment_on(backdrop: Backdrop, illumination: EnvironmentMap, origin: np.ndarray) -> np.ndarray:
    """What an environment far away shows where a backdrop stands, seen from `origin` (3,): (h, w, 3) float32.

    Four times as fine as the map, up to 4096 texels along a side. Raises ValueError for an origin on the backdrop.
    """
    distance = abs(float((backdrop.centre - origin) @ np.cross(backdrop.right, backdrop.up)))
    if distance < 1e-6 * max(backdrop.width, backdrop.height):
        raise ValueError(f"the point {np.round(origin, 4).tolist()} lies on the backdrop; give one before it")
    # A pixel of the map is π / rows wide; four texels for it keep the steps between texels small.
    finest = distance * np.pi / illumination.size / 4
    rows, columns = (int(np.clip(np.ceil(side / finest), 16, _LARGEST)) for side in (backdrop.height, backdrop.width))
    u, v = (np.arange(columns) + 0.5) / columns, (np.arange(rows) + 0.5) / rows
    places = np.stack(np.broadcast_arrays(u[None, :], v[:, None]), axis=-1)
    return illumination.lookup(normalised(backdrop.points(places) - origin)).astype(np.float32)


def illumination_without_backdrop(illumination: EnvironmentMap, backdrop: Backdrop) -> EnvironmentMap:
    """The map without the light that a backdrop would hide from the origin: what relighting has to integrate.

    Pixels that its edge cuts keep the part that is beside it, of 4 × 4 directions.
    """
    fine = 4
    directions = illumination.mapping.directions(
        illumination.mapping.shown(pixel_points(illumination.mapping, illumination.size, fine))
    )
    middles = np.repeat(np.repeat(pixel_directions(illumination.mapping, illumination.size), fine, 0), fine, 1)
    directions = np.where(np.isnan(directions), middles, directions)
    hidden = backdrop.covers(directions).astype(np.float32)
    rows, columns = illumination.radiance.shape[:2]
    beside = 1 - hidden.reshape(rows, fine, columns, fine).mean(axis=(1, 3))
    return replace(illumination, radiance=(illumination.radiance * beside[..., None]).astype(np.float32))


def _table(backdrop: np.ndarray) -> np.ndarray:
    """The summed-area table (h + 1, w + 1, 3) float64 of a backdrop."""
    picture = np.asarray(backdrop)
    if picture.ndim != 3 or picture.shape[2] != 3 or 0 in picture.shape:
        raise ValueError(f"the backdrop is {picture.shape}; expected (rows, columns, 3)")
    if not np.all(np.isfinite(picture)):
        raise ValueError("the backdrop holds NaN or infinity; give finite pixels")
    table = np.zeros((picture.shape[0] + 1, picture.shape[1] + 1, 3))
    np.cumsum(np.cumsum(picture, axis=0, dtype=np.float64), axis=1, out=table[1:, 1:])
    return table


def _summed(
    matte: EnvironmentMatte, straight: np.ndarray, around: np.ndarray, foreground: np.ndarray | None
) -> np.ndarray:
    """Foreground and all areas' means times their colours; `straight` and `around` are tables of two backdrops."""
    first = matte.foreground if foreground is None else np.asarray(foreground)
    if first.shape != matte.foreground.shape:
        raise ValueError(f"the foreground is {first.shape}; expected {matte.foreground.shape}, as the matte's")
    total = first.astype(np.float64)
    total += (1 - matte.coverage)[..., None] * _means(straight, matte.straight)
    for area, colour in zip(matte.areas, matte.colours, strict=True):
        total += colour * _means(around, area)
    return total.astype(np.float32)


def _means(table: np.ndarray, areas: np.ndarray) -> np.ndarray:
    """The mean (H, W, 3) of a backdrop over each of its areas (H, W, 4)."""
    flat = np.ascontiguousarray(areas.reshape(-1, 4))
    means = np.empty((len(flat), 3))
    in_threads(lambda begin, end: matte_kernel.box_means(begin, end, table, flat, means), len(flat))
    return means.reshape(*areas.shape[:2], 3)
