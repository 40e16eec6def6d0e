"""A place's blocks in terms of what is sought: sizes and positions are linear in it, so that constraints cost nothing.

Equal sizes, aligned sides, symmetry and standing on each other are substituted, not minimised (Debevec, Taylor & Malik
1996, §2.2: relations between blocks leave fewer unknowns).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from relume.scene.places.bodies import BODIES, Body, revolved
from relume.scene.places.place_tables import SIDES, SIZES, BlockTable, require_known

AXES = "xyz"
SHARES = (0.0, 0.5, 1.0)
"""Of the size, from the low side: where the three of SIDES lie."""


@dataclass(frozen=True)
class Quantity:
    """A length that is linear in unknowns: metres, and the factor of each unknown."""

    constant: float = 0.0
    factors: dict[str, float] = field(default_factory=dict)

    def plus(self, other: Quantity, times: float = 1.0) -> Quantity:
        """The sum with so many times another."""
        factors = dict(self.factors)
        for name, factor in other.factors.items():
            factors[name] = factors.get(name, 0.0) + times * factor
        return Quantity(
            self.constant + times * other.constant, {name: factor for name, factor in factors.items() if factor}
        )


@dataclass(frozen=True, eq=False)
class Turn:
    """How a block and those aligned with it are turned about +Y: radians, or the number of an unknown."""

    angle: float | None
    name: str


@dataclass(frozen=True, eq=False)
class SoughtBlock:
    """A block whose low corner and size are linear in the unknowns.

    low, size : one a coordinate, in the frame that is turned as the block
    turn : which of the model's turns it has
    """

    name: str
    kind: str
    body: Body
    low: tuple[Quantity, Quantity, Quantity]
    size: tuple[Quantity, Quantity, Quantity]
    turn: int

    def side(self, axis: int, share: float) -> Quantity:
        """Where a side or the middle lies along an axis."""
        return self.low[axis].plus(self.size[axis], share)


@dataclass(frozen=True, eq=False)
class Model:
    """All blocks, and the names of the unknown lengths in order."""

    blocks: tuple[SoughtBlock, ...]
    turns: tuple[Turn, ...]
    lengths: tuple[str, ...]

    def row(self, quantity: Quantity) -> np.ndarray:
        """(1 + number of lengths,): the constant, then the factor of each unknown."""
        return np.array([quantity.constant, *(quantity.factors.get(name, 0.0) for name in self.lengths)])

    def points(self, index: int, vertices: Sequence[int]) -> np.ndarray:
        """(N, 3, 1 + lengths): factors of points of a block, in its turned frame."""
        block = self.blocks[index]
        low, size = (np.stack([self.row(q) for q in three]) for three in (block.low, block.size))
        return low + block.body.vertices[list(vertices)][:, :, None] * size


def modelled(tables: Sequence[BlockTable]) -> Model:
    """The blocks of a place file; raises ValueError naming block and key where a name is wrong."""
    made: dict[str, SoughtBlock] = {}
    turns: list[Turn] = []
    for table in tables:
        made[table.name] = _block(table, made, turns)
    names = dict.fromkeys(name for block in made.values() for q in (*block.size, *block.low) for name in q.factors)
    return Model(tuple(made.values()), tuple(turns), tuple(names))


def _block(table: BlockTable, made: dict[str, SoughtBlock], turns: list[Turn]) -> SoughtBlock:
    where = f"blocks.{table.name}"
    if table.on is not None:
        require_known(table.on, made, f"{where}.on", "block above it")
    body = BODIES[table.kind] if table.kind != "revolution" else _revolution(table, where)
    turn = _turn(table, made, turns)
    if table.mirrored is not None:
        return _mirrored(table, body, turn, made)
    size = [_size(table, axis, body, made) for axis in range(3)]
    if table.kind == "revolution":
        size[2] = size[0]
    low = []
    for axis in range(3):
        given = next((i for i, side in enumerate(SIDES[axis]) if getattr(table, side) is not None), None)
        if given is not None:
            place = _place(table, SIDES[axis][given], axis, turn, made)
            share = SHARES[given]
        elif axis == 1:
            place, share = (made[table.on].side(1, 1.0) if table.on else Quantity()), 0.0
        else:
            # The first block sets the frame.
            name = f"{AXES[axis]} of block {table.name!r}"
            place, share = (Quantity(factors={name: 1.0}) if made else Quantity()), 0.5
        low.append(place.plus(size[axis], -share))
    return SoughtBlock(table.name, table.kind, body, (low[0], low[1], low[2]), (size[0], size[1], size[2]), turn)


def _revolution(table: BlockTable, where: str) -> Body:
    if table.depth is not None:
        raise ValueError(f"{where}.depth: a revolution is as deep as it is wide; leave depth out")
    try:
        return revolved(table.profile or ((1.0, 0.0), (1.0, 1.0)))
    except ValueError as error:
        raise ValueError(f"{where}.{error}") from None


def _turn(table: BlockTable, made: dict[str, SoughtBlock], turns: list[Turn]) -> int:
    """The number of its turn, which is added where it is a new one."""
    if table.turn is None or table.turn in made:
        like = table.turn if isinstance(table.turn, str) else table.on
        if like is not None:
            return made[like].turn
        if made:
            return next(iter(made.values())).turn
        turns.append(Turn(0.0, table.name))
    elif table.turn == "unknown":
        if not made:
            raise ValueError(f"blocks.{table.name}.turn: the first block sets the frame; give its turn in degrees")
        turns.append(Turn(None, table.name))
    elif isinstance(table.turn, str):
        require_known(table.turn, [*made, "unknown"], f"blocks.{table.name}.turn", "block above it")
    else:
        angle = float(np.radians(table.turn))
        for index, turn in enumerate(turns):
            if turn.angle == angle:
                return index
        turns.append(Turn(angle, table.name))
    return len(turns) - 1


def _size(table: BlockTable, axis: int, body: Body, made: dict[str, SoughtBlock]) -> Quantity:
    name, value = SIZES[axis], getattr(table, SIZES[axis])
    if body.flat == axis:
        if value is not None:
            raise ValueError(f"blocks.{table.name}.{name}: a {table.kind} has none; leave it out")
        return Quantity()
    if value is None:
        return Quantity(factors={f"{name} of block {table.name!r}": 1.0})
    if not isinstance(value, str):
        return Quantity(float(value))
    other, _, word = value.partition(".")
    where = f"blocks.{table.name}.{name}"
    require_known(other, made, where, "block above it")
    require_known(word, SIZES, where, "size")
    return made[other].size[SIZES.index(word)]


def _place(table: BlockTable, side: str, axis: int, turn: int, made: dict[str, SoughtBlock]) -> Quantity:
    value = getattr(table, side)
    where = f"blocks.{table.name}.{side}"
    if not isinstance(value, str):
        return Quantity(float(value))
    if value == "unknown":
        return Quantity(factors={f"{AXES[axis]} of block {table.name!r}": 1.0})
    return _side_of(value, axis, turn, made, where)


def _side_of(value: str, axis: int, turn: int, made: dict[str, SoughtBlock], where: str) -> Quantity:
    other, _, word = value.partition(".")
    require_known(other, made, where, "block above it")
    require_known(word, SIDES[axis], where, "side along that axis")
    if axis != 1 and made[other].turn != turn:
        raise ValueError(f"{where}: {other} is turned otherwise, so that nothing aligns; give turn = {other!r}")
    return made[other].side(axis, SHARES[SIDES[axis].index(word)])


def _mirrored(table: BlockTable, body: Body, turn: int, made: dict[str, SoughtBlock]) -> SoughtBlock:
    """The image of another block in an upright plane; a mirrored size or side of its own is refused."""
    assert table.mirrored is not None
    where = f"blocks.{table.name}.mirrored"
    require_known(table.mirrored.of, made, f"{where}.of", "block above it")
    of = made[table.mirrored.of]
    if own := [key for key in (*SIZES, *SIDES[0], *SIDES[1], *SIDES[2], "on") if getattr(table, key) is not None]:
        raise ValueError(f"{where}: its {own[0]} is that of {of.name}; leave {own[0]} out")
    if of.kind != table.kind or of.turn != turn:
        raise ValueError(f"{where}: {of.name} is of another kind or turned otherwise; symmetric blocks are alike")
    word = table.mirrored.across.partition(".")[2]
    axis = next((a for a in (0, 2) if word in SIDES[a]), None)
    if axis is None or (axis == 2 and table.kind == "wedge"):
        raise ValueError(
            f"{where}.across is {table.mirrored.across!r}; expected an upright plane like 'house.centre_x'"
        )
    plane = _side_of(table.mirrored.across, axis, turn, made, f"{where}.across")
    # The mirrored low side is as far beyond the plane as the high side is before it.
    low = list(of.low)
    low[axis] = plane.plus(plane).plus(of.side(axis, 1.0), -1.0)
    return replace(of, name=table.name, body=body, low=(low[0], low[1], low[2]), turn=turn)
