"""The recursive ray tracer of Whitted (1980)."""
