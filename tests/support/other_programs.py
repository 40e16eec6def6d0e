"""Files as OpenCV, OpenImageIO and Mitsuba read them."""

from __future__ import annotations

from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any

import numpy as np

from relume.renderers.mitsuba.path_tracer import _mitsuba


def by_opencv(path: Path) -> np.ndarray:
    """(H, W, 3), as stored, red first."""
    import cv2

    pixels = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
    assert pixels is not None
    return np.asarray(pixels)[..., ::-1]


def by_openimageio(path: Path) -> np.ndarray:
    """(H, W, channels) float32."""
    import OpenImageIO as oiio

    pixels = oiio.ImageBuf(str(path)).get_pixels(oiio.FLOAT)
    assert pixels is not None, oiio.geterror()
    return pixels


def attributes_by_openimageio(path: Path, *names: str) -> list[Any]:
    """What a file says under these names, None for each that it has not."""
    import OpenImageIO as oiio

    source = oiio.ImageInput.open(str(path))
    assert source is not None, oiio.geterror()
    said = [source.spec().getattribute(name) for name in names]
    source.close()
    return said


def mitsuba_reading(variant: str | None) -> AbstractContextManager[Any]:
    """Mitsuba with the second thread that its reader of OpenEXR waits for, for ever where there is none."""
    return _mitsuba(variant, 2)
