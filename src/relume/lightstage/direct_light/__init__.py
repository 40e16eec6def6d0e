"""direct_light."""
