"""A camera that turns radiance into what a photographer brings home: noisy 8-bit JPEGs with EXIF. NumPy and Pillow.

Radiance 1.0 is 100 cd/m². A pixel is white at an exposure of 1.2 lx·s · 100 / ISO behind the lens's f-number, as ISO
12232's saturation speed has it (78 cd/m² at 1 s, f/1, ISO 1 over the lens's 0.65). Nothing here comes from relume.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path

import numpy as np
import OpenEXR
from PIL import ExifTags, Image
from PIL.TiffImagePlugin import IFDRational

WHITE = 1.2
"""Radiance × 100 · seconds · ISO / 100 ÷ f² that is white."""


def read(path: Path) -> np.ndarray:
    """(H, W, 3) float32 radiance of an EXR."""
    with OpenEXR.File(str(path)) as file:
        return file.channels()["RGB"].pixels.astype(np.float32)


def write(path: Path, pixels: np.ndarray) -> None:
    """(H, W, 3) float32 as an EXR."""
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    with OpenEXR.File(header, {"RGB": pixels.astype(np.float32)}) as file:
        file.write(str(path))


def knee(x: np.ndarray) -> np.ndarray:
    """A toe, a power of 2.1 and highlights pressed together."""
    encoded = (x * x / (x + 2e-3) * 1.002) ** (1 / 2.1)
    return encoded * 3.5 / (encoded + 2.5)


def contrasty(x: np.ndarray) -> np.ndarray:
    """sRGB's curve under an S, as cameras call vivid."""
    value = np.where(x <= 0.0031308, 12.92 * x, 1.055 * np.maximum(x, 1e-9) ** (1 / 2.4) - 0.055)
    return value + 0.5 * value * (1 - value) * (2 * value - 1)


def film(x: np.ndarray) -> np.ndarray:
    """Toe and shoulder."""
    power = x**0.95
    return power / (power + 0.16) * 1.16


def logarithmic(x: np.ndarray) -> np.ndarray:
    """As video cameras keep highlights."""
    return np.log1p(40 * x) / np.log1p(40.0)


@dataclass(frozen=True)
class Camera:
    """A camera and its settings; ISO, aperture and balance do not change during a shoot.

    curve : encodes exposure, 0 to 1, as a value, 0 to 1; red and blue are bent a little beside it
    electrons, read_noise : of a pixel at white; standard deviation, electrons
    falloff : of light at the corners, a share
    quality, subsampling : of the JPEGs, as Pillow has them
    plate_stops, ball_stops : between the photographs of the plate, of the ball
    ball_filter : a grey filter before the lens at the ball: what it divides by
    """

    model: str
    curve: Callable[[np.ndarray], np.ndarray]
    electrons: float
    read_noise: float
    f_number: float
    iso: int
    falloff: float
    quality: int
    subsampling: int
    plate_stops: float
    ball_stops: float
    ball_filter: float = 1.0

    def exposure(self, radiance: np.ndarray, seconds: float) -> np.ndarray:
        """What reaches the sensor, 1 at white."""
        return radiance * (100 * seconds * self.iso / 100 / self.f_number**2 / WHITE)

    def seconds(self, radiance: float) -> float:
        """The longest time, in thirds of a stop, that keeps `radiance` at or below 0.9 of white."""
        longest = 0.9 / float(self.exposure(np.float64(radiance), 1.0))
        return float(2 ** (np.floor(np.log2(longest) * 3) / 3))

    def passed(self, height: int, width: int) -> np.ndarray:
        """(H, W, 1), the share of light that the lens passes: it falls off with the square of the distance from the
        middle."""
        y, x = np.mgrid[:height, :width] + 0.5
        r2 = ((x - width / 2) ** 2 + (y - height / 2) ** 2) / (width**2 + height**2) * 4
        return 1 - self.falloff * r2[..., None]

    def values(self, radiance: np.ndarray, seconds: float, seed: int) -> np.ndarray:
        """(H, W, 3) uint8."""
        generator = np.random.default_rng(seed)
        light = self.exposure(radiance.astype(np.float64), seconds) * self.passed(*radiance.shape[:2])
        caught = generator.poisson(np.clip(light, 0, 4) * self.electrons)
        x = np.clip((caught + generator.normal(0, self.read_noise, light.shape)) / self.electrons, 0, 1)
        value = self.curve(x) ** (1 + np.array([0.012, 0.0, -0.01]))
        return np.rint(np.clip(value, 0, 1) * 255).astype(np.uint8)

    def photograph(
        self, path: Path, radiance: np.ndarray, seconds: float, focal_length: float, *, seed: int, clock: int
    ) -> None:
        """One JPEG; `focal_length` in mm on 36 mm, `clock` in seconds after ten."""
        exif = Image.Exif()
        exif[ExifTags.Base.Make], exif[ExifTags.Base.Model] = "Virtual", self.model
        shutter = Fraction(seconds).limit_denominator(4_000_000)
        exif.get_ifd(ExifTags.IFD.Exif).update({
            ExifTags.Base.ExposureTime: IFDRational(shutter.numerator, shutter.denominator),
            ExifTags.Base.FNumber: IFDRational(round(self.f_number * 10), 10),
            ExifTags.Base.ISOSpeedRatings: self.iso,
            ExifTags.Base.DateTimeOriginal: f"2026:11:02 10:{clock // 60:02d}:{clock % 60:02d}",
            ExifTags.Base.FocalLength: IFDRational(round(focal_length * 1000), 1000),
            ExifTags.Base.FocalLengthIn35mmFilm: round(focal_length),
        })  # fmt: skip
        path.parent.mkdir(parents=True, exist_ok=True)
        picture = Image.fromarray(self.values(radiance, seconds, seed))
        picture.save(path, quality=self.quality, subsampling=self.subsampling, exif=exif)


CAMERAS = {
    "indoor_windows": Camera("curve_b", knee, 30_000, 5, 8.0, 100, 0.01, 95, 0, 1.0, 1.0),
    "outdoor_noon": Camera("curve_c", contrasty, 50_000, 4, 11.0, 100, 0.015, 93, 0, 1.5, 2.0, ball_filter=1000.0),
    "night_street": Camera("curve_d", film, 20_000, 6, 4.0, 400, 0.02, 95, 2, 1.5, 1.5),
    "product_table": Camera("curve_e", logarithmic, 60_000, 3, 11.0, 100, 0.005, 97, 0, 1.0, 1.25),
}
"""The camera of each shoot."""
