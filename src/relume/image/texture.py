"""The texture of what a picture shows, for shadows on it to be filtered without it.

What a shadow takes of a textured surface is a share of what the surface shows. Whatever filters it, a denoiser or a
lens, must filter that share: the picture's own texture is as sharp as it is, and what a filter took of it would stand
in a deep shadow several times as strong as beside it. Light that is added may be gloss, which knows no texture.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

DARK, AROUND = 0.01, 8.0
"""Share of what is seen about a pixel, and σ in pixels, that counts beside what it shows: so black has a ratio too."""
ROWS = 512
"""Of a picture that are looked at at once."""
TENT = np.array([0.125, 0.75, 0.125])
"""∫ of the tent (1 − |x|) over a pixel: ¾ in the middle and ⅛ at each side."""


def texture(picture: np.ndarray, textured: np.ndarray | None = None, *, rendered: bool = False) -> np.ndarray:
    """What a picture (H, W, 3) shows, float32, nowhere 0.

    textured : (H, W) bool, where surfaces are rendered with the picture's own pixels as their texture; elsewhere the
        light on them knows nothing of the picture, and one even value stands, the mean of the texture. All unless given
    rendered : as such surfaces look: a little softer
    """
    return textures(picture, textured, (rendered,))[0]


def textures(picture: np.ndarray, textured: np.ndarray | None, rendered: Sequence[bool]) -> list[np.ndarray]:
    """The same once for each of `rendered`; what lies about a pixel is looked at once for all of them."""
    from scipy.ndimage import gaussian_filter

    least, reach = max(1e-6 * float(picture.max()), 1e-30), round(4 * AROUND)
    results = [np.empty(picture.shape, np.float32) for _ in rendered]
    # By rows, so that a large picture takes no more memory than the results.
    for top in range(0, len(picture), ROWS):
        bottom = min(top + ROWS, len(picture))
        begin = max(top - reach, 0)
        part, own = np.asarray(picture[begin : bottom + reach], np.float32), slice(top - begin, bottom - begin)
        floor = np.maximum(DARK * gaussian_filter(part, (AROUND, AROUND, 0), mode="nearest")[own], least)
        for result, soft in zip(results, rendered, strict=True):
            shown = as_rendered(part)[own] if soft else part[own]
            result[top:bottom] = np.maximum(shown, 0) + floor
    if textured is not None and not textured.all():
        # The level of the texture, so that what is filtered does not leap where the one surface meets the other.
        for result in results:
            result[~textured] = result[textured].mean(0, dtype=np.float64) if textured.any() else 1.0
    return results


def as_rendered(picture: np.ndarray) -> np.ndarray:
    """A texture (H, W, …) of the picture's own pixels as the picture shows it: bilinear, averaged over each pixel."""
    from scipy.ndimage import convolve1d

    return convolve1d(convolve1d(picture, TENT, axis=0, mode="nearest"), TENT, axis=1, mode="nearest")
