"""Shading by reflection maps: prefiltered environment lighting (Miller & Hoffman 1984)."""
