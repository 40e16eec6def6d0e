"""Models of COLMAP, text and binary: cameras, images and points3D of a folder (colmap.github.io/format.html).

COLMAP's camera looks along +Z, x to the right and y down; its pixels are counted from the upper left corner, as ours.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from relume.errors import UnreadableFile
from relume.scene.places.photogrammetry.model import FoundModel, FoundView, lens_of, one_focal_length

MODELS = {
    0: ("SIMPLE_PINHOLE", 3), 1: ("PINHOLE", 4), 2: ("SIMPLE_RADIAL", 4), 3: ("RADIAL", 5), 4: ("OPENCV", 8),
    5: ("OPENCV_FISHEYE", 8), 6: ("FULL_OPENCV", 12), 7: ("FOV", 5), 8: ("SIMPLE_RADIAL_FISHEYE", 4),
    9: ("RADIAL_FISHEYE", 5), 10: ("THIN_PRISM_FISHEYE", 12),
}  # fmt: skip
"""Number in binary files, name in text files, and how many parameters."""
READ = ("SIMPLE_PINHOLE", "PINHOLE", "SIMPLE_RADIAL", "RADIAL", "OPENCV")
Lens = tuple[str, int, int, tuple[float, ...]]
"""Model, width, height and parameters."""
Pose = tuple[str, int, np.ndarray, np.ndarray]
"""Picture, number of the lens, unit quaternion w x y z and translation, world to camera."""


def read_colmap(folder: Path) -> FoundModel:
    """A COLMAP model; the binary files where both are there, as COLMAP has it. Raises UnreadableFile."""
    kind = next((kind for kind in (".bin", ".txt") if (folder / f"images{kind}").is_file()), None)
    if kind is None or not (folder / f"cameras{kind}").is_file():
        raise UnreadableFile(f"{folder}: no COLMAP model; expected cameras and images, .bin or .txt, in it")
    names = [folder / f"{name}{kind}" for name in ("cameras", "images", "points3D")]
    try:
        if kind == ".bin":
            lenses, poses, (numbers, points) = (
                _binary_lenses(names[0]),
                _binary_poses(names[1]),
                _binary_points(names[2]),
            )
        else:
            lenses, poses, (numbers, points) = _text_lenses(names[0]), _text_poses(names[1]), _text_points(names[2])
    except (OSError, OverflowError, ValueError, IndexError, struct.error) as error:
        reason = " ".join(str(error).split())
        raise UnreadableFile(f"{folder}: not a readable COLMAP model ({reason}); export it again") from None
    if not poses:
        raise UnreadableFile(f"{folder}: the model holds no registered images; reconstruct it again")
    return FoundModel(tuple(_view(folder, lenses, pose) for pose in poses), points, numbers)


def _view(folder: Path, lenses: dict[int, Lens], pose: Pose) -> FoundView:
    picture, number, quaternion, translation = pose
    if number not in lenses:
        raise UnreadableFile(f"{folder}: image {picture} names camera {number}, which is not there; export it again")
    model, width, height, given = lenses[number]
    if model not in READ:
        raise UnreadableFile(
            f"{folder}: camera {number} is a {model}; {', '.join(READ)} are read: undistort the images with "
            "COLMAP first"
        )
    two = model in ("PINHOLE", "OPENCV")
    focal = one_focal_length(folder, f"camera {number}", given[0], given[1 if two else 0])
    across, down, *rest = given[2 if two else 1 :]
    length = float(np.linalg.norm(quaternion))
    if not (np.isfinite(quaternion).all() and np.isfinite(translation).all() and abs(length - 1) < 1e-3):
        raise UnreadableFile(f"{folder}: image {picture} has no rotation; export the model again")
    w, x, y, z = quaternion / length
    rotation = np.array([
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ])  # fmt: skip
    return FoundView(
        picture, (width, height), focal, (across, down), rotation, -rotation.T @ translation, lens_of(*rest)
    )


def _lines(path: Path) -> list[str]:
    return [line for line in path.read_text(encoding="utf-8").splitlines() if not line.startswith("#")]


def _text_lenses(path: Path) -> dict[int, Lens]:
    found = {}
    counts = dict(MODELS.values())
    for line in filter(str.strip, _lines(path)):
        number, model, width, height, *given = line.split()
        if model in counts and len(given) != counts[model]:
            raise ValueError(f"camera {number}: {len(given)} parameters; a {model} has {counts[model]}")
        found[int(number)] = (model, int(width), int(height), tuple(map(float, given)))
    return found


def _text_poses(path: Path) -> list[Pose]:
    """Two lines an image, of which the second, its points, may be empty."""
    lines = _lines(path)
    while lines and not lines[0].strip():
        lines = lines[1:]
    found = []
    for line in lines[::2]:
        if not line.strip():
            continue
        words = line.split(maxsplit=9)
        numbers = np.array(words[1:8], np.float64)
        found.append((words[9].strip(), int(words[8]), numbers[:4], numbers[4:]))
    return found


def _text_points(path: Path) -> tuple[np.ndarray, np.ndarray]:
    if not path.is_file():
        return np.empty(0, int), np.empty((0, 3))
    rows = [line.split(maxsplit=4)[:4] for line in _lines(path) if line.strip()]
    table = np.array(rows, np.float64).reshape(-1, 4)
    return table[:, 0].astype(int), table[:, 1:]


@dataclass
class _Reader:
    """Little-endian values of a binary file, one after the other."""

    data: bytes
    place: int = 0

    def take(self, form: str) -> tuple:
        """The next values; raises struct.error where the file ends before them."""
        values = struct.unpack_from("<" + form, self.data, self.place)
        self.place += struct.calcsize("<" + form)
        return values

    def word(self) -> str:
        """Up to the next zero byte."""
        end = self.data.index(b"\0", self.place)
        text = self.data[self.place : end].decode("utf-8")
        self.place = end + 1
        return text

    def skip(self, count: int) -> None:
        self.place += count
        if self.place > len(self.data):
            raise ValueError("it ends early")


def _entries(path: Path) -> tuple[_Reader, Iterator[int]]:
    reader = _Reader(path.read_bytes())
    (count,) = reader.take("Q")
    if count > len(reader.data):
        raise ValueError(f"{path.name} claims {count} entries")
    return reader, iter(range(count))


def _binary_lenses(path: Path) -> dict[int, Lens]:
    reader, entries = _entries(path)
    found = {}
    for _ in entries:
        number, model, width, height = reader.take("IiQQ")
        if model not in MODELS:
            raise ValueError(f"camera {number} is of the unknown model {model}")
        name, count = MODELS[model]
        found[number] = (name, width, height, reader.take(f"{count}d"))
    return found


def _binary_poses(path: Path) -> list[Pose]:
    reader, entries = _entries(path)
    found = []
    for _ in entries:
        _, *numbers, lens = reader.take("I7dI")
        name = reader.word()
        (points,) = reader.take("Q")
        reader.skip(24 * points)
        found.append((name, lens, np.array(numbers[:4]), np.array(numbers[4:])))
    return found


def _binary_points(path: Path) -> tuple[np.ndarray, np.ndarray]:
    if not path.is_file():
        return np.empty(0, int), np.empty((0, 3))
    reader, entries = _entries(path)
    numbers, points = [], []
    for _ in entries:
        number, x, y, z, _, _, _, _, track = reader.take("Q3d3BdQ")
        reader.skip(8 * track)
        numbers.append(number)
        points.append((x, y, z))
    return np.array(numbers, int), np.array(points, np.float64).reshape(-1, 3)
