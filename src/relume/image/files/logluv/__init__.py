"""LogLuv TIFF (Larson 1998)."""
