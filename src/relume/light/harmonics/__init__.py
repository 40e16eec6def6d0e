"""Spherical harmonics of environment maps."""
