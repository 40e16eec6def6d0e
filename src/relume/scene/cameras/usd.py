"""A camera of any USD file (.usd, .usda, .usdc, .usdz), read by OpenUSD: the extra `usd`."""

from __future__ import annotations

import textwrap
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from relume.errors import UnreadableFile, warn
from relume.scene.cameras.camera import Camera
from relume.scene.cameras.pose import UpAxis, pose, the_only, warn_of_aspect


def read_usd_camera(
    path: Path, width: int, height: int, name: str | None, up: UpAxis | None, unit: float | None
) -> Camera:
    """Read a perspective camera of a USD file; its horizontal field of view is that of the picture.

    name : of the camera's prim; not needed where there is one only
    up, unit : what points up, and metres to a unit; the file's own upAxis and metersPerUnit unless given
    References, payloads and the variants that the file selects are followed. A camera that moves is taken at its first
    time, with a warning; so are files that the stage names and that cannot be opened.
    Raises UnreadableFile where the file is damaged, holds no such camera or several to choose from, or where OpenUSD is
    not installed.
    """
    try:
        path.open("rb").close()
    except OSError as error:
        raise UnreadableFile(f"{path}: cannot be read ({error.strerror or error}); check the path") from None
    try:
        # Its stubs lack most names.
        tf, usd, geometry, utilities = (import_module(f"pxr.{name}") for name in ("Tf", "Usd", "UsdGeom", "UsdUtils"))
    except ImportError:
        raise UnreadableFile(f"{path}: USD files need OpenUSD; install it with: pip install 'relume[usd]'") from None
    # While it lives, OpenUSD hands it what it would print on standard error.
    diagnostics = utilities.CoalescingDiagnosticDelegate()
    try:
        stage = usd.Stage.Open(str(path))
        prim = _chosen(path, stage, name, usd, geometry)
        lens = geometry.Camera(prim).GetCamera(usd.TimeCode.EarliestTime())
        faults = [textwrap.shorten(str(each.commentary), 160) for each in diagnostics.TakeUncoalescedDiagnostics()]
        moves = _moves(prim, geometry)
        metres = unit or float(geometry.GetStageMetersPerUnit(stage))
        axis = up or ("z" if geometry.GetStageUpAxis(stage) == "Z" else "y")
    except tf.ErrorException as error:
        reason = textwrap.shorten(str(error.args[0].commentary), 160)
        raise UnreadableFile(f"{path}: not a readable USD file ({reason}); export it again") from None
    if faults:
        warn(f"{path}: {faults[0]}" + (f" (and {len(faults) - 1} more)" if faults[1:] else ""))
    if moves:
        warn(f"{path}: camera {prim.GetName()!r} changes with time; its first time is taken")
    return _camera(path, lens, prim.GetName(), (width, height), axis, metres)


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
