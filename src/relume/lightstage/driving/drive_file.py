"""A stage's settings as files: JSON, which holds all, and CSV, which a spreadsheet or a lighting desk reads.

JSON: {"kind": "relume stage drive", "version": 1, "primaries": [{"name", "irradiance": [r, g, b]}], "maximum": number
or null, "lights": [{"name", "direction": [x, y, z], "intensities": {primary: number}}], "headroom", "clipped",
"residual", "beyond_gamut"}. CSV: a header `light,x,y,z,<primaries…>`, then a line a light. Directions are unit vectors
from the subject towards the light, +Y up; intensities are factors on a primary's irradiance, or shares of full power
where they are written with `normalised`.
"""

from __future__ import annotations

import csv
import io
import json
import os
from pathlib import Path

import numpy as np

from relume.errors import UnreadableFile
from relume.image.files import write_text
from relume.lightstage.driving.driving import Drive
from relume.lightstage.driving.primaries import LampPrimaries
from relume.lightstage.field.lights import StageLights

_KIND = "relume stage drive"


def write_drive(path: str | os.PathLike[str], drive: Drive) -> None:
    """Write settings to .json or .csv, whole or not at all.

    Where the primaries have a maximum, CSV holds shares of it, 0 to 1, which is what lighting desks take; JSON always
    holds intensities.
    Raises ValueError for another suffix, OutputNotWritten.
    """
    suffix = Path(path).suffix.lower()
    if suffix not in (".json", ".csv"):
        raise ValueError(f'{path} ends in "{suffix}"; settings of a stage are written to .json or .csv')
    write_text(path, drive_as_json(drive) if suffix == ".json" else drive_as_csv(drive))


def drive_as_json(drive: Drive) -> str:
    """The settings as a JSON document; numbers come back exactly."""
    names = drive.primaries.names
    document = {
        "kind": _KIND,
        "version": 1,
        "frame": "right-handed, +Y up; directions point from the subject towards the light",
        "primaries": [
            {"name": name, "irradiance": colour.tolist()}
            for name, colour in zip(names, drive.primaries.irradiance, strict=True)
        ],
        "maximum": _number(drive.primaries.maximum),
        "headroom": _number(drive.headroom),
        "clipped": drive.clipped,
        "residual": [_number(share) for share in drive.residual],
        "beyond_gamut": drive.beyond_gamut,
        "lights": [
            {
                "name": name,
                "direction": direction.tolist(),
                "intensities": dict(zip(names, intensities.tolist(), strict=True)),
            }
            for name, direction, intensities in zip(
                drive.lights.names, drive.lights.directions, drive.intensities, strict=True
            )
        ],
    }
    return json.dumps(document, indent=1, ensure_ascii=False) + "\n"


def drive_as_csv(drive: Drive) -> str:
    """The settings as a table: name, direction and one column a primary, shares of the maximum where there is one."""
    maximum = drive.primaries.maximum
    shares = drive.intensities / maximum if np.isfinite(maximum) else drive.intensities
    text = io.StringIO()
    table = csv.writer(text, lineterminator="\n")
    table.writerow(["light", "x", "y", "z", *drive.primaries.names])
    for name, direction, row in zip(drive.lights.names, drive.lights.directions, shares, strict=True):
        table.writerow([name, *(f"{value:.9g}" for value in (*direction, *row))])
    return text.getvalue()


def read_drive(path: str | os.PathLike[str], primaries: LampPrimaries | None = None) -> Drive:
    """The settings in a .json or .csv file.

    primaries : of a CSV's columns, which holds none; RGB without a maximum unless given
    Raises UnreadableFile, in one line, for a file that is missing, damaged or of another kind.
    """
    try:
        text = Path(path).read_bytes().decode("utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        reason = error.strerror if isinstance(error, OSError) else "it is no text"
        raise UnreadableFile(f"{path}: cannot be read: {reason}; give what `relume stage drive` wrote") from None
    try:
        return _from_json(text) if Path(path).suffix.lower() == ".json" else _from_csv(text, primaries)
    except (KeyError, TypeError, ValueError, IndexError, AttributeError) as error:
        what = f"there is no {error}" if isinstance(error, KeyError) else " ".join(str(error).split())
        raise UnreadableFile(f"{path}: no settings of a stage: {what}; write it with `relume stage drive`") from None


def _from_json(text: str) -> Drive:
    document = json.loads(text)
    if not isinstance(document, dict) or document.get("kind") != _KIND:
        raise ValueError(f'its "kind" is not "{_KIND}"')
    if document["version"] != 1:
        raise ValueError(f"its version is {document['version']}, and 1 is known")
    colours = np.array([primary["irradiance"] for primary in document["primaries"]], np.float64)
    maximum = np.inf if document["maximum"] is None else float(document["maximum"])
    primaries = LampPrimaries(tuple(primary["name"] for primary in document["primaries"]), colours, maximum)
    entries = document["lights"]
    lights = StageLights.towards(
        np.array([entry["direction"] for entry in entries], np.float64), tuple(entry["name"] for entry in entries)
    )
    intensities = np.array([[entry["intensities"][name] for name in primaries.names] for entry in entries], np.float64)
    residual = np.array([np.inf if share is None else share for share in document["residual"]], np.float64)
    headroom = np.inf if document["headroom"] is None else float(document["headroom"])
    return Drive(
        lights, primaries, _checked(intensities), residual, document["clipped"], headroom, document["beyond_gamut"]
    )


def _from_csv(text: str, primaries: LampPrimaries | None) -> Drive:
    rows = [row for row in csv.reader(io.StringIO(text)) if row]
    header = [cell.strip() for cell in rows[0]] if rows else []
    if header[:4] != ["light", "x", "y", "z"] or len(header) < 5:
        raise ValueError(f'its first line is "{",".join(header)}"; expected light,x,y,z and the primaries')
    lamps = LampPrimaries.rgb() if primaries is None else primaries
    if tuple(header[4:]) != lamps.names:
        raise ValueError(f"its primaries are {', '.join(header[4:])}; expected {', '.join(lamps.names)}")
    for number, row in enumerate(rows[1:], start=2):
        if len(row) != len(header):
            raise ValueError(f"line {number} has {len(row)} values; expected {len(header)}")
    numbers = np.array([[float(cell) for cell in row[1:]] for row in rows[1:]], np.float64).reshape(-1, len(header) - 1)
    lights = StageLights.towards(numbers[:, :3], tuple(row[0] for row in rows[1:]))
    shares = _checked(numbers[:, 3:])
    intensities = shares * lamps.maximum if np.isfinite(lamps.maximum) else shares
    return Drive(lights, lamps, intensities, np.full(3, np.nan))


def _checked(intensities: np.ndarray) -> np.ndarray:
    if not np.all(np.isfinite(intensities)) or np.any(intensities < 0):
        raise ValueError("an intensity is negative or not finite")
    return intensities


def _number(value: float) -> float | None:
    """What JSON can hold: infinity is null."""
    return float(value) if np.isfinite(value) else None
