"""Options of commands that read an environment map."""

from __future__ import annotations

from typing import Annotated

from cyclopts import Parameter

Clamp = Annotated[
    bool, Parameter(negative="", help="Set negative pixels, which a resize may leave, to 0; refused unless given.")
]
