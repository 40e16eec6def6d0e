"""Projective, view-dependent texture mapping: photographs of a place shown from where none was taken."""
