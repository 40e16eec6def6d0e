"""The metadata of an EXR header as texts, and back to the types that other programs read.

Standard attributes go to their own places with their own types (`attributes.EXR`), and "envmap", latlong or cube, to
OpenEXR's own, which marks a picture of all directions; all else is relume's and stored as
strings under "relume:". Strings of other programs are read by their own names. What has neither a standard place nor is
a string (time codes, matrices, key codes) is not kept.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from typing import Any

import numpy as np

from relume.errors import warn
from relume.image.files.metadata.attributes import EXR, PREFIX

# Of the file's form, not of the picture; "view" is an eye of a stereo pair, and not Radiance's VIEW.
_NOT_OURS = ("name", "type", "view", "channels")
_LEAST_ASPECT, _LARGEST_ASPECT = 1e-6, 1e6  # of a pixel that the library writes (OpenEXR 3.4, "sanityCheck")


def attributes_of(header: Mapping[str, Any]) -> dict[str, str]:
    """The texts and standard attributes in a header by our names, and the OpenEXR `envmap` kind where there is one."""
    standard = {theirs: ours for ours, (theirs, _) in EXR.items()}
    found, ours = dict[str, str](), dict[str, str]()
    for name, value in header.items():
        if isinstance(value, str) and name.startswith(PREFIX):
            ours[name.removeprefix(PREFIX)] = value
        elif isinstance(value, str) and name not in _NOT_OURS:
            found[standard.get(name, name)] = value
        elif name in standard and (number := _number(value)) is not None:
            found[standard[name]] = number
    if found.get("pixel_aspect") == "1":
        del found["pixel_aspect"]
    if "envmap" in header:
        found["envmap"] = str(header["envmap"]).rpartition(".")[2].removeprefix("ENVMAP_").lower()
    return found | ours


def header_of(attributes: Mapping[str, str]) -> dict[str, Any]:
    """The header attributes that hold our texts: typed where there is a standard place, else under "relume:".

    A number that its type cannot hold to the last digit is stored in both places, and comes back as it was.
    """
    import OpenEXR

    layouts = {"latlong": OpenEXR.ENVMAP_LATLONG, "cube": OpenEXR.ENVMAP_CUBE}
    header = dict[str, Any]()
    for name, text in attributes.items():
        if name == "envmap" and text in layouts:
            header[name] = layouts[text]
            continue
        theirs, kind = EXR.get(name, ("", str))
        value = _typed(str(text), kind) if theirs else None
        if name == "pixel_aspect" and value is not None and not _LEAST_ASPECT <= value <= _LARGEST_ASPECT:
            value = None
        if value is not None:
            header[theirs] = value
        if value is None or (kind is float and _number(value) != str(text)):
            header[PREFIX + name] = str(text)
    return header


def storable(path: str | os.PathLike[str], attributes: Mapping[str, str]) -> dict[str, str]:
    """The attributes with "?" for what a header cannot hold, lone surrogates and zeros in a name; warns of those."""
    clean = {_clean(name).replace("\0", "?"): _clean(str(text)) for name, text in attributes.items()}
    if changed := sorted(set(attributes.items()) - set(clean.items())):
        names = ", ".join(ascii(name)[1:-1] for name, _ in changed)
        warn(f"{path}: the attributes {names} hold characters that no text has; each becomes ?")
    return clean


def _clean(text: str) -> str:
    return text.encode("utf-8", "replace").decode("utf-8")


def _typed(text: str, kind: type) -> Any:
    if kind is str:
        return text
    try:
        number = float(text)
    except ValueError:
        return None
    with np.errstate(over="ignore"):
        return number if np.isfinite(np.float32(number)) else None


def _number(value: Any) -> str | None:
    """A lone number with the digits that float32 holds, without ".0"; None for anything else."""
    array = np.asarray(value)
    if array.size != 1 or array.dtype.kind not in "iuf":
        return None
    number = np.float32(array.reshape(()).item())
    return str(number).removesuffix(".0") if np.isfinite(number) else None
