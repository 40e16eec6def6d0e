"""The light of a shot file: photographs of a mirrored ball and how they are merged, or finished light, and changes."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Annotated, Literal

import numpy as np
from pydantic import Field, model_validator

from relume.capture.brackets.settings import RESPONSE_METHODS, MergeSettings
from relume.errors import BallNotFound
from relume.probe.ball.silhouette import Outline, outline_of_circle, outline_through
from relume.project.finished_light import FinishedLight
from relume.project.place_tables import DistantTable
from relume.project.schema import Names, Positive, Table, Vector
from relume.project.shot_file.added_lights import AddedLight
from relume.project.shot_file.sequence_table import LightKey, require_rising

Mirrored = Annotated[float, Field(gt=0, le=1)]


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


class BallPhotographs(MergeTable):
    """A bracket of the mirrored ball and where its camera stood.

    camera : unless given the plate's camera, from the plate's place; of a further view it is found by registration
    pick : the ball's rim in pixels, [x, y, radius] or three points or more [x, y, x, y, x, y]; followed near there
    rim : the same, taken exactly as it is
    """

    photographs: Names = Field(min_length=1)
    camera: Vector | None = None
    times: list[Positive] | None = None
    focal_length: Positive | None = None
    pick: tuple[float, ...] | None = None
    rim: tuple[float, ...] | None = None

    @model_validator(mode="after")
    def _is_a_rim(self) -> BallPhotographs:
        if self.pick is not None and self.rim is not None:
            raise ValueError("pick is followed to the rim near it, rim is taken as it is; give one of them")
        self.outline()
        return self

    def outline(self) -> Outline | None:
        """The outline that was picked, or None; raises ValueError for what makes no circle."""
        numbers = self.rim or self.pick
        if numbers is None:
            return None
        if len(numbers) == 3:
            return outline_of_circle(*numbers)
        if len(numbers) < 6 or len(numbers) % 2:
            raise ValueError("a rim is [x, y, radius], or three points or more [x, y, x, y, x, y], in pixels")
        return outline_through(np.reshape(numbers, (-1, 2)))


@contextmanager
def picked_by_key(table: str, key: str = "pick") -> Iterator[None]:
    """A ball that is not found in the block is refused by the key that picks it, in place of options of `probe`.

    table : of the shot file, which takes the key, as "light.balls.0"
    """
    try:
        yield
    except BallNotFound as error:
        if not error.remedy:
            raise
        rims = [f"{key} = [{', '.join(f'{value:.1f}' for value in circle)}]" for circle in error.candidates]
        remedy = f"or write the ball's rim into {table}: {' or '.join(rims) or f'{key} = [x, y, radius]'}"
        drawn = "; `relume probe --picture` draws what is round" if rims else ""
        raise BallNotFound(error.found, error.candidates, error.radiance, remedy + drawn) from None


class Ball(Table):
    """The mirrored ball; `reflectance` of its surface, 1 unless measured, "chrome" a chrome steel ball's.

    centre : metres; above the origin, on the table, where the camera is found from the ball
    """

    centre: Vector | None = None
    radius: Positive
    reflectance: Mirrored | tuple[Mirrored, Mirrored, Mirrored] | Literal["chrome"] = 1.0


class Light(FinishedLight):
    """The light of the place: photographs of a mirrored ball, or finished light: a map, maps, probes or a sky.

    distant : the shape of the distant scene, onto which the light is projected; or a mesh that shines by its own
        radiance and needs no other light
    probe : where a finished map was taken, metres; the ball's centre is known. Of several probes the place that they
        are joined for: unless given their middle, and of a scene at infinity the middle of the objects
    heading : degrees about +Y by which a finished map is turned to stand in the scene's frame, counter-clockwise seen
        from above
    lamps : places of lamps that hang in the room, before its walls
    scale : by which the light is multiplied to be on the plate's scale, before anything is measured by it; where no
        exposure says it, it is found from a reflectance that is given, or from what both show. Three numbers, one a
        channel, give the light the plate's white too, which is then not looked for
    surface_reflectance : mean share of light that the surface under the objects gives back, from which the scale is
        found where no exposure says it; its reflectance is recovered all the same
    turn : degrees about +Y by which what was measured is turned, counter-clockwise from above
    exposure : stops by which it is brighter than what was measured
    added : lights that were never there, beside what was measured
    """

    balls: list[BallPhotographs] | None = None
    ball: Ball | None = None
    size: Annotated[int, Field(ge=16, le=8192)] = 512
    distant: DistantTable = DistantTable()
    probe: Vector | None = None
    heading: float = 0.0
    scale: Positive | tuple[Positive, Positive, Positive] | None = None
    surface_reflectance: Mirrored | None = None
    lamps: list[Vector] = Field(default_factory=list)
    turn: float = 0.0
    exposure: float = 0.0
    added: tuple[AddedLight, ...] = ()
    keyframes: tuple[LightKey, ...] = ()

    @model_validator(mode="after")
    def _one_source(self) -> Light:
        require_rising(self.keyframes)
        finished, shines = bool(self.given()), self.distant.radiance == "own"
        if shines:
            self._require_place_alone()
        elif (self.balls is None) != finished:
            raise ValueError("give one of balls, map, maps, probes and sky")
        if self.balls is not None and (self.ball is None or not self.balls):
            raise ValueError("balls need ball = { radius }, and its centre where the camera is not found from the ball")
        if self.scale is not None and self.surface_reflectance is not None:
            raise ValueError("scale and surface_reflectance both say how bright the light is; give one of them")
        if finished and self.ball is not None:
            raise ValueError("ball goes with photographs of it; with a finished map give probe = [x, y, z]")
        if not finished and self.probe is not None:
            raise ValueError("probe is for a finished map; of a ball the centre is known: leave it out")
        if not finished and self.heading:
            raise ValueError("heading is for a finished map; photographs of a ball have their own: leave it out")
        if self.probes is not None and self.heading:
            raise ValueError("heading: of several probes each has its own; give it beside its position")
        near = self.distant.is_projected or self.lamps
        if finished and self.probes is None and self.probe is None and near:
            raise ValueError("a near distant scene needs probe = [x, y, z], the place the map was taken at, metres")
        return self

    def _require_place_alone(self) -> None:
        """Refuse what measures or changes the light of a place that shines by its own radiance."""
        measured = [name for name in ("balls", "ball", "probes", "probe", "surface_reflectance") if getattr(self, name)]
        if measured or self.lamps:
            raise ValueError(
                f'{(measured or ["lamps"])[0]} measures the place\'s light, which distant.radiance = "own" has '
                "already; leave one of them out, or give a map or a sky for what lies beyond the place"
            )
        if self.turn or self.exposure or self.keyframes:
            raise ValueError(
                'turn, exposure and keyframes change light that was measured; distant.radiance = "own" shines as its '
                "textures say: leave them out; light.scale makes it brighter"
            )
