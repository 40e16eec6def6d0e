"""Glass, metals and spectra of lamps in scene files: values by name, files beside the scene, one line for faults."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from relume.errors import InvalidScene
from relume.image.colour import LUMINANCE_WEIGHTS
from relume.light.spectra.lamps import lamp_colour
from relume.light.spectra.spectrum import Spectrum, blackbody, illuminant
from relume.project.scene_file.scene_file import read_scene
from relume.scene.materials.glasses import GLASSES
from relume.scene.materials.materials import Material
from relume.scene.materials.metals import METALS
from toml_files import SCENE_BALL as BALL
from toml_files import SCENE_CAMERA, scene_of

HEAD = (
    SCENE_CAMERA
    + """\
[light]
colour = 0.1
"""
)
LAMPS = {
    "point": ("position = [0, 2, 0]\nintensity = 50", "intensity"),
    "distant": ("towards = [0, 1, 0]\nirradiance = 50", "irradiance"),
    "sphere": ("position = [0, 2, 0]\nradius = 0.1\nradiance = 50", "radiance"),
    "ambient": ("radiance = 50", "radiance"),
}


def material_of(folder: Path, keys: str) -> Material:
    text = f'{HEAD}[materials.ball]\nkind = "pbr"\n{keys}\n{BALL}'
    material = scene_of(folder, text).scene.objects[0].material
    assert isinstance(material, Material)
    return material


def test_a_material_names_its_glass(tmp_path):
    found = material_of(tmp_path, 'transmission = 1\nroughness = 0\nglass = "SF11"')
    assert found.glass == GLASSES["SF11"] and found.ior == pytest.approx(1.78472, abs=1e-5)
    found = material_of(tmp_path, "transmission = 1\nsellmeier = { B = [1.2], C = [0.01] }")
    assert found.ior == pytest.approx(np.sqrt(1 + 1.2 / (1 - 0.01 / 0.5875618**2)))


def test_a_material_names_its_metal(tmp_path):
    found = material_of(tmp_path, 'metal = "Cu"\nroughness = 0.1')
    assert found.metal == METALS["Cu"] and found.metallic == 1 and found.roughness == 0.1


@pytest.mark.parametrize("kind", LAMPS)
def test_a_lamp_has_the_colour_of_its_spectrum(tmp_path, kind):
    keys, amount = LAMPS[kind]
    text = f'{HEAD}[materials.ball]\nkind = "pbr"\n{BALL}[[lights]]\nkind = "{kind}"\n{keys}\n'
    found = scene_of(tmp_path, text + "spectrum = { blackbody = 2700 }").scene.lights[0]
    assert getattr(found, amount) == lamp_colour(blackbody(2700), 50)
    assert np.array(getattr(found, amount)) @ LUMINANCE_WEIGHTS == pytest.approx(50, rel=1e-4)
    found = scene_of(tmp_path, text + 'spectrum = { illuminant = "F11" }').scene.lights[0]
    assert getattr(found, amount) == lamp_colour(illuminant("F11"), 50)
    grey = scene_of(tmp_path, text).scene.lights[0]
    assert getattr(grey, amount) == (50, 50, 50)


def test_a_spectrum_is_read_beside_the_scene(tmp_path):
    (tmp_path / "lamp.csv").write_text("nm,power\n380,1\n780,4\n")
    (tmp_path / "scene.toml").write_text(
        f'{HEAD}[materials.ball]\nkind = "pbr"\n{BALL}[[lights]]\nkind = "ambient"\nradiance = 2\n'
        'spectrum = { file = "lamp.csv" }\n'
    )
    found = read_scene(tmp_path / "scene.toml").scene.lights[0]
    assert found.radiance == lamp_colour(Spectrum((380, 780), (1, 4)), 2)  # pyright: ignore[reportAttributeAccessIssue]


@pytest.mark.parametrize(
    ("keys", "words"),
    [
        ('radiance = 1\nspectrum = { illuminant = "D93" }', r"lights.0.spectrum: no illuminant 'D93'"),
        ("radiance = 1\nspectrum = { blackbody = 3 }", r"lights.0.spectrum: the temperature is 3 K"),
        ("radiance = 1\nspectrum = {}", r"lights.0.spectrum: has none; give one of blackbody, illuminant and file"),
        ('radiance = 1\nspectrum = { blackbody = 3000, illuminant = "A" }', "has blackbody and illuminant; give one"),
        ("radiance = [1, 2, 3]\nspectrum = { blackbody = 3000 }", r"lights.0.radiance: is a colour beside a spectrum"),
        ('radiance = 1\nspectrum = { file = "none.csv" }', r"lights.0.spectrum: .*none.csv: no such spectrum"),
    ],
)
def test_faults_of_a_spectrum_are_one_line_that_names_the_key(tmp_path, keys, words):
    text = f'{HEAD}[materials.ball]\nkind = "pbr"\n{BALL}[[lights]]\nkind = "ambient"\n{keys}\n'
    with pytest.raises(InvalidScene, match=words):
        scene_of(tmp_path, text)
