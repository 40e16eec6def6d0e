"""The JSON of OpenMVG (sfm_data.json) and of AliceVision, which Meshroom runs (cameras.sfm, sfm.json).

Both have the camera of computer vision: x to the right, y down, looking along +Z; their distortions are polynomials of
OpenCV's. AliceVision writes its matrices by columns, and from version 1.2.1 on principal points from the middle.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

from relume.errors import UnreadableFile
from relume.scene.places.photogrammetry.model import FoundModel, FoundView, lens_of, one_focal_length


def read_sfm_json(path: Path) -> FoundModel:
    """Cameras and points of either program; raises UnreadableFile."""
    try:
        found = json.loads(path.read_bytes())
        views, points = _openmvg(path, found) if "extrinsics" in found else _alicevision(path, found)
        numbers = np.array([number for number, _ in points], int)
        places = np.array([place for _, place in points], np.float64).reshape(-1, 3)
        model = FoundModel(tuple(views), places, numbers)
    except UnreadableFile:
        raise
    except (OSError, RecursionError, ArithmeticError, ValueError, LookupError, TypeError, AttributeError) as error:
        raise UnreadableFile(
            f"{path}: no model of Meshroom or OpenMVG ({type(error).__name__}: {' '.join(str(error).split())}); export "
            "views, intrinsics, poses and structure again as JSON"
        ) from None
    if not model.views:
        raise UnreadableFile(f"{path}: holds no photograph with a pose; reconstruct it again")
    return model


def _openmvg(path: Path, found: dict[str, Any]) -> tuple[list[FoundView], list[tuple[int, list[float]]]]:
    lenses = {entry["key"]: _inner(entry["value"]) for entry in found["intrinsics"]}
    poses = {entry["key"]: entry["value"] for entry in found["extrinsics"]}
    views = []
    for entry in found["views"]:
        view = _inner(entry["value"])
        pose, lens = poses.get(view["id_pose"]), lenses.get(view["id_intrinsic"])
        if pose is None or lens is None:
            continue  # a photograph that was not placed
        data = lens.get("value0", lens)
        if odd := [key for key in lens if key.startswith(("fisheye", "disto")) and key not in _OPENMVG]:
            raise UnreadableFile(f"{path}: a lens with {odd[0]} is not read; undistort the photographs first")
        terms = [term for key in _OPENMVG for term in lens.get(key, [])]
        k1, k2, k3, t1, t2 = (*map(float, terms), 0.0, 0.0, 0.0, 0.0, 0.0)[:5]
        focal = float(data["focal_length"])
        x, y = map(float, data["principal_point"])
        size = int(data["width"]), int(data["height"])
        rotation, centre = _rotation(path, pose["rotation"]), np.array(pose["center"], np.float64)
        views.append(FoundView(view["filename"], size, focal, (x, y), rotation, centre, lens_of(k1, k2, t1, t2, k3)))
    points = [(int(entry["key"]), entry["value"]["X"]) for entry in found.get("structure") or []]
    return views, points


_OPENMVG = ("disto_k1", "disto_k3", "disto_t2")
"""Terms that are read: k1; k1, k2, k3; these and the two tangential ones. A lens has one of the three."""


def _inner(value: dict[str, Any]) -> dict[str, Any]:
    """What cereal wraps a shared object in."""
    return value["ptr_wrapper"]["data"] if "ptr_wrapper" in value else value


_ALICEVISION = {"pinhole": 0, "none": 0, "radial1": 1, "radialk1": 1, "radial3": 3, "radialk3": 3, "brown": 5}
"""Distortions that are read, and how many terms each has."""


def _alicevision(path: Path, found: dict[str, Any]) -> tuple[list[FoundView], list[tuple[int, list[float]]]]:
    version = tuple(int(number) for number in found.get("version", ["1", "0", "0"]))
    lenses = {str(entry["intrinsicId"]): entry for entry in found["intrinsics"]}
    poses = {str(entry["poseId"]): entry["pose"]["transform"] for entry in found.get("poses", [])}
    views = []
    for view in found["views"]:
        pose, lens = poses.get(str(view.get("poseId"))), lenses.get(str(view.get("intrinsicId")))
        if pose is None or lens is None:
            continue
        width, height = int(view["width"]), int(view["height"])
        x, y = (float(number) for number in lens["principalPoint"])
        middle = (width / 2, height / 2) if version >= (1, 2, 1) else (0.0, 0.0)
        rotation = _rotation(path, np.array(pose["rotation"], np.float64).reshape(3, 3).T)
        centre = np.array(pose["center"], np.float64)
        views.append(
            FoundView(
                Path(str(view["path"]).replace("\\", "/")).name,
                (width, height),
                _focal(path, lens, width),
                (x + middle[0], y + middle[1]),
                rotation,
                centre,
                _distortion(path, lens),
            )
        )
    points = [(int(entry["landmarkId"]), [float(x) for x in entry["X"]]) for entry in found.get("structure") or []]
    return views, points


def _focal(path: Path, lens: dict[str, Any], width: int) -> float:
    """Pixels; version 1.2.2 and later give millimetres beside the sensor's width, some with a ratio of the pixels."""
    what = f"intrinsic {lens['intrinsicId']}"
    if "pxFocalLength" in lens:
        given = lens["pxFocalLength"]
        across, down = (given, given) if isinstance(given, str | int | float) else given
        return one_focal_length(path, what, float(across), float(down))
    across = float(lens["focalLength"]) * width / float(lens["sensorWidth"])
    return one_focal_length(path, what, across, across * float(lens.get("pixelRatio", 1.0)))


def _distortion(path: Path, lens: dict[str, Any]) -> Any:
    kind = str(lens.get("distortionType") or lens.get("type", "pinhole")).lower()
    terms = [float(term) for term in lens.get("distortionParams") or []]
    if kind not in _ALICEVISION or len(terms) < _ALICEVISION[kind]:
        if not any(terms):
            return None
        raise UnreadableFile(
            f"{path}: a lens of type {kind} is not read; undistort the photographs first (PrepareDenseScene)"
        )
    k1, k2, k3, t1, t2 = (*terms[: _ALICEVISION[kind]], 0.0, 0.0, 0.0, 0.0, 0.0)[:5]
    return lens_of(k1, k2, t1, t2, k3)


def _rotation(path: Path, given: Any) -> np.ndarray:
    rotation = np.array(given, np.float64)
    if rotation.shape != (3, 3) or not np.allclose(rotation @ rotation.T, np.eye(3), atol=1e-3):
        raise UnreadableFile(f"{path}: a pose's rotation is none; export it again")
    if np.linalg.det(rotation) < 0:
        raise UnreadableFile(f"{path}: a pose's rotation mirrors the place; export it again")
    left, _, right = np.linalg.svd(rotation)
    return left @ right
