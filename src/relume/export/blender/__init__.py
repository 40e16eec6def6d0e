"""Lamps and shots as Blender scripts."""
