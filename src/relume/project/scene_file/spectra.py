"""Lamps of a scene file by their spectra: `spectrum` beside intensity, irradiance or radiance."""

from __future__ import annotations

from pathlib import Path
from typing import TypeVar

from pydantic import model_validator

from relume.light.spectra.lamps import lamp_colour, read_spectrum
from relume.light.spectra.spectrum import Spectrum, blackbody, illuminant
from relume.project.scene_file.images import naming
from relume.project.schema import Table

AMOUNTS = ("intensity", "irradiance", "radiance")
"""The keys that say how much light a lamp gives."""
AnyTable = TypeVar("AnyTable", bound=Table)


class SpectrumTable(Table):
    """The spectrum of a lamp: a radiator's temperature in K, an illuminant of the CIE, or a file of two columns."""

    blackbody: float | None = None
    illuminant: str | None = None
    file: str | None = None

    @model_validator(mode="after")
    def _one_source(self) -> SpectrumTable:
        given = [name for name in SpectrumTable.model_fields if getattr(self, name) is not None]
        if len(given) != 1:
            raise ValueError(f"has {' and '.join(given) or 'none'}; give one of blackbody, illuminant and file")
        if self.file is None:
            self.made(Path())
        return self

    def made(self, folder: Path) -> Spectrum:
        """The spectrum; raises ValueError or UnreadableFile. folder : beside which a file is looked for."""
        if self.file is not None:
            return read_spectrum(folder / self.file)
        return blackbody(self.blackbody) if self.blackbody is not None else illuminant(self.illuminant or "")


def with_spectrum(table: AnyTable, place: str, folder: Path) -> AnyTable:
    """A lamp's table whose amount of light has the colour of its `spectrum`; the same where it has none.

    The amount is then a single number, the luminance of that key. Raises InvalidScene naming the key below `place`.
    """
    spectrum = getattr(table, "spectrum", None)
    if spectrum is None:
        return table
    key = next(name for name in AMOUNTS if hasattr(table, name))
    amount = getattr(table, key)
    with naming(f"{place}.{key}"):
        if not amount[0] == amount[1] == amount[2]:
            raise ValueError("is a colour beside a spectrum, which says it; give a number or leave the spectrum out")
    with naming(f"{place}.spectrum"):
        return table.model_copy(update={key: lamp_colour(spectrum.made(folder), amount[0])})
