"""Reflectance transformation imaging (museums' PTM and HSH files)."""
