"""ghosts."""
