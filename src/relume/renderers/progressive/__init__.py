"""progressive."""
