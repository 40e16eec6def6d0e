"""Shapes, meshes and patches."""
