"""The frame of TIFF and BigTIFF, and radiance maps as TIFF of floats."""
