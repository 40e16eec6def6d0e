"""Lamps and shots as USD layers."""
