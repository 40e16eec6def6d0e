"""Commands about the light itself: the sky, and the sun of a map."""
