"""Images that are repeated over texture coordinates."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from relume.image.bilinear import bilinear


def repeated(image: np.ndarray) -> Callable[[np.ndarray], np.ndarray]:
    """What looks an image (H, W) or (H, W, C) up, bilinearly, at texture coordinates (P, 2).

    (0, 0) is the image's lower left corner, (1, 1) its upper right one, where it begins anew.
    """
    rows, columns = image.shape[:2]
    tiled = np.pad(image, ((1, 1), (1, 1)) + ((0, 0),) * (image.ndim - 2), mode="wrap")

    def looked_up(uv: np.ndarray) -> np.ndarray:
        # Images begin with the upper row.
        return bilinear(tiled, uv[:, 0] % 1 * columns + 1, (1 - uv[:, 1] % 1) * rows + 1)

    return looked_up
