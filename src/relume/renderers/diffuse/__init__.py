"""Scenes of diffuse surfaces: what the renderers of this course have in common."""
