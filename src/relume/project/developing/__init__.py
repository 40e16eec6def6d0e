"""Developing files: pictures, sequences, and the way back, as `relume develop` does."""
