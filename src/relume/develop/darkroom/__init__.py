"""The Virtual Darkroom: radiance → negative → print."""
