"""Light of the sky: where the sun stands, and a model of a clear sky."""
