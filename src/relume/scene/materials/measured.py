"""Measured surfaces: tables of an isotropic BRDF by half and difference angle, and MERL's files of them.

The half vector h = (ω₁ + ω₂)/|ω₁ + ω₂| has the angle θh to the normal; seen from h, ω₁ has the angles θd to it and φd
about it (Rusinkiewicz 1998, "A new change of variables for efficient BRDF representation"). An isotropic surface is
the same for every φh, and by reciprocity for φd and φd + π. The frame of a surface is x along u, y up, z the normal.
"""

from __future__ import annotations

import os
import struct
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from relume.errors import UnreadableFile

__all__ = ["MeasuredBRDF", "half_and_difference", "read_merl"]

MERL_SHAPE = (90, 90, 180)
"""Entries along θh, θd and φd of a file of the MERL database (Matusik, Pfister, Brand and McMillan 2003)."""
MERL_SCALE = (1.0 / 1500, 1.15 / 1500, 1.66 / 1500)
"""What multiplies red, green and blue of such a file, as the database's documentation says."""
_HEADER = 12


@dataclass(frozen=True, eq=False)
class MeasuredBRDF:
    """An isotropic surface as it was measured: f in 1/sr by half and difference angle.

    values : (H, D, P, 3) float32, 0 or more, linear Rec. 709. Entry i of H is the middle of √(2θh/π) from i/H to (i +
        1)/H, so that the entries are densest at the highlight. D goes over θd from 0 to π/2, P over φd from 0 to π
    name : for messages
    """

    values: np.ndarray
    name: str = ""

    def __post_init__(self) -> None:
        shape = self.values.shape
        if len(shape) != 4 or shape[3] != 3 or min(shape) < 2:
            raise ValueError(
                f"values of material {self.name!r} have the shape {shape}; expected (θh, θd, φd, 3), at least 2 of each"
            )
        if not (self.values.min() >= 0 and np.isfinite(self.values.max())):
            raise ValueError(
                f"values of material {self.name!r} go from {self.values.min():g} to {self.values.max():g}; "
                "expected 0 or more, in 1/sr"
            )

    def evaluate(self, one: np.ndarray, other: np.ndarray) -> np.ndarray:
        """The BRDF f (…, 3) in 1/sr for light from one direction to the other: linear between entries, 0 below.

        one, other : (…, 3) unit, in the surface's frame, whose z is its normal
        """
        one, other = np.broadcast_arrays(np.asarray(one, float), np.asarray(other, float))
        sizes = np.array(self.values.shape[:3])
        theta_h, theta_d, phi_d = half_and_difference(one, other)
        at = np.stack([np.sqrt(2 * theta_h / np.pi), 2 * theta_d / np.pi, phi_d / np.pi], -1) * sizes - 0.5
        # Beyond the middle of the outermost entries these go on; φd comes round.
        at[..., :2] = np.clip(at[..., :2], 0, sizes[:2] - 1)
        low = np.floor(at).astype(int)
        share = at - low
        found = np.zeros((*at.shape[:-1], 3))
        for corner in np.ndindex(2, 2, 2):
            index = low + corner
            index[..., :2] = np.minimum(index[..., :2], sizes[:2] - 1)
            weight = np.prod(np.where(np.array(corner) == 1, share, 1 - share), axis=-1)
            found += weight[..., None] * self.values[index[..., 0], index[..., 1], index[..., 2] % sizes[2]]
        return np.where(((one[..., 2] > 0) & (other[..., 2] > 0))[..., None], found, 0.0)


def half_and_difference(one: np.ndarray, other: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """θh, θd and φd of pairs of unit vectors (…, 3) in the surface's frame, radians; φd from 0 to π."""
    half, apart = one + other, one - other
    level = np.hypot(half[..., 0], half[..., 1])
    theta_h = np.arctan2(level, half[..., 2])
    theta_d = np.arctan2(np.linalg.norm(apart, axis=-1), np.linalg.norm(half, axis=-1))
    # About h: y is n × h, x is y × h; of ω₁ − ω₂ = 2·(ω₁ − its part along h). Along the normal h has no azimuth: 0.
    along = level > 1e-9
    x, y = (np.where(along, half[..., axis] / np.where(along, level, 1), 1.0 - axis) for axis in (0, 1))
    across = y * -apart[..., 0] + x * apart[..., 1]
    upright = np.cos(theta_h) * (x * apart[..., 0] + y * apart[..., 1]) - np.sin(theta_h) * apart[..., 2]
    return theta_h, theta_d, np.mod(np.arctan2(across, upright), np.pi)


def read_merl(path: str | os.PathLike[str]) -> MeasuredBRDF:
    """Read a `.binary` file of the MERL BRDF database: 90 × 90 × 180 values of red, of green and of blue.

    path : the file

    Entries below 0 mark what was not measured, as what lies under the surface: they take the value of the nearest
    smaller θd that was measured, else of the nearest smaller θh.
    Raises UnreadableFile for a file that is missing, of another kind, cut short or longer than it says, or that holds
    no numbers.
    """
    path = Path(path)
    count = int(np.prod(MERL_SHAPE))
    try:
        with path.open("rb") as stream:
            size = os.fstat(stream.fileno()).st_size
            head = stream.read(_HEADER)
            if len(head) < _HEADER or struct.unpack("<3i", head) != MERL_SHAPE:
                said = "×".join(map(str, struct.unpack("<3i", head))) if len(head) == _HEADER else "nothing"
                raise UnreadableFile(
                    f"{path}: begins with {said}, not with 90×90×180; give a .binary file of the MERL BRDF database"
                )
            if size != _HEADER + 24 * count:
                raise UnreadableFile(
                    f"{path}: is {size} bytes long; a MERL BRDF file has {_HEADER + 24 * count}: copy it again"
                )
            raw = np.frombuffer(stream.read(), "<f8").reshape(3, *MERL_SHAPE)
    except FileNotFoundError:
        raise UnreadableFile(f"{path}: no such file; check the path") from None
    except OSError as error:
        raise UnreadableFile(f"{path}: cannot be read ({error.__class__.__name__})") from None
    if not np.all(np.isfinite(raw)):
        raise UnreadableFile(f"{path}: holds values that are no numbers; copy the file again")
    values = np.stack([channel * scale for channel, scale in zip(raw, MERL_SCALE, strict=True)], axis=-1)
    if values.max() <= 0:
        raise UnreadableFile(f"{path}: holds no value above 0; is it a measurement?")
    return MeasuredBRDF(_filled(values), path.stem)


def _filled(values: np.ndarray) -> np.ndarray:
    """The table with what was not measured filled in from smaller angles; what has no such neighbour is 0."""
    measured = np.all(values >= 0, axis=-1)
    filled = np.where(measured[..., None], values, 0).astype(np.float32)
    for axis in (1, 0):
        index = np.arange(values.shape[axis]).reshape([-1 if a == axis else 1 for a in range(3)])
        last = np.maximum.accumulate(np.where(measured, index, -1), axis=axis)
        known = last >= 0
        source = np.broadcast_to(np.maximum(last, 0)[..., None], filled.shape)
        filled = np.where(known[..., None], np.take_along_axis(filled, source, axis=axis), filled)
        measured = known
    return filled
