"""The camera's response curve and its profile (Debevec & Malik 1997; Mitsunaga & Nayar 1999; Robertson et al. 2003)."""
