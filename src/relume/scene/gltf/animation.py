"""The keys of an animated glTF file: nodes, and what moves them (glTF 2.0, §3.5, §3.11)."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from relume.errors import UnreadableFile, warn
from relume.scene.gltf.document import AT_REST, GltfDocument, read_document
from relume.scene.motion.animation import Animation, Node
from relume.scene.motion.keyframes import Interpolation, Linear, Slerp, Step, Tangents, Track

_MOVING = {"translation": 3, "rotation": 4, "scale": 3}


def read_animation(path: str | Path) -> Animation | None:
    """The motion that a .glb or .gltf file holds; None where it holds none, and for files of other kinds.

    Warns of what is not rendered of it: skins, morph targets, more than one animation. Raises UnreadableFile.
    """
    path = Path(path)
    if path.suffix.lower() not in (".glb", ".gltf"):
        return None
    document = read_document(path)
    try:
        return _animation(document) if document.header.get("animations") else None
    except (OSError, ValueError, KeyError, IndexError, TypeError, AttributeError) as error:
        reason = " ".join(str(error).split()) or type(error).__name__
        raise UnreadableFile(f"{path}: its animation cannot be read ({reason}); export it again as .glb") from None


def _animation(document: GltfDocument) -> Animation:
    header, path = document.header, document.path
    chosen, *others = header["animations"]
    lost = [f"the animation {other.get('name', '')!r}" for other in others]
    tracks: dict[tuple[int, str], Track] = {}
    for channel in chosen["channels"]:
        node, what = channel["target"].get("node"), channel["target"]["path"]
        if node is None or what not in _MOVING:
            lost.append("morph targets" if what == "weights" else f"the motion of {what}")
            continue
        tracks[node, what] = _track(what, chosen["samplers"][channel["sampler"]], document)
    if any("skin" in node for node in header["nodes"]):
        lost.append("skins")
    if lost:
        warn(f"{path}: not rendered of its motion: {', '.join(dict.fromkeys(lost))}")
    parents = {child: i for i, node in enumerate(header["nodes"]) for child in node.get("children", [])}
    nodes = [
        _node(i, table, parents.get(i), {what: tracks[i, what] for what in _MOVING if (i, what) in tracks})
        for i, table in enumerate(header["nodes"])
    ]
    _require_tree(nodes)
    return Animation(tuple(nodes), str(path))


def _track(what: str, sampler: Mapping[str, Any], document: GltfDocument) -> Track:
    times, values = document.accessor(sampler["input"])[:, 0], document.accessor(sampler["output"])
    if values.shape[1] != _MOVING[what] or not np.all(np.isfinite(values)):
        raise ValueError(f"the keys of {what} are not {_MOVING[what]} numbers each")
    kind = sampler.get("interpolation", "LINEAR")
    between: Interpolation
    if kind == "CUBICSPLINE":
        arriving, values, leaving = values.reshape(-1, 3, values.shape[1]).swapaxes(0, 1)
        between = Tangents(arriving, leaving)
    elif kind in ("LINEAR", "STEP"):
        between = Step() if kind == "STEP" else Slerp() if what == "rotation" else Linear()
    else:
        raise ValueError(f"the interpolation {kind} is not known")
    return Track(times, values, between)


def _node(index: int, table: Mapping[str, Any], parent: int | None, tracks: Mapping[str, Track]) -> Node:
    return Node(
        name=str(table.get("name", index)),
        parent=parent,
        matrix=np.reshape(table["matrix"], (4, 4)).T.astype(np.float64) if "matrix" in table else None,
        at_rest={what: np.array(table.get(what, default), np.float64) for what, default in AT_REST.items()},
        tracks=tracks,
        shaped="mesh" in table,
    )


def _require_tree(nodes: list[Node]) -> None:
    for node in nodes:
        steps, parent = 0, node.parent
        while parent is not None:
            steps, parent = steps + 1, nodes[parent].parent
            if steps > len(nodes):
                raise ValueError(f"the node {node.name!r} is inside itself")
