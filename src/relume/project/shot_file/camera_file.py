"""The shot file's camera.file: a camera that another program wrote, at rest or at a frame of a sequence."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Annotated

from pydantic import Field

from relume.errors import InvalidShot
from relume.project.schema import Positive, Table
from relume.scene.cameras.camera import Camera
from relume.scene.cameras.distortion import Distortion
from relume.scene.cameras.files import NUMBERED, read_camera
from relume.scene.cameras.nuke_chan import holds_focal_length
from relume.scene.cameras.pose import UpAxis
from relume.scene.cameras.rolling_shutter import rolling_through


class CameraFile(Table):
    """A camera that another program wrote; `up` and `unit` where they are not what the file says.

    frame : which, of a file whose cameras go by the numbers of frames (.chan, places); that of each plate in a sequence
    time : seconds since the file's motion began, of other files; from the sequence's first frame in a sequence
    offset : frames added to those of a sequence for the camera's
    rate : frames a second of the camera's file; the sequence's unless given
    """

    path: str
    name: str | None = None
    up: UpAxis | None = None
    unit: Positive | None = None
    frame: Annotated[float, Field(ge=0)] | None = None
    time: float | None = None
    offset: float = 0.0
    rate: Positive | None = None

    @property
    def numbered(self) -> bool:
        """Whether its cameras go by the numbers of frames, and not by seconds."""
        return Path(self.path).suffix.lower() in NUMBERED

    @property
    def says_when(self) -> bool:
        """Whether one moment of the file is asked for."""
        return self.time is not None or (self.frame is not None and self.rate is not None)

    def at(self, frame: float, first: int, rate: float) -> CameraFile:
        """The same at a frame of a sequence that begins with `first` and has `rate` frames a second."""
        own = self.rate or rate
        if self.numbered and self.name is not None:
            # One photograph of a place, which stands still.
            return self
        begun = self.model_copy(update={"frame": first + self.offset, "rate": own, "offset": 0.0})
        return (begun if self.numbered else self).after((frame - first) / rate, own)

    def after(self, seconds: float, rate: float = 24.0) -> CameraFile:
        """The same so many seconds after its motion began: after its first frame, where it goes by their numbers.

        rate : frames a second, where the file's is not given
        """
        own = self.rate or rate
        if self.numbered:
            number = (self.frame or 0.0) + self.offset + seconds * own
            return self.model_copy(update={"frame": number, "rate": own, "offset": 0.0})
        return self.model_copy(update={"time": (self.time or 0.0) + seconds + self.offset / own, "offset": 0.0})

    def shifted(self, seconds: float) -> CameraFile:
        """The same so many seconds later; itself where it does not say when."""
        if self.frame is not None and self.rate is not None:
            return self.model_copy(update={"frame": self.frame + seconds * self.rate})
        return self if self.time is None else self.model_copy(update={"time": self.time + seconds})

    def read(self, size: tuple[int, int], folder: Path, focal_length: float | None = None) -> Camera:
        """The camera for a picture of (width, height); raises UnreadableFile."""
        return read_camera(
            folder / self.path, *size, name=self.name, up=self.up, unit=self.unit, time=self.time, frame=self.frame,
            focal_length=focal_length,
        )  # fmt: skip


def camera_of_file(
    asked: CameraFile, size: tuple[int, int], folder: Path, *, focal_length: float | None, exif: float | None,
    centre: tuple[float, float] | None, distortion: Distortion | None, readout: float,
) -> Camera:  # fmt: skip
    """The camera of a file, whose rows have the poses of their times where the sensor is read row after row.

    size : (width, height) of the picture; folder : where the file's path starts
    focal_length : pixels, as [camera] gives it; exif : as the plate does; one of them, if the file has none
    readout : seconds from the first row to the last, below 0 where the lowest is the first; 0 for rows of one moment
    Raises InvalidShot naming the key, UnreadableFile.
    """
    given = None
    if asked.path.lower().endswith(".chan") and not holds_focal_length(folder / asked.path):
        given = focal_length or exif
        if given is None:
            raise InvalidShot(
                f"camera.focal_length: missing, and {asked.path} and the plate have none; give it in pixels"
            )
    elif focal_length is not None:
        raise InvalidShot(f"camera.focal_length: {asked.path} holds the field of view; leave focal_length out")
    camera = asked.read(size, folder, given)
    try:
        bent = camera.distortion if distortion is None else distortion
        camera = replace(camera, centre=camera.centre if centre is None else centre, distortion=bent)
    except ValueError as error:
        raise InvalidShot(f"camera.distortion: {error}") from None
    if readout == 0:
        return camera
    if not asked.says_when:
        raise InvalidShot("camera.readout: the camera's file is not asked for a moment; give sequence.plates, or time")
    first, last = (asked.shifted(sign * abs(readout) / 2).read(size, folder, given) for sign in (-1, 1))
    try:
        rolling = rolling_through(
            (first.position, camera.position, last.position), (first.rotation, camera.rotation, last.rotation),
            size[1], readout < 0,
        )  # fmt: skip
    except ValueError as error:
        raise InvalidShot(f"camera.readout: {error}") from None
    return replace(camera, rolling=rolling)
