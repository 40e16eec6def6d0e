"""The light of a studio's shot: edited as a whole, and looked at map by map where it changes."""
