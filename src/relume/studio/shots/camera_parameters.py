"""The numbers and switches of a virtual camera as a page offers them: each in words, with its unit and a useful range.

Their keys are a preset's (`rl.CameraPreset.keys`); what names files, and vectors of motion, is left to presets.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import relume as rl


@dataclass(frozen=True)
class Parameter:
    """One number or switch of a virtual camera.

    words : what the page calls it
    unit : behind the number
    low, high, step : of its slider, in which useful values lie; others can be typed
    start : what a key that has to be given begins with
    parts : what the numbers of a list are called; none for a lone number
    choices : the values that it may have, where those are words or few
    """

    words: str
    unit: str = ""
    low: float = 0.0
    high: float = 1.0
    step: float = 0.01
    start: Any = None
    parts: tuple[str, ...] = ()
    choices: tuple[Any, ...] = ()


SHUTTER = Parameter("Shutter opens and closes", "of its time", 0, 0.5, 0.01)
BLADES = {
    "blades": Parameter("Blades of the iris", "", 0, 12, 1), "curvature": Parameter("Roundness of the blades"),
    "rotation": Parameter("Turn of the iris", "°", 0, 90, 1),
}  # fmt: skip
SCREEN = {
    "screen.white": Parameter("Screen's white", "cd/m²", 50, 1000, 10),
    "screen.black": Parameter("Screen's black", "cd/m²", 0.01, 5, 0.01),
}
HISTOGRAM = SCREEN | {
    "human_contrast": Parameter("An eye's contrast"), "veil": Parameter("An eye's glare"),
    "acuity": Parameter("An eye's acuity"), "colour": Parameter("An eye's colours at night"),
    "centre_weighted": Parameter("Weighted to the middle"),
}  # fmt: skip
KEY = Parameter("Key: where the log average goes", "of white", 0.02, 0.8, 0.01)
LEVELS = {
    "peak": Parameter("Peak of the screen", "cd/m²", 400, 2000, 50),
    "white": Parameter("What white is shown as", "cd/m²", 80, 400, 1),
}
BITS = {"bits": Parameter("Bits of a channel", choices=(8, 16))}

PARAMETERS: Mapping[str, Mapping[str, Mapping[str, Parameter]]] = {
    "view": {"": {"luminance": Parameter("Luminance of a relative 1", "cd/m²", 1, 5000, 1)}},
    "geometry": {
        "": {
            "k1": Parameter("Distortion k₁: barrel below 0", "", -0.5, 0.5, 0.005),
            "k2": Parameter("Distortion k₂", "", -0.5, 0.5, 0.005),
            "k3": Parameter("Distortion k₃", "", -0.5, 0.5, 0.005),
            "p1": Parameter("Decentring p₁", "", -0.02, 0.02, 0.0005),
            "p2": Parameter("Decentring p₂", "", -0.02, 0.02, 0.0005),
            "red": Parameter("Red drawn larger", "", -0.01, 0.01, 0.0001, parts=("by", "at r² by")),
            "blue": Parameter("Blue drawn larger", "", -0.01, 0.01, 0.0001, parts=("by", "at r² by")),
        }
    },
    "vignetting": {
        "natural": {},
        "polynomial": {
            "coefficients": Parameter("Falloff", "", -1, 0.5, 0.01, start=(-0.3, 0, 0), parts=("a₁", "a₂", "a₃")),
            "centre": Parameter("Centre", "of the picture", 0, 1, 0.01, parts=("across", "down")),
        },
    },
    "soft_focus": {
        "": {
            "share": Parameter("Light that is spread", "of all"),
            "radius": Parameter("How far", "of the width", 0, 0.1, 0.001),
        }
    },
    "defocus": {
        "": {
            "focus": Parameter("In focus", "m", 0.1, 10, 0.01, start=1.0),
            "f_number": Parameter("f-number", "", 1, 22, 0.1, start=2.8),
            "focal_length": Parameter("Focal length", "mm", 10, 200, 1, start=50.0), **BLADES,
        }
    },
    "motion": {
        "straight": {
            "pixels": Parameter("Moves by", "px", -100, 100, 1, start=(10, 0), parts=("right", "down")),
            "opening": SHUTTER,
        },
        "turn": {
            "degrees": Parameter("Turns by", "°", -10, 10, 0.1, start=(1, 0, 0), parts=("right", "up", "clockwise")),
            "opening": SHUTTER,
        },
    },
    "glare": {
        "eye": {
            "adaptation": Parameter("Used to", "cd/m²", 0.01, 1000, 0.01), "pupil": Parameter("Pupil", "mm", 2, 8, 0.1),
            "sharp": Parameter("Its finest blur left to who looks"), "mirrored": Parameter("World mirrored beside"),
        },
        "camera": BLADES | {
            "f_number": Parameter("f-number", "", 1, 32, 0.1),
            "sensor_width": Parameter("Sensor's longer side", "mm", 5, 60, 0.1),
            "veil": Parameter("Veiling glare", "of all light", 0, 0.2, 0.001),
            "halo": Parameter("Scattered by dust", "of all light", 0, 0.2, 0.001),
            "halo_core": Parameter("Core of that halo", "of the diagonal", 0.0005, 0.05, 0.0005),
            "halo_power": Parameter("How steeply it falls", "", 1.05, 3, 0.05),
            "mirrored": Parameter("World mirrored beside"),
        },
    },
    "tone": {
        "exposure": {
            "percentile": Parameter("Becomes white: percentile", "%", 50, 100, 0.1),
            "grey": Parameter("Log mean becomes", "of white", 0.02, 0.8, 0.01),
        },
        "fixed": {"gain": Parameter("Display per radiance", "", 0.01, 10, 0.01)},
        "camera": {
            "seconds": Parameter("Shutter", "s", 0.0005, 4, 0.0005, start=1 / 60),
            "f_number": Parameter("f-number", "", 1, 32, 0.1, start=8.0),
            "iso": Parameter("ISO", "", 50, 6400, 10),
        },
        "reinhard": {"key": KEY, "white": Parameter("Smallest that becomes white", "of grey's scale", 0.5, 50, 0.1)},
        "reinhard-local": {
            "key": KEY, "sharpening": Parameter("Sharpening φ", "", 1, 20, 0.5),
            "threshold": Parameter("Contrast that is an edge, ε", "", 0.01, 0.5, 0.01),
            "scales": Parameter("Sizes of surroundings", "", 2, 12, 1),
        },
        "histogram": HISTOGRAM, "human": HISTOGRAM, "tumblin-rushmeier": SCREEN,
        "ferwerda": SCREEN | {
            "percentile": Parameter("Adapted to half of: percentile", "%", 50, 100, 0.1),
            "acuity": Parameter("An eye's acuity"), "colour": Parameter("An eye's colours at night"),
        },
        "pattanaik": SCREEN | {"screen_adaptation": Parameter("Used to, at the screen", "cd/m²", 1, 500, 1)},
        "black-white": {
            "black": Parameter("Becomes black", "of 1/255", 0.01, 10, 0.01),
            "white": Parameter("Becomes white", "of radiance 1", 0.1, 50, 0.1),
        },
        "darkroom": {
            "stock": Parameter("Film", choices=("black-and-white", "colour-negative", "slide")),
            "speed": Parameter("Its speed", "ISO", 25, 3200, 25),
            "grade": Parameter("Grade of the paper", "", 0, 5, 0.5),
            "stops": Parameter("Film exposed by", "stops", -3, 3, 0.1),
            "print_stops": Parameter("Print exposed by", "stops", -3, 3, 0.1),
            "frame": Parameter("Width of the frame", "µm", 5000, 120000, 500),
            "grain": Parameter("Grain"), "halation": Parameter("Halation"),
        },
    },
    "display": {
        "srgb": BITS, "p3": BITS, "pq": LEVELS, "hlg": LEVELS,
        "gain-map": {
            "headroom": Parameter("Kept above white", "stops", 0.5, 8, 0.1),
            "quality": Parameter("Quality of the JPEG", "", 50, 100, 1),
        },
    },
}  # fmt: skip
TITLES = {
    "view": "Scene", "geometry": "Distortion and colour fringes", "vignetting": "Vignetting",
    "soft_focus": "Soft focus", "defocus": "Depth of field", "motion": "Motion", "glare": "Glare",
    "tone": "Tone or film", "display": "Display",
}  # fmt: skip


def parameters(*, depth: bool) -> list[dict[str, Any]]:
    """The tables of a camera with their kinds and parameters, and what each is unless given, for JSON.

    depth : whether the composite's depth is known, which depth of field needs
    """
    known = rl.CameraPreset.keys()
    return [
        {
            "table": table, "title": TITLES[table],
            "kinds": {
                kind: [
                    {
                        "key": key, "words": each.words, "unit": each.unit, "low": each.low, "high": each.high,
                        "step": each.step, "parts": list(each.parts), "choices": list(each.choices),
                        "start": each.start, "otherwise": known[table][kind][key],
                    }
                    for key, each in keys.items()
                ]
                for kind, keys in kinds.items()
            },
        }
        for table, kinds in PARAMETERS.items() if depth or table != "defocus"
    ]  # fmt: skip


def settings_of(given: Any) -> dict[str, dict[str, Any]]:
    """The tables of a preset that a page asks for: kind, where the table has kinds, and keys.

    Raises ValueError for what there is none of; whether values fit, the preset itself says.
    """
    if not isinstance(given, dict):
        raise ValueError("settings are tables of a preset")
    for table, keys in given.items():
        kinds = PARAMETERS.get(table)
        if kinds is None or not isinstance(keys, dict):
            raise ValueError(f"there is no such part of a camera; there are {', '.join(PARAMETERS)}")
        kind = keys.get("kind", "")
        if not isinstance(kind, str) or kind not in kinds:
            raise ValueError(f"{table}: there is no such kind; there are {', '.join(kinds)}")
        for key, value in keys.items():
            if key != "kind" and key not in kinds[kind]:
                raise ValueError(
                    f"{table}: {key[:40]} is none of its keys; there are {', '.join(kinds[kind]) or 'none'}"
                )
            values = value if isinstance(value, list) else [value]
            if len(values) > 8 or not all(isinstance(each, bool | int | float | str) for each in values):
                raise ValueError(f"{table}.{key}: a number, a switch, a word or a few numbers")
    return {table: dict(keys) for table, keys in given.items()}


def flattened(keys: Mapping[str, Any]) -> dict[str, Any]:
    """A table with screen = { white } as "screen.white"; `nested` undoes it."""
    found: dict[str, Any] = {}
    for key, value in keys.items():
        found |= {f"{key}.{inner}": each for inner, each in value.items()} if isinstance(value, dict) else {key: value}
    return found


def nested(keys: Mapping[str, Any]) -> dict[str, Any]:
    """A table with "screen.white" as screen = { white }."""
    found: dict[str, Any] = {}
    for key, value in keys.items():
        outer, point, inner = key.partition(".")
        if point:
            found.setdefault(outer, {})[inner] = value
        else:
            found[key] = value
    return found
