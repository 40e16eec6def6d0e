"""Edits of radiance maps, and the way through a paint program."""
