"""The table [match] of a shot file: how what is rendered is made to look like the photograph, and what is in front."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field, model_validator

from relume.capture.lens.vignetting import Vignetting
from relume.capture.response.camera_profile import read_profile
from relume.errors import InvalidShot
from relume.project.schema import Positive, Table


class MatchTable(Table):
    """How the objects are fitted into the plate.

    grain, sharpness : measured on the plate and given to the objects; on unless turned off
    vignetting : the fall-off that is in the plate: a camera profile in which it was measured, coefficients of r², r⁴, …
        (r is 1 at the corners), "cos4" for an uncorrected lens, or false. Off unless given: most cameras and raw
        converters correct it, and the lens' fall-off cannot be separated from that of the lamps in a plate
    mode : "additive", the paper's; "ratio" where the reflectance is only roughly known
    occluder : a painted matte of real things in front of the objects
    aperture : diameter of the lens, metres, or "exif" for that of the plate's photograph; a pinhole unless given
    focus : distance that the lens was focused on, metres
    seed : of the grain
    """

    grain: bool = True
    sharpness: bool | Annotated[float, Field(ge=0, le=20)] = True
    vignetting: Literal[False] | Annotated[list[float], Field(min_length=1)] | str = False
    mode: Literal["additive", "ratio"] = "additive"
    occluder: str | None = None
    aperture: Positive | Literal["exif"] | None = None
    focus: Positive | None = None
    seed: Annotated[int, Field(ge=0)] = 0

    @model_validator(mode="after")
    def _lens(self) -> MatchTable:
        if (self.aperture is None) != (self.focus is None):
            raise ValueError("aperture and focus go together: give both, or neither for a pinhole")
        return self

    def vignetting_in(self, folder: Path, focal_length: float, size: tuple[int, int]) -> Vignetting | None:
        """The fall-off that is in the plate; None where there is none.

        folder : where the shot file's paths start
        focal_length : of the plate's camera, pixels
        size : (width, height) of the plate
        Raises InvalidShot for a profile that cannot be read or holds no fall-off.
        """
        if self.vignetting is False:
            return None
        if isinstance(self.vignetting, list):
            return Vignetting(tuple(self.vignetting))
        if self.vignetting == "cos4":
            return Vignetting.cos4(focal_length, size)
        try:
            found = read_profile(folder / self.vignetting).vignetting
            if found is not None:
                return Vignetting.from_dict(found)
        except ValueError as error:
            raise InvalidShot(f"match.vignetting: {error}") from None
        raise InvalidShot(
            f"match.vignetting: {self.vignetting} holds no fall-off; photograph an evenly lit wall for it, or give "
            'coefficients or "cos4"'
        )
