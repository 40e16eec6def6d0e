"""Arrays that a kernel's loop may use without counting the references to them; it stands beside `relume._kernel`."""

from __future__ import annotations

from typing import Any

from numba import types
from numba.extending import intrinsic
from numba.np.arrayobj import make_array


def _unowned(typing: Any, held: Any) -> Any:
    """The same array, or tuple of arrays and numbers, not owned: to be taken once, before a loop over rays.

    Numba counts the references to each array that is given to a function, even to one compiled into its caller, and
    counts atomically: ten arrays cost a ray 100 ns. Nothing is counted for an array that nobody owns. It lives as long
    as its owner does, so it has to be, or be part of, an argument of the kernel: that one's caller keeps it.
    """

    def without_owner(context: Any, builder: Any, part: Any, value: Any) -> Any:
        if isinstance(part, types.BaseTuple):
            kinds: Any = part
            for i, inner in enumerate(kinds):
                mine = without_owner(context, builder, inner, builder.extract_value(value, i))
                value = builder.insert_value(value, mine, i)
        elif isinstance(part, types.Array):
            array = make_array(part)(context, builder, value)
            array.meminfo, array.parent = array.meminfo.type(None), array.parent.type(None)
            value = array._getvalue()
        return value

    return held(held), lambda context, builder, signature, given: without_owner(context, builder, held, given[0])


unowned: Any = intrinsic(_unowned)
