"""The sun of an environment map: taken out as a lamp, and recovered where it clipped."""
