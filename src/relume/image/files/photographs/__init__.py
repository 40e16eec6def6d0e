"""JPEG, PNG, TIFF and AVIF photographs."""
