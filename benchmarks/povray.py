"""The twin of a scene for POV-Ray 3.7, an independent tracer of the same model (1991–2013), and runs of it.

Both use the same world: POV-Ray's is left-handed only by its camera's habit, and ours is given whole. Where the models
differ: POV-Ray filters no total internal reflection, its bumps are another noise, a light's linear falloff and the
attenuation between a tree's nodes are left out, and its highlights have the light's colour alone.
"""

from __future__ import annotations

import re
import shutil
import subprocess
import tempfile
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

import relume as rl
from relume.scene.lights import AmbientLight, DistantLight, Light, Linear, PointLight, SquareLaw
from relume.scene.materials.bumps import Wrinkles
from relume.scene.materials.whitted import Checks, WhittedMaterial
from relume.scene.shapes.shapes import Patches, Polygon, Shape

PROGRAM = shutil.which("povray")
ADAPTIVE = ("+AM2", "+A0.1", "+R3")
"""Its antialiasing as the comparison sets it: recursive, as Whitted's."""
STEEPNESS = 0.276
"""Root mean square slope, in one direction, of POV-Ray's bumps of strength 1; measured on a wrinkled plane."""


@dataclass(frozen=True, eq=False)
class Traced:
    """What POV-Ray made of a scene, and its own figures.

    pixels : (H, W, 3) float64, linear, clipped to 0…1
    trace : seconds, as it reports them; `wall` is the whole command's
    rays : all that it traced but those to lights, which it counts by the objects they were held against
    """

    pixels: np.ndarray
    trace: float
    wall: float
    rays: int


def traced(text: str, width: int, height: int, options: tuple[str, ...] = ADAPTIVE, threads: int = 2) -> Traced:
    """Have POV-Ray trace a scene's text; raises RuntimeError with its last lines where it refuses."""
    if PROGRAM is None:
        raise RuntimeError("povray is not installed")
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder)
        (place / "scene.pov").write_text(text)
        output = ["+Oscene.png", "+FN16", "File_Gamma=1.0", f"+W{width}", f"+H{height}", "-D", f"+WT{threads}"]
        start = time.perf_counter()
        run = subprocess.run([PROGRAM, "+Iscene.pov", *output, *options], cwd=place, capture_output=True, text=True)
        wall = time.perf_counter() - start
        if run.returncode or not (place / "scene.png").exists():
            raise RuntimeError("\n".join(run.stderr.splitlines()[-5:]))
        pixels = rl.read_photograph(place / "scene.png").pixels / 65535
    seconds = re.search(r"Trace Time:.*\(([\d.]+) seconds\)", run.stderr)
    rays = re.search(r"Rays:\s+(\d+)", run.stderr)
    if seconds is None or rays is None:
        raise RuntimeError(f"{PROGRAM} does not report its trace time and rays as POV-Ray 3.7 does")
    return Traced(pixels, float(seconds[1]), wall, int(rays[1]))


def scene_text(scene: rl.Scene, camera: rl.Camera, depth: int) -> str:
    """A scene in POV-Ray's language; raises ValueError for what has no twin."""
    if camera.centre is not None or camera.distortion is not None or camera.aperture > 0:
        raise ValueError("the camera has a principal point, a distortion or an aperture; only a plain one has a twin")
    ambient = np.zeros(3)
    for light in scene.lights:
        if isinstance(light, AmbientLight):
            ambient = ambient + light.radiance
    right, up, backward = camera.rotation.T
    ahead = -backward * camera.focal_length
    shapes = (*scene.local, *scene.objects)
    return "\n".join(
        [
            "#version 3.7;",
            f"global_settings {{ assumed_gamma 1 max_trace_level {depth} ambient_light rgb 1 }}",
            f"camera {{ perspective location {_vector(camera.position)} direction {_vector(ahead)}"
            f" right {_vector(right * camera.width)} up {_vector(up * camera.height)} }}",
            f"background {{ rgb {_vector(_background(scene))} }}",
            *(_light(light) for light in scene.lights if not isinstance(light, AmbientLight)),
            *(_shape(shape, ambient, shapes, camera) for shape in shapes),
        ]
    )


