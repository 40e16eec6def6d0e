"""Scene + camera → radiance."""
