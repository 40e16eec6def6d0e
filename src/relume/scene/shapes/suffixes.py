"""By which suffixes a file is known to hold meshes, without a reader of meshes having to be imported."""

from __future__ import annotations

from relume.scene.usd.stage import SUFFIXES as USD_SUFFIXES

SUFFIXES = (".glb", ".gltf", ".obj", ".ply", ".stl", *USD_SUFFIXES)
"""Of the files that `relume.scene.shapes.meshes.read_meshes` reads."""
