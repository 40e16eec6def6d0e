"""What moves: keyframes, animated files, moving objects."""
