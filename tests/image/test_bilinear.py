"""Look-up between the pixels of a plain image."""

import numpy as np
import pytest

from relume.image.bilinear import bilinear


def one(image: np.ndarray, x: float, y: float) -> np.ndarray:
    """The slow twin: each pixel counts by how near its middle is, both ways."""
    height, width = image.shape[:2]
    x, y = min(max(x - 0.5, 0), width - 1), min(max(y - 0.5, 0), height - 1)
    across, down = (np.maximum(1 - abs(np.arange(n) - at), 0) for n, at in ((width, x), (height, y)))
    return np.tensordot(down, np.tensordot(across, image, (0, 1)), (0, 0))


@pytest.mark.parametrize("shape", [(6, 7, 3), (6, 7), (1, 1, 3), (1, 5), (4, 1, 2)])
@pytest.mark.parametrize("strided", [False, True])
def test_between_pixels_the_nearer_counts_more_and_the_edge_goes_on(shape, strided):
    random = np.random.default_rng(3)
    image = random.random((2 * shape[0], 2 * shape[1], *shape[2:]))[::2, ::2] if strided else random.random(shape)
    assert image.flags.c_contiguous != strided or image.size <= 3
    x, y = (random.uniform(-2, n + 2, (4, 9)) for n in (shape[1], shape[0]))
    expected = [[one(image, *at) for at in zip(*row, strict=True)] for row in zip(x, y, strict=True)]
    np.testing.assert_allclose(bilinear(image, x, y), expected, rtol=1e-12)
