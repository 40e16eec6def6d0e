"""Illumination map → the forms of light a scene can hold: reflection maps, harmonics."""
