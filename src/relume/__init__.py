"""relume: photographs in, light out; light in, photographs out. Every public name, loaded when it is first used."""

from __future__ import annotations

import sys
from importlib import import_module
from importlib.metadata import version as _version
from types import ModuleType
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from relume.capture.alignment import align
    from relume.capture.bracket import Bracket, read_bracket
    from relume.capture.calibration import Calibration, recover_response
    from relume.capture.debevec_malik import DebevecMalik
    from relume.capture.deghosting import deghost
    from relume.capture.measurement import Measurement, Treatment, measure
    from relume.capture.merging import merge
    from relume.capture.mitsunaga_nayar import MitsunagaNayar
    from relume.capture.profile import CameraProfile, read_profile, write_profile
    from relume.capture.ratios import Ratios
    from relume.capture.raw_merging import merge_raw
    from relume.capture.robertson import Robertson
    from relume.capture.weighting import Hat, InverseVariance
    from relume.composite.differential import Ratio, differential
    from relume.composite.local_scene import Recovered, recover_reflectance
    from relume.composite.reflectance import recover
    from relume.develop.blades import Blades
    from relume.develop.darkroom.darkroom import Darkroom
    from relume.develop.darkroom.stocks import black_and_white_negative, colour_negative, colour_paper, paper, slide
    from relume.develop.display.displays import HLG, PQ, DisplayP3, HdrGainMap, Srgb
    from relume.develop.display.false_colour import false_colour
    from relume.develop.display.stops import stops_sheet
    from relume.develop.display.writing import write_display
    from relume.develop.film import Film, develop, virtual_photograph
    from relume.develop.glare.camera import CameraGlare
    from relume.develop.glare.eye import EyeGlare
    from relume.develop.glare.measured import MeasuredGlare
    from relume.develop.inverse import radiance_of, undone_all
    from relume.develop.lens.defocus_blur import Defocus
    from relume.develop.lens.geometry import LensGeometry
    from relume.develop.lens.lateral_colour import LateralColour, RadialScale
    from relume.develop.lens.motion_path import HomographyPath, TurningCamera
    from relume.develop.lens.motion_straight import StraightMotion
    from relume.develop.lens.motion_vectors import MotionVectors
    from relume.develop.lens.soft_focus import SoftFocus
    from relume.develop.lens.vignetting import CosineFourth, MeasuredVignetting, PolynomialVignetting
    from relume.develop.plate_match import matched_film
    from relume.develop.steps import Screen
    from relume.develop.tone.black_white_point import BlackWhitePoint
    from relume.develop.tone.ferwerda import Ferwerda
    from relume.develop.tone.histogram import HistogramAdjustment
    from relume.develop.tone.metered import CameraExposure, Fixed, Metered
    from relume.develop.tone.ocio import Ocio
    from relume.develop.tone.pattanaik import Pattanaik
    from relume.develop.tone.reinhard import Reinhard
    from relume.develop.tone.reinhard_local import ReinhardLocal
    from relume.develop.tone.tumblin_rushmeier import TumblinRushmeier
    from relume.develop.virtual_camera import VirtualCamera, developed, developed_frames, photograph
    from relume.errors import (
        BallNotFound,
        DoubtfulResult,
        FormatError,
        GridNotFound,
        InvalidScene,
        InvalidShot,
        InvalidStage,
        NotABracket,
        NotAPanorama,
        OutputNotWritten,
        RelumeError,
        SunNotFound,
        SunNotRecovered,
        UnreadableFile,
        UnsupportedScene,
    )
    from relume.image.files import Reading, read, read_photograph, read_radiance, read_raw, write, write_layers
    from relume.image.files.encodings import PFM, FloatTIFF, GainMap, LogLuv, OpenEXR, RadianceHDR, RawFloat
    from relume.image.photograph import Exposure, Photograph
    from relume.image.radiance import RadianceMap
    from relume.image.response import Response
    from relume.light.clipped_sun import recover_sun
    from relume.light.constellation import Constellation, constellation
    from relume.light.k_means import KMeans
    from relume.light.median_cut import MedianCut
    from relume.light.reflection import ReflectionMap, reflection_map, reflection_maps
    from relume.light.residual import key_lights
    from relume.light.sun import extract_sun
    from relume.light.variance_cut import VarianceMinimisation
    from relume.lightstage.clothing import Cloths, reclothed
    from relume.lightstage.driving import drive
    from relume.lightstage.environment_matte import EnvironmentMatte, environment_matte
    from relume.lightstage.field import Noise, Pictures
    from relume.lightstage.illumination import irradiances
    from relume.lightstage.lights import StageLights
    from relume.lightstage.reading import read_stage
    from relume.lightstage.relighting import relight
    from relume.lightstage.separation import separate
    from relume.lightstage.store_building import build_store
    from relume.lightstage.viewpoint import Source, view
    from relume.probe.ball import BallView, view_ball
    from relume.probe.blending import Probe, assemble
    from relume.probe.painting import HotSpot, paint
    from relume.probe.panorama import mosaic
    from relume.probe.panorama_views import PanoramaView
    from relume.render.change import Change
    from relume.render.environment import environment
    from relume.render.mapped import Mapped
    from relume.render.mitsuba import Mitsuba
    from relume.render.mitsuba_differential import Differential
    from relume.render.renderer import Constant, Render, Renderer, render
    from relume.render.whitted import Whitted
    from relume.scene.camera import Camera
    from relume.scene.camera_files import read_camera
    from relume.scene.distant import Box, Dome
    from relume.scene.distortion import Distortion
    from relume.scene.grid import camera_from_grid
    from relume.scene.lights import AmbientLight, DistantLight, PointLight, SphereLight
    from relume.scene.materials import Diffuse, Material, Ward
    from relume.scene.meshes import read_meshes
    from relume.scene.patches import Patches, read_patches
    from relume.scene.presets import preset
    from relume.scene.reflective import Reflective
    from relume.scene.scene import Scene
    from relume.scene.shapes import Mesh, Plane, Polygon, Sphere
    from relume.scene.vanishing import fit_vanishing_lines
    from relume.scene.whitted import Checks, WhittedMaterial
    from relume.shot.insert import insert
    from relume.shot.outcome import Inserted
    from relume.shot.preset import read_preset
    from relume.shot.project import Shot, read_shot
    from relume.shot.scene_file import SceneFile, read_scene
    from relume.sphere.audit import audit
    from relume.sphere.cubes import Cross, Strip, VerticalCross
    from relume.sphere.discs import Angular, Fisheye, Hemispheres, MirrorBall
    from relume.sphere.illumination import IlluminationMap, as_illumination, as_radiance_map
    from relume.sphere.mappings import LatLong
    from relume.sphere.orientation import oriented
    from relume.sphere.perspective import perspective_view
    from relume.sphere.sampling import Sampler
    from relume.sphere.spherical_harmonics import Harmonics, project
    from relume.sphere.squares import EqualArea, Octahedral

