"""Light constellations: a set of lamps that stands for an environment map."""
