"""Photon mapping (Jensen 1996, 2001): light followed from the lamps, kept where it lands, and looked up there."""
