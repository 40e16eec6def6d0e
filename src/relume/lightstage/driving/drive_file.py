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

from relume.image.files import write_text
from relume.lightstage.driving.driving import Drive

_KIND = "relume stage drive"


def write_drive(path: str | os.PathLike[str], drive: Drive) -> None:
    """Write settings to .json or .csv, whole or not at all.

    path : .json or .csv
    drive : as `drive` solved it

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


def _number(value: float) -> float | None:
    """What JSON can hold: infinity is null."""
    return float(value) if np.isfinite(value) else None
