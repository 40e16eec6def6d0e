"""A place file before anything is found: what is wrong with it, and the bodies that its blocks are of."""

from __future__ import annotations

import os
from pathlib import Path

from relume.errors import InvalidPlace
from relume.scene.places.bodies import Body
from relume.scene.places.place_tables import read_tables
from relume.scene.places.quantities import modelled
from relume.scene.places.sightings import sightings
from relume.scene.places.solving import known_distance


def read_place_bodies(path: str | os.PathLike[str]) -> dict[str, Body]:
    """The body of each block of a place file, by the block's name, whether or not the place was found yet.

    path : the place file, .toml; of photogrammetry made elsewhere there are none
    A body says which edges and corners may be marked. Photographs are not opened.
    Raises InvalidPlace, one line, for whatever of keys, names, constraints, marks or lengths is wrong.
    """
    path = Path(path)
    tables = read_tables(path)
    if tables.photogrammetry is not None:
        return {}
    try:
        model = modelled(tables.blocks)
        sightings(tables, model)
        for number in range(len(tables.lengths)):
            known_distance(tables, model, number)
    except ValueError as error:
        raise InvalidPlace(f"{path}: {error}") from None
    return {block.name: block.body for block in model.blocks}
