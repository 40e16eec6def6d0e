"""relighting."""
