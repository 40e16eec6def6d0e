"""Films of a mirrored ball, or of a 360° camera, in several exposures → an environment map a frame."""
