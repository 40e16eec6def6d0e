"""Lenses, shutters and eyes that cannot be are refused, each with what was expected."""

import numpy as np
import pytest

from relume.virtual_camera.lens.blades import Blades
from relume.virtual_camera.lens.defocus_blur import Defocus
from relume.virtual_camera.lens.geometry import RadialScale
from relume.virtual_camera.lens.glare.camera import CameraGlare
from relume.virtual_camera.lens.glare.eye import EyeGlare
from relume.virtual_camera.lens.glare.measured import MeasuredGlare
from relume.virtual_camera.lens.motion.shutter import Shutter
from relume.virtual_camera.lens.motion.straight import StraightMotion
from relume.virtual_camera.lens.soft_focus import SoftFocus
from relume.virtual_camera.lens.vignetting import image_illuminance


@pytest.mark.parametrize(
    ("make", "given", "message"),
    [
        (SoftFocus, (1.2,), "share is 1.2"),
        (SoftFocus, (np.nan,), "share"),
        (SoftFocus, (0.5, -0.1), "radius is -0.1"),
        *((Blades, (count,), "at least 3") for count in (2, -1)),
        (Blades, (5, 1.5), "curvature is 1.5"),
        (Blades, (5, 0, np.nan), "rotation is nan"),
        (Defocus, (0.0, 1.0), "aperture is 0"),
        (Defocus, (1.0, -1.0), "focus is -1"),
        *((RadialScale, (scale,), "above −1") for scale in (-1.0, np.nan)),
        (RadialScale, (0.0, np.inf), "finite"),
        (CameraGlare, {"f_number": 0.0}, "f_number is 0"),
        (CameraGlare, {"sensor_width": np.inf}, "sensor_width is inf"),
        (CameraGlare, {"veil": 0.6, "halo": 0.5}, "together below 1"),
        (CameraGlare, {"halo_power": 1.0}, "halo_power is 1"),
        *((EyeGlare, {"adaptation": wrong}, "adaptation is .*above 0") for wrong in (0.0, np.inf)),
        (EyeGlare, {"pupil": -1.0}, "pupil is .*above 0"),
        (MeasuredGlare, (np.ones((4, 3)),), r"\(4, 3\); expected"),
        (MeasuredGlare, (np.ones((3, 3, 2)),), r"\(3, 3, 2\); expected"),
        (MeasuredGlare, (np.ones(3),), r"\(3,\); expected"),
        (MeasuredGlare, (np.full((3, 3), -1.0),), "negative"),
        (MeasuredGlare, (np.zeros((3, 3)),), "sums to 0"),
        (Shutter, (0.6,), r"share of the exposure from 0 to 0\.5"),
        *((StraightMotion, wrong, "at most 65536 pixels") for wrong in ((np.nan, 0), (0, np.inf), (7e4, 0))),
        (image_illuminance, {"luminance": 1.0, "f_number": 0}, "f-number is 0"),
        (image_illuminance, {"luminance": 1.0, "f_number": 2, "transmittance": 1.1}, "transmittance is 1.1"),
    ],
)
def test_what_cannot_be_is_refused(make, given, message):
    with pytest.raises(ValueError, match=message):
        make(**given) if isinstance(given, dict) else make(*given)
