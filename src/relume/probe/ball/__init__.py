"""ball."""
