"""A photograph: encoded pixel values, or what a sensor read before any colour was made of it, with their exposure."""

from __future__ import annotations

from dataclasses import dataclass, field
from datetime import datetime

import numpy as np


@dataclass(frozen=True)
class Exposure:
    """How much light the sensor was given: shutter, aperture and sensitivity.

    seconds : exposure time Δt, s
    f_number : aperture N; None for a lens that reports none
    iso : sensitivity S; None where the camera stores none
    source : who says so: "given", "sidecar", "EXIF", "name" (the file's) or "estimated"; exposures of
        different sources may be equal
    """

    seconds: float
    f_number: float | None = None
    iso: float | None = None
    source: str = field(default="given", compare=False)

    def __post_init__(self) -> None:
        for name in ("seconds", "f_number", "iso"):
            value = getattr(self, name)
            if value is not None and not (np.isfinite(value) and value > 0):
                raise ValueError(f"{name} is {value}; an exposure needs a positive {name}")

    @property
    def factor(self) -> float:
        """Pixel exposure per unit of radiance, Δt · (S/100) / N²; an unknown S is 100, an unknown N is 1.

        Reciprocity (Debevec & Malik 1997, §2.1) extended over aperture and gain, so that brackets taken at
        different settings share one scale.

        >>> Exposure(1 / 100, f_number=2.0, iso=400).factor
        0.01
        """
        return self.seconds * (self.iso or 100.0) / 100.0 / (self.f_number or 1.0) ** 2


@dataclass(frozen=True)
class Settings:
    """What else a file stores about how its photograph was made; None for what it does not.

    taken : when the shutter opened, to the fraction of a second where the camera writes one
    automatic_white : whether the camera chose the white balance itself
    bias : exposure compensation, stops; it moved what the camera chose and is already in `Exposure`, so never added
    lens : its model
    serial : of the body, so that two cameras of one model are distinguished
    focal_length : of the lens, mm
    make, model : of the camera, each as EXIF has it; `Photograph.camera` is both in one
    owner, copyright, comments : who took it, who has the rights, what it shows
    latitude, longitude : where it was taken, degrees north and east (WGS 84 unless the camera was set otherwise)
    """

    taken: datetime | None = None
    automatic_white: bool | None = None
    bias: float | None = None
    lens: str | None = None
    serial: str | None = None
    focal_length: float | None = None
    make: str | None = None
    model: str | None = None
    owner: str | None = None
    copyright: str | None = None
    comments: str | None = None
    latitude: float | None = None
    longitude: float | None = None

    def __post_init__(self) -> None:
        for name, most in (("latitude", 90), ("longitude", 180)):
            value = getattr(self, name)
            if value is not None and not -most <= value <= most:
                raise ValueError(f"{name} is {value}; expected degrees from −{most} to {most}")


@dataclass(frozen=True)
class JpegCoding:
    """How a JPEG was coded.

    quantisation : its tables of 64 steps, brightness first, in the file's order
    subsampling : 0 of colour at full resolution (4:4:4), 1 at half of it across (4:2:2), 2 also down (4:2:0)
    """

    quantisation: tuple[tuple[int, ...], ...]
    subsampling: int


