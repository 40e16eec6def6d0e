"""The lens's tables of a preset: motion, defocus, soft focus, glare, geometry and vignetting."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from pydantic import Field, model_validator

from relume.project.presets.tones import Step
from relume.project.schema import Positive, Share, Vector
from relume.virtual_camera.steps import Optics

Pair = tuple[float, float]


class StraightTable(Step):
    """The whole picture moves by so many pixels, right and down."""

    kind: Literal["straight"]
    pixels: Pair
    opening: Annotated[float, Field(ge=0, le=0.5)] = 0.0

    def made(self) -> Optics:
        from relume.virtual_camera.lens.motion.shutter import Shutter
        from relume.virtual_camera.lens.motion.straight import StraightMotion

        return StraightMotion(*self.pixels, shutter=Shutter(self.opening))


class TurnTable(Step):
    """The camera turns on its tripod: yaw right, pitch up, roll clockwise, degrees."""

    kind: Literal["turn"]
    degrees: Vector
    opening: Annotated[float, Field(ge=0, le=0.5)] = 0.0

    def made(self) -> Optics:
        from relume.virtual_camera.lens.motion.path import TurningCamera
        from relume.virtual_camera.lens.motion.shutter import Shutter

        yaw, pitch, roll = np.radians(self.degrees)
        # Right and clockwise, as all of the command line has it; the value turns about its axes, right-handed.
        return TurningCamera(-float(yaw), float(pitch), -float(roll), shutter=Shutter(self.opening))


class VectorsTable(Step):
    """Every pixel moves by its own vector, given beside the picture."""

    kind: Literal["vectors"]
    opening: Annotated[float, Field(ge=0, le=0.5)] = 0.0

    def made(self) -> Optics:
        from relume.virtual_camera.lens.motion.shutter import Shutter
        from relume.virtual_camera.lens.motion.vectors import MotionVectors

        return MotionVectors(Shutter(self.opening))


MotionTable = Annotated[StraightTable | TurnTable | VectorsTable, Field(discriminator="kind")]


class DefocusTable(Step):
    """A lens of an f-number and a focal length in mm, focused at so many metres; its depth map is given beside."""

    focus: Positive
    f_number: Positive
    focal_length: Positive
    blades: Annotated[int, Field(ge=0, le=32)] = 0
    curvature: float = 0.0
    rotation: float = 0.0

    @model_validator(mode="after")
    def _can_be(self) -> DefocusTable:
        self.made()
        return self

    def made(self) -> Optics:
        from relume.virtual_camera.lens.blades import Blades
        from relume.virtual_camera.lens.defocus_blur import Defocus
        from relume.virtual_camera.lens.depth_of_field import aperture_of

        blades = Blades(self.blades, self.curvature, float(np.radians(self.rotation)))
        return Defocus(aperture_of(self.f_number, self.focal_length), self.focus, blades)


class SoftFocusTable(Step):
    """A share of the light, spread by a fraction of the picture's width."""

    share: Share | None = None
    radius: Share | None = None

    def made(self) -> Optics:
        from relume.virtual_camera.lens.soft_focus import SoftFocus

        return SoftFocus(**self.given())


class EyeGlareTable(Step):
    """Spencer et al. 1995; adaptation in cd/m², pupil in mm: the picture's own unless given."""

    kind: Literal["eye"]
    adaptation: Positive | None = None
    pupil: Positive | None = None
    sharp: bool | None = None
    mirrored: bool | None = None

    def made(self, folder: Path) -> Optics:
        from relume.virtual_camera.lens.glare.eye import EyeGlare

        return EyeGlare(**self.given())


class CameraGlareTable(Step):
    """Diffraction at the iris, veiling glare and scatter of a camera's lens."""

    kind: Literal["camera"]
    blades: Annotated[int, Field(ge=0, le=32)] = 6
    curvature: float = 0.0
    rotation: float = 0.0
    f_number: Positive | None = None
    sensor_width: Positive | None = None
    veil: Share | None = None
    halo: Share | None = None
    halo_core: Positive | None = None
    halo_power: Positive | None = None
    mirrored: bool | None = None

    @model_validator(mode="after")
    def _can_be(self) -> CameraGlareTable:
        self.made(Path())
        return self

    def made(self, folder: Path) -> Optics:
        from relume.virtual_camera.lens.blades import Blades
        from relume.virtual_camera.lens.glare.camera import CameraGlare

        blades = Blades(self.blades, self.curvature, float(np.radians(self.rotation)))
        return CameraGlare(blades, **self.given("blades", "curvature", "rotation"))


class MeasuredGlareTable(Step):
    """The picture of a small lamp in the dark, as a point spread."""

    kind: Literal["measured"]
    picture: str
    mirrored: bool = False

    def made(self, folder: Path) -> Optics:
        from relume.image.files import read_radiance
        from relume.virtual_camera.lens.glare.measured import MeasuredGlare

        return MeasuredGlare.of_lamp(read_radiance(folder / self.picture), mirrored=self.mirrored)


GlareTable = Annotated[EyeGlareTable | CameraGlareTable | MeasuredGlareTable, Field(discriminator="kind")]


class GeometryTable(Step):
    """Distortion by OpenCV's coefficients; lateral colour: red and blue drawn larger by 1 + scale + quadratic r²."""

    k1: float = 0.0
    k2: float = 0.0
    p1: float = 0.0
    p2: float = 0.0
    k3: float = 0.0
    red: Pair | None = None
    blue: Pair | None = None

    def made(self) -> Optics:
        from relume.scene.cameras.distortion import Distortion
        from relume.virtual_camera.lens.geometry import LensGeometry
        from relume.virtual_camera.lens.lateral_chromatic_aberration import LateralColour, RadialScale

        bends = self.k1, self.k2, self.p1, self.p2, self.k3
        coloured = self.red is not None or self.blue is not None
        return LensGeometry(
            Distortion(*bends) if any(bends) else None,
            LateralColour(RadialScale(*self.red or (0.0,)), RadialScale(*self.blue or (0.0,))) if coloured else None,
        )


class NaturalTable(Step):
    """cos⁴ of the angle."""

    kind: Literal["natural"]

    def made(self, folder: Path) -> Optics:
        from relume.virtual_camera.lens.vignetting import CosineFourth

        return CosineFourth()


class PolynomialTable(Step):
    """1 + a₁r² + a₂r⁴ + …, r = 1 in the corners."""

    kind: Literal["polynomial"]
    coefficients: tuple[float, ...] = Field(min_length=1)
    centre: Pair | None = None

    def made(self, folder: Path) -> Optics:
        from relume.virtual_camera.lens.vignetting import PolynomialVignetting

        return PolynomialVignetting(**self.given())


class MeasuredTable(Step):
    """What a camera's profile tells."""

    kind: Literal["measured"]
    profile: str

    def made(self, folder: Path) -> Optics:
        from relume.capture.response.camera_profile import read_profile
        from relume.virtual_camera.lens.vignetting import MeasuredVignetting
        from relume.virtual_camera.plate_matching.camera_profile import profiled_vignetting

        found = profiled_vignetting(read_profile(folder / self.profile))
        if found is None:
            raise ValueError(f"vignetting.profile: {self.profile} tells no vignetting; measure it with relume merge")
        return MeasuredVignetting(found)


VignettingTable = Annotated[NaturalTable | PolynomialTable | MeasuredTable, Field(discriminator="kind")]
