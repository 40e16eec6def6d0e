"""The sheet of docs/how-to/develop.md: every operator and effect over a church, a probe with a sun, and a composite.

python examples/develop/sheet.py CHURCH.hdr PROBE.hdr ROOM docs/images      ROOM: a folder of `relume demo`
"""

from __future__ import annotations

import sys
import tomllib
import warnings
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from relume.image import files
from relume.image.colour import luminance
from relume.image.radiance import RadianceMap
from relume.image.resizing import resized
from relume.project.developing.depth_and_motion import read_depth
from relume.project.presets.preset import CameraPreset, preset_of
from relume.virtual_camera.developing import develop
from relume.virtual_camera.tone.display.lettering import Words, lettered
from relume.virtual_camera.view import log_mean

HEIGHT = 170
GAP, CAPTION, COLUMNS = 8, 24, 2
PAGE = 28
GREY = {"kind": "exposure", "grey": 0.18}
LOOKS: dict[str, dict[str, Any]] = {
    "plain exposure, the bright parts near white": {"tone": {"kind": "exposure", "percentile": 99.0}},
    "plain exposure, the log mean at 18 %": {"tone": GREY},
    "plain exposure, the brighter of both": {},
    "Reinhard et al. 2002, global": {"tone": {"kind": "reinhard"}},
    "Reinhard et al. 2002, dodging and burning": {"tone": {"kind": "reinhard-local"}},
    "Ward Larson et al. 1997, histogram adjustment": {"tone": {"kind": "histogram"}},
    "Ward Larson et al. 1997, with glare, acuity and colour of an eye": {"tone": {"kind": "human"}},
    "Tumblin & Rushmeier 1993": {"tone": {"kind": "tumblin-rushmeier"}},
    "Ferwerda et al. 1996": {"tone": {"kind": "ferwerda"}},
    "Ferwerda et al. 1996, the log mean at 0.05 cd/m²": {"tone": {"kind": "ferwerda"}, "night": 0.05},
    "Pattanaik et al. 1998, multiscale": {"tone": {"kind": "pattanaik"}},
    "ACES, through OpenColorIO": {"tone": {"kind": "ocio"}},
    "black point 10 %, white point 4 (HDRExpose)": {"tone": {"kind": "black-white", "black": 0.1, "white": 4.0}},
    "black-and-white negative on paper, with grain": tomllib.loads(CameraPreset.text("black-and-white")),
    "colour negative on paper, with grain and halation": tomllib.loads(CameraPreset.text("colour-negative")),
    "slide": tomllib.loads(CameraPreset.text("slide")),
    "glare of an eye by day (Spencer et al. 1995)": {"glare": {"kind": "eye", "adaptation": 100.0}, "tone": GREY},
    "glare of an eye at night": {"glare": {"kind": "eye", "adaptation": 0.01}, "tone": GREY},
    "a lens of seven blades at f/16, veiling glare 1 %": {
        "glare": {"kind": "camera", "blades": 7, "f_number": 16.0, "veil": 0.01}, "tone": GREY
    },
    "moved 37 pixels while the shutter was open": {"motion": {"kind": "straight", "pixels": [37.0, 0.0]}, "tone": GREY},
    "turned on its tripod, 2° and a roll of 6°": {
        "motion": {"kind": "turn", "degrees": [2.0, 0.0, 6.0]}, "tone": GREY
    },
    "focused at 0.9 m by f/1.4, six blades (where there is depth)": {
        "defocus": {"focus": 0.9, "f_number": 1.4, "focal_length": 50.0, "blades": 6}, "tone": GREY
    },
    "soft focus, a third of the light": {"soft_focus": {"share": 0.33, "radius": 0.012}, "tone": GREY},
    "vignetting by cos⁴, seen 90° wide": {
        "vignetting": {"kind": "natural"}, "view": {"field_of_view": 90.0}, "tone": GREY
    },
    "barrel distortion and lateral colour": {
        "geometry": {"k1": -0.2, "red": [0.004, 0.0], "blue": [-0.004, 0.0]}, "tone": GREY
    },
}  # fmt: skip


def looked(picture: RadianceMap, depth: np.ndarray | None, look: dict[str, Any]) -> np.ndarray:
    """The picture by one look, (HEIGHT, W, 3) uint8; plainly exposed where the look needs a depth that it lacks."""
    look = dict(look)
    night = look.pop("night", None)
    if depth is None:
        look.pop("defocus", None)
    preset = preset_of(look)
    camera = preset.camera
    # All three alike in front of operators that know no meter: the log mean is a grey card's.
    gain = 0.18 / log_mean(luminance(picture.radiance))
    picture = RadianceMap(picture.radiance * np.float32(gain))
    view = camera.view(
        picture,
        field_of_view=float(np.radians(preset.view.field_of_view)),
        luminance_scale=(night or 100.0) / 0.18,
        depth=depth,
    )
    shown = develop(picture, camera, view).pixels
    linear = RadianceMap((shown / np.float32(255)) ** np.float32(2.2))
    width = round(shown.shape[1] * HEIGHT / shown.shape[0])
    return np.rint(255 * np.clip(resized(linear, width, HEIGHT).radiance, 0, 1) ** (1 / 2.2)).astype(np.uint8)


def main(church: Path, probe: Path, room: Path, out: Path) -> None:
    """Write develop_sheet.jpg."""
    scenes = [
        (files.read_radiance(church), None),
        (files.read_radiance(probe), None),
        (files.read_radiance(room / "composite.exr"), read_depth(room / "layers.exr", 900.0)),
    ]
    rows = []
    for caption, look in LOOKS.items():
        rows.append((caption, np.concatenate([padded(looked(*scene, look)) for scene in scenes], axis=1)))
    width, down = rows[0][1].shape[1], HEIGHT + CAPTION + GAP
    page = np.full((-(-len(rows) // COLUMNS) * down + GAP, COLUMNS * (width + GAP) + GAP, 3), PAGE, np.uint8)
    words = []
    for index, (caption, row) in enumerate(rows):
        y, x = GAP + index // COLUMNS * down, GAP + index % COLUMNS * (width + GAP)
        page[y : y + HEIGHT, x : x + width] = row
        words.append(Words(x + 2, y + HEIGHT + 4, caption, 9.0))
    Image.fromarray(lettered(page, words)).save(out / "develop_sheet.jpg", quality=85)


def padded(picture: np.ndarray) -> np.ndarray:
    return np.pad(picture, ((0, 0), (0, 4), (0, 0)), constant_values=PAGE)


if __name__ == "__main__":
    warnings.simplefilter("ignore", UserWarning)
    main(*(Path(word) for word in sys.argv[1:]))
