"""A reflectance field on disk: a zarr store whose chunks are tiles of a few lights, read without ever being whole.

`values` (N, H, W, 3) are float32, or float16 or uint8 with a `scale` (N,) for each light; `statistics` (N, 2) are each
picture's mean and greatest value. `sizes` (groups of lights, tiles down, tiles across) are the bytes of every chunk,
written when a group is finished: they separate an incomplete store from a whole one. In a large store each file is a
shard of many chunks, and `sizes` are those of the shards. A store lies in a folder or at an fsspec URL. Lights, camera,
noise, the subject's mesh and the radius of the lamps are attributes, in metres and radians, the world's frame;
`made_from` is the fingerprint of what the values were made from.
Needs the extra "lightstage" (zarr).
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from relume.errors import UnreadableFile
from relume.lightstage.acquire.store_place import (
    Place,
    as_place,
    chunk_sizes,
    described,
    exists,
    filesystem,
    is_url,
    opened_group,
    reading,
)
from relume.lightstage.field.field import Noise
from relume.lightstage.field.lights import StageLights
from relume.scene.cameras.camera import Camera
from relume.scene.cameras.distortion import Distortion
from relume.sphere.map_store import required_zarr

KIND, VERSION = "relume reflectance field", 1
RESUME = "give the same import again: it goes on where it stopped"


@dataclass(frozen=True, eq=False)
class StoredField:
    """A reflectance field that lies in a store and is read block by block (`read_store`).

    path : of the store, or its URL
    lights, shape, camera : as of every `ReflectanceField`
    noise : of its values, what rounding to the store's type added included; None where the field's was unknown
    rounding : variance of what rounding alone added, known always; for values that are not below 0
    chunks : lights and rows of a chunk: blocks of whole chunks are read fastest
    file_rows : rows of a file: bands of whole files are read from storage once
    value_bytes : bytes that a value takes while it is read: as it is kept, and once more while chunks are opened
    """

    path: Path | str
    lights: StageLights
    shape: tuple[int, int]
    camera: Camera | None
    noise: Noise | None
    rounding: Noise
    chunks: tuple[int, int]
    file_rows: int
    value_bytes: int
    values: Any
    scale: np.ndarray | None

    def block(self, lights: slice, rows: slice) -> np.ndarray:
        """Values (lights, rows, columns, 3) float32 of these lights and rows."""
        part, scale = self.encoded(lights, rows)
        found = part.astype(np.float32)
        if scale is not None:
            found *= scale[:, None, None, None].astype(np.float32)
        return found

    def encoded(self, lights: slice, rows: slice) -> tuple[np.ndarray, np.ndarray | None]:
        """Values as they are kept, and what 1 stands for in each picture, (lights,) float64, None for 1.

        Raises UnreadableFile where a chunk is damaged.
        """
        try:
            part = np.asarray(self.values[lights, rows])
        except Exception as error:  # each codec has its own
            raise UnreadableFile(
                f"{self.path}: the store is damaged among lights {lights.start}…{lights.stop - 1} and rows "
                f"{rows.start}…{rows.stop - 1} ({str(error)[:60]}); delete the store and import again"
            ) from error
        return part, None if self.scale is None else self.scale[lights].astype(np.float64)


def is_store(path: Place) -> bool:
    """Whether a reflectance field's store is there, whole or not; raises UnreadableFile for a URL that is refused."""
    return f'"{KIND}"' in (described(path) or "")


def read_store(path: Place) -> StoredField:
    """The field of a store; nothing but its description is read yet.

    Raises UnreadableFile for what is no store, one that was cut short, one with a missing or shortened file, and one of
    a later version; ValueError where zarr is not installed.
    """
    root = opened(path)
    attributes = dict(root.attrs)
    if attributes.get("version") != VERSION:
        raise UnreadableFile(
            f"{path}: a store of version {attributes.get('version')}, and this relume reads version {VERSION}; upgrade "
            "it, or import again"
        )
    try:
        values, scale, sizes = root["values"], np.asarray(root["scale"]), np.asarray(root["sizes"])
        lights, camera = lights_of(attributes["lights"]), camera_of(attributes["camera"])
        noise, rounding = attributes["noise"], attributes.get("rounding")
    except Exception as error:
        raise UnreadableFile(f"{path}: the store's description is damaged ({error}); {RESUME}") from error
    with reading(path):
        missing = unfinished(path, sizes)
    if missing.any() or rounding is None:
        lacking = np.count_nonzero(missing)
        short = f"{lacking} of its {len(missing)} groups of lights are missing or cut short" if lacking else "cut short"
        raise UnreadableFile(f"{path}: the store is not whole, {short}; {RESUME}")
    added = Noise(*rounding)
    known = None if noise is None else Noise(noise[0] + added.constant, noise[1] + added.slope)
    return StoredField(
        as_place(path),
        lights,
        (values.shape[1], values.shape[2]),
        camera,
        known,
        added,
        (values.chunks[0], values.chunks[1]),
        (values.shards or values.chunks)[1],
        2 * values.dtype.itemsize,
        values,
        None if values.dtype == np.float32 else scale,
    )


