"""Relighting: a subject under any light as a weighted sum of its pictures."""
