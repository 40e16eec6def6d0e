"""A camera that looks along one ray."""

from __future__ import annotations

import numpy as np

from relume.scene.cameras.camera import Camera
from relume.sphere.directions import UP, normalised


def eye(position, direction) -> Camera:
    """A camera of one pixel, through whose middle the ray goes."""
    backward = -normalised(direction)
    right = normalised(np.cross([0.0, 0.0, 1.0] if abs(backward[2]) < 0.9 else UP, backward))
    rotation = np.stack([right, np.cross(backward, right), backward], axis=1)
    return Camera(1, 1, 1.0, np.asarray(position, np.float64), rotation)
