"""Views that were cropped out of a light map, and remember how: their lens and where they looked."""

from __future__ import annotations

import warnings
from dataclasses import dataclass

import numpy as np

from relume.image.radiance import RadianceMap
from relume.probe.panorama.views import focal_length_of
from relume.sphere.directions import required_rotation


@dataclass(frozen=True, eq=False)
class Crop:
    """How a picture was cropped out of a light map.

    focal_length : pixels
    rotation : (3, 3) world-from-camera; None where only the field of view is remembered
    """

    focal_length: float
    rotation: np.ndarray | None


def remembered_crop(picture: RadianceMap, name: str = "view") -> Crop | None:
    """What `perspective_view` let a picture remember, or None where it remembers nothing.

    What is remembered but cannot be is warned of and not used.
    """
    told = picture.attributes
    if "view-field" not in told:
        return None
    try:
        focal_length = focal_length_of(float(np.radians(float(told["view-field"]))), picture.size[0])
        rotation = None
        if "view-rotation" in told:
            numbers = [float(word) for word in told["view-rotation"].split()]
            rotation = required_rotation(np.array(numbers).reshape(3, 3))
    except ValueError as error:
        warnings.warn(f"{name}: remembers a view that cannot be ({error}); it is not used", stacklevel=2)
        return None
    return Crop(focal_length, rotation)
