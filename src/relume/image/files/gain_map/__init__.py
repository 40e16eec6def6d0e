"""JPEGs with a gain map (Ultra HDR, ISO 21496-1)."""
