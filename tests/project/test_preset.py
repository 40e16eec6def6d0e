"""Presets: every key reaches the value it is for, and every fault is one line that names it."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from relume.errors import InvalidShot
from relume.image.photograph import Exposure
from relume.project.presets.preset import CameraPreset, preset_of
from relume.virtual_camera.film.darkroom import Darkroom
from relume.virtual_camera.lens.defocus_blur import Defocus, aperture_of
from relume.virtual_camera.lens.geometry import LensGeometry
from relume.virtual_camera.lens.glare.camera import CameraGlare
from relume.virtual_camera.lens.glare.eye import EyeGlare
from relume.virtual_camera.lens.motion.path import TurningCamera
from relume.virtual_camera.lens.soft_focus import SoftFocus
from relume.virtual_camera.lens.vignetting import PolynomialVignetting
from relume.virtual_camera.tone.display.encoding import PQ
from relume.virtual_camera.tone.display_range import DisplayRange
from relume.virtual_camera.tone.ferwerda import Ferwerda
from relume.virtual_camera.tone.histogram.adjustment import HistogramAdjustment
from relume.virtual_camera.tone.histogram.curve import HumanContrast
from relume.virtual_camera.tone.metered import CameraExposure, MeteredExposure
from relume.virtual_camera.tone.reinhard import Reinhard

WHOLE = """
title = "everything"
exposure = -1.5
[view]
field_of_view = 40
luminance = 12.0
seed = 7
[motion]
kind = "turn"
degrees = [2.0, -1.0, 0.5]
[defocus]
focus = 3.0
f_number = 2.0
focal_length = 50.0
blades = 6
rotation = 30.0
[soft_focus]
share = 0.2
[glare]
kind = "camera"
blades = 7
f_number = 11.0
[geometry]
k1 = -0.1
red = [0.001, 0.0]
[vignetting]
kind = "polynomial"
coefficients = [-0.3, 0.05]
[tone]
kind = "reinhard"
key = 0.36
[display]
kind = "pq"
peak = 600.0
"""


def test_every_key_reaches_its_value(tmp_path):
    (tmp_path / "all.toml").write_text(WHOLE, encoding="utf-8")
    preset = CameraPreset.read(tmp_path / "all.toml")
    camera = preset.camera
    assert (preset.view.field_of_view, preset.view.luminance, preset.view.seed) == (40, 12, 7)
    assert camera.stops == -1.5 and camera.tone == Reinhard(key=0.36) and camera.display == PQ(peak=600)
    assert isinstance(camera.motion, TurningCamera)
    assert np.degrees([camera.motion.yaw, camera.motion.pitch, camera.motion.roll]) == pytest.approx([-2, -1, -0.5])
    assert isinstance(camera.defocus, Defocus) and camera.defocus.aperture == aperture_of(2, 50) == 0.025
    assert camera.defocus.blades.count == 6 and np.degrees(camera.defocus.blades.rotation) == pytest.approx(30)
    assert camera.soft_focus == SoftFocus(0.2)
    assert isinstance(camera.glare, CameraGlare) and camera.glare.f_number == 11 and camera.glare.blades.count == 7
    assert isinstance(camera.geometry, LensGeometry) and camera.geometry.distortion is not None
    assert camera.geometry.distortion.k1 == -0.1 and camera.geometry.lateral is not None
    assert (camera.geometry.lateral.red.scale, camera.geometry.lateral.blue.scale) == (0.001, 0)
    assert camera.vignetting == PolynomialVignetting((-0.3, 0.05))


def test_what_is_left_out_is_the_values_own_default():
    camera = preset_of({"glare": {"kind": "eye"}, "tone": {"kind": "exposure"}}).camera
    assert camera.glare == EyeGlare() and camera.tone == MeteredExposure()
    assert preset_of({"tone": {"kind": "exposure", "grey": 0.2}}).camera.tone == MeteredExposure(None, 0.2)
    assert preset_of({}).camera.tone == MeteredExposure() and preset_of({}).camera.optics == ()
    assert preset_of({"tone": {"kind": "ferwerda"}}).camera.tone == Ferwerda()
    bright = preset_of({"tone": {"kind": "ferwerda", "screen": {"white": 400, "black": 0.5}, "colour": False}}).camera
    assert bright.tone == Ferwerda(DisplayRange(400, 0.5), colour=False)


@pytest.mark.parametrize("kind", ["ferwerda", "tumblin-rushmeier", "pattanaik", "histogram", "human"])
def test_what_a_screen_leaves_out_is_the_tones_own(kind):
    own = tone_of({"kind": kind}).screen
    assert own == (DisplayRange(100, 0.01) if kind == "ferwerda" else DisplayRange(100, 1))
    assert tone_of({"kind": kind, "screen": {"white": 80}}).screen == DisplayRange(80, own.black)
    assert tone_of({"kind": kind, "screen": {"black": 0.3}}).screen == DisplayRange(100, 0.3)
    with pytest.raises(InvalidShot, match="expected 0 < black < white"):
        preset_of({"tone": {"kind": kind, "screen": {"white": own.black}}})


def tone_of(table) -> Any:
    return preset_of({"tone": table}).camera.tone


def test_human_is_histogram_with_an_eye():
    human = preset_of({"tone": {"kind": "human", "screen": {"white": 80, "black": 0.8}}}).camera.tone
    assert human == HistogramAdjustment.human(DisplayRange(80, 0.8))
    eye = preset_of({"tone": {"kind": "histogram", "human_contrast": True}}).camera.tone
    assert eye == HistogramAdjustment(contrast=HumanContrast())


def test_a_cameras_exposure_and_a_films_speed():
    tone = preset_of({"tone": {"kind": "camera", "seconds": 0.02, "f_number": 4, "iso": 200}}).camera.tone
    assert tone == CameraExposure(Exposure(0.02, 4, 200))
    tone = preset_of({"tone": {"kind": "darkroom", "stock": "slide", "grain": False, "print_stops": 0.5}}).camera.tone
    assert isinstance(tone, Darkroom) and tone.negative.grain is None and tone.paper is None
    assert tone.negative.halation is not None and tone.print_stops == 0.5


@pytest.mark.parametrize(
    ("table", "words"),
    [
        ({"tone": {"kind": "reinhart"}}, "tone.kind: got 'reinhart'.*did you mean reinhard"),
        ({"tone": {"kind": "reinhard", "keys": 1}}, "tone.keys: unknown key; did you mean key"),
        ({"glare": {"kind": "eye", "pupil": -1}}, "glare: pupil is -1.*above 0"),
        ({"exposure": "much"}, "exposure: .*number"),
        ({"tone": {"kind": "darkroom", "stock": "slide", "grade": 2}}, "leave grade out"),
        ({"defocus": {"focus": 1.0}}, "defocus.f_number: missing"),
    ],
)
def test_a_fault_is_one_line_that_names_the_key(table, words):
    with pytest.raises(InvalidShot, match=words) as refused:
        preset_of(table, Path("look.toml"))
    assert str(refused.value).startswith("look.toml: ") and "\n" not in str(refused.value)


def test_a_display_has_the_keys_of_its_kind():
    with pytest.raises(InvalidShot, match=r"display\.peak: unknown key"):
        preset_of({"display": {"kind": "p3", "peak": 1000}})


def test_the_presets_that_come_along_are_whole():
    names = CameraPreset.builtin()
    assert {"day", "night", "black-and-white", "slide"} <= set(names)
    for name, title in names.items():
        assert title == CameraPreset.read(name).title and CameraPreset.read(name).camera is not None
    with pytest.raises(InvalidShot, match=r"no such preset; give a \.toml, or one of .*night"):
        CameraPreset.read("nigth")


def test_the_documents_preset_can_be_read(tmp_path):
    text = (Path(__file__).parents[2] / "docs" / "how-to" / "develop.md").read_text(encoding="utf-8")
    (tmp_path / "doc.toml").write_text(text.split("```toml\n")[1].split("```")[0], encoding="utf-8")
    preset = CameraPreset.read(tmp_path / "doc.toml")
    assert preset.camera.stops == 0.5 and preset.title == "An old fast lens"


def test_the_document_names_every_kind_of_tone():
    text = (Path(__file__).parents[2] / "docs" / "how-to" / "develop.md").read_text(encoding="utf-8")
    kinds = (
        "exposure, fixed, camera, reinhard, reinhard-local, histogram, human",
        "tumblin-rushmeier, ferwerda, pattanaik, black-white, ocio",
    )
    assert all(line in text for line in kinds)
    for kind in ", ".join(kinds).split(", "):
        needed = {"camera": {"seconds": 1.0, "f_number": 8.0}}.get(kind, {})
        assert preset_of({"tone": {"kind": kind, **needed}}).camera.tone is not None
