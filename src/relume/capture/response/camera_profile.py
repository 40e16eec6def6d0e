"""A camera's profile: everything that was once measured of it, kept in a file and used again."""

from __future__ import annotations

import json
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np

from relume.capture.raw.sensor import Sensor
from relume.capture.response.calibration import Calibration
from relume.capture.response.curve_files import read_curves
from relume.image.colour import triple
from relume.image.files import write_text
from relume.image.response import Response

KIND, VERSION = "camera profile", 1


@dataclass(frozen=True, eq=False)
class CameraProfile:
    """What is known of a camera: of its photographs, by their response, or of its raws, by their sensor.

    camera : make and model, "" where unknown
    response : its curves and the noise of its pixel values; None for raws
    sensor : its levels and noise; None for photographs that are encoded
    shot, read : (3,) of `Noise`, exposure 1 at the greatest value; None where not measured
    vignetting : what `Vignetting.to_dict` wrote; None where not measured
    scale, scale_deviation : cd/m² per unit of relative radiance, and the standard deviation of its logarithm; None
        where not measured
    scale_exposure : whether the exposures that it was measured with have f-number and ISO: relative radiance takes an
        unknown one as 1 and 100, so the scale holds for exposures that have the same
    balance : (3,) factors on the channels' radiance that make its reference white achromatic
    brackets, pixels : how many the response came from; 0 where unknown
    residual : (3,) weighted misfit of ln exposure; None where unknown

    Raises ValueError unless it holds either a response or a sensor.
    """

    camera: str
    response: Response | None = None
    sensor: Sensor | None = None
    shot: tuple[float, float, float] | None = None
    read: tuple[float, float, float] | None = None
    vignetting: dict[str, Any] | None = None
    scale: float | None = None
    scale_deviation: float | None = None
    scale_exposure: tuple[bool, bool] | None = None
    balance: tuple[float, float, float] = (1.0, 1.0, 1.0)
    brackets: int = 0
    pixels: int = 0
    residual: tuple[float, float, float] | None = None

    def __post_init__(self) -> None:
        if (self.response is None) == (self.sensor is None):
            raise ValueError("a profile holds the response of encoded photographs or the sensor of raws, and not both")
        if self.scale is not None and not (np.isfinite(self.scale) and self.scale > 0):
            raise ValueError(f"scale is {self.scale}; expected cd/m² per unit of radiance, positive")
        if len(self.balance) != 3 or not all(np.isfinite(b) and b > 0 for b in self.balance):
            raise ValueError(f"balance is {self.balance}; expected three positive factors")


def profile_of(calibration: Calibration, camera: str, *, brackets: int = 1) -> CameraProfile:
    """The profile that a calibration gives.

    camera : make and model, `Photograph.camera`
    brackets : how many the calibration was made from
    """
    noise = calibration.noise
    return CameraProfile(
        camera,
        calibration.response,
        shot=None if noise is None else triple(noise.shot),
        read=None if noise is None else triple(noise.read),
        brackets=brackets,
        pixels=int(np.max(calibration.pixels)),
        residual=triple(calibration.residual),
    )


def write_profile(path: str | Path, profile: CameraProfile) -> None:
    """Write the profile as JSON; raises OutputNotWritten."""
    table: dict[str, Any] = {"relume": KIND, "version": VERSION, "camera": profile.camera}
    if profile.response is not None:
        table |= json.loads(profile.response.to_json())
    if profile.sensor is not None:
        table["sensor"] = profile.sensor.to_dict()
    table |= {name: getattr(profile, name) for name in _OWN}
    write_text(path, json.dumps(table, indent=1))


def read_profile(path: str | Path) -> CameraProfile:
    """The profile in a file: relume's own, a response that relume wrote, or another program's curves.

    Raises ValueError, one line that names the file, for anything else.
    """
    path = Path(path)
    try:
        text = path.read_text("utf-8")
    except (OSError, UnicodeDecodeError) as error:
        reason = error.strerror if isinstance(error, OSError) else "it is not text"
        raise ValueError(f"{path.name}: no camera profile could be read: {reason}") from None
    if not text.lstrip().startswith("{"):
        return CameraProfile("", read_curves(text, path.name))
    try:
        table = json.loads(text)
        if "relume" not in table:
            return CameraProfile("", Response.from_json(text))
        if table["relume"] != KIND or table["version"] > VERSION:
            raise ValueError(f"it is a {table['relume']} of version {table.get('version')}; update relume")
        sensor = Sensor.from_dict(table["sensor"]) if "sensor" in table else None
        response = Response.from_json(text) if sensor is None or "log_exposure" in table else None
        own = {name: table[name] for name in _OWN if name in table}
        own = {name: tuple(value) if isinstance(value, list) else value for name, value in own.items()}
        return CameraProfile(str(table["camera"]), response, sensor, **own)
    except (KeyError, TypeError, ValueError) as error:
        raise ValueError(f"{path.name}: not a camera profile of relume: {' '.join(str(error).split())}") from None


_OWN = [field.name for field in fields(CameraProfile) if field.name not in ("camera", "response", "sensor")]
