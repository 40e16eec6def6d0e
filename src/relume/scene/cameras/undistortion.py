"""Pictures with their lens distortion undone, for programs that know pinholes only, and redone afterwards."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from relume.scene.cameras.camera import Camera, border

LARGEST = 4.0
"""Times the picture's sides: a undistorted picture that is larger is that of a model stretched beyond its measure."""


def undistorted(camera: Camera) -> Camera:
    """A camera without distortion that sees all that `camera` sees, as finely in the middle: same pose, larger picture.

    Raises ValueError where its picture would be more than four times as wide or high.
    """
    if camera.distortion is None:
        return camera
    pinhole = camera.pinhole()
    seen = pinhole.project(camera.position + camera.rays_through(border(camera.width, camera.height)))
    low, high = np.floor(seen.min(0)), np.ceil(seen.max(0))
    width, height = (int(n) for n in high - low)
    if not (width <= LARGEST * camera.width and height <= LARGEST * camera.height):
        raise ValueError(
            f"the undistorted picture has {width}×{height} pixels for {camera.width}×{camera.height}; the distortion "
            "does not hold out to the corners: check its coefficients"
        )
    across, down = camera.principal_point
    return replace(pinhole, width=width, height=height, centre=(across - float(low[0]), down - float(low[1])))


def reprojected(picture: np.ndarray, seen_by: Camera, wanted: Camera) -> np.ndarray:
    """A picture (H, W) or (H, W, C) as another camera at the same place would have taken it, float32.

    seen_by : the camera of `picture`; wanted : the camera whose lens or turn the result has
    With `wanted = undistorted(seen_by)` the distortion is undone, the other way round it is redone.
    Bilinear, so that nothing gets brighter or darker than its neighbours; NaN where `picture` does not reach.
    """
    from scipy.ndimage import map_coordinates

    if picture.shape[:2] != (seen_by.height, seen_by.width):
        raise ValueError(f"a picture of {picture.shape} from a camera of {seen_by.width}×{seen_by.height} pixels")
    if np.linalg.norm(wanted.position - seen_by.position) > 0:
        raise ValueError("the two cameras stand at different places; what one hides from the other is in no picture")
    points = seen_by.project(seen_by.position + wanted.rays())
    x, y = points[..., 0], points[..., 1]
    with np.errstate(invalid="ignore"):
        # Half a pixel beyond the outermost centres the picture still reaches: its edge is repeated there.
        reached = (x >= 0) & (x <= seen_by.width) & (y >= 0) & (y <= seen_by.height)
    places = np.where(reached, np.stack([y, x]) - 0.5, 0.0)
    planes = np.asarray(picture, np.float32).reshape(*picture.shape[:2], -1)
    found = np.stack([map_coordinates(p, places, order=1, mode="nearest") for p in np.moveaxis(planes, -1, 0)], axis=-1)
    return np.where(reached[..., None], found, np.float32(np.nan)).reshape(*reached.shape, *picture.shape[2:])
