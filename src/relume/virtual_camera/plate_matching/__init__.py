"""plate_matching."""
