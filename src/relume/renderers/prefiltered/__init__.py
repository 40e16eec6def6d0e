"""prefiltered."""
