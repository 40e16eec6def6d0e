"""Radiance maps → illumination map."""