def stored_geometry(path: Place) -> tuple[Path | None, float | None]:
    """The mesh of the subject that a store names and the angular radius of its lights, radians; None where it does not.

    Raises UnreadableFile for what is no store, and where the mesh is no longer there.
    """
    attributes = dict(opened(path).attrs)
    mesh, radius = attributes.get("mesh"), attributes.get("light_radius")
    if mesh is not None and not Path(mesh).is_file():
        raise UnreadableFile(
            f"{path}: the store names the mesh {mesh}, which is not there; put it back, or import again with another"
        )
    return None if mesh is None else Path(mesh), None if radius is None else float(radius)


def opened(path: Place, mode: Any = "r") -> Any:
    """The zarr group of a store; UnreadableFile where there is none."""
    zarr = required_zarr()
    if is_url(path):
        filesystem(path)
    if not is_store(path):
        if not exists(path):
            raise UnreadableFile(f"{path}: there is no such store")
        raise UnreadableFile(f"{path}: no store of a reflectance field; give a folder that an import wrote")
    try:
        return opened_group(zarr, path, mode)
    except Exception as error:
        raise UnreadableFile(f"{path}: the store cannot be opened ({error}); import again") from error


def unfinished(path: Place, sizes: np.ndarray) -> np.ndarray:
    """Which groups of lights (groups,) have a chunk that is not there in the length it was written in."""
    return (sizes == 0).any(axis=(1, 2)) | (chunk_sizes(path, sizes.shape) != sizes).any(axis=(1, 2))


def description(lights: StageLights, camera: Camera | None, noise: Noise | None) -> dict[str, Any]:
    """What a store's attributes hold, as JSON; numbers come back to the last bit."""
    return {
        "kind": KIND,
        "version": VERSION,
        "lights": {
            "names": list(lights.names),
            "directions": lights.directions.tolist(),
            "solid_angles": lights.solid_angles.tolist(),
            "positions": None if lights.positions is None else lights.positions.tolist(),
            "grid": None if lights.grid is None else list(lights.grid),
        },
        "camera": None if camera is None else _camera_as_json(camera),
        "noise": None if noise is None else [noise.constant, noise.slope],
    }


def lights_of(attributes: dict[str, Any]) -> StageLights:
    """The lights of a `description`."""
    positions, grid = attributes["positions"], attributes["grid"]
    return StageLights(
        np.array(attributes["directions"], np.float64),
        np.array(attributes["solid_angles"], np.float64),
        tuple(attributes["names"]),
        None if positions is None else np.array(positions, np.float64),
        None if grid is None else (grid[0], grid[1]),
    )


def camera_of(attributes: dict[str, Any] | None) -> Camera | None:
    """The camera of a `description`."""
    if attributes is None:
        return None
    return Camera(
        attributes["width"],
        attributes["height"],
        attributes["focal_length"],
        np.array(attributes["position"]),
        np.array(attributes["rotation"]),
        None if attributes["centre"] is None else (attributes["centre"][0], attributes["centre"][1]),
        None if attributes["distortion"] is None else Distortion(**attributes["distortion"]),
        attributes["aperture"],
        np.inf if attributes["focus"] is None else attributes["focus"],
    )


def _camera_as_json(camera: Camera) -> dict[str, Any]:
    return {
        "width": camera.width,
        "height": camera.height,
        "focal_length": float(camera.focal_length),
        "position": np.asarray(camera.position, np.float64).tolist(),
        "rotation": np.asarray(camera.rotation, np.float64).tolist(),
        "centre": None if camera.centre is None else [float(c) for c in camera.centre],
        "distortion": None if camera.distortion is None else vars(camera.distortion).copy(),
        "aperture": float(camera.aperture),
        "focus": None if np.isinf(camera.focus) else float(camera.focus),
    }
