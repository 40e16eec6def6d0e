"""logluv."""
