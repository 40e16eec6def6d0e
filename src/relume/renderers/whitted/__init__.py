"""whitted."""
