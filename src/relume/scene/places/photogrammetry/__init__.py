"""Cameras, points and meshes that other programs found in photographs: COLMAP, Meshroom, OpenMVG, glTF."""
