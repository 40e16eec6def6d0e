"""One ray against four boxes at once, in the processor's vectors.

Written for LLVM: from a loop over four boxes Numba makes scalar code.
"""

from __future__ import annotations

from typing import Any

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic
from numba.np.arrayobj import make_array

FOUR = 4
"""Boxes of a node; their sides lie one behind the other for each of the six."""
MISSED = 0x7FF0000000000000
"""The key of a box that a ray does not meet: the bits of ∞, beyond every other key."""
_DOUBLES, _FLOATS, _WORDS = (ir.VectorType(of, FOUR) for of in (ir.DoubleType(), ir.FloatType(), ir.IntType(64)))
_SORTING = ((0, 1), (2, 3), (0, 2), (1, 3), (1, 2))
"""Which of four are compared, so that they end in order."""


def _cross_boxes(
    typing: Any, boxes: Any, node: Any, near: Any, origin: Any, inverse: Any, enter: Any, leave: Any
) -> Any:
    """The keys of a node's four boxes, the nearest first: the bits of the distance at which the ray enters, which order
    as distances do, with the box's number in the last two; `MISSED` where [enter, leave] has none within the box.

    near : the side of each axis that the ray comes to first
    inverse : of the direction, and of the same a little shorter
    enter : 0 or more
    """

    def generate(context: Any, builder: Any, signature: Any, given: Any) -> Any:
        def spread(value: Any) -> Any:
            one = builder.insert_element(ir.Constant(_DOUBLES, ir.Undefined), value, ir.IntType(32)(0))
            zeros = ir.Constant(ir.VectorType(ir.IntType(32), FOUR), [0] * FOUR)
            return builder.shuffle_vector(one, ir.Constant(_DOUBLES, ir.Undefined), zeros)

        def number(place: int, axis: int) -> Any:
            kind = signature.args[place][axis]
            return context.cast(builder, builder.extract_value(given[place], axis), kind, types.float64)

        sides = make_array(signature.args[0])(context, builder, given[0]).data
        first = builder.mul(context.cast(builder, given[1], signature.args[1], types.intp), ir.IntType(64)(6 * FOUR))

        def distances(axis: int, far: bool) -> Any:
            side = context.cast(builder, builder.extract_value(given[2], axis), signature.args[2][axis], types.intp)
            side = builder.xor(side, ir.IntType(64)(1)) if far else side
            at = builder.gep(sides, [builder.add(first, builder.mul(side, ir.IntType(64)(FOUR)))])
            four = builder.load(builder.bitcast(at, _FLOATS.as_pointer()), align=4)
            away = builder.fsub(builder.fpext(four, _DOUBLES), spread(number(3, axis)))
            return builder.fmul(away, spread(number(4, axis + 3 * far)))

        # A distance that is NaN, in the very plane of a side, compares as false and is left out.
        begin, end = spread(given[5]), spread(given[6])
        for axis in range(3):
            t = distances(axis, False)
            begin = builder.select(builder.fcmp_ordered(">", t, begin), t, begin)
            t = distances(axis, True)
            end = builder.select(builder.fcmp_ordered("<", t, end), t, end)
        bits = builder.and_(builder.bitcast(begin, _WORDS), ir.Constant(_WORDS, [~3] * FOUR))
        bits = builder.or_(bits, ir.Constant(_WORDS, list(range(FOUR))))
        met = builder.select(builder.fcmp_ordered("<=", begin, end), bits, ir.Constant(_WORDS, [MISSED] * FOUR))
        keys = [builder.extract_element(met, ir.IntType(32)(k)) for k in range(FOUR)]
        for i, j in _SORTING:
            before = builder.icmp_signed("<", keys[i], keys[j])
            less, more = builder.select(before, keys[i], keys[j]), builder.select(before, keys[j], keys[i])
            keys[i], keys[j] = less, more
        return cgutils.pack_array(builder, keys)

    return types.UniTuple(types.int64, FOUR)(boxes, node, near, origin, inverse, types.float64, types.float64), generate


cross_boxes: Any = intrinsic(_cross_boxes)


def _key_of(typing: Any, distance: Any) -> Any:
    """The bits of a distance of 0 or more, which order as distances do."""
    return types.int64(types.float64), lambda context, builder, signature, given: builder.bitcast(
        given[0], ir.IntType(64)
    )


key_of: Any = intrinsic(_key_of)
