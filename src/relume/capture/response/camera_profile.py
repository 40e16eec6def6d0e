"""A camera's profile: everything that was once measured of it, kept in a file and used again.

Curves of other programs are read too: of pfstools, Luminance HDR and hdrgen, and plain tables.
"""

from __future__ import annotations

import json
import re
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np

from relume.capture.raw.sensor import Sensor
from relume.capture.response.calibration import Calibration
from relume.image.colour import triple
from relume.image.files import write_text
from relume.image.response import Response

KIND, VERSION = "camera profile", 1
ROUNDING = 12**-0.5
"""Standard deviation of a pixel value from rounding alone: curves of other programs say nothing of noise."""


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
    """Write a camera's profile as JSON, whole or not at all.

    path : .json
    profile : what `read_profile` will give back
    Raises OutputNotWritten.
    """
    table: dict[str, Any] = {"relume": KIND, "version": VERSION, "camera": profile.camera}
    if profile.response is not None:
        table |= json.loads(profile.response.to_json())
    if profile.sensor is not None:
        table["sensor"] = profile.sensor.to_dict()
    table |= {name: getattr(profile, name) for name in _OWN}
    write_text(path, json.dumps(table, indent=1))


def read_profile(path: str | Path) -> CameraProfile:
    """The profile in a file: relume's own, a response that relume wrote, or another program's curves.

    path : a .json of relume, or the curves that pfstools or hdrgen wrote
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
        own: dict[str, Any] = {name: table[name] for name in _OWN if name in table}
        own |= {name: tuple(value) for name, value in own.items() if isinstance(value, list)}
        return CameraProfile(str(table["camera"]), response, sensor, **own)
    except (KeyError, TypeError, ValueError) as error:
        raise ValueError(f"{path.name}: not a camera profile of relume: {' '.join(str(error).split())}") from None


_OWN = [field.name for field in fields(CameraProfile) if field.name not in ("camera", "response", "sensor")]


def read_curves(text: str, name: str) -> Response:
    """The response in `text`, whichever of the known forms it has.

    name : of the file, for messages
    pfstools writes one Octave matrix a channel ("# name: IR") with rows of log10 response, value, response;
        Luminance HDR one of seven columns, value and log10 and response of each channel; hdrgen one line a channel,
        a polynomial's order and its coefficients from the highest, of the value over 255; a table has 256 or 65536
        rows of one exposure or of one a channel, after the value itself or without it
    Raises ValueError for anything else.
    """
    if "# columns:" in text:
        return _octave(text, name)
    lines = [line for line in (raw.split("#")[0].strip() for raw in text.splitlines()) if line]
    try:
        rows = [[float(word) for word in re.split(r"[\s,;]+", line.strip(",;"))] for line in lines]
    except ValueError:
        raise ValueError(
            f"{name}: not a response curve; expected relume's JSON, pfstools' .m, hdrgen's .rsp or a table"
        ) from None
    if len(rows) in (1, 3) and all(len(row) >= 3 and row[0] == len(row) - 2 for row in rows):
        curves = [np.polyval(row[1:], np.arange(256) / 255) for row in rows]
        return _response(np.stack(curves * (3 // len(curves))), name)
    return _table(rows, name)


def _octave(text: str, name: str) -> Response:
    blocks = re.split(r"#\s*columns:\s*", text)[1:]
    tables = []
    for block in blocks:
        head, _, body = block.partition("\n")
        # The comments before the next matrix belong to it.
        rows = [line.split() for line in body.splitlines() if line.strip() and not line.lstrip().startswith("#")]
        try:
            table = np.array(rows, np.float64)
        except ValueError:
            table = np.zeros((0, 0))
        if table.ndim != 2 or not head.strip().isdigit() or table.shape[1] != int(head) or len(table) == 0:
            raise ValueError(f"{name}: its matrix is not rows of {head.strip()} numbers; the file is damaged")
        tables.append(table)
    if len(tables) == 1 and tables[0].shape[1] == 7:
        return _response(tables[0][:, [2, 4, 6]].T, name)
    # The weights that pfstools saves as well have two columns.
    curves = [table[np.argsort(table[:, 1]), 2] for table in tables if table.shape[1] == 3]
    if len(curves) not in (1, 3) or len({len(curve) for curve in curves}) != 1:
        raise ValueError(f"{name}: {len(curves)} curves; expected one for all channels or one for each of three")
    return _response(np.stack(curves * (3 // len(curves))), name)


def _table(rows: list[list[float]], name: str) -> Response:
    widths = {len(row) for row in rows}
    if len(rows) not in (256, 65536) or len(widths) != 1 or not widths <= {1, 2, 3, 4}:
        raise ValueError(
            f"{name}: {len(rows)} rows of {'/'.join(map(str, sorted(widths)))} numbers; "
            "a table of a response has 256 rows of one exposure or of three"
        )
    table = np.array(rows)
    if table.shape[1] in (2, 4):
        if not np.array_equal(table[:, 0], np.arange(len(table))):
            raise ValueError(f"{name}: its first column is not the pixel values from 0; expected value and exposure")
        table = table[:, 1:]
    return _response(np.repeat(table, 3 // table.shape[1], axis=1).T, name)


def _response(exposure: np.ndarray, name: str) -> Response:
    """A response from exposures (3, levels); those that are not positive, at the dark end, go on towards black."""
    curves = []
    for channel in exposure:
        positive = np.flatnonzero(channel > 0)
        if not np.all(np.isfinite(channel)) or len(positive) < len(channel) // 2:
            raise ValueError(f"{name}: most of its exposures are not positive; it is no response curve")
        # The last stretch that rises to white; before it a polynomial may have turned or fallen below 0.
        falls = np.flatnonzero((np.diff(channel) < 0) | (channel[:-1] <= 0))
        first = int(falls[-1]) + 1 if len(falls) else 0
        if first > len(channel) // 8:
            raise ValueError(f"{name}: its exposure falls from value {first - 1} to {first}; a response rises")
        curve = np.log(np.maximum(channel, channel[first]))
        place = np.log(np.maximum(np.arange(len(channel)), 0.5))
        beyond = min(first + max(8, len(channel) // 32), len(channel) - 1)
        slope = max((curve[beyond] - curve[first]) / (place[beyond] - place[first]), 1e-3)
        curve[:first] = curve[first] + slope * (place[:first] - place[first])
        curves.append(curve + 1e-9 * np.arange(len(channel)))
    log_exposure = np.stack(curves)
    middle = (log_exposure.shape[1] - 1) // 2
    return Response(log_exposure - log_exposure[:, middle : middle + 1], np.full(3, ROUNDING))
