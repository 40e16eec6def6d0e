"""What the pixel values of a stage's photographs stand for: sRGB, light itself, or a camera's own response."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from relume.errors import InvalidStage
from relume.image.colour import decode_srgb
from relume.image.colour_space import colour_space_of, in_rec709, response_of
from relume.image.photograph import Photograph
from relume.image.radiance import RadianceMap
from relume.image.response import Response

_BLACK = 0.25
"""What the value 0 stands for in a response, which has no logarithm of nothing: a quarter of the first value."""
_DEVIATION = 0.5
"""Of a value about a curve that nobody measured: that of rounding, and of a little noise."""


@dataclass(frozen=True, eq=False)
class PhotographEncoding:
    """How a stage's photographs are encoded.

    name : "srgb", "linear" or the response's file
    measured : the response of that file, else None
    """

    name: str = "srgb"
    measured: Response | None = None

    @staticmethod
    def named(name: str, folder: Path) -> PhotographEncoding:
        """ "srgb", "linear", or the response in a file of `folder`, as a merge writes it; raises InvalidStage."""
        if name in ("srgb", "linear"):
            return PhotographEncoding(name)
        path = folder / name
        try:
            return PhotographEncoding(name, Response.from_json(path.read_text("utf-8")))
        except FileNotFoundError:
            raise InvalidStage(
                f'{path}: no such response; encoding is "srgb", "linear" or the name of a response file'
            ) from None
        except (OSError, UnicodeDecodeError, ValueError) as error:
            raise InvalidStage(f"{path}: {error}; give the response file that a merge wrote") from None

    def response(self, levels: int, name: str, photograph: Photograph | None = None) -> Response:
        """As a response of so many values, whose white is 1 where nothing was measured; `name` is for messages.

        photograph : whose profile says what its values are where they are "srgb"
        """
        if self.name == "srgb" and photograph is not None and (own := response_of(photograph)) is not None:
            return own
        if self.measured is not None:
            if self.measured.levels != levels:
                raise InvalidStage(
                    f"{name} has {levels} values a channel, and the response {self.name} is of {self.measured.levels}; "
                    "give the response of these photographs"
                )
            return self.measured
        values = np.arange(levels, dtype=np.float64)
        values[0] = _BLACK
        curve = np.log(self._decoded(values / (levels - 1)))
        return Response(np.stack([curve] * 3), np.full(3, _DEVIATION))

    def linearised(self, photograph: Photograph) -> np.ndarray:
        """The exposures (H, W, 3) float32 of a photograph's pixels, in Rec. 709; of "srgb" as its profile says."""
        curves = self._exposures(photograph).astype(np.float32)
        own = np.stack([curves[channel][photograph.pixels[..., channel]] for channel in range(3)], axis=-1)
        return in_rec709(RadianceMap(own), photograph).radiance

    def step(self, photograph: Photograph) -> float:
        """How far apart the exposures of neighbouring codes are, as a root mean square over a photograph's values."""
        widths = np.gradient(self._exposures(photograph), axis=1)
        squares = [(widths[channel][photograph.pixels[..., channel]] ** 2).mean() for channel in range(3)]
        return float(np.sqrt(np.mean(squares)))

    def _exposures(self, photograph: Photograph) -> np.ndarray:
        """The exposure (3, levels) of every code of a photograph."""
        levels = int(np.iinfo(photograph.pixels.dtype).max) + 1
        if self.name == "srgb" and (space := colour_space_of(photograph)) is not None:
            return space.curves.T.astype(np.float64)
        if self.measured is None:
            return np.stack([self._decoded(np.arange(levels) / (levels - 1))] * 3)
        return np.exp(self.response(levels, photograph.name).log_exposure)

    def _decoded(self, values: np.ndarray) -> np.ndarray:
        return values if self.name == "linear" else decode_srgb(values)
