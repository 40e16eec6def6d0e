"""Aligning the frames of a hand-held bracket (shift and turn, by rank, before any response is known)."""
