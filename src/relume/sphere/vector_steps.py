"""Steps of kernels in LLVM's own terms, for vector instructions that Numba's compiler does not find by itself.

Numba has LLVM make vectors of loops, not of statements that stand side by side: the channels of a pixel are worked on
one after the other. These work on all at once, by whatever vectors the processor has. Each is called from a kernel
with addresses, `np.int64(array.ctypes.data)` and bytes from there, of arrays that the kernel's caller holds; nothing
asks whether an address lies inside.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import reduce
from typing import Any

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

BYTES_AT_ONCE = 24
"""Values that `add_four_lights` adds at once: whole pixels, and whole registers of any width."""

_LANE, _ADDRESS, _SINGLE = ir.IntType(32), ir.IntType(64), ir.FloatType()
_FOUR = ir.VectorType(_SINGLE, 4)
_FUSED = ("contract",)


def _step(signature: Any, write: Callable[[Any, Any], Any]) -> tuple[Any, Callable[..., Any]]:
    """What `intrinsic` wants: the types, and what writes code by a builder and the values given."""

    def build(context: Any, builder: Any, signature: Any, given: Any) -> Any:
        made = write(builder, given)
        return context.get_dummy_value() if made is None else context.make_tuple(builder, signature.return_type, made)

    return signature, build


def _read(builder: Any, address: Any, offset: int, kind: Any = _FOUR, align: int = 4) -> Any:
    """A vector in memory."""
    return builder.load(_place(builder, address, offset, kind), align=align)


def _place(builder: Any, address: Any, offset: int, kind: Any) -> Any:
    return builder.inttoptr(builder.add(address, _ADDRESS(offset)), kind.as_pointer())


def _chosen(builder: Any, vector: Any, lanes: list[int]) -> Any:
    """A vector of some of the lanes of four."""
    return builder.shuffle_vector(vector, _FOUR(ir.Undefined), ir.VectorType(_LANE, 4)(lanes))


def _all_four(builder: Any, number: Any) -> Any:
    return _chosen(builder, builder.insert_element(_FOUR(ir.Undefined), number, _LANE(0)), [0] * 4)


def _mixed(builder: Any, vectors: list[Any], shares: list[Any]) -> Any:
    parts = [
        builder.fmul(vector, _all_four(builder, share), _FUSED) for vector, share in zip(vectors, shares, strict=True)
    ]
    return reduce(lambda so_far, part: builder.fadd(so_far, part, _FUSED), parts)


def _add_looked_up(context: Any, place: Any, upper: Any, lower: Any, shares: Any, weight: Any, along: Any) -> Any:
    """Adds four neighbours of a table by their shares, times what lies between two weights, to `place`: four channels.

    place, upper, lower, weight : addresses of float32; the right neighbours and the second weight follow
    shares : of the upper left, upper right, lower left, lower right
    along : from the first weight to the second, 0…1
    """

    def write(builder: Any, given: Any) -> None:
        place, upper, lower, shares, weight, along = given
        around = [_read(builder, row, right) for row in (upper, lower) for right in (0, 16)]
        seen = _mixed(builder, around, cgutils.unpack_tuple(builder, shares))
        between = [builder.fsub(_SINGLE(1), along), along]
        factor = _mixed(builder, [_read(builder, weight, step) for step in (0, 16)], between)
        total = builder.fadd(_read(builder, place, 0), builder.fmul(seen, factor, _FUSED), _FUSED)
        builder.store(total, _place(builder, place, 0, _FOUR), align=4)

    address, number = types.int64, types.float32
    return _step(types.void(address, address, address, types.UniTuple(number, 4), address, number), write)


add_looked_up: Any = intrinsic(_add_looked_up)


def _between_four(context: Any, upper: Any, lower: Any, across: Any, down: Any) -> Any:
    """Three channels, bilinear between four neighbours, in a form that gives back constants to the bit.

    upper, lower : addresses of the left neighbours' three channels, float32; those of the right ones follow
    """

    def write(builder: Any, given: Any) -> list[Any]:
        upper, lower, across, down = given

        def between(first: Any, last: Any, share: Any) -> Any:
            part = builder.fmul(_all_four(builder, share), builder.fsub(last, first, _FUSED), _FUSED)
            return builder.fadd(first, part, _FUSED)

        # Four floats are read; of the right neighbour from the one before it, so that nothing beyond it is touched.
        rows = [
            between(_read(builder, at, 0), _chosen(builder, _read(builder, at, 8), [1, 2, 3, 3]), across)
            for at in (upper, lower)
        ]
        seen = between(rows[0], rows[1], down)
        return [builder.extract_element(seen, _LANE(k)) for k in range(3)]

    number = types.float32
    return _step(types.UniTuple(number, 3)(types.int64, types.int64, number, number), write)


between_four: Any = intrinsic(_between_four)


def _ask_for(context: Any, address: Any) -> Any:
    """Asks memory for what is at an address, which need not be anything."""
    return _step(types.void(types.int64), lambda builder, given: _ask(builder, given[0]))


def _ask(builder: Any, address: Any) -> None:
    kinds = [ir.IntType(8).as_pointer(), *[_LANE] * 3]
    ask = cgutils.get_or_insert_function(builder.module, ir.FunctionType(ir.VoidType(), kinds), "llvm.prefetch.p0")
    # To read, near the core, as data.
    builder.call(ask, [builder.inttoptr(address, kinds[0]), *(_LANE(k) for k in (0, 3, 1))])


ask_for: Any = intrinsic(_ask_for)


def _add_four_lights(context: Any, totals: Any, values: Any, stride: Any, factors: Any, steps: Any) -> Any:
    """Adds the bytes of four lights, times their weights, to totals, `BYTES_AT_ONCE` values at a time.

    totals, values, stride : addresses of float64 and uint8, and bytes from one light's values to the next one's
    factors : address of (4, 2, BYTES_AT_ONCE) float64, each light's weights as the values lie, and these times −2⁵²
    """

    def write(builder: Any, given: Any) -> None:
        totals, values, stride, factors, steps = given
        double, byte, whole = (ir.VectorType(kind, 8) for kind in (ir.DoubleType(), ir.IntType(8), ir.IntType(64)))
        fused = cgutils.get_or_insert_function(builder.module, ir.FunctionType(double, [double] * 3), "llvm.fma.v8f64")
        # A number of 52 bits that ends in the byte is 2⁵² and the byte: m·w − 2⁵²·w, rounded once, is the byte's
        # product, and takes less than its conversion would.
        bias = whole([0x4330000000000000] * 8)
        # All of them stay in registers.
        held = [_read(builder, factors, 64 * k, double, 8) for k in range(BYTES_AT_ONCE)]
        with cgutils.for_range(builder, steps) as loop:
            begin = builder.mul(loop.index, _ADDRESS(BYTES_AT_ONCE))
            target = builder.add(totals, builder.mul(begin, _ADDRESS(8)))
            for part in range(3):
                total, start = _read(builder, target, 64 * part, double, 8), builder.add(values, begin)
                for light in range(4):
                    seen = _read(builder, start, 8 * part, byte, 1)
                    number = builder.bitcast(builder.or_(builder.zext(seen, whole), bias), double)
                    product = builder.call(fused, [number, held[6 * light + part], held[6 * light + 3 + part]])
                    total, start = builder.fadd(total, product), builder.add(start, stride)
                    if part == 0:
                        _ask(builder, builder.add(start, builder.mul(stride, _ADDRESS(3))))
                builder.store(total, _place(builder, target, 64 * part, double), align=8)

    return _step(types.void(*[types.int64] * 5), write)


add_four_lights: Any = intrinsic(_add_four_lights)
