"""Rays against shapes: the bounding volume hierarchy, and the surface where a ray meets it."""
