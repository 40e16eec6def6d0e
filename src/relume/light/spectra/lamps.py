"""Lamps by their spectra: files of measured power, and the linear Rec. 709 light that a lamp of a luminance sends."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np

from relume.errors import UnreadableFile, warn
from relume.image.colour import LUMINANCE_WEIGHTS, triple
from relume.light.spectra.spectrum import Spectrum, rgb_matching, visible

LARGEST = 10_000_000
"""Bytes of a spectrum's file; an instrument's has a few thousand."""


def lamp_colour(spectrum: Spectrum, luminance: float = 1.0) -> tuple[float, float, float]:
    """Linear Rec. 709 light of a spectrum, for the `radiance` or the `intensity` of a lamp.

    spectrum : of the lamp, in any unit
    luminance : the light's luminance in cd/m², or its luminous intensity in cd

    A lamp redder than 2000 K or of one line has colours outside of Rec. 709: what is below 0 becomes 0 with a warning,
    the luminance stays. Raises ValueError for a luminance that is not 0 or more, and for a spectrum that is black.
    """
    if not 0 <= luminance < np.inf:
        raise ValueError(f"the luminance of a lamp is {luminance:g}; expected 0 or more")
    seen = spectrum.at(visible()) @ rgb_matching()
    bright = float(seen @ LUMINANCE_WEIGHTS)
    if not bright > 0:
        raise ValueError("the spectrum of a lamp has no light from 380 to 780 nm; give its power at wavelengths in nm")
    colour = seen / bright
    if colour.min() < 0:
        inside = np.maximum(colour, 0)
        inside /= inside @ LUMINANCE_WEIGHTS
        warn(
            f"the lamp's colour, {', '.join(f'{value:.3f}' for value in colour)}, is outside of Rec. 709 and is taken "
            f"for {', '.join(f'{value:.3f}' for value in inside)}, as bright"
        )
        colour = inside
    return triple(luminance * colour)


def read_spectrum(path: Path | str) -> Spectrum:
    """A spectrum of a text file: lines of a wavelength in nm and a value, between commas, semicolons, tabs or spaces.

    path : the file

    Lines before the first of numbers are a heading; `#` begins a remark; more columns than two are refused. Raises
    UnreadableFile naming the line.
    """
    path = Path(path)
    rows: list[tuple[float, float]] = []
    for number, line in enumerate(_text(path).splitlines(), 1):
        cells = [cell for cell in next(csv.reader([_plain(line)]), []) if cell.strip()]
        if not cells:
            continue
        try:
            values = [float(cell) for cell in cells]
        except ValueError:
            if not rows:
                continue
            raise UnreadableFile(
                f"{path}: line {number} is {line.strip()[:40]!r}; expected a wavelength in nm and a value"
            ) from None
        if len(values) != 2:
            raise UnreadableFile(
                f"{path}: line {number} has {len(values)} numbers; a spectrum has two columns, wavelength in nm and "
                "value"
            )
        rows.append((values[0], values[1]))
    if len(rows) < 2:
        raise UnreadableFile(
            f"{path}: has {len(rows)} lines of numbers; a spectrum needs two or more, of a wavelength in nm and a value"
        )
    rows.sort()
    try:
        return Spectrum(*zip(*rows, strict=True))
    except ValueError as error:
        raise UnreadableFile(f"{path}: {error}") from None


def _text(path: Path) -> str:
    try:
        if path.stat().st_size > LARGEST:
            raise UnreadableFile(f"{path}: is too large for a spectrum; expected lines of a wavelength and a value")
        return path.read_text(encoding="utf-8-sig")
    except FileNotFoundError:
        raise UnreadableFile(f"{path}: no such spectrum; check the path") from None
    except (OSError, UnicodeDecodeError) as error:
        raise UnreadableFile(f"{path}: cannot be read ({error.__class__.__name__}); is it a text file?") from None


def _plain(line: str) -> str:
    line = line.split("#")[0].strip()
    for separator in ";\t":
        line = line.replace(separator, ",")
    return line if "," in line else ",".join(line.split())
