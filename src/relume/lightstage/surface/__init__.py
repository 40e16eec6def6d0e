"""Normals, albedo, gloss and shadow maps of a subject."""
