"""Panoramas: perspective views matched, adjusted and stitched into one environment map."""
