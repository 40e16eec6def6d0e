"""What the studio asks of a shot: where a light is mirrored, how materials look under its light."""
