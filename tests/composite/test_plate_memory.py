"""What the steps of an insertion take of memory, in planes of a large plate: as much as they are to hold, and no more.

A first run on a small plate loads libraries and compiles what is not kept, which counts for nothing.
"""

import subprocess
import sys

import pytest

SCRIPT = """
import os
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path
import numpy as np
from relume.image import bands
bands.BAND //= 8  # a large plate has as many bands
os.cpu_count = lambda: 2  # each core holds a band
from relume.composite.borders import _Small
from relume.composite.differential import composed
from relume.composite.surface.reflectance import recover_reflectance
from relume.image.mapped_arrays import Mapped, give_back_freed, give_back_read
from relume.image.radiance import RadianceMap
from relume.renderers.renderer import Renderer
from relume.renderers.results import Change, Render
from relume.report import plots
from relume.scene.cameras.camera import Camera
from relume.scene.materials.materials import Diffuse
from relume.scene.scene import Scene
from relume.scene.shapes.shapes import Plane
from relume.sphere.environment_map import EnvironmentMap
from relume.virtual_camera.plate_matching.grain_measuring import radiance_grain
from relume.virtual_camera.plate_matching.sharpness import measured_sharpness

@dataclass(frozen=True)
class Even(Renderer):
    def render(self, scene, camera, *, seed=0, progress=None):
        plane = np.full((camera.height, camera.width, 3), 0.5, np.float32)
        return Render(plane, plane, plane[..., 0], plane[..., 0], plane, plane)

def camera(height):
    width = 3 * height // 2
    return Camera.looking_at(np.array([0.1, 0.6, 1.2]), np.zeros(3), width=width, height=height, focal_length=width)

def planes(height, count, colours=3):
    shape = (height, 3 * height // 2, 3)[: 3 if colours == 3 else 2]
    made = Mapped().zeros(Path(tempfile.gettempdir()), [shape] * count)
    for plane in made:
        for top in range(0, height, 100):
            plane[top : top + 100] = np.random.default_rng(top).random(plane[top : top + 100].shape, np.float32)
        give_back_read(plane)
    return made

def change(height):
    objects, difference, rest = planes(height, 3)
    (matte,) = planes(height, 1, 1)
    return Change(objects, difference, matte, matte, rest, rest, rest, rest)

def plate(height):
    grey = np.empty((height, 3 * height // 2, 3), np.float32)
    for top in range(0, height, 100):
        part = grey[top : top + 100]
        part[...] = 0.1 + np.random.default_rng(top).random(part.shape, np.float32)
    return RadianceMap(grey)

def ready(step, height):
    if step == "reflectance":
        light = EnvironmentMap(np.ones((8, 16, 3), np.float32))
        table = Scene(light, (Plane(Diffuse((0.5, 0.5, 0.5)), (9.0, 9.0)),))
        return recover_reflectance, (plate(height), camera(height), table), {"renderer": Even()}
    if step == "sharpness":
        return measured_sharpness, (plate(height),), {}
    if step == "grain":
        return radiance_grain, (plate(height),), {}
    if step == "borders":
        return _Small.of, (change(height), plate(height), camera(height)), {}
    if step == "composite":
        return composed, (plate(height).radiance, change(height)), {}
    return plots.signed, (planes(height, 1)[0], 1.0), {}

def peak():
    return next(int(line.split()[1]) for line in open("/proc/self/status") if line.startswith("VmHWM"))

for height in (200, 2000):
    work, given, options = ready(sys.argv[1], height)
    give_back_freed()
    Path("/proc/self/clear_refs").write_text("5")
    before = peak()
    work(*given, **options)
print((peak() - before) * 1024 / (2000 * 3000 * 12))
"""


@pytest.mark.slow
@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="the peak of memory is read as Linux states it")
@pytest.mark.parametrize(
    ("step", "least", "most"),
    [
        ("reflectance", 3.0, 6.1),  # the albedos before they are held to 0 … 1 and after, the light, masks
        ("sharpness", 1.5, 2.8),  # three planes of one channel in double
        ("grain", 0.5, 3.8),  # patches
        ("borders", 0.05, 0.7),
        ("composite", 1.0, 1.6),  # its result
        ("picture", 0.02, 0.5),
    ],
)
def test_a_step_holds_few_planes_of_six_megapixels_at_once(step, least, most):
    said = subprocess.run([sys.executable, "-c", SCRIPT, step], capture_output=True, text=True, check=True).stdout
    assert least <= float(said) <= most