def _vector(values: np.ndarray | tuple[float, ...]) -> str:
    return "<" + ",".join(f"{value:.9g}" for value in values) + ">"


def _background(scene: rl.Scene) -> np.ndarray:
    radiance = scene.light.radiance.reshape(-1, 3)
    if np.ptp(radiance, axis=0).max() > 0:
        raise ValueError("the light is a map; only one colour from everywhere has a twin")
    return radiance[0]


def _light(light: Light) -> str:
    # A diffuse surface shows irradiance/π here, and POV-Ray the light's colour.
    if isinstance(light, DistantLight):
        far = 1e5 * np.asarray(light.towards) / np.linalg.norm(light.towards)
        colour = np.asarray(light.irradiance) / np.pi
        return f"light_source {{ {_vector(far)} rgb {_vector(colour)} parallel point_at 0 }}"
    assert isinstance(light, PointLight)
    colour, fade = np.asarray(light.intensity) / np.pi, ""
    if isinstance(light.falloff, Linear):
        colour = colour * light.falloff.at(np.array(np.linalg.norm(light.position)))  # as at the origin
    if isinstance(light.falloff, SquareLaw):
        # 2/(1 + (d/s)²) is 2s²/d² where the distance s is small.
        small = 1e-3
        colour, fade = colour / (2 * small**2), f" fade_distance {small} fade_power 2"
    return f"light_source {{ {_vector(light.position)} rgb {_vector(colour)}{fade} }}"


def _shape(shape: Shape, ambient: np.ndarray, every: tuple[Shape, ...], camera: rl.Camera) -> str:
    look = _texture(shape.material, ambient, _around(shape, every))
    if isinstance(shape, rl.Sphere):
        return f"sphere {{ {_vector(shape.centre)}, {shape.radius:.9g} {look} }}"
    if isinstance(shape, rl.Plane) and shape.size is None:
        return f"plane {{ y, {shape.height:.9g} {look} }}"
    if isinstance(shape, rl.Plane):
        x, z = np.array([-1, 1, 1, -1]) * shape.extent[0] / 2, np.array([-1, -1, 1, 1]) * shape.extent[1] / 2
        return _polygon(np.stack([x, np.full(4, shape.height), z], axis=-1), look)
    if isinstance(shape, Polygon):
        return _polygon(shape.vertices, look)
    if isinstance(shape, Patches):
        return "\n".join(_patch(control, camera, look) for control in shape.control)
    parts = [_list("vertex_vectors", shape.vertices), _list("face_indices", shape.faces)]
    if shape.normals is not None:
        parts.insert(1, _list("normal_vectors", shape.normals))
    return f"mesh2 {{ {' '.join(parts)} {look} }}"


def _polygon(vertices: np.ndarray, look: str) -> str:
    points = ", ".join(_vector(vertex) for vertex in (*vertices, vertices[0]))
    return f"polygon {{ {len(vertices) + 1}, {points} {look} }}"


def _list(name: str, rows: np.ndarray) -> str:
    return f"{name} {{ {len(rows)}, {', '.join(_vector(row) for row in rows)} }}"


def _patch(control: np.ndarray, camera: rl.Camera, look: str) -> str:
    points = control.reshape(16, 3)
    # Flat to a quarter of a pixel where it is nearest, so that its outline is as smooth as ours.
    nearest = np.linalg.norm(points - camera.position, axis=1).min()
    flat = f"flatness {0.25 * nearest / camera.focal_length:.3g} u_steps 5 v_steps 5"
    return f"bicubic_patch {{ type 1 {flat}, {', '.join(_vector(point) for point in points)} {look} }}"