_HOMES = {
    "capture.alignment": ("align",),
    "capture.bracket": ("Bracket", "read_bracket"),
    "capture.calibration": ("Calibration", "recover_response"),
    "capture.debevec_malik": ("DebevecMalik",),
    "capture.deghosting": ("deghost",),
    "capture.measurement": ("Measurement", "Treatment", "measure"),
    "capture.merging": ("merge",),
    "capture.mitsunaga_nayar": ("MitsunagaNayar",),
    "capture.profile": ("CameraProfile", "read_profile", "write_profile"),
    "capture.ratios": ("Ratios",),
    "capture.raw_merging": ("merge_raw",),
    "capture.robertson": ("Robertson",),
    "capture.weighting": ("Hat", "InverseVariance"),
    "composite.differential": ("Ratio", "differential"),
    "composite.local_scene": ("Recovered", "recover_reflectance"),
    "composite.reflectance": ("recover",),
    "develop.blades": ("Blades",),
    "develop.darkroom.darkroom": ("Darkroom",),
    "develop.darkroom.stocks": (
        "black_and_white_negative",
        "colour_negative",
        "colour_paper",
        "paper",
        "slide",
    ),
    "develop.display.displays": (
        "HLG",
        "PQ",
        "DisplayP3",
        "HdrGainMap",
        "Srgb",
    ),
    "develop.display.false_colour": ("false_colour",),
    "develop.display.stops": ("stops_sheet",),
    "develop.display.writing": ("write_display",),
    "develop.glare.camera": ("CameraGlare",),
    "develop.glare.eye": ("EyeGlare",),
    "develop.glare.measured": ("MeasuredGlare",),
    "develop.inverse": (
        "radiance_of",
        "undone_all",
    ),
    "develop.lens.defocus_blur": ("Defocus",),
    "develop.lens.geometry": ("LensGeometry",),
    "develop.lens.lateral_colour": (
        "LateralColour",
        "RadialScale",
    ),
    "develop.lens.motion_path": (
        "HomographyPath",
        "TurningCamera",
    ),
    "develop.lens.motion_straight": ("StraightMotion",),
    "develop.lens.motion_vectors": ("MotionVectors",),
    "develop.lens.soft_focus": ("SoftFocus",),
    "develop.lens.vignetting": (
        "CosineFourth",
        "MeasuredVignetting",
        "PolynomialVignetting",
    ),
    "develop.plate_match": ("matched_film",),
    "develop.steps": ("Screen",),
    "develop.tone.black_white_point": ("BlackWhitePoint",),
    "develop.tone.ferwerda": ("Ferwerda",),
    "develop.tone.histogram": ("HistogramAdjustment",),
    "develop.tone.metered": (
        "CameraExposure",
        "Fixed",
        "Metered",
    ),
    "develop.tone.ocio": ("Ocio",),
    "develop.tone.pattanaik": ("Pattanaik",),
    "develop.tone.reinhard": ("Reinhard",),
    "develop.tone.reinhard_local": ("ReinhardLocal",),
    "develop.tone.tumblin_rushmeier": ("TumblinRushmeier",),
    "develop.virtual_camera": (
        "VirtualCamera",
        "developed",
        "developed_frames",
        "photograph",
    ),
    "develop.film": ("Film", "develop", "virtual_photograph"),
    "errors": (
        "BallNotFound",
        "DoubtfulResult",
        "FormatError",
        "GridNotFound",
        "InvalidScene",
        "InvalidShot",
        "InvalidStage",
        "NotABracket",
        "NotAPanorama",
        "OutputNotWritten",
        "RelumeError",
        "SunNotFound",
        "SunNotRecovered",
        "UnreadableFile",
        "UnsupportedScene",
    ),
    "image.files": ("Reading", "read", "read_photograph", "read_radiance", "read_raw", "write", "write_layers"),
    "image.files.encodings": ("PFM", "FloatTIFF", "GainMap", "LogLuv", "OpenEXR", "RadianceHDR", "RawFloat"),
    "image.photograph": ("Exposure", "Photograph"),
    "image.radiance": ("RadianceMap",),
    "image.response": ("Response",),
    "light.clipped_sun": ("recover_sun",),
    "light.constellation": ("Constellation", "constellation"),
    "light.k_means": ("KMeans",),
    "light.median_cut": ("MedianCut",),
    "light.reflection": ("ReflectionMap", "reflection_map", "reflection_maps"),
    "light.residual": ("key_lights",),
    "light.sun": ("extract_sun",),
    "light.variance_cut": ("VarianceMinimisation",),
    "lightstage.clothing": ("Cloths", "reclothed"),
    "lightstage.driving": ("drive",),
    "lightstage.environment_matte": ("EnvironmentMatte", "environment_matte"),
    "lightstage.field": ("Noise", "Pictures"),
    "lightstage.illumination": ("irradiances",),
    "lightstage.lights": ("StageLights",),
    "lightstage.reading": ("read_stage",),
    "lightstage.relighting": ("relight",),
    "lightstage.separation": ("separate",),
    "lightstage.store_building": ("build_store",),
    "lightstage.viewpoint": ("Source", "view"),
    "probe.ball": ("BallView", "view_ball"),
    "probe.blending": ("Probe", "assemble"),
    "probe.painting": ("HotSpot", "paint"),
    "probe.panorama": ("mosaic",),
    "probe.panorama_views": ("PanoramaView",),
    "render.change": ("Change",),
    "render.environment": ("environment",),
    "render.mapped": ("Mapped",),
    "render.mitsuba": ("Mitsuba",),
    "render.mitsuba_differential": ("Differential",),
    "render.renderer": ("Constant", "Render", "Renderer", "render"),
    "render.whitted": ("Whitted",),
    "scene.camera": ("Camera",),
    "scene.camera_files": ("read_camera",),
    "scene.distant": ("Box", "Dome"),
    "scene.distortion": ("Distortion",),
    "scene.grid": ("camera_from_grid",),
    "scene.lights": ("AmbientLight", "DistantLight", "PointLight", "SphereLight"),
    "scene.materials": ("Diffuse", "Material", "Ward"),
    "scene.meshes": ("read_meshes",),
    "scene.patches": ("Patches", "read_patches"),
    "scene.presets": ("preset",),
    "scene.reflective": ("Reflective",),
    "scene.scene": ("Scene",),
    "scene.shapes": ("Mesh", "Plane", "Polygon", "Sphere"),
    "scene.vanishing": ("fit_vanishing_lines",),
    "scene.whitted": ("Checks", "WhittedMaterial"),
    "shot.insert": ("insert",),
    "shot.outcome": ("Inserted",),
    "shot.preset": ("read_preset",),
    "shot.project": ("Shot", "read_shot"),
    "shot.scene_file": ("SceneFile", "read_scene"),
    "sphere.audit": ("audit",),
    "sphere.cubes": ("Cross", "Strip", "VerticalCross"),
    "sphere.discs": ("Angular", "Fisheye", "Hemispheres", "MirrorBall"),
    "sphere.illumination": ("IlluminationMap", "as_illumination", "as_radiance_map"),
    "sphere.mappings": ("LatLong",),
    "sphere.orientation": ("oriented",),
    "sphere.perspective": ("perspective_view",),
    "sphere.sampling": ("Sampler",),
    "sphere.spherical_harmonics": ("Harmonics", "project"),
    "sphere.squares": ("EqualArea", "Octahedral"),
}
_HOME = {name: home for home, names in _HOMES.items() for name in names}

