"""An environment matte as one EXR of many parts, float32, which compositing programs show as layers.

Parts: `foreground` (RGB), `coverage`, `residual`, and for each of `straight`, `area1` and `area2` the planes `.u`,
`.width`, `.v`, `.height` in parts of the backdrop's sides, with `area1.colour` and `area2.colour` (RGB). The attribute
`environment_matte` holds the backdrop's texels, across and down.
"""

from __future__ import annotations

import os

import numpy as np

from relume.errors import UnreadableFile
from relume.image import files
from relume.image.files.exr.header import read_headers
from relume.image.files.read_options import ReadOptions
from relume.lightstage.matting.environment_matte import EnvironmentMatte

_ATTRIBUTE = "environment_matte"
_PLANES = ("u", "width", "v", "height")


def write_matte(path: str | os.PathLike[str], matte: EnvironmentMatte) -> None:
    """Write a matte, whole or not at all.

    path : .exr
    matte : as `environment_matte` found it
    Raises ValueError for another suffix, OutputNotWritten.
    """
    layers = {"foreground": matte.foreground, "coverage": matte.coverage, "residual": matte.residual}
    for name, area in (("straight", matte.straight), ("area1", matte.areas[0]), ("area2", matte.areas[1])):
        layers |= {f"{name}.{plane}": area[..., index] for index, plane in enumerate(_PLANES)}
    layers |= {f"area{which + 1}.colour": colour for which, colour in enumerate(matte.colours)}
    across, down = matte.texels
    files.write_layers(path, layers, attributes={_ATTRIBUTE: f"{across} {down}"})


def read_matte(path: str | os.PathLike[str]) -> EnvironmentMatte:
    """The matte that `write_matte` wrote, bit for bit.

    path : .exr
    Raises UnreadableFile for any other file.
    """
    layers = files.read_layers(path)
    texts = read_headers(path, ReadOptions()).parts[0].texts
    stored = next((text for name, text in texts.items() if name.endswith(_ATTRIBUTE)), None)
    try:
        across, down = (int(count) for count in (stored or "").split())
        straight, first, second = (
            np.stack([layers[f"{name}.{plane}"] for plane in _PLANES], axis=-1)
            for name in ("straight", "area1", "area2")
        )
        return EnvironmentMatte(
            layers["foreground"],
            layers["coverage"],
            straight,
            np.stack([first, second]),
            np.stack([layers["area1.colour"], layers["area2.colour"]]),
            layers["residual"],
            (across, down),
        )
    except (KeyError, ValueError):
        raise UnreadableFile(f"{path}: no environment matte; give a file that `relume stage matte` wrote") from None
