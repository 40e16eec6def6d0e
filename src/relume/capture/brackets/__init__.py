"""Brackets → radiance maps: settings, the steps for photographs and for camera raws, and their results."""