__all__ = [
    "HLG",
    "PFM",
    "PQ",
    "AmbientLight",
    "Angular",
    "BallNotFound",
    "BallView",
    "BlackWhitePoint",
    "Blades",
    "Box",
    "Bracket",
    "Calibration",
    "Camera",
    "CameraExposure",
    "CameraGlare",
    "CameraProfile",
    "Change",
    "Checks",
    "Cloths",
    "Constant",
    "Constellation",
    "CosineFourth",
    "Cross",
    "Darkroom",
    "DebevecMalik",
    "Defocus",
    "Differential",
    "Diffuse",
    "DisplayP3",
    "DistantLight",
    "Distortion",
    "Dome",
    "DoubtfulResult",
    "EnvironmentMatte",
    "EqualArea",
    "Exposure",
    "EyeGlare",
    "Ferwerda",
    "Film",
    "Fisheye",
    "Fixed",
    "FloatTIFF",
    "FormatError",
    "GainMap",
    "GridNotFound",
    "Harmonics",
    "Hat",
    "HdrGainMap",
    "Hemispheres",
    "HistogramAdjustment",
    "HomographyPath",
    "HotSpot",
    "IlluminationMap",
    "Inserted",
    "InvalidScene",
    "InvalidShot",
    "InvalidStage",
    "InverseVariance",
    "KMeans",
    "LatLong",
    "LateralColour",
    "LensGeometry",
    "LogLuv",
    "Mapped",
    "Material",
    "MeasuredGlare",
    "MeasuredVignetting",
    "Measurement",
    "MedianCut",
    "Mesh",
    "Metered",
    "MirrorBall",
    "Mitsuba",
    "MitsunagaNayar",
    "MotionVectors",
    "Noise",
    "NotABracket",
    "NotAPanorama",
    "Ocio",
    "Octahedral",
    "OpenEXR",
    "OutputNotWritten",
    "PanoramaView",
    "Patches",
    "Pattanaik",
    "Photograph",
    "Pictures",
    "Plane",
    "PointLight",
    "Polygon",
    "PolynomialVignetting",
    "Probe",
    "RadialScale",
    "RadianceHDR",
    "RadianceMap",
    "Ratio",
    "Ratios",
    "RawFloat",
    "Reading",
    "Recovered",
    "ReflectionMap",
    "Reflective",
    "Reinhard",
    "ReinhardLocal",
    "RelumeError",
    "Render",
    "Renderer",
    "Response",
    "Robertson",
    "Sampler",
    "Scene",
    "SceneFile",
    "Screen",
    "Shot",
    "SoftFocus",
    "Source",
    "Sphere",
    "SphereLight",
    "Srgb",
    "StageLights",
    "StraightMotion",
    "Strip",
    "SunNotFound",
    "SunNotRecovered",
    "Treatment",
    "TumblinRushmeier",
    "TurningCamera",
    "UnreadableFile",
    "UnsupportedScene",
    "VarianceMinimisation",
    "VerticalCross",
    "VirtualCamera",
    "Ward",
    "Whitted",
    "WhittedMaterial",
    "align",
    "as_illumination",
    "as_radiance_map",
    "assemble",
    "audit",
    "black_and_white_negative",
    "build_store",
    "camera_from_grid",
    "colour_negative",
    "colour_paper",
    "constellation",
    "deghost",
    "develop",
    "developed",
    "developed_frames",
    "differential",
    "drive",
    "environment",
    "environment_matte",
    "extract_sun",
    "false_colour",
    "fit_vanishing_lines",
    "insert",
    "irradiances",
    "key_lights",
    "matched_film",
    "measure",
    "merge",
    "merge_raw",
    "mosaic",
    "oriented",
    "paint",
    "paper",
    "perspective_view",
    "photograph",
    "preset",
    "project",
    "radiance_of",
    "read",
    "read_bracket",
    "read_camera",
    "read_meshes",
    "read_patches",
    "read_photograph",
    "read_preset",
    "read_profile",
    "read_radiance",
    "read_raw",
    "read_scene",
    "read_shot",
    "read_stage",
    "reclothed",
    "recover",
    "recover_reflectance",
    "recover_response",
    "recover_sun",
    "reflection_map",
    "reflection_maps",
    "relight",
    "render",
    "separate",
    "slide",
    "stops_sheet",
    "undone_all",
    "view",
    "view_ball",
    "virtual_photograph",
    "write",
    "write_display",
    "write_layers",
    "write_profile",
]


class _Relume(ModuleType):
    """Keeps `relume.render` and `relume.develop` the functions, though folders of the same names are imported."""

    def __setattr__(self, name: str, value: Any) -> None:
        if not (name in _HOME and isinstance(value, ModuleType)):
            super().__setattr__(name, value)


sys.modules[__name__].__class__ = _Relume


def __getattr__(name: str) -> Any:
    if name == "__version__":
        return _version("relume")
    if name not in _HOME:
        raise AttributeError(f"module 'relume' has no attribute {name!r}")
    value = getattr(import_module(f"relume.{_HOME[name]}"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return [*__all__, "__version__"]
