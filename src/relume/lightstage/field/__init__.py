"""Reflectance fields: a subject's pictures per unit of each light's irradiance, corrected and masked."""
