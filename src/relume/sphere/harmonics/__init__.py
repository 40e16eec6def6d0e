"""harmonics."""
