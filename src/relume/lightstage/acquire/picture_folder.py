"""A reflectance field that lies in a folder as pictures, read when they are asked for.

Radiance maps are taken as they are, photographs are linearised, brackets merged, and each is divided by its light's
irradiance: what comes out is R of `field`, in the pictures' unit. Nothing is believed unseen: sizes, negative light,
frames that stayed dark and values that are no numbers are refused by file and pixel.
"""

from __future__ import annotations

import threading
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from relume.capture.exposure.bracket import read_bracket
from relume.capture.merging import merge
from relume.errors import InvalidStage, warn
from relume.image import files
from relume.image.colour_space import in_rec709
from relume.image.photograph import Photograph
from relume.image.radiance import OUTSIDE, SATURATED
from relume.lightstage.acquire.encoding import PhotographEncoding
from relume.lightstage.field.field import Noise
from relume.lightstage.field.lights import StageLights
from relume.scene.cameras.camera import Camera

DARK = 0.012
"""Of white: photographs without any value above, 3 of 255, hold a sensor's noise and no light."""
ROUNDING = 1e-3
"""Of a picture's largest value: what is further below 0 is no rounding of a lossy format."""
KEPT = 2**29
"""Bytes of decoded pictures that are kept: 288 of 512×288, so that a small set is read once."""


@dataclass(frozen=True)
class _Picture:
    """A picture as read: radiance (H, W, 3) float32, and where it was saturated (H, W), None where nowhere."""

    radiance: np.ndarray
    saturated: np.ndarray | None


@dataclass(eq=False)
class _Kept:
    """What was read: the first pictures that fit stay, because blocks of rows go round all lights again and again and
    whatever makes room for the latest would throw out each picture just before it is asked for."""

    pictures: dict[int, _Picture] = field(default_factory=dict)
    latest: tuple[int, _Picture] | None = None
    amount: int = 0
    warned: set[str] = field(default_factory=set)
    lock: threading.Lock = field(default_factory=threading.Lock)


