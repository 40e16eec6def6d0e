"""A radiance map remembers which photographs it was measured from."""

from dataclasses import replace
from datetime import datetime

import numpy as np

from relume.capture.provenance import provenance
from relume.image.photograph import Exposure, Photograph, Settings


def test_what_all_photographs_share_is_kept_and_what_differs_is_not() -> None:
    settings = Settings(taken=datetime(2026, 3, 1, 12, 0, 5), lens="50 mm", serial="7", focal_length=50.0)
    pixels = np.zeros((2, 2, 3), np.uint8)
    first = Photograph(pixels, "a", Exposure(1 / 250, 8.0, 100.0), "A B", settings=settings)
    second = replace(first, exposure=Exposure(1 / 60, 8.0, 100.0))
    earlier = replace(settings, taken=datetime(2026, 3, 1, 12, 0, 4), lens="35 mm")
    third = replace(first, exposure=Exposure(2.0, 8.0, 200.0), settings=earlier)
    told = {"camera": "A B", "lens": "50 mm", "serial": "7", "focal_length": "50", "iso": "100"}
    told |= {"taken": "2026:03:01 12:00:05", "exposure_times": "0.004 0.0166667"}
    assert provenance([first, second]) == told
    assert provenance([first, third]) == {
        "camera": "A B",
        "serial": "7",
        "focal_length": "50",
        "taken": "2026:03:01 12:00:04",
        "exposure_times": "0.004 2",
    }
    assert provenance([Photograph(pixels)]) == {}
