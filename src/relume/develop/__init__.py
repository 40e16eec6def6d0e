"""Radiance → photograph."""
