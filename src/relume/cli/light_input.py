"""Options of commands that read an environment map."""

from __future__ import annotations

from typing import Annotated

from cyclopts import Parameter

import relume as rl

Clamp = Annotated[
    bool, Parameter(negative="", help="Set negative pixels, which a resize may leave, to 0; refused unless given.")
]
From = Annotated[
    str | None,
    Parameter(
        name="--from",
        help="Mapping of the map where the file does not store it: latlong, angular, ball or another of `convert`.",
    ),
]


def mapping_of(name: str | None, option: str = "--from") -> rl.mappings.Mapping | None:
    """The mapping of an option's word, None for none; raises ValueError naming the option."""
    if name is None:
        return None
    try:
        return rl.mappings.mapping_named(name)
    except ValueError as error:
        raise ValueError(f"{option}: {error}") from None
