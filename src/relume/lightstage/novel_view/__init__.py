"""A relit subject from new viewpoints (Debevec et al. 2000, §4)."""
