"""Conversion of files between formats, and of environment maps between mappings."""
