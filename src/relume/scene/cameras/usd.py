"""A camera of any USD file (.usd, .usda, .usdc, .usdz), read by OpenUSD: the extra `usd`."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from relume.errors import UnreadableFile, warn
from relume.scene.cameras.camera import Camera
from relume.scene.cameras.pose import UpAxis, pose, the_only, warn_of_aspect
from relume.scene.usd.stage import stage_of


def read_usd_camera(
    path: Path, width: int, height: int, name: str | None, up: UpAxis | None, unit: float | None,
    time: float | None = None,
) -> Camera:  # fmt: skip
    """Read a perspective camera of a USD file; its horizontal field of view is that of the picture.

    name : of the camera's prim; not needed where there is one only
    up, unit : what points up, and metres to a unit; the file's own upAxis and metersPerUnit unless given
    time : seconds since the stage's first time code, by its rate; what lies between two samples is interpolated
    References, payloads and the variants that the file selects are followed. A camera that moves is taken at its first
    time, with a warning, unless a time is given. Warns too of files that the stage names and that cannot be opened.
    Raises UnreadableFile where the file is damaged, holds no such camera or several to choose from, or where OpenUSD is
    not installed.
    """
    with stage_of(path, "Usd", "UsdGeom") as (stage, usd, geometry):
        prim = _chosen(path, stage, name, usd, geometry)
        code = usd.TimeCode.EarliestTime()
        if time is not None:
            code = usd.TimeCode(stage.GetStartTimeCode() + time * stage.GetTimeCodesPerSecond())
        lens = geometry.Camera(prim).GetCamera(code)
        moves = time is None and _moves(prim, geometry)
        metres = unit or float(geometry.GetStageMetersPerUnit(stage))
        axis = up or ("z" if geometry.GetStageUpAxis(stage) == "Z" else "y")
    if moves:
        warn(f"{path}: camera {prim.GetName()!r} changes with time; its first time is taken")
    return _camera(path, lens, prim.GetName(), (width, height), axis, metres)


def usd_span(path: Path, name: str | None) -> tuple[float, float] | None:
    """Seconds from a stage's first time code to its last, if its camera moves; else None; raises UnreadableFile."""
    with stage_of(path, "Usd", "UsdGeom") as (stage, usd, geometry):
        prim = _chosen(path, stage, name, usd, geometry)
        if not _moves(prim, geometry) or not stage.HasAuthoredTimeCodeRange():
            return None
        return 0.0, float((stage.GetEndTimeCode() - stage.GetStartTimeCode()) / stage.GetTimeCodesPerSecond())


def _chosen(path: Path, stage: Any, name: str | None, usd: Any, geometry: Any) -> Any:
    """The prim of the camera asked for."""
    cameras = [prim for prim in stage.Traverse(usd.TraverseInstanceProxies()) if prim.IsA(geometry.Camera)]
    if not cameras:
        raise UnreadableFile(f"{path}: holds no camera; export it with its cameras")
    chosen = [prim for prim in cameras if name in (None, prim.GetName())]
    return the_only(path, chosen, name, [prim.GetName() for prim in cameras])


def _moves(prim: Any, geometry: Any) -> bool:
    """Whether the camera, its lens or a prim that it lies in changes with time."""
    chain, above = [], prim
    while above and not above.IsPseudoRoot():
        chain.append(above)
        above = above.GetParent()
    placed = (geometry.Xformable(each) for each in chain)
    return any(each and each.TransformMightBeTimeVarying() for each in placed) or any(
        each.ValueMightBeTimeVarying() for each in prim.GetAttributes()
    )


def _camera(path: Path, lens: Any, name: str, size: tuple[int, int], up: UpAxis, metres: float) -> Camera:
    if lens.projection != lens.Perspective:
        raise UnreadableFile(f"{path}: camera {name!r} is not perspective; export a perspective camera")
    focal, across, down = lens.focalLength, lens.horizontalAperture, lens.verticalAperture
    if not (0 < focal < np.inf and 0 < across < np.inf and 0 < down < np.inf):
        raise UnreadableFile(f"{path}: a lens of {focal} on a sensor of {across}×{down}; expected numbers above 0")
    warn_of_aspect(path, size, across / down, "its horizontal field of view")
    # USD multiplies row vectors.
    position, rotation = pose(path, np.array(lens.transform).T, up, metres)
    pixels = size[0] / across
    shifts = lens.horizontalApertureOffset, lens.verticalApertureOffset
    centre = (size[0] / 2 - shifts[0] * pixels, size[1] / 2 + shifts[1] * pixels)
    # Lens and sensor are in tenths of a unit, the distance in focus in units.
    aperture = focal / 10 * metres / (2 * lens.fStop) if lens.fStop > 0 else 0.0
    focus = lens.focusDistance * metres if lens.focusDistance > 0 else np.inf
    return Camera(
        *size, focal * pixels, position, rotation, centre if any(shifts) else None,
        aperture=aperture if np.isfinite(focus) else 0.0, focus=focus,
    )  # fmt: skip
