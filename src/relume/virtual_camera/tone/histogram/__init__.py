"""histogram."""
