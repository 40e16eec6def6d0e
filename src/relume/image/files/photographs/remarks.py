"""What is to be said once of several photographs, and not of each of them."""

from __future__ import annotations

from collections.abc import Sequence

from relume.errors import warn
from relume.image.photograph import Photograph


def warn_of_gain_maps(photographs: Sequence[Photograph]) -> None:
    """Say which photographs have gain maps, which are for HDR screens and measure nothing."""
    names = [photograph.name for photograph in photographs if photograph.gain_map]
    if names:
        having = "has a gain map" if len(names) == 1 else "have gain maps"
        warn(f"{_shortened(names)} {having} for HDR screens, not used: the photograph is read as other screens show it")


def warn_of_crops(photographs: Sequence[Photograph]) -> None:
    """Say which photographs were cropped, whose optical axis need not be in their middle."""
    cropped = [photograph for photograph in photographs if photograph.uncropped and photograph.focal_length]
    if cropped:
        width, height = cropped[0].uncropped or (0, 0)
        was = "was" if len(cropped) == 1 else "were"
        names = _shortened([photograph.name for photograph in cropped])
        warn(
            f"{names} {was} cropped from {width}×{height} pixels, it seems: taken as not resized, with the lens "
            "looking at the middle of what is left; whole photographs are surer"
        )


def _shortened(names: Sequence[str]) -> str:
    others = len(names) - 1
    return names[0] if others < 1 else f"{names[0]} and {others} other{'s' * (others > 1)}"
