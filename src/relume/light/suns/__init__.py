"""suns."""
