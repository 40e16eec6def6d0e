"""Perspective views cropped out of an environment map, and put back into it."""

from __future__ import annotations

import numpy as np

from relume.image.radiance import RadianceMap
from relume.sphere.directions import required_rotation
from relume.sphere.environment_map import EnvironmentMap
from relume.sphere.mappings.layouts import FLAT, Layout, laid_out, layout


def perspective_view(light: EnvironmentMap, rotation: np.ndarray, field: float, size: tuple[int, int]) -> RadianceMap:
    """What a pinhole camera in the middle of the light sees, antialiased.

    light : in any mapping
    rotation : (3, 3) world from camera; the camera looks along its −Z with +X to its right and +Y up
    field : the horizontal field of view, radians
    size : (width, height) in pixels, which are square

    The picture keeps the light's unit and marks, and its attributes store the view: "view-field" in degrees and
    "view-rotation", nine numbers by rows. Raises ValueError for a field that is not above 0 and below π, for a size
    below 1, and for a matrix that is no rotation.
    """
    camera = _camera(rotation, field, size)
    from relume.sphere.resampling.resampling import moved

    radiance, marks, _ = moved(light.radiance, light.clipped, layout(light.mapping, light.size), camera, np.eye(3))
    attributes = {
        "view-field": f"{np.degrees(field):.12g}",
        "view-rotation": " ".join(f"{number:.12g}" for number in np.asarray(rotation, np.float64).ravel()),
    }
    return RadianceMap(radiance, clipped=marks, unit=light.unit, attributes=attributes)


def insert_view(
    light: EnvironmentMap, picture: RadianceMap, rotation: np.ndarray, field: float, feather: float = 0.0
) -> EnvironmentMap:
    """The light with a perspective picture put in: the inverse of `perspective_view`.

    light, rotation, field : as there
    picture : in the light's unit
    feather : width of the soft edge, as a share of the picture's shorter side, up to ½. 0, a hard edge, unless given: a
        picture that was edited inside has the light's own values at its edge

    Pixels of the map that lie wholly inside the picture become the mean of what it shows there; all others stay as they
    are, to the bit. Marks follow the picture where it counts more than half.
    Raises ValueError for another unit, for a feather out of range, and as `perspective_view` does.
    """
    if picture.unit != light.unit:
        raise ValueError(
            f'the picture is in "{picture.unit}" and the light in "{light.unit}"; bring them to one unit first'
        )
    if not 0 <= feather <= 0.5:
        raise ValueError(f"feather is {feather:g}; expected 0 to 0.5 of the picture's shorter side")
    camera = _camera(rotation, field, picture.size)
    from relume.sphere.resampling.resampling import moved

    target = layout(light.mapping, light.size)
    eye = np.eye(3)
    radiance, marks, covered = moved(picture.radiance, picture.clipped, camera, target, eye)
    share = (covered > 1 - 1e-6).astype(np.float32)
    if feather > 0:
        edge = _edge(picture.size, feather)
        share *= np.clip(moved(edge, None, camera, target, eye)[0][..., 0], 0, 1)
    inside = share > 0
    mixed = light.radiance.astype(np.float32)
    mixed[inside] += share[inside, None] * (radiance[inside] - mixed[inside])
    clipped = light.clipped
    if clipped is not None or picture.clipped is not None:
        clipped = np.zeros(share.shape, np.uint8) if clipped is None else clipped.copy()
        more = share > 0.5
        clipped[more] = marks[more] if marks is not None and picture.clipped is not None else 0
    return EnvironmentMap(np.maximum(mixed, 0), light.mapping, light.unit, clipped)


def _camera(rotation: np.ndarray, field: float, size: tuple[int, int]) -> Layout:
    """The one plane of a pinhole camera's picture."""
    rotation, (width, height) = required_rotation(rotation), size
    if not 0 < field < np.pi:
        raise ValueError(f"the field of view is {np.degrees(field):g}°; expected more than 0 and less than 180")
    if width < 1 or height < 1:
        raise ValueError(f"the picture is {width}×{height} pixels; expected at least 1×1")
    right, up, backward = rotation.T
    tangent = float(np.tan(field / 2))
    frame = np.stack([right, -up, -backward])[None]
    shape = (height, width)
    return laid_out(FLAT, shape, shape, frame, across=tangent, down=tangent * height / width, whole=False)


def _edge(size: tuple[int, int], feather: float) -> np.ndarray:
    """Weights (H, W, 3) that rise smoothly from 0 at a picture's edge to 1."""
    width, height = size
    x, y = np.arange(width) + 0.5, np.arange(height) + 0.5
    nearest = np.minimum(np.minimum(x, width - x)[None, :], np.minimum(y, height - y)[:, None])
    rise = np.clip(nearest / (feather * min(width, height)), 0, 1)
    return np.repeat((rise * rise * (3 - 2 * rise))[..., None], 3, axis=2).astype(np.float32)
