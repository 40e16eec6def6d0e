"""Photographs → radiance map."""
