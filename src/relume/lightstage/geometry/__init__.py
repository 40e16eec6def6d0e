"""The shape of a subject by structured light: patterns, decoding, calibration, triangulation, cleaning and meshing."""
