"""Driving the lamps of a real stage so that it lights like an environment map."""
