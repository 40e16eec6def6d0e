"""Reflectance and gloss of the real surfaces in a photograph, recovered under its light (Debevec 1998, §7)."""
