"""What a mesh file needs beside itself: buffers, pictures, materials and layers that it names."""

from __future__ import annotations

from importlib import import_module
from pathlib import Path
from urllib.parse import unquote

from relume.errors import UnreadableFile
from relume.scene.gltf.document import read_document
from relume.scene.gltf.writing import RADIANCE
from relume.scene.usd.stage import SUFFIXES as USD_SUFFIXES


def files_beside_mesh(path: str | Path) -> tuple[str, ...]:
    """The files that a mesh file, an OBJ's .mtl or a layer of USD names itself, as paths from its folder.

    path : of the mesh, the .mtl or the layer

    Of a glTF these are its buffers and pictures; of an OBJ its .mtl; of a .mtl the picture of its base colour, which is
    all that is read of it; of a USD file its layers and pictures, in which <UDIM> stands for a number. A .usdz holds
    all it needs, as do PLY and STL. Raises UnreadableFile where the file is missing or damaged, or OpenUSD is not
    installed.
    """
    path, kind = Path(path), Path(path).suffix.lower()
    if not path.is_file():
        raise UnreadableFile(f"{path}: no such mesh file; check the path")
    found: list[str] = []
    if kind in (".glb", ".gltf"):
        try:
            header = read_document(path).header
            given = [each.get("uri") for key in ("buffers", "images") for each in header.get(key, [])]
            given += [(each.get("extras") or {}).get(RADIANCE) for each in header.get("materials", [])]
        except (ValueError, AttributeError, TypeError) as error:
            raise UnreadableFile(f"{path}: not a readable glTF ({' '.join(str(error).split())})") from None
        found = [unquote(uri) for uri in given if isinstance(uri, str) and not uri.startswith("data:")]
    elif kind in (".obj", ".mtl"):
        found = _named_in_lines(path)
    elif kind in USD_SUFFIXES and kind != ".usdz":
        found = _named_in_layer(path)
    return tuple(dict.fromkeys(name.replace("\\", "/") for name in found if name))


def _named_in_lines(path: Path) -> list[str]:
    """The .mtl of an OBJ; the base colours' pictures of a .mtl."""
    found = []
    with open(path, encoding="utf-8", errors="replace") as lines:
        for line in lines:
            key, _, rest = line.strip().partition(" ")
            if key == "mtllib":
                found.append(rest.strip())
            elif key == "map_Kd" and path.suffix.lower() == ".mtl":
                found.append(rest.split("#", 1)[0].split()[-1] if rest.split() else "")
    return found


def _named_in_layer(path: Path) -> list[str]:
    try:
        tf, utilities = (import_module(f"pxr.{name}") for name in ("Tf", "UsdUtils"))
    except ImportError:
        raise UnreadableFile(f"{path}: USD files need OpenUSD; install it with: pip install 'relume[usd]'") from None
    kept = utilities.CoalescingDiagnosticDelegate()  # what it would print
    try:
        named = utilities.ExtractExternalReferences(str(path))
        faults = [str(each.commentary) for each in kept.TakeUncoalescedDiagnostics()]
    except tf.ErrorException as error:
        faults, named = [str(error.args[0].commentary)], ([],)
    if faults:
        raise UnreadableFile(f"{path}: not a readable USD file ({' '.join(faults[0].split())[:160]}); export it again")
    return [name for names in named for name in names]
