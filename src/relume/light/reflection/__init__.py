"""Illumination and reflection maps: environment maps convolved with a reflectance (Miller & Hoffman 1984)."""
