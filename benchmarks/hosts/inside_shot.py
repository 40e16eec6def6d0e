"""What Blender does in `shot_in_blender.py`: runs under a python that has bpy, without relume.

Usage: python inside_shot.py FOLDER SAMPLES, which holds shot.py; writes composite.exr and objects.exr into FOLDER
"""

import runpy
import sys
from pathlib import Path

import bpy  # pyright: ignore[reportMissingImports]


def main(folder, samples):
    scene = runpy.run_path(str(folder / "shot.py"))["built"]
    scene.cycles.samples = samples
    scene.cycles.use_adaptive_sampling = scene.cycles.use_denoising = False
    scene.render.filepath = str(folder / "composite.exr")
    bpy.ops.render.render(write_still=True, scene=scene.name)
    # Without the compositor: the objects alone, on nothing.
    scene.render.use_compositing = False
    scene.render.image_settings.color_mode = "RGBA"
    scene.render.filepath = str(folder / "objects.exr")
    bpy.ops.render.render(write_still=True, scene=scene.name)


if __name__ == "__main__":
    arguments = list(sys.argv)
    sys.argv = sys.argv[:1]  # what follows is not for shot.py
    main(Path(arguments[1]), int(arguments[2]))
