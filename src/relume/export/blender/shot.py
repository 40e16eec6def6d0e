"""The shot as a folder for Blender: two scripts, the objects as glTF, light and plate as OpenEXR.

Blender's +Z is up: our (x, y, z) is (x, −z, y) there, as its own importer turns glTF.
"""

from __future__ import annotations

from pathlib import Path
from pprint import pformat

import numpy as np

from relume.export.blender import lights
from relume.export.parts import Part, base_colour, parts_of
from relume.export.shot_lamps import light_of, undistorted, write_pictures
from relume.image import files
from relume.image.colour import luminance
from relume.image.radiance import RadianceMap
from relume.project.insertion.prepared import PreparedShot
from relume.renderers.mitsuba.distant import walls
from relume.scene.cameras.camera import Camera
from relume.scene.gltf.writing import glb
from relume.scene.materials.materials import Diffuse, Material, is_image
from relume.scene.shapes.shapes import Mesh

SCRIPT = Path(__file__).parent / "scripts" / "shot.py"
"""Builds the shot in Blender, once the line of its facts is replaced."""
FACTS = "SHOT = {}  # relume writes the facts of the shot here"
SENSOR = 36.0
"""Millimetres across: with a full frame the focal length is the one photographers know."""
USE = """    blender --python shot.py                          opens the shot in a scene of its own
    blender -b --python shot.py -- --render OUT.exr   renders the composite: plate, shadows and objects

light.py alone sets world and lamps; keep the files together. Real surfaces are shadow catchers with the reflectance
that was recovered. The compositor multiplies the plate by what the objects change (the "Shadow Catcher" pass) and puts
the objects over it; Cycles' viewport shows shadows alone, no light that the objects throw."""
ROWS = 256
"""Of the walls' grid: cells of 0.7°, of which few hold both a lamp and what is beside it."""
STOPS = 2
"""Of luminance a class of walls: within one no triangle is sampled more than four times too often or too seldom."""


def write(value: PreparedShot, folder: Path) -> tuple[str, ...]:
    """Write the files; what Blender does not hold."""
    value, notes = undistorted(value)
    parts, lost = parts_of(value.scene)
    light, lamps = light_of(value)
    write_pictures(value, folder, light)
    (folder / "light.py").write_text(lights.text(lamps), encoding="utf-8")
    finite = lamps.background is None
    real, added = [part for part in parts if part.real], [part for part in parts if not part.real]
    if added:
        (folder / "objects.glb").write_bytes(glb([part.named_mesh for part in added]))
    if real:
        (folder / "real.glb").write_bytes(glb([part.named_mesh for part in real], images=False))
    steps: list[float] = []
    if finite:
        shining, steps = _walls(value, light.radiance)
        (folder / "distant.glb").write_bytes(glb([part.named_mesh for part in shining], images=False))
    facts = {
        "camera": _camera(value.camera),
        "samples": value.samples,
        "depth": value.depth,
        # Blender's exposure is in stops; its Standard view shows 1 as white.
        "exposure": float(np.log2(value.developed_by().exposure)),
        "objects": "objects.glb" if added else None,
        "real": "real.glb" if real else None,
        "albedo": _albedo(real, folder),
        "distant": "distant.glb" if finite else None,
        "steps": steps,
    }
    text = SCRIPT.read_text(encoding="utf-8").replace(FACTS, f"SHOT = {pformat(facts, width=110)}")
    (folder / "shot.py").write_text(text, encoding="utf-8")
    return (*notes, *lost, *_lost(added))


def _camera(camera: Camera) -> dict[str, object]:
    """Position and axes in our frame, and the lens in Blender's terms."""
    x, y = camera.principal_point
    lens = SENSOR * camera.focal_length / camera.width
    facts: dict[str, object] = {
        "size": (camera.width, camera.height),
        "position": tuple(map(float, camera.position)),
        "axes": tuple(tuple(map(float, axis)) for axis in np.asarray(camera.rotation).T),
        "sensor": SENSOR,
        "lens": float(lens),
        # Shares of the width; a positive shift moves the frame right and up, and the principal point left and down.
        "shift": (float((camera.width / 2 - x) / camera.width), float((y - camera.height / 2) / camera.width)),
        "f_stop": None,
    }
    if camera.aperture:
        facts |= {"f_stop": float(lens / 1000 / (2 * camera.aperture)), "focus": float(min(camera.focus, 1e6))}
    return facts


def _albedo(real: list[Part], folder: Path) -> dict[str, str]:
    """Of real surfaces whose reflectance is an image: the file, in full precision and linear."""
    found = {}
    for part in real:
        base = base_colour(part.material)
        if is_image(base):
            found[part.name] = f"{part.name}.exr"
            files.write(folder / found[part.name], RadianceMap(np.asarray(base, np.float32)))
    return found


def _walls(value: PreparedShot, radiance: np.ndarray) -> tuple[list[Part], list[float]]:
    """What the probe saw, where it saw it, a mesh for each step of luminance, and that luminance.

    Cycles chooses among shining triangles by their area and the strength of their material, not by what their texture
    has there: with a material a step it finds windows and lamps.
    """
    built = walls(value.scene.distant, value.scene.probe, ROWS)
    rows, columns = radiance.shape[:2]
    middles = built.uv[built.faces].mean(axis=1)
    row = np.clip((middles[:, 1] * rows).astype(int), 0, rows - 1)
    shine = luminance(radiance)[row, (middles[:, 0] * columns).astype(int) % columns]
    least = max(float(shine.max()) * 2.0 ** -(STOPS * 10), 1e-30)
    step = np.floor(np.log2(np.maximum(shine, least) / least) / STOPS).astype(int)
    uv = (built.uv * [1, -1] + [0, 1]).astype(np.float32)
    parts, strengths = [], []
    for one in np.unique(step):
        faces = built.faces[step == one]
        used, renumbered = np.unique(faces, return_inverse=True)
        # As many as there are, in the order of the strengths: the script goes by the number at the end.
        mesh = Mesh(
            built.vertices[used], renumbered.reshape(-1, 3).astype(np.int32), Diffuse((0.0, 0.0, 0.0)), None, uv[used]
        )
        parts.append(Part(f"distant_{len(parts):02d}", mesh, True))
        strengths.append(float(least * 2.0 ** (STOPS * (one + 0.5))))
    return parts, strengths


def _lost(added: list[Part]) -> tuple[str, ...]:
    notes = []
    for part in added:
        material = part.material
        if not isinstance(material, Material):
            continue
        values = (material.base_color, material.metallic, material.roughness, material.transmission, material.normal)
        if any(each is not None and is_image(each) for each in values):
            notes.append(f"{part.name}: its images are written with 8 bits a value")
        if is_image(material.alpha):
            notes.append(f"{part.name}: its alpha is the mean of its image")
    return tuple(notes)
