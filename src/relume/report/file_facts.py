"""What `relume info` shows: what a file holds, a drawing of a map, and what this machine renders with."""

from __future__ import annotations

import os
import platform
import re
from collections.abc import Mapping as MappingOf
from pathlib import Path
from typing import TYPE_CHECKING, Any

from relume.image import files
from relume.image.files.description import describe as facts_of
from relume.image.files.read_options import ReadOptions
from relume.scene.shapes.suffixes import SUFFIXES as MESHES
from relume.sphere.map_store import is_map_store, store_facts

if TYPE_CHECKING:
    from relume.sphere.environment_map import EnvironmentMap

LIBRARIES = (
    "numpy", "scipy", "numba", "llvmlite", "drjit", "mitsuba-oidn", "opencv-python-headless", "OpenImageIO", "OpenEXR",
    "pillow", "rawpy", "trimesh",
)  # fmt: skip
"""Distributions whose version decides what a picture becomes, beside Mitsuba."""
NO_EXTRAS = ("dev", "docs")
"""Extras of developers, which no report needs."""


def describe(path: str | os.PathLike[str], options: ReadOptions = ReadOptions()) -> dict[str, Any]:
    """What a file holds, in plain values that JSON can hold.

    path : of a picture, a map, a mesh or a store
    options : limits, and how what a file leaves open is understood

    The places "brightest" and "lone" of a map have a "direction" besides, None where the map has no directions: azimuth
    and elevation, degrees to the right of −Z and up from level, and the name of the mapping. It is marked as assumed
    where only the shape says that the map is equirectangular (lat-long). A mesh (.glb, .gltf, .obj, .ply, .stl, USD)
    has its triangles, materials and its extent in metres. A store of maps (.zarr) has its frames, rate and unit, and
    whether variance is there.
    Raises UnreadableFile.
    """
    if is_map_store(path):
        return store_facts(path)
    if Path(path).suffix.lower() in MESHES and Path(path).is_file():
        return _mesh_facts(Path(path))
    facts: dict[str, Any] = facts_of(path, options)
    places = {name: facts[name] for name in ("brightest", "lone") if facts.get(name)}
    return facts | {name: {**place, "direction": _direction(facts, place)} for name, place in places.items()}


def maps_summary(facts: MappingOf[str, Any]) -> dict[str, str]:
    """The facts of a store of maps, as label → text.

    facts : of a store, as `describe` gives them
    """
    (width, height), rate = facts["size"], facts["rate"]
    seconds = "" if rate is None else f", {rate:.5g} a second"
    absolute = facts["unit"] == "cd/m²"
    return {
        "format": f"zarr: a store of maps, {facts['dtype']}",
        "holds": f"light that changes: radiance {'in cd/m²' if absolute else 'without an absolute unit'}",
        "size": f"{width} × {height}",
        "frames": f"{facts['frames']}{seconds}",
        "variance": "of every map" if facts["variance"] else "not kept",
    }


def _mesh_facts(path: Path) -> dict[str, Any]:
    import numpy as np

    from relume.scene.shapes.meshes import read_meshes

    meshes = read_meshes(path)
    low, high = (
        edge([edge(mesh.vertices, axis=0) for mesh in meshes], axis=0).astype(float).tolist()
        for edge in (np.min, np.max)
    )
    names = [str(getattr(mesh.material, "name", "") or type(mesh.material).__name__) for mesh in meshes]
    return {
        "kind": "mesh", "format": path.suffix[1:].lower(), "meshes": len(meshes),
        "triangles": sum(len(mesh.faces) for mesh in meshes), "vertices": sum(len(mesh.vertices) for mesh in meshes),
        "materials": list(dict.fromkeys(names)), "low": low, "high": high,
        "extent": [above - below for below, above in zip(low, high, strict=True)],
    }  # fmt: skip


def describe_system() -> dict[str, Any]:
    """What this machine renders with, and why, in plain values: what a report of a fault needs.

    "variant" is Mitsuba's and "because" says why it was chosen; "cores" are those that this process may use; "extras"
    are those of `pip install relume[…]` that are whole; "kernels" says where compiled loops come from. The machine's
    name and the user's are not asked for.
    """
    from importlib.metadata import version

    from relume.renderers.mitsuba.variant import choose_variant

    choice = choose_variant()
    mine = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    in_wheel = (Path(__file__).parents[1] / "kernels").is_dir()
    return {
        "relume": version("relume"),
        "python": f"{platform.python_version()} ({platform.python_implementation()})",
        "system": platform.platform(),
        "processor": platform.machine(),
        "cores": mine,
        "mitsuba": version("mitsuba"),
        "variant": choice.name,
        "because": choice.reason,
        "libraries": ", ".join(f"{name} {_version(name) or 'missing'}" for name in LIBRARIES),
        "extras": ", ".join(_extras()) or "none",
        "kernels": "from the wheel" if in_wheel else "compiled here, when they are first called",
    }


def _version(distribution: str) -> str | None:
    from importlib.metadata import PackageNotFoundError, version

    try:
        return version(distribution)
    except PackageNotFoundError:
        return None


def _extras() -> list[str]:
    """The extras all of whose distributions are installed, by relume's own metadata."""
    from importlib.metadata import metadata, requires

    needed: dict[str, list[str]] = {name: [] for name in metadata("relume").get_all("Provides-Extra") or []}
    for line in requires("relume") or []:
        name = re.match(r"[\w.-]+", line)
        extra = re.search(r"extra == ['\"]([\w-]+)['\"]", line)
        if name and extra:
            needed[extra[1]].append(name[0])
    return [name for name, all_of in needed.items() if name not in NO_EXTRAS and all(map(_version, all_of))]


def draw_environment(light: EnvironmentMap, path: str | os.PathLike[str], *, title: str = "") -> None:
    """Write a map at three exposures with its axes as a .png.

    light : the map
    path : .png
    title : above the drawing; the name of the file unless given
    Raises OutputNotWritten.
    """
    from relume.report.light_plot import light_plot

    with files.replacing(path) as temporary:
        temporary.write_bytes(light_plot(light, title or Path(path).name))


def _direction(facts: MappingOf[str, Any], place: MappingOf[str, Any]) -> dict[str, Any] | None:
    attributes, (width, height) = facts["attributes"], facts["size"]
    if "mirror" in attributes or "face" in attributes or ("mapping" not in attributes and width != 2 * height):
        return None

    import numpy as np

    from relume.sphere.mappings.mapping import LatLong
    from relume.sphere.mappings.names import mapping_named

    try:
        mapping = mapping_named(attributes["mapping"]) if "mapping" in attributes else LatLong()
        if mapping.shape(height) != (height, width):
            return None
        view = mapping
        if "orientation" in attributes:
            from relume.sphere.mappings.orientation import orientation_named

            view = orientation_named(attributes["orientation"])
    except ValueError:  # of another program, or of another time
        return None
    x, y, z = view.directions(np.array([(place["x"] + 0.5) / width, (place["y"] + 0.5) / height]))
    if np.isnan(x):
        return None
    azimuth, elevation = np.degrees([np.arctan2(x, -z), np.arcsin(np.clip(y, -1, 1))])
    return {
        "azimuth": round(float(azimuth), 2),
        "elevation": round(float(elevation), 2),
        "mapping": mapping.name,
        "assumed": "mapping" not in attributes and attributes.get("envmap") != "latlong",
    }