@dataclass(frozen=True, eq=False)
class PictureFolder:
    """A reflectance field over picture files.

    lights : of the pictures
    files : one tuple a light: its picture, or the photographs of its bracket
    irradiances : (N, 3), R, G, B at normal incidence
    shape : rows and columns, those of the first picture (`open_pictures` looks)
    camera, noise : as of every `ReflectanceField`
    encoding : of photographs
    exposures : seconds of each file of each light, by which what it shows is divided; None where the EXIF of
        photographs counts, and radiance maps stay as they are
    kept : bytes of decoded pictures held in memory
    """

    lights: StageLights
    files: tuple[tuple[Path, ...], ...]
    irradiances: np.ndarray
    shape: tuple[int, int]
    camera: Camera | None = None
    noise: Noise | None = None
    encoding: PhotographEncoding = PhotographEncoding()
    exposures: tuple[tuple[float, ...], ...] | None = None
    kept: int = KEPT
    _state: _Kept = field(default_factory=_Kept, repr=False, init=False)

    def __reduce__(self) -> tuple[object, ...]:
        # What was read stays here: another process, of another folder, reads the files itself.
        files = tuple(tuple(path.absolute() for path in paths) for paths in self.files)
        names = ("irradiances", "shape", "camera", "noise", "encoding", "exposures", "kept")
        return PictureFolder, (self.lights, files, *(getattr(self, name) for name in names))

    def block(self, lights: slice, rows: slice) -> np.ndarray:
        """Values (lights, rows, columns, 3) float32; raises InvalidStage, UnreadableFile, NotABracket."""
        chosen = range(len(self.lights))[lights]
        values = np.empty((len(chosen), len(range(self.shape[0])[rows]), self.shape[1], 3), np.float32)
        for place, index in enumerate(chosen):
            values[place] = self._picture(index).radiance[rows] / self.irradiances[index].astype(np.float32)
        return values

    def saturated(self, light: int) -> np.ndarray:
        """Where (H, W) bool a light's photographs were all saturated, so that its values are lower bounds."""
        marked = self._picture(light).saturated
        return np.zeros(self.shape, bool) if marked is None else marked.copy()

    def beside(self, path: Path) -> np.ndarray:
        """A picture (H, W, 3) float32 beside those of the lights, read as the first of them is: the room's own light.

        Raises InvalidStage for another size, and where lights have brackets, whose scale no single picture has.
        """
        if any(len(names) > 1 for names in self.files):
            raise InvalidStage(f"{path}: one picture beside brackets has not their scale; give every light one picture")
        if files.has_radiance(path):
            radiance = files.read_radiance(path).radiance
            radiance = radiance / np.float32(1.0 if self.exposures is None else self.exposures[0][0])
        else:
            photograph = files.read_photograph(path)
            radiance = self.encoding.linearised(photograph) / np.float32(self._exposure(0, photograph))
        if radiance.shape[:2] != self.shape:
            raise InvalidStage(
                f"{path} is {radiance.shape[1]}×{radiance.shape[0]} pixels, the pictures are "
                f"{self.shape[1]}×{self.shape[0]}; take it with the same camera"
            )
        return radiance

    def step(self) -> float:
        """How coarse the codes of the photographs are, in the field's values, as in the first of them.

        0 for radiance maps and for brackets, whose frames share out their codes.
        """
        path = self.files[0][0]
        if len(self.files[0]) > 1 or files.has_radiance(path):
            return 0.0
        photograph = files.read_photograph(path)
        return self.encoding.step(photograph) / self._exposure(0, photograph) / float(self.irradiances[0].mean())

    def _picture(self, index: int) -> _Picture:
        state = self._state
        with state.lock:
            if index in state.pictures:
                return state.pictures[index]
            if state.latest is not None and state.latest[0] == index:
                return state.latest[1]
            picture = self._checked(self._read(index), str(self.files[index][0]))
            size = picture.radiance.nbytes + (0 if picture.saturated is None else picture.saturated.nbytes)
            if state.amount + size <= self.kept:
                state.pictures[index], state.amount = picture, state.amount + size
            else:
                state.latest = index, picture
            return picture

    def _read(self, index: int) -> _Picture:
        paths = self.files[index]
        if any(len(names) > 1 for names in self.files):
            return self._merged(index)
        if files.has_radiance(paths[0]):
            found = files.read_radiance(paths[0])
            seconds = 1.0 if self.exposures is None else self.exposures[index][0]
            saturated = None if found.clipped is None else found.clipped == SATURATED
            return _Picture(found.radiance / np.float32(seconds), saturated)
        photograph = files.read_photograph(paths[0])
        if photograph.pixels.max() <= DARK * np.iinfo(photograph.pixels.dtype).max:
            raise _dark(str(paths[0]))
        radiance = self.encoding.linearised(photograph) / np.float32(self._exposure(index, photograph))
        if photograph.outside is not None:
            radiance[photograph.outside] = 0
        return _Picture(radiance, np.any(photograph.pixels == np.iinfo(photograph.pixels.dtype).max, axis=-1))

    def _merged(self, index: int) -> _Picture:
        """The light of a bracket, per second of exposure (at ISO 100 and f/1, where EXIF has those)."""
        paths = self.files[index]
        for path in paths:
            if files.has_radiance(path):
                raise InvalidStage(
                    f"{path}: a radiance map in a bracket; a bracket is of photographs, else give one file"
                )
            if self.exposures is None and files.read_facts(path).exposure is None:
                raise InvalidStage(
                    f'{path}: its exposure is not known; give "exposure", seconds a file, in the stage file'
                )
        bracket = read_bracket(paths, times=None if self.exposures is None else self.exposures[index], sidecars=False)
        levels = int(np.iinfo(bracket.photographs[0].pixels.dtype).max) + 1
        # `merge_brackets` gives the same values; its checks would take some times as long, for every light again.
        first = bracket.photographs[0]
        merged = in_rec709(merge(bracket, self.encoding.response(levels, str(paths[0]), first)), first)
        clipped = merged.clipped if merged.clipped is not None else np.zeros(merged.radiance.shape[:2], np.uint8)
        radiance = np.where((clipped == OUTSIDE)[..., None], np.float32(0), merged.radiance)
        return _Picture(radiance, clipped == SATURATED)

    def _exposure(self, index: int, photograph: Photograph) -> float:
        """By what a single photograph is divided: the seconds given, else its EXIF exposure, if the first has one too.

        The first photograph's own exposure counts as 1, so that a set taken at one exposure stays as it is.
        """
        if self.exposures is not None:
            return self.exposures[index][0]
        first = files.read_facts(self.files[0][0]).exposure
        own = photograph.exposure
        if first is None and own is None:
            return 1.0
        if first is None or own is None:
            raise InvalidStage(
                f"{self.files[0][0].name} and {photograph.name}: only one has an exposure time; give every light's "
                '"exposure" in the stage file'
            )
        return own.factor / first.factor

    def _checked(self, picture: _Picture, name: str) -> _Picture:
        radiance = picture.radiance
        if radiance.shape[:2] != self.shape:
            raise InvalidStage(
                f"{name} is {radiance.shape[1]}×{radiance.shape[0]} pixels, the first picture "
                f"{self.shape[1]}×{self.shape[0]}; all pictures of a stage have one size"
            )
        if not np.all(np.isfinite(radiance)):
            row, column = np.argwhere(~np.isfinite(radiance).all(axis=-1))[0]
            raise InvalidStage(
                f"{name}: pixel ({column}, {row}) is no number, {radiance[row, column]}; mend the picture"
            )
        largest, least = float(radiance.max()), float(radiance.min())
        if largest <= 0 and least == 0:
            raise _dark(name)
        if least < 0:
            radiance = self._without_negatives(radiance, least, largest, name)
        if picture.saturated is not None and np.any(picture.saturated):
            self._warn_once(
                "saturated",
                f"{name}: {int(picture.saturated.sum())} pixels are saturated, and brighter in truth (only the first "
                "such picture is named); take shorter exposures too",
            )
        return replace(picture, radiance=radiance)

    def _without_negatives(self, radiance: np.ndarray, least: float, largest: float, name: str) -> np.ndarray:
        if least < -ROUNDING * max(largest, 0.0):
            row, column, _ = np.argwhere(radiance == least)[0]
            raise InvalidStage(
                f"{name}: negative radiance, {least:.3g} at pixel ({column}, {row}); was a dark frame taken off that "
                "does not belong to it?"
            )
        self._warn_once(
            "negative",
            f"{name}: values down to {least:.2g}, a rounding below 0, are read as 0 (only the first such picture is "
            "named)",
        )
        return np.maximum(radiance, 0)

    def _warn_once(self, what: str, message: str) -> None:
        if what not in self._state.warned:
            self._state.warned.add(what)
            warn(message)


def _dark(name: str) -> InvalidStage:
    return InvalidStage(f"{name}: black all over; did its light shine? Take it again, or leave its light out")
