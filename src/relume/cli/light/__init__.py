"""Commands about the light itself and where it is: the sky, the sun of a map, a place."""
