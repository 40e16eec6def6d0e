"""Presets of the virtual camera, as TOML."""
