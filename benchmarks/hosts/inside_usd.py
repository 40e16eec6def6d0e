"""Reads a layer for `usd.py`: runs under a python that has usd-core, without relume.

Usage: python inside_usd.py LAYER RESULT
"""

import json
import sys

from pxr import Gf, Usd, UsdGeom, UsdLux, UsdValidation  # pyright: ignore[reportMissingImports]


def main(layer, result):
    stage = Usd.Stage.Open(layer)
    known = UsdValidation.ValidationRegistry()
    names = [said.name for said in known.GetAllValidatorMetadata() if not said.isSuite]
    context = UsdValidation.ValidationContext(known.GetOrLoadValidatorsByName(names))
    problems = [f"{error.GetName()}: {error.GetMessage()}" for error in context.Validate(stage)]
    cache = UsdGeom.XformCache()
    lights, spheres, dome = [], [], None
    for prim in stage.Traverse():
        matrix = cache.GetLocalToWorldTransform(prim)
        if prim.IsA(UsdLux.DistantLight):
            light = UsdLux.DistantLight(prim)
            lights.append(
                {
                    "towards": list(matrix.TransformDir(Gf.Vec3d(0, 0, 1))),
                    "irradiance": [light.GetIntensityAttr().Get() * part for part in light.GetColorAttr().Get()],
                    "angle": light.GetAngleAttr().Get(),
                    "normalize": light.GetNormalizeAttr().Get(),
                }
            )
        if prim.IsA(UsdLux.SphereLight):
            light = UsdLux.SphereLight(prim)
            spheres.append(
                {
                    "position": list(matrix.ExtractTranslation()),
                    "power": [light.GetIntensityAttr().Get() * part for part in light.GetColorAttr().Get()],
                    "radius": light.GetRadiusAttr().Get(),
                    "point": light.GetTreatAsPointAttr().Get(),
                    "normalize": light.GetNormalizeAttr().Get(),
                }
            )
        if prim.IsA(UsdLux.DomeLight):
            light = UsdLux.DomeLight(prim)
            dome = {
                # Latitude 0, longitude 0 is +Z and the middle of the file; longitude π/2 is +X and left of it.
                "middle": list(matrix.TransformDir(Gf.Vec3d(0, 0, 1))),
                "right": list(matrix.TransformDir(Gf.Vec3d(-1, 0, 0))),
                "top": list(matrix.TransformDir(Gf.Vec3d(0, 1, 0))),
                "file": light.GetTextureFileAttr().Get().resolvedPath,
                "format": light.GetTextureFormatAttr().Get(),
            }
    said = {
        "version": list(Usd.GetVersion()),
        "checks": len(names),
        "problems": problems,
        "up": str(UsdGeom.GetStageUpAxis(stage)),
        "metres": UsdGeom.GetStageMetersPerUnit(stage),
        "default": str(stage.GetDefaultPrim().GetPath()),
        "lights": lights,
        "spheres": spheres,
        "dome": dome,
    }
    with open(result, "w") as file:
        json.dump(said, file, indent=1)


if __name__ == "__main__":
    main(*sys.argv[1:])
