"""gain_map."""
