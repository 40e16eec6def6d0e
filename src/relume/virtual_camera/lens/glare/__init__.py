"""Glare: light that an eye or a lens scatters."""
