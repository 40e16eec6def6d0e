"""Radiance as a function of direction."""
