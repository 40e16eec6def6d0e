"""A modelled place: blocks in world metres and the cameras of the photographs they were found from."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from relume.scene.cameras.camera import Camera
from relume.scene.places.place_tables import SIZES
from relume.scene.shapes.shapes import Mesh


@dataclass(frozen=True)
class CameraDeviation:
    """How well a photograph's camera is known: one standard deviation of each.

    position : metres, the root of the three variances' sum
    rotation : radians, likewise
    focal_length : pixels; 0 where it was given
    """

    position: float
    rotation: float
    focal_length: float


UNKNOWN_DEVIATION = CameraDeviation(float("nan"), float("nan"), float("nan"))
"""Of a camera that another program found and said nothing of."""


@dataclass(frozen=True, eq=False)
class PlacePhotograph:
    """A photograph of the place.

    name : as the place file has it
    file : the picture; it need not be there where the place file gives its size
    camera : where it was taken from, and through which lens
    deviation : of the camera
    residual : root mean square distance, pixels, of the marked points from the edges as the camera sees them
    marks : how many points were marked in it
    """

    name: str
    file: Path
    camera: Camera
    deviation: CameraDeviation
    residual: float
    marks: int


@dataclass(frozen=True, eq=False)
class PlaceBlock:
    """A block of the place.

    name : as the place file has it
    kind : "box", "roof", "wall" and so on
    mesh : world, metres, faces outward; grey until a texture or a reflectance is known
    size : (3,) width, height and depth, metres, along the block's own axes
    deviation : (3,) one standard deviation of each, metres; 0 of a size that was given
    corners : world points by name, metres, such as "front_left_top"
    edges : points (N, 3) along each named edge, world, metres; two of a straight one
    """

    name: str
    kind: str
    mesh: Mesh
    size: np.ndarray
    deviation: np.ndarray
    corners: dict[str, np.ndarray]
    edges: dict[str, np.ndarray]


@dataclass(frozen=True, eq=False)
class PlaceMark:
    """Points that were marked on one edge, or at one corner, in one photograph.

    photograph, block, edge : their names; `edge` is the corner's where a corner was marked
    points : (N, 2) pixels, x to the right and y down from the upper left corner of the picture
    distances : (N,) pixels, 0 or more, from the edge as the camera that was found sees it, but for the distortion
    """

    photograph: str
    block: str
    edge: str
    points: np.ndarray
    distances: np.ndarray


@dataclass(frozen=True, eq=False)
class Place:
    """Blocks and cameras in one frame: world, metres, +Y up, the first block's foot in the middle of the frame.

    blocks, photographs : in the order of the place file
    covariance : (N, N) of the unknowns, in the order of `unknowns`: metres, radians, logarithms of focal lengths
    unknowns : their names, such as "depth of block 'tower'"
    chi_square : sum of squared residuals, each in its standard deviation
    freedom : how many residuals there are beyond the unknowns; chi_square is about as large where the marks are sound
    doubts : one line each on what should be looked at
    points : (N, 3) world, metres, that photogrammetry found beside; none of a place of blocks
    marks : in the order of the place file, each with its distance from what was found
    """

    blocks: tuple[PlaceBlock, ...]
    photographs: tuple[PlacePhotograph, ...]
    covariance: np.ndarray = field(default_factory=lambda: np.zeros((0, 0)))
    unknowns: tuple[str, ...] = ()
    chi_square: float = 0.0
    freedom: int = 0
    doubts: tuple[str, ...] = ()
    points: np.ndarray = field(default_factory=lambda: np.zeros((0, 3)))
    marks: tuple[PlaceMark, ...] = ()

    def meshes(self) -> tuple[Mesh, ...]:
        """One mesh a block, with its name, in world metres, +Y up."""
        return tuple(block.mesh for block in self.blocks)

    def block(self, name: str) -> PlaceBlock:
        """The block of that name; raises ValueError with the names that there are."""
        return _named(self.blocks, name, "block")

    def photograph(self, name: str) -> PlacePhotograph:
        """The photograph of that name; raises ValueError with the names that there are."""
        return _named(self.photographs, name, "photograph")

    def facts(self) -> dict[str, object]:
        """What was found, in words, for a report: each size and each camera with its deviation."""
        blocks = {
            block.name: {
                word: f"{value:.4g} m" + (f" ± {deviation:.2g}" if deviation > 0 else "")
                for word, value, deviation in zip(SIZES, block.size, block.deviation, strict=True)
                if value > 0
            }
            for block in self.blocks
        }
        cameras = {
            each.name: _found(each) if each.marks else f"focal length {each.camera.focal_length:.5g} pixels"
            for each in self.photographs
        }
        found: dict[str, object] = {"blocks": blocks, "cameras": cameras}
        found |= {"chi square": f"{self.chi_square:.4g} of {self.freedom}"} if self.freedom else {}
        return found | ({"points": len(self.points)} if len(self.points) else {})


def _found(photograph: PlacePhotograph) -> dict[str, object]:
    camera, deviation = photograph.camera, photograph.deviation
    return {
        "marks": photograph.marks,
        "off by": f"{photograph.residual:.2f} pixels (RMS)",
        "position": f"± {deviation.position:.2g} m",
        "rotation": f"± {np.degrees(deviation.rotation):.2g}°",
        "focal length": f"{camera.focal_length:.5g} ± {deviation.focal_length:.2g} pixels",
    }


def _named(among: tuple, name: str, what: str):
    for each in among:
        if each.name == name:
            return each
    raise ValueError(f"the place has no {what} {name!r}; it has {', '.join(each.name for each in among)}")
