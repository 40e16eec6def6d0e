"""shot_file."""
