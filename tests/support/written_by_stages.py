"""Plain readers of what a stage writes, as witnesses of the round trip: .ptm, .rti and the settings of lamps."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import numpy as np

from relume.lightstage.driving.driving import Drive, LampPrimaries
from relume.lightstage.field.lights import StageLights
from relume.lightstage.rti.hsh import HemisphericalHarmonics
from relume.lightstage.rti.ptm import PolynomialTexture


def read_ptm(path: Path) -> PolynomialTexture:
    """A polynomial texture map, RGB or LRGB (PtmFormat12, Hewlett-Packard 2001)."""
    content, words, start = path.read_bytes(), [], 0
    while len(words) < 16:  # numbers may stand on one line or on several
        end = content.index(b"\n", start)
        words += content[start:end].decode("latin-1").split()
        start = end + 1
    form, width, height = words[1], int(words[2]), int(words[3])
    scales, biases = np.array(words[4:10], np.float64), np.array(words[10:16], np.float64)
    body = np.frombuffer(content, np.uint8, width * height * (18 if form == "PTM_FORMAT_RGB" else 9), start)
    if form == "PTM_FORMAT_RGB":
        codes, colour = np.moveaxis(body.reshape(3, height, width, 6), 0, 2), None
    else:
        size = width * height * 6
        codes, colour = body[:size].reshape(height, width, 1, 6), body[size:].reshape(height, width, 3)
    coefficients = ((codes[::-1].astype(np.float64) - biases) * scales / 255).astype(np.float32)
    return PolynomialTexture(coefficients, None if colour is None else (colour[::-1] / 255).astype(np.float32))


def read_hsh(path: Path) -> HemisphericalHarmonics:
    """Hemispherical harmonics, as RTIViewer and RelightLab read them."""
    content, lines, start = path.read_bytes(), [], 0
    assert content.startswith(b"#HSH")
    while len(lines) < 3:
        end = content.index(b"\n", start)
        line, start = content[start:end].decode("latin-1").strip(), end + 1
        lines += [] if line.startswith("#") else [line]
    width, height, _ = (int(word) for word in lines[1].split())
    terms = int(lines[2].split()[0])
    scale, bias = np.frombuffer(content, "<f4", 2 * terms, start).reshape(2, terms).astype(np.float64)
    codes = np.frombuffer(content, np.uint8, width * height * 3 * terms, start + 8 * terms)
    return HemisphericalHarmonics((codes.reshape(height, width, 3, terms) / 255 * scale + bias).astype(np.float32))


def read_drive(path: Path, primaries: LampPrimaries | None = None) -> Drive:
    """The settings in a .json, or in a .csv whose columns are of `primaries`."""
    if path.suffix == ".csv":
        with path.open(newline="") as file:
            rows = list(csv.reader(file))
        lamps = LampPrimaries.rgb() if primaries is None else primaries
        assert rows[0] == ["light", "x", "y", "z", *lamps.names]
        numbers = np.array([[float(cell) for cell in row[1:]] for row in rows[1:]])
        lights = StageLights.towards(numbers[:, :3], tuple(row[0] for row in rows[1:]))
        shares = numbers[:, 3:]
        return Drive(
            lights, lamps, shares * lamps.maximum if np.isfinite(lamps.maximum) else shares, np.full(3, np.nan)
        )
    table = json.loads(path.read_text("utf-8"))
    colours = np.array([primary["irradiance"] for primary in table["primaries"]])
    maximum = np.inf if table["maximum"] is None else table["maximum"]
    lamps = LampPrimaries(tuple(primary["name"] for primary in table["primaries"]), colours, maximum)
    entries = table["lights"]
    lights = StageLights.towards(
        np.array([entry["direction"] for entry in entries]), tuple(entry["name"] for entry in entries)
    )
    intensities = np.array([[entry["intensities"][name] for name in lamps.names] for entry in entries])
    residual = np.array([np.inf if share is None else share for share in table["residual"]])
    headroom = np.inf if table["headroom"] is None else table["headroom"]
    return Drive(lights, lamps, intensities, residual, table["clipped"], headroom, table["beyond_gamut"])
