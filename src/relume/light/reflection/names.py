"""The lobe or BRDF that a word stands for, as the command line writes it: "lambert", "phong:50", "ggx:0.2"."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TypeVar

from relume.light.reflection.brdf import GGX, PhongReflectance, Reflectance, Ward
from relume.light.reflection.lobes import (
    VARNISH,
    GGXLobe,
    Lambert,
    Lobe,
    Mirror,
    Phong,
    SelfLuminous,
    WardLobe,
)

LOBES = "lambert, self-luminous, mirror, phong:N, varnish:N, ggx:ALPHA, ward:ALPHA"
BRDFS = "ggx:ALPHA, ward:ALPHA, phong:N"
_Kind = TypeVar("_Kind")


def lobe_named(word: str) -> Lobe:
    """The lobe of a word, like "phong:50".

    word : a name, and its numbers after colons
    Raises ValueError that names all there are.
    """
    plain: dict[str, Lobe] = {each.name: each for each in (Lambert(), SelfLuminous(), Mirror())}
    if word in plain:
        return plain[word]
    numbered: dict[str, Callable[[float], Lobe]] = {
        "phong": Phong,
        "varnish": lambda n: Phong(n, varnish=VARNISH),
        "ggx": GGXLobe,
        "ward": WardLobe,
    }
    return _numbered(word, numbered, LOBES)


def brdf_named(word: str) -> Reflectance:
    """The BRDF of a word, like "ggx:0.2".

    word : a name, and its numbers after colons
    Raises ValueError that names all there are.
    """
    kinds: dict[str, Callable[[float], Reflectance]] = {"ggx": GGX, "ward": Ward, "phong": PhongReflectance}
    return _numbered(word, kinds, BRDFS)


def tables_named(words: Sequence[str]) -> dict[str, Lobe]:
    """The lobes of words by the names of their tables' files: phong:50 as specular_phong_50.

    words : of lobes
    """
    lobes = {word: lobe_named(word) for word in words}
    diffuse = ("lambert", "self-luminous")
    return {
        f"{'diffuse' if word in diffuse else 'specular'}_{_in_file_name(word)}": lobe for word, lobe in lobes.items()
    }


def glossy_named(words: Sequence[str]) -> dict[str, Reflectance]:
    """The BRDFs of words by the names of their tables' files: ggx:0.2 as glossy_ggx_0.2.

    words : of BRDFs
    """
    brdfs = {word: brdf_named(word) for word in words}
    return {f"glossy_{_in_file_name(word)}": brdf for word, brdf in brdfs.items()}


def _in_file_name(word: str) -> str:
    name, colon, text = word.partition(":")
    return name.replace("-", "_") + (f"_{float(text):.12g}" if colon else "")


def _numbered(word: str, kinds: dict[str, Callable[[float], _Kind]], known: str) -> _Kind:
    name, _, text = word.partition(":")
    if name not in kinds:
        raise ValueError(f'"{word}" is not known; choose one of {known}')
    try:
        number = float(text)
    except ValueError:
        raise ValueError(f'"{word}" needs a number after "{name}:", as in {known}') from None
    try:
        return kinds[name](number)
    except ValueError as error:
        raise ValueError(f"{word}: {error}") from None
