"""The types of option words: one word like "726,487,28.33", "640x360" or "sun.png=12" becomes a typed tuple.

An option is annotated with its type and with `numbers`, which reads one word by that type:

    spot: Annotated[tuple[float, float, float] | None, numbers("X,Y,CD", like="726,487,28.33")] = None

- `tuple[int, int, int, int]`: so many numbers, with commas, spaces, "x" or "×" between; ints must be whole.
- `tuple[float, ...]`: one or more. A union is tried member by member: `tuple[float] | tuple[float, float, float]`.
- A tuple with words, paths or tuples in it, `tuple[Path, float]` or `tuple[tuple[int, int], float]`, is split at "="
  and "@". `list[…]` of any of them is an option that may be repeated.
- All numbers are finite; a number may be a fraction, like 1/60.

Bounds are cyclopts validators beside it: `Parameter(validator=Number(gt=0))`.
"""

from __future__ import annotations

import math
import re
import types
from collections.abc import Callable, Sequence
from fractions import Fraction
from pathlib import Path
from typing import Annotated, Any, Union, get_args, get_origin

from cyclopts import Parameter, Token


def numbers(
    form: str, *, like: str, help: str | None = None, filled: float | None = None, repeated: bool = False,
    above: float | None = None, words: Sequence[str] = (), group: Any = None,
) -> Parameter:  # fmt: skip
    """How one option word becomes the annotated type, for use in `Annotated`.

    form : the word's form as `--help` shows it, like "X,Y,RADIUS"
    like : an example of it, for messages
    filled : stands for the numbers that are missing at the end of a tuple, as the 0 of YAW[,PITCH[,ROLL]]
    repeated : one number stands for all numbers of the tuple, as a grey for R,G,B
    above : every number must be above this
    words : words that are taken as they are, like "auto"; no other text is, though the type is then a union with str
    """

    def one(kind: Any, word: str) -> Any:
        if word in words:
            return word
        try:
            return _value(_without_text(kind) if words else kind, word, filled, repeated, above)
        except ValueError:
            raise ValueError(f'"{word}" is not of the form {form}; write it like {like}') from None

    def convert(kind: Any, tokens: Sequence[Token]) -> Any:
        kind = _bare(kind)
        if get_origin(kind) is list:
            (member,) = get_args(kind)
            return [one(_bare(member), token.value) for token in tokens]
        return one(kind, tokens[-1].value)

    # A group of None that is given, and not left out, would hide the option in --help.
    return Parameter(
        converter=convert, n_tokens=1, accepts_keys=False, allow_leading_hyphen=True, negative="", metavar=form,
        help=help, **({} if group is None else {"group": group}),
    )  # fmt: skip


Point = Annotated[tuple[float, float, float], numbers("X,Y,Z", like="0,0.17,1")]
"""A place in metres, or a direction."""
Pixel = Annotated[tuple[int, int], numbers("X,Y", like="320,240")]
"""A pixel, from the upper left corner."""
Box = Annotated[tuple[int, int, int, int], numbers("LEFT,TOP,WIDTH,HEIGHT", like="40,60,80,80")]
"""A rectangle of pixels."""
Size = Annotated[tuple[int, int], numbers("WIDTHxHEIGHT", like="1280x720", above=0)]
"""Pixels across and down."""
Colour = Annotated[tuple[float, float, float], numbers("R,G,B", like="0.5 or 0.6,0.5,0.4", repeated=True)]
"""Red, green and blue; one number is a grey."""
Angles = Annotated[tuple[float, float, float], numbers("YAW,PITCH,ROLL", like="90 or 90,-10,0", filled=0.0)]
"""Degrees; pitch and roll are 0 unless given."""
Seconds = Annotated[tuple[float, ...], numbers("SECONDS,…", like="1/30,1/60,0.5", above=0)]
"""Exposure times."""
TimesFromNames = Annotated[
    bool,
    Parameter(
        negative="",
        help="Read the exposure times from the file names: 1_160.jpg or cp_t160.jpg is 1/160 s, 0.25s.jpg is 0.25 s.",
    ),
]
"""Whether names are read as times."""


def _bare(kind: Any) -> Any:
    """The type without Annotated and without None."""
    while get_origin(kind) is Annotated:
        kind = get_args(kind)[0]
    if get_origin(kind) in (Union, types.UnionType):
        members = [_bare(member) for member in get_args(kind) if member is not type(None)]
        return members[0] if len(members) == 1 else Union[tuple(members)]  # noqa: UP007
    return kind


def _without_text(kind: Any) -> Any:
    """The members of a union that are not str."""
    if get_origin(kind) not in (Union, types.UnionType):
        return kind
    return Union[tuple(member for member in get_args(kind) if member is not str)]  # noqa: UP007


def _value(kind: Any, word: str, filled: float | None, repeated: bool, above: float | None) -> Any:
    """The word as a value of the type; raises ValueError where it is none."""
    read: Callable[[Any, str], Any] = lambda each, part: _value(_bare(each), part, filled, repeated, above)  # noqa: E731
    origin, members = get_origin(kind), get_args(kind)
    if origin in (Union, types.UnionType):
        for member in members:
            try:
                return read(member, word)
            except ValueError:
                continue
        raise ValueError(word)
    if origin is not tuple:
        return _single(kind, word, above)
    # Tuples of anything but plain numbers: parts between "=" and "@". A first part that is a name may hold "=" itself.
    if not all(member in (int, float, ...) for member in members):
        parts = re.split("[=@]", word)
        if len(parts) > len(members) and members[0] in (str, Path):
            name, *parts = word.rsplit("=", len(members) - 1)
            parts = [name, *parts]
        return tuple(read(member, part) for member, part in zip(members, parts, strict=True))
    # Plain numbers.
    parts = [part for part in re.split(r"[\s,x×]+", word.strip().lower()) if part]
    if len(members) == 2 and members[1] is ...:
        if not parts:
            raise ValueError(word)
        return tuple(_single(members[0], part, above) for part in parts)
    if repeated and len(parts) == 1:
        parts *= len(members)
    if filled is not None and parts:
        parts += [repr(filled)] * (len(members) - len(parts))
    return tuple(_single(member, part, above) for member, part in zip(members, parts, strict=True))


def _single(kind: Any, word: str, above: float | None) -> Any:
    if kind in (str, Path):
        if not word.strip():
            raise ValueError(word)
        return kind(word)
    try:
        number = float(Fraction(word)) if "/" in word else float(word)
    except (ZeroDivisionError, OverflowError):
        raise ValueError(word) from None
    if not math.isfinite(number) or (above is not None and not number > above):
        raise ValueError(word)
    if kind is int and number != int(number):
        raise ValueError(word)
    return int(number) if kind is int else number
