"""The mapping that a name stands for, as files and the command line write it."""

from __future__ import annotations

from relume.sphere.mappings.cubes import CubeCross, Strip, VerticalCubeCross
from relume.sphere.mappings.discs import Angular, Fisheye, Hemispheres, MirrorBall
from relume.sphere.mappings.mapping import LatLong, Mapping
from relume.sphere.mappings.squares import EqualArea, Octahedral


def mapping_named(text: str) -> Mapping:
    """The mapping a file remembers by `text`: "latlong", "cross", "fisheye:equisolid:180", …

    Raises ValueError that names all there are.

    >>> mapping_named("latlong").shape(512)
    (512, 1024)
    """
    plain: tuple[Mapping, ...] = (
        LatLong(), Angular(), MirrorBall(), CubeCross(), VerticalCubeCross(), Strip(), Octahedral(), EqualArea(),
        Hemispheres(),
    )  # fmt: skip
    known = {mapping.name: mapping for mapping in plain}
    if text in known:
        return known[text]
    if text.partition(":")[0] == "fisheye":
        return Fisheye.named(text)
    raise ValueError(f'there is no mapping "{text}"; there are {", ".join(known)} and fisheye')
