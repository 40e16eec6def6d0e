"""Reads a shot's layer for `shot_in_usd.py`: runs under a python that has usd-core, without relume.

Usage: python inside_shot_usd.py LAYER RESULT
"""

import json
import sys

from pxr import Usd, UsdGeom, UsdShade, UsdValidation  # pyright: ignore[reportMissingImports]


def main(layer, result):
    stage = Usd.Stage.Open(layer)
    known = UsdValidation.ValidationRegistry()
    names = [said.name for said in known.GetAllValidatorMetadata() if not said.isSuite]
    context = UsdValidation.ValidationContext(known.GetOrLoadValidatorsByName(names))
    camera = UsdGeom.Camera(stage.GetPrimAtPath("/Shot/Camera")).GetCamera()
    meshes = [prim for prim in stage.Traverse() if prim.IsA(UsdGeom.Mesh)]
    said = {
        "checks": len(names),
        "problems": [f"{error.GetName()}: {error.GetMessage()}" for error in context.Validate(stage)],
        "fov": camera.GetFieldOfView(camera.FOVHorizontal),
        "position": list(camera.transform.ExtractTranslation()),
        "meshes": [str(prim.GetPath()) for prim in meshes],
        "bound": [bool(UsdShade.MaterialBindingAPI(prim).ComputeBoundMaterial()[0]) for prim in meshes],
        "types": sorted({str(prim.GetTypeName()) for prim in stage.Traverse()}),
    }
    with open(result, "w") as file:
        json.dump(said, file, indent=1)


if __name__ == "__main__":
    main(*sys.argv[1:])