@dataclass(frozen=True, eq=False)
class Photograph:
    """Encoded pixels as a camera wrote them, with what the file stores about how they were made.

    pixels : (H, W, 3) uint8 or uint16, encoded by the camera's response
    name : the file it came from, for messages
    exposure : shutter, aperture, ISO; None where the file has none
    camera : make and model, "" where unknown; photographs of one camera share a response
    focal_length : in pixels of this photograph's width, None where unknown
    outside : (H, W) bool, True where a pixel is not part of the picture (a border left by registration, alpha 0, a
        thing that moved through this frame alone); such pixels count nowhere. None where all are part
    settings : what else the file stores
    profile : the ICC profile that its values are of, as embedded, or as its EXIF names one. None where there is none:
        sRGB
    uncropped : (width, height) that it had before it was cropped; None where it was not, or nothing says so
    gain_map : whether its file has a gain map for HDR screens besides, of which these pixels show nothing
    jpeg : how the JPEG was coded that the pixels were read from; None for other files
    """

    pixels: np.ndarray
    name: str = "photograph"
    exposure: Exposure | None = None
    camera: str = ""
    focal_length: float | None = None
    outside: np.ndarray | None = None
    settings: Settings = Settings()
    profile: bytes | None = field(default=None, repr=False)
    uncropped: tuple[int, int] | None = None
    gain_map: bool = False
    jpeg: JpegCoding | None = field(default=None, repr=False)

    def __post_init__(self) -> None:
        if self.pixels.ndim != 3 or self.pixels.shape[2] != 3 or self.pixels.dtype not in (np.uint8, np.uint16):
            raise ValueError(
                f"pixels are {self.pixels.shape} {self.pixels.dtype}; a photograph is (H, W, 3) uint8 or uint16"
            )
        if self.outside is not None and (self.outside.shape != self.pixels.shape[:2] or self.outside.dtype != bool):
            raise ValueError(
                f"outside is {self.outside.shape} {self.outside.dtype}; expected {self.pixels.shape[:2]} bool"
            )

    @property
    def size(self) -> tuple[int, int]:
        """The (width, height) in pixels."""
        return self.pixels.shape[1], self.pixels.shape[0]

    @property
    def make_and_model(self) -> tuple[str, str]:
        """The camera's make and model apart, as EXIF has them; "" for each that is unknown.

        Where `settings` names another camera than `camera` does, `camera` is believed and the make is unknown.
        """
        make, model = self.settings.make or "", self.settings.model or ""
        if not self.camera or self.camera == named(make, model):
            return make, model
        if make and not model and self.camera.startswith(make + " "):
            return make, self.camera.removeprefix(make).strip()
        return "", self.camera


def named(make: str, model: str) -> str:
    """A camera's make and model in one, the make once where the model repeats it; "" where both are."""
    return model if model.startswith(make) else f"{make} {model}".strip()


@dataclass(frozen=True, eq=False)
class RawPhotograph:
    """A camera raw: one value a photosite behind a Bayer pattern of colour filters, linear in the light.

    mosaic : (H, W) uint16, the lit part of the sensor, seen upright
    pattern : (2, 2) int, the channel, 0 red, 1 green, 2 blue, of the photosites at even and odd rows and columns
    black : (2, 2) float64, the value that no light gives, of the same photosites
    white : the value at which photosites are saturated
    matrix : (3, 3) float64, balanced camera colours → Rec. 709; its rows sum to 1, so that neutral stays neutral
    daylight : (3,) float64, what camera colours are multiplied by so that light of Rec. 709's white (D65) is neutral;
        the least of them is 1
    as_shot : (3,) float64, the same of the white that the camera set or its user chose; None where the file has none
    name : the file it came from, for messages
    exposure : shutter, aperture, ISO; None where the file has none
    camera : make and model, "" where unknown
    focal_length : in pixels, None where unknown
    settings : what else the file stores
    """

    mosaic: np.ndarray
    pattern: np.ndarray
    black: np.ndarray
    white: float
    matrix: np.ndarray
    daylight: np.ndarray
    as_shot: np.ndarray | None = None
    name: str = "raw"
    exposure: Exposure | None = None
    camera: str = ""
    focal_length: float | None = None
    settings: Settings = Settings()

    def __post_init__(self) -> None:
        if self.mosaic.ndim != 2 or self.mosaic.dtype != np.uint16 or min(self.mosaic.shape) < 6:
            raise ValueError(f"mosaic is {self.mosaic.shape} {self.mosaic.dtype}; a raw is (H, W) uint16, 6 at least")
        if not is_bayer(self.pattern):
            raise ValueError(f"pattern is {self.pattern}; a Bayer pattern has greens on a diagonal, a red and a blue")
        for name, shape in (("black", (2, 2)), ("matrix", (3, 3)), ("daylight", (3,))):
            if getattr(self, name).shape != shape:
                raise ValueError(f"{name} is {getattr(self, name).shape}; expected {shape}")
        if not np.all(self.black < self.white):
            raise ValueError(f"black is {self.black}, white {self.white}; white must be above black")

    @property
    def size(self) -> tuple[int, int]:
        """(width, height) in pixels."""
        return self.mosaic.shape[1], self.mosaic.shape[0]


def is_bayer(pattern: np.ndarray) -> bool:
    """Whether a (2, 2) pattern of channels has greens on one diagonal and a red and a blue on the other."""
    pattern = np.asarray(pattern)
    if pattern.shape != (2, 2):
        return False
    diagonals = [pattern.diagonal().tolist(), pattern[:, ::-1].diagonal().tolist()]
    return any(greens == [1, 1] and sorted(others) == [0, 2] for greens, others in (diagonals, diagonals[::-1]))
