"""Pixels and what they mean."""
