"""Radiance pictures (.hdr, .pic): RGBE and XYZE."""
