"""Cameras: pose and lens, from a chessboard, vanishing lines or other programs' files."""
