"""What a projector shows so that a camera knows, at each pixel, which of its pixels lights the place that is seen.

Gray code numbers the half-periods across and down; a cosine shifted in steps places within them, far finer than a
projector's pixel, and shows the light that comes straight from the projector: light that is scattered below skin or
between surfaces is blurred over the periods and does not answer to the shift (Nayar et al. 2006). Projector pixels are
counted as a picture's: x right, y down from the upper left corner, pixel centres at halves.
"""

from __future__ import annotations

import json
import os
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from relume.errors import UnreadableFile
from relume.image import files
from relume.image.colour import encode_srgb
from relume.image.files.atomic import made_folder
from relume.image.photograph import Photograph
from relume.lightstage.matting.gray_code import gray_stripes

LIST = "projector.json"


@dataclass(frozen=True)
class ProjectorPatterns:
    """Pictures that a projector shows one after the other: white, black, Gray code and shifted cosines of both axes.

    width, height : pixels of the projector
    period : of the cosine, projector pixels, even; 16 is short against how far light spreads between surfaces, and
        long enough for a camera that does not resolve the projector's pixels
    steps : shifts of the cosine over one period; with 8 the projector's tone curve may bend harmonics up to the sixth
        and moves no phase

    Raises ValueError for what no projector can show.
    """

    width: int
    height: int
    period: int = 16
    steps: int = 8

    def __post_init__(self) -> None:
        if self.period < 4 or self.period % 2:
            raise ValueError(f"a period of {self.period} projector pixels; give an even number from 4 on, like 16")
        if self.steps < 4:
            raise ValueError(f"{self.steps} steps of the phase; give 4 or more, like 8: fewer show no noise")
        if min(self.width, self.height) <= self.period:
            raise ValueError(f"a projector of {self.width}×{self.height} pixels; expected more than a period each way")

    def length(self, axis: str) -> int:
        """Projector pixels along an axis, "x" or "y"."""
        return self.width if axis == "x" else self.height

    def cells(self, axis: str) -> int:
        """Half-periods along an axis, those begun counted: what its Gray code numbers."""
        return -(-self.length(axis) // (self.period // 2))

    def levels(self, axis: str) -> int:
        """Levels of an axis's Gray code."""
        return (self.cells(axis) - 1).bit_length()

    @property
    def names(self) -> tuple[str, ...]:
        """The names of the pictures, in the order in which they are shown."""
        coded = [f"gray_{axis}{level}" for axis in "xy" for level in range(self.levels(axis))]
        shifted = [f"phase_{axis}{step}" for axis in "xy" for step in range(self.steps)]
        return ("white", "black", *coded, *shifted)

    def pictures(self) -> Iterator[tuple[str, np.ndarray]]:
        """Each picture's name and the light that it shows, (height, width) float32, 0 to 1."""
        yield "white", np.ones((self.height, self.width), np.float32)
        yield "black", np.zeros((self.height, self.width), np.float32)
        for axis in "xy":
            for level in range(self.levels(axis)):
                white = gray_stripes(axis, level, self.cells(axis)).white
                yield f"gray_{axis}{level}", self._across(axis, np.repeat(white, self.period // 2))
        for axis in "xy":
            turns = (np.arange(self.length(axis)) + 0.5) / self.period
            for step in range(self.steps):
                wave = 0.5 + 0.5 * np.cos(2 * np.pi * (turns - step / self.steps))
                yield f"phase_{axis}{step}", self._across(axis, wave)

    def _across(self, axis: str, values: np.ndarray) -> np.ndarray:
        """Values along an axis as a picture that is the same all along the other one."""
        line = values[: self.length(axis)].astype(np.float32)
        return np.broadcast_to(line if axis == "x" else line[:, None], (self.height, self.width))


def write_patterns(folder: str | os.PathLike[str], patterns: ProjectorPatterns) -> tuple[Path, ...]:
    """Write the pictures to project as PNG files into a folder, and projector.json, which the photographs need too.

    folder : made where it is missing
    patterns : the projector's

    Codes are sRGB's, as projectors show pictures. Returns the files. Raises OutputNotWritten.
    """
    place = made_folder(folder)
    written = []
    for name, light in patterns.pictures():
        codes = np.rint(255 * encode_srgb(light)).astype(np.uint8)
        written.append(place / f"{name}.png")
        files.write(written[-1], Photograph(np.repeat(codes[..., None], 3, axis=-1)))
    files.write_text(place / LIST, json.dumps(asdict(patterns), indent=1) + "\n")
    return (*written, place / LIST)


def read_projector_patterns(folder: str | os.PathLike[str]) -> ProjectorPatterns:
    """What the projector showed, from the projector.json in a folder; raises UnreadableFile."""
    path = Path(folder) / LIST
    try:
        table = json.loads(path.read_text("utf-8"))
        return ProjectorPatterns(**{name: int(value) for name, value in table.items()})
    except FileNotFoundError:
        raise UnreadableFile(f"{path}: is missing; copy it from the folder of the patterns that were shown") from None
    except (OSError, AttributeError, TypeError, ValueError) as error:
        raise UnreadableFile(
            f"{path}: does not describe patterns ({error}); `relume stage patterns` writes one"
        ) from None
