"""The kinds of each table of a preset: which value or function a kind is made by; its arguments are the table's keys.

A dataclass has its own fields as keys. A function is here where a file's keys differ from the value's: angles in
degrees, paths in place of pictures. An argument `folder` is no key: it is where relative paths start.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, Literal

import numpy as np

from relume.image.photograph import Exposure
from relume.virtual_camera.film import stocks
from relume.virtual_camera.film.darkroom import FRAME, Darkroom
from relume.virtual_camera.film.film import Film
from relume.virtual_camera.lens.blades import Blades
from relume.virtual_camera.lens.defocus_blur import Defocus, aperture_of
from relume.virtual_camera.lens.geometry import LensGeometry
from relume.virtual_camera.lens.glare.camera import CameraGlare
from relume.virtual_camera.lens.glare.eye import EyeGlare
from relume.virtual_camera.lens.glare.measured import MeasuredGlare
from relume.virtual_camera.lens.motion.path import TurningCamera
from relume.virtual_camera.lens.motion.shutter import Shutter
from relume.virtual_camera.lens.motion.straight import StraightMotion
from relume.virtual_camera.lens.motion.vectors import MotionVectors
from relume.virtual_camera.lens.soft_focus import SoftFocus
from relume.virtual_camera.lens.vignetting import CosineFourth, MeasuredVignetting, PolynomialVignetting
from relume.virtual_camera.tone.black_white_point import BlackWhitePoint
from relume.virtual_camera.tone.display.encoding import HLG, PQ, DisplayP3, HdrGainMap, Srgb
from relume.virtual_camera.tone.display_range import DisplayRange
from relume.virtual_camera.tone.ferwerda import Ferwerda
from relume.virtual_camera.tone.histogram.adjustment import HistogramAdjustment
from relume.virtual_camera.tone.histogram.curve import HumanContrast, LinearContrast
from relume.virtual_camera.tone.metered import CameraExposure, FixedExposure, MeteredExposure
from relume.virtual_camera.tone.ocio import Ocio
from relume.virtual_camera.tone.pattanaik.pattanaik import Pattanaik
from relume.virtual_camera.tone.reinhard import Reinhard, ReinhardLocal
from relume.virtual_camera.tone.tumblin_rushmeier import TumblinRushmeier

Make = Callable[..., Any]
Pair = tuple[float, float]


def straight_motion(pixels: Pair, opening: float = 0.0) -> StraightMotion:
    """The whole picture moves by so many pixels, right and down."""
    return StraightMotion(*pixels, shutter=Shutter(opening))


def turning_camera(degrees: tuple[float, float, float], opening: float = 0.0) -> TurningCamera:
    """The camera turns on its tripod: yaw right, pitch up, roll clockwise, degrees."""
    yaw, pitch, roll = (float(angle) for angle in np.radians(degrees))
    # Right and clockwise, as everywhere on the command line; the value turns about its axes, right-handed.
    return TurningCamera(-yaw, pitch, -roll, shutter=Shutter(opening))


def motion_vectors(opening: float = 0.0) -> MotionVectors:
    """Every pixel moves by its own vector, given beside the picture."""
    return MotionVectors(Shutter(opening))


def defocus(
    focus: float, f_number: float, focal_length: float, blades: int = 0, curvature: float = 0.0, rotation: float = 0.0
) -> Defocus:
    """A lens of an f-number and a focal length in mm, focused at so many metres; rotation in degrees."""
    if not (focus > 0 and f_number > 0 and focal_length > 0):
        raise ValueError("focus, f_number and focal_length must be above 0")
    iris = Blades(blades, curvature, float(np.radians(rotation)))
    return Defocus(aperture_of(f_number, focal_length), focus, iris)


def camera_glare(
    blades: int = 6, curvature: float = 0.0, rotation: float = 0.0, f_number: float = 8.0, sensor_width: float = 36.0,
    veil: float = 0.01, halo: float = 0.0, halo_core: float = 0.002, halo_power: float = 1.25, mirrored: bool = False,
) -> CameraGlare:  # fmt: skip
    """Diffraction at the iris, veiling glare and scatter of a camera's lens; rotation of the blades in degrees."""
    iris = Blades(blades, curvature, float(np.radians(rotation)))
    return CameraGlare(iris, f_number, sensor_width, veil, halo, halo_core, halo_power, mirrored)


def measured_glare(picture: str, mirrored: bool = False, *, folder: Path) -> MeasuredGlare:
    """The picture of a small lamp in the dark, as a point spread."""
    from relume.image.files import read_radiance

    return MeasuredGlare.of_lamp(read_radiance(folder / picture), mirrored=mirrored)


def geometry(
    k1: float = 0.0, k2: float = 0.0, p1: float = 0.0, p2: float = 0.0, k3: float = 0.0,
    red: Pair | None = None, blue: Pair | None = None,
) -> LensGeometry:  # fmt: skip
    """Distortion by OpenCV's coefficients; red and blue drawn larger by 1 + scale + quadratic r²."""
    from relume.scene.cameras.distortion import Distortion
    from relume.virtual_camera.lens.geometry import LateralColour, RadialScale

    bends = k1, k2, p1, p2, k3
    coloured = red is not None or blue is not None
    return LensGeometry(
        Distortion(*bends) if any(bends) else None,
        LateralColour(RadialScale(*red or (0.0,)), RadialScale(*blue or (0.0,))) if coloured else None,
    )


