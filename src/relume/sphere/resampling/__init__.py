"""Resampling environment maps between mappings and sizes; blur on the sphere."""
