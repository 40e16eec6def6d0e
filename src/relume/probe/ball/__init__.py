"""Mirrored balls: found in the picture, unwrapped, registered and blended into one environment map."""
