"""Arithmetic of radiance maps with other maps or constants, as an edit."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from pathlib import Path

from relume.image import arithmetic, files
from relume.image.radiance import RadianceMap

Colour = tuple[float, float, float]


class Operation(Enum):
    """What `Arithmetic` does with its operands."""

    ADD = "add"
    SUBTRACT = "subtract"
    MULTIPLY = "multiply"
    DIVIDE = "divide"
    MIN = "min"
    MAX = "max"
    AVERAGE = "average"


@dataclass(frozen=True, eq=False)
class Arithmetic:
    """Arithmetic with other maps of the same size, or constants.

    operation : what is done with the map and the operands
    operands : maps, paths of maps, numbers or R,G,B, taken one after the other
    signed : keep negative results; else they become 0
    """

    operation: Operation
    operands: tuple[RadianceMap | Path | float | Colour, ...]
    signed: bool = False

    @property
    def name(self) -> str:
        """The word of the operation, for reports."""
        return self.operation.value

    def __post_init__(self) -> None:
        if self.operation is Operation.AVERAGE and any(isinstance(each, float | tuple) for each in self.operands):
            raise ValueError("average takes maps; add a constant, and halve by a gain of 0.5")

    def __str__(self) -> str:
        words = [
            "map" if isinstance(o, RadianceMap) else ",".join(f"{v:g}" for v in o) if isinstance(o, tuple) else str(o)
            for o in self.operands
        ]
        return f"{self.operation.value} {' '.join(words)}"

    def __call__(self, picture: RadianceMap) -> RadianceMap:
        values = [files.read_radiance(each) if isinstance(each, Path) else each for each in self.operands]
        if self.operation is Operation.AVERAGE:
            picture = arithmetic.average([picture, *(each for each in values if isinstance(each, RadianceMap))])
        else:
            function = {
                Operation.ADD: arithmetic.added,
                Operation.SUBTRACT: arithmetic.subtracted,
                Operation.MULTIPLY: arithmetic.multiplied,
                Operation.DIVIDE: arithmetic.divided,
                Operation.MIN: arithmetic.darker,
                Operation.MAX: arithmetic.brighter,
            }[self.operation]
            for value in values:
                picture = function(picture, value)
        return picture if self.signed else arithmetic.without_negative(picture)
