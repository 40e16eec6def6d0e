"""Modelled places: blocks and cameras from edges marked in photographs, or photogrammetry made elsewhere."""
