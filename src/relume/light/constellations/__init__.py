"""constellations."""
