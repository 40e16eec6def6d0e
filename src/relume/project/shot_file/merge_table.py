"""Keys of a shot file's tables of photographs: how a bracket is merged into radiance, as `relume merge` does it."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from relume.capture.brackets.settings import RESPONSE_METHODS, MergeSettings
from relume.project.schema import Table


class MergeTable(Table):
    """How photographs are merged.

    align : whether frames are brought onto one another
    deghost : whether what moved between them is left out
    refine : whether exposures that the photographs contradict are corrected
    method : recovers the response
    neutral : the pixel value at which equal channels are grey; unless given as in `MergeSettings`
    profile : a camera profile, as `relume merge --save-profile` writes it, in place of a response recovered here
    """

    align: bool = True
    deghost: bool = True
    refine: bool = False
    method: Literal["debevec-malik", "mitsunaga-nayar", "robertson"] = "debevec-malik"
    neutral: Annotated[int, Field(ge=0, le=65535)] | None = None
    profile: str | None = None

    def merge_settings(self) -> MergeSettings:
        """The same as a value for `merge_brackets`."""
        return MergeSettings(
            method=RESPONSE_METHODS[self.method], refine=self.refine, align=self.align, deghost=self.deghost,
            neutral=self.neutral,
        )  # fmt: skip
