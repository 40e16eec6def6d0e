"""`relume stage`: pictures of a real thing under one light at a time (OLAT) in, the thing under any light out."""

from __future__ import annotations

from cyclopts import App

COMMANDS = {
    "import": "Find the lights of a stage, calibrate its pictures, and keep them in a store that is quick to relight.",
    "relight": "Relight a subject with environment maps, directions and lamps: a picture, frames or a movie.",
    "inspect": "Print what a stage holds; with -o draw its reflectance functions and an interactive relighting viewer.",
    "separate": "Separate diffuse from specular reflection: normals, albedo, specular energy and roughness maps.",
    "patterns": "Write the patterns that a projector shows for a scan.",
    "scan": "Make a mesh of a subject from photographs under a projector's patterns.",
    "reflectometry": "Measure a patch of skin under a turning lamp: albedo, highlight, roughness, and plots.",
    "view": "Relight a subject and see it from a new place, on a mesh of it.",
    "clothe": "Recolour the subject's clothing, from takes in white and in black clothing.",
    "matte": "Recover an environment matte from coded backdrops, or put one over a backdrop.",
    "drive": "Find what each lamp of a real stage must give so that it lights like an environment map.",
    "actor": "Matte an actor who was filmed in a stage, and put them before another backdrop, frame by frame.",
    "perform": "Relight a performance that was filmed under strobes that repeat: all lamps at every moment.",
    "export": "Write a stage for museums' viewers: pictures with .lp, PTM (.ptm), HSH (.rti).",
}

stage = App(
    name="stage", help="Light stages (OLAT): real things under any light. STAGE is a folder with stage.json or .lp."
)
for name, text in COMMANDS.items():
    module = f"relume.cli.stage.{'import_stage' if name == 'import' else name}"
    stage.command(f"{module}:{name}_stage" if name == "import" else f"{module}:{name}", name=name, help=text)