def measured_vignetting(profile: str, *, folder: Path) -> MeasuredVignetting:
    """The vignetting in a camera's profile."""
    from relume.capture.response.camera_profile import read_profile
    from relume.virtual_camera.plate_matching.camera_matching import profiled_vignetting

    found = profiled_vignetting(read_profile(folder / profile))
    if found is None:
        raise ValueError(f"{profile} holds no vignetting; measure it with relume merge")
    return MeasuredVignetting(found)


def metered(percentile: float | None = None, grey: float | None = None) -> MeteredExposure:
    """Plain exposure, by the bright parts or the mean where one of them is given, by the brighter of both else."""
    return MeteredExposure() if percentile is None and grey is None else MeteredExposure(percentile, grey)


def fixed(gain: float = 1.0) -> FixedExposure:
    """Plain exposure: display values per unit of radiance."""
    return FixedExposure(gain)


def camera(
    seconds: float, f_number: float, iso: float = 100.0, response: str | None = None, *, folder: Path
) -> CameraExposure | Film:
    """A camera's shutter, f-number and ISO; with its profile its response, on whose scale the picture has to be."""
    exposure = Exposure(seconds, f_number, iso)
    if response is None:
        return CameraExposure(exposure)
    from relume.capture.response.camera_profile import read_profile
    from relume.virtual_camera.plate_matching.camera_matching import profiled_response, profiled_scale

    profile = read_profile(folder / response)
    return Film.of(exposure, profiled_response(profile), scale=profiled_scale(profile, exposure))


def histogram(
    screen: DisplayRange = DisplayRange(), human_contrast: bool = False, veil: bool = False, acuity: bool = False,
    colour: bool = False, centre_weighted: bool = False,
) -> HistogramAdjustment:  # fmt: skip
    """Ward Larson et al. 1997."""
    contrast = HumanContrast() if human_contrast else LinearContrast()
    return HistogramAdjustment(
        screen, contrast, veil=veil, acuity=acuity, colour=colour, centre_weighted=centre_weighted
    )


def human(
    screen: DisplayRange = DisplayRange(), human_contrast: bool = True, veil: bool = True, acuity: bool = True,
    colour: bool = True, centre_weighted: bool = False,
) -> HistogramAdjustment:  # fmt: skip
    """The same with an eye's contrast, veil, acuity and colours."""
    return histogram(screen, human_contrast, veil, acuity, colour, centre_weighted)


def ocio(
    config: str | None = None, display: str | None = None, view: str | None = None, looks: tuple[str, ...] = (),
    grey: float | None = None, *, folder: Path,
) -> Ocio:  # fmt: skip
    """A view of an OpenColorIO configuration."""
    place = config if config is None or config.startswith("ocio://") else str(folder / config)
    return Ocio(place, display, view, looks, grey)


def darkroom(
    stock: Literal["black-and-white", "colour-negative", "slide"] = "black-and-white", speed: float | None = None,
    grade: float | None = None, stops: float = 0.0, print_stops: float = 0.0, frame: float = FRAME,
    grain: bool = True, halation: bool = True,
) -> Darkroom:  # fmt: skip
    """A film, and the paper that it is printed on."""
    if grade is not None and stock != "black-and-white":
        raise ValueError("grades are of black-and-white paper; leave grade out")
    of_speed = {} if speed is None else {"speed": speed}
    if stock == "slide":
        film, paper = stocks.slide_film(**of_speed), None
    elif stock == "colour-negative":
        film, paper = stocks.colour_negative(**of_speed), stocks.colour_paper()
    else:
        film, paper = (
            stocks.black_and_white_negative(**of_speed),
            stocks.black_and_white_paper(2.0 if grade is None else grade),
        )
    film = replace(film, grain=film.grain if grain else None, halation=film.halation if halation else None)
    return Darkroom(film, paper, stops=stops, print_stops=print_stops, frame=frame)


TABLES: Mapping[str, Make | Mapping[str, Make]] = {
    "motion": {"straight": straight_motion, "turn": turning_camera, "vectors": motion_vectors},
    "defocus": defocus,
    "soft_focus": SoftFocus,
    "glare": {"eye": EyeGlare, "camera": camera_glare, "measured": measured_glare},
    "geometry": geometry,
    "vignetting": {"natural": CosineFourth, "polynomial": PolynomialVignetting, "measured": measured_vignetting},
    "tone": {
        "exposure": metered, "fixed": fixed, "camera": camera, "reinhard": Reinhard, "reinhard-local": ReinhardLocal,
        "histogram": histogram, "human": human, "tumblin-rushmeier": TumblinRushmeier, "ferwerda": Ferwerda,
        "pattanaik": Pattanaik, "black-white": BlackWhitePoint, "ocio": ocio, "darkroom": darkroom,
    },
    "display": {"srgb": Srgb, "p3": DisplayP3, "pq": PQ, "hlg": HLG, "gain-map": HdrGainMap},
}  # fmt: skip
"""By the name of a table what makes its value; by its kind where it has kinds."""
