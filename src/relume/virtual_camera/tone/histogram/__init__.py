"""Histogram adjustment (Ward Larson, Rushmeier & Piatko 1997)."""
