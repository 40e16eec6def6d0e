"""scene_file."""
