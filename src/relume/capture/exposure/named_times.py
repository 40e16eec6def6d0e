"""Exposure times that photographers write into file names: 1_160.jpg and cp_t160.jpg for 1/160 s, 0.25s.jpg for 0.25 s.

A number in a name mostly counts photographs, so what reads like a time is suggested, and believed only when asked.
"""

from __future__ import annotations

import os
import re
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path

from relume.capture.exposure.sidecar import number_in
from relume.errors import NotABracket

FORMS = "names like 1_160.jpg or cp_t160.jpg for 1/160 s, or 0.25s.jpg for 0.25 s, a different time for each"
_COUNTED = 3
"""Names from which on numbers that rise by one count photographs: no camera has 1/2, 1/3 and 1/4 s."""
_T_AND_A_NUMBER = r"(?:^|[^A-Za-z0-9])t[\d.]+(?:s|sec)?$"


def times_in_names(names: Sequence[str]) -> list[str] | None:
    """The time in each file name, as text for --times, where every name reads like one and all have one form.

    Forms: 1_25 and 17_1, of which one number is 1; t160 for 1/160; a decimal number, as in img_0.033, or one with its
    unit, as in 2s; beside decimal numbers also whole ones, as in img_15.
    None where any name has none, two are equal, or the numbers rise by one: then they count something else.
    """
    stems = [Path(name).stem for name in names]
    for form in (_pair, _reciprocal, _seconds):
        times = [form(stem) for stem in stems]
        if form is _seconds and any(time and "." in time for time in times):
            # Beside img_0.033 a whole number is a time too: img_15.
            times = [time or _whole(stem) for time, stem in zip(times, stems, strict=True)]
        found = [time for time in times if time]
        if len(found) == len(names) == len(set(found)) and not _count(found):
            return found
    return None


def seconds_in_names(paths: Sequence[str | os.PathLike[str]]) -> tuple[float, ...]:
    """Seconds of each photograph of one bracket as its name has them.

    Raises NotABracket, naming the first name without one, where `times_in_names` finds none.
    """
    names = [Path(path).name for path in paths]
    times = times_in_names(names)
    if times is None:
        odd = next((name for name in names if times_in_names([name]) is None), names[0])
        raise NotABracket(f"{odd}: the names of these photographs give no times; --times-from-names reads {FORMS}")
    return tuple(number_in(time) for time in times)


def _pair(stem: str) -> str | None:
    """One of a pair is 1 in every marked time: 1_25 is 1/25 s, 17_1 is 17 s, and 2016_08 is a date."""
    found = re.search(r"(?:^|[^\d._-]|(?<!\d)[_-])(\d+)[_-](\d+)(?:s|sec)?$", stem)
    if found is None:
        return None
    above, below = found.groups()
    if "1" not in (above, below) or above.startswith("0") or below.startswith("0"):
        return None
    return above if below == "1" else f"{above}/{below}"


def _reciprocal(stem: str) -> str | None:
    """t160 is 1/160 s; with a point, a unit or a leading 0 it could be seconds as well, and is none."""
    found = re.search(r"(?:^|[^A-Za-z0-9])t([1-9]\d*)$", stem)
    return found and (found[1] if found[1] == "1" else f"1/{found[1]}")


def _seconds(stem: str) -> str | None:
    found = re.search(r"(?<![\d.])(?<!\d[_-])(\d+\.\d+|\d+(?=s|sec))(?:s|sec)?$", stem)
    if found is None or re.search(_T_AND_A_NUMBER, stem):
        return None
    return found[1] if float(found[1]) > 0 else None


def _whole(stem: str) -> str | None:
    found = re.search(r"(?<![\d.])\d+$", stem)
    return found[0] if found and not re.search(_T_AND_A_NUMBER, stem) else None


def _count(times: Sequence[str]) -> bool:
    """Whether the numbers are those of a count: 1/1, 1/2, 1/3."""
    numbers = sorted(round(1 / number_in(time)) if "/" in time else number_in(time) for time in times)
    return len(numbers) >= _COUNTED and all(b - a == 1 for a, b in pairwise(numbers))
