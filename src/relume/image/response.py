"""The response of a camera: the curve between sensor exposure and pixel value, readable both ways."""

from __future__ import annotations

import json
from dataclasses import dataclass

import numpy as np

from relume.image.colour import decode_srgb


@dataclass(frozen=True, eq=False)
class Response:
    """One curve a channel, g(z) = ln f⁻¹(z) (Debevec & Malik 1997, §2.1).

    log_exposure : (3, levels) float64, natural logarithm of the exposure that gives each pixel value;
        rising; its zero is the scale of the radiance that is merged with it
    noise : standard deviation of a pixel value about the curve, in pixel values: (3,), or (3, levels) where it is
        known at every value (photons make bright values noisier)
    """

    log_exposure: np.ndarray
    noise: np.ndarray

    def __post_init__(self) -> None:
        if self.log_exposure.ndim != 2 or self.log_exposure.shape[0] != 3:
            raise ValueError(f"log_exposure is {self.log_exposure.shape}; a response is (3, levels)")
        if np.any(np.diff(self.log_exposure, axis=1) <= 0):
            raise ValueError("log_exposure does not rise everywhere; a response must be invertible")
        if self.noise.shape not in ((3,), self.log_exposure.shape):
            raise ValueError(f"noise is {self.noise.shape}; expected (3,) or {self.log_exposure.shape}")

    @property
    def levels(self) -> int:
        """The number of pixel values: 256 for 8-bit photographs."""
        return self.log_exposure.shape[1]

    @property
    def deviation(self) -> np.ndarray:
        """The standard deviation (3, levels) of every pixel value, in pixel values."""
        noise = self.noise if self.noise.ndim == 2 else self.noise[:, None]
        return np.broadcast_to(noise, self.log_exposure.shape)

    def pixel_values(self, exposure: np.ndarray) -> np.ndarray:
        """Pixel values (H, W, 3), not rounded, of a sensor `exposure` (H, W, 3): a virtual photograph (§2.7)."""
        with np.errstate(divide="ignore"):
            logarithm = np.log(np.maximum(exposure, 0.0))
        values = np.arange(self.levels, dtype=np.float64)
        return np.stack([np.interp(logarithm[..., c], g, values) for c, g in enumerate(self.log_exposure)], axis=-1)

    def balanced_at(self, value: int) -> Response:
        """The curves shifted so that pixels of equal `value` in all channels are achromatic (§2.6).

        The middle value is the paper's choice, for film. A digital camera balances its channels before it encodes
        them, and its white (255, 255, 255) is the neutral its maker meant: photographs are balanced at 255.
        """
        shift = self.log_exposure[:, value] - self.log_exposure[:, value].mean()
        return Response(self.log_exposure - shift[:, None], self.noise)

    def _repr_html_(self) -> str:
        """What a notebook shows: ln exposure over pixel value, channel by channel."""
        from relume.image.files.photographs.notebook_html import curves_html, three

        span = (self.log_exposure[:, -2] - self.log_exposure[:, 1]) / np.log(2)
        facts = {
            "response": f"{self.levels} pixel values",
            "drawn": "ln exposure over pixel value",
            "stops from the second to the last but one": three(span),
            "noise, pixel values": three(self.deviation.mean(axis=1)),
        }
        return curves_html(np.arange(self.levels, dtype=np.float64), self.log_exposure, facts)

    def to_json(self) -> str:
        """The response as text, for a file kept beside the pictures it made."""
        return json.dumps({"log_exposure": self.log_exposure.tolist(), "noise": self.noise.tolist()})

    @staticmethod
    def from_json(text: str) -> Response:
        """The response that `to_json` wrote; raises ValueError for any other text."""
        try:
            table = json.loads(text)
            return Response(np.array(table["log_exposure"], np.float64), np.array(table["noise"], np.float64))
        except (KeyError, TypeError, ValueError) as error:
            raise ValueError(f"not a response file of relume: {error}") from None


def srgb_response(levels: int = 256) -> Response:
    """The sRGB curve as a response (IEC 61966-2-1), exposure 1 white, its only noise that of rounding.

    The value 0 has no exposure of its own: it stands a quarter of the way to 1.
    """
    share = np.arange(levels) / (levels - 1)
    share[0] = 0.25 * share[1]
    return Response(np.tile(np.log(decode_srgb(share)), (3, 1)), np.full(3, np.sqrt(1 / 12)))
