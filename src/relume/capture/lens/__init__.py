"""Vignetting and veiling glare of the photographing lens: measured and removed."""
