"""Which photographs make a bracket, how long each was exposed, and whether its pixels agree."""