def _around(shape: Shape, every: tuple[Shape, ...]) -> float:
    """Index of refraction of the spheres that a sphere lies in: ours are relative to the outside, POV-Ray's are not."""
    index = 1.0
    if not isinstance(shape, rl.Sphere):
        return index
    for other in every:
        if other is shape or not isinstance(other, rl.Sphere) or not isinstance(other.material, WhittedMaterial):
            continue
        apart = float(np.linalg.norm(np.subtract(shape.centre, other.centre)))
        if apart + shape.radius <= other.radius and max(other.material.transmission) > 0:
            index *= other.material.ior
    return index


def _texture(material: object, ambient: np.ndarray, around: float) -> str:
    if isinstance(material, rl.Diffuse):
        material = WhittedMaterial(diffuse=material.reflectance)
    if not isinstance(material, WhittedMaterial) or isinstance(material.diffuse, np.ndarray) or material.roughness:
        raise ValueError(f"{material} has no twin; only Whitted's materials without images and roughness do")
    through = np.asarray(material.transmission, np.float64)
    most = float(through.max())
    grey = np.ptp(through) == 0
    pigment = " ".join(_pigment(material, through, most, grey))
    highlight = float(np.mean(material.specular if material.highlight is None else material.highlight))
    finish = f"ambient rgb {_vector(_ambient(material, ambient, most))} diffuse 1"
    if highlight:
        finish += f" specular {highlight:.6g} roughness {1 / material.exponent:.9g}"
    if max(material.specular) > 0 and material.fresnel:
        finish += f" reflection {{ rgb 0, rgb {_vector(material.specular)} fresnel on }} conserve_energy"
    elif max(material.specular) > 0:
        finish += f" reflection {{ rgb {_vector(material.specular)} }}"
    bumps = f" normal {{ {_bumps(material.bumps)} }}" if material.bumps is not None else ""
    interior = f" interior {{ ior {material.ior * around:.9g} }}" if most or material.fresnel else ""
    return f"texture {{ pigment {{ {pigment} }} finish {{ {finish} }}{bumps} }}{interior}"


def _pigment(material: WhittedMaterial, through: np.ndarray, most: float, grey: bool) -> Iterator[str]:
    """Colours that show `diffuse` although POV-Ray dims them by what it lets through."""

    def colour(diffuse: np.ndarray | tuple[float, ...]) -> str:
        shown = np.asarray(diffuse) / (1 - most) if most < 1 else np.zeros(3)
        return f"rgbt {_vector((*shown, most))}" if grey else f"rgbf {_vector((*(through / most), most))}"

    if isinstance(material.diffuse, Checks):
        checks = material.diffuse
        # A cube of the first colour begins at x = z = 0 and is halved by y = 0.
        yield f"checker {colour(checks.first)}, {colour(checks.second)}"
        yield f"scale {checks.size:.9g} translate y*{-checks.size / 2:.9g}"
    else:
        assert not isinstance(material.diffuse, np.ndarray)
        yield colour(material.diffuse)


def _ambient(material: WhittedMaterial, ambient: np.ndarray, most: float) -> np.ndarray:
    """What POV-Ray multiplies the pigment by, which shows the diffuse colour unless another is given."""
    if material.ambient is None:
        return ambient
    if isinstance(material.diffuse, Checks) or not isinstance(material.ambient, tuple):
        raise ValueError(f"ambient of {material.name!r} has no twin; leave it as its diffuse colour")
    return ambient * np.asarray(material.ambient) / np.maximum(np.asarray(material.diffuse), 1e-6)


def _bumps(bumps: object) -> str:
    if not isinstance(bumps, Wrinkles):
        raise ValueError(f"{bumps} has no twin; use wrinkles")
    slope = bumps.height * 2 * np.pi / bumps.wavelength / np.sqrt(3)  # in one direction of three
    return f"bumps {slope / STEEPNESS:.6g} scale {0.6 * bumps.wavelength:.9g}"  # waves as long, by eye


if __name__ == "__main__":
    print("nothing is measured here: POV-Ray's part of benchmarks/whitted.py")
