"""Textures of game engines: cubes of light with their levels."""
