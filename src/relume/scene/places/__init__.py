"""Modelled places: blocks and cameras found together from edges marked in photographs, or photogrammetry made elsewhere."""
