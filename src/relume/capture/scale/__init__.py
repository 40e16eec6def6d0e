"""The absolute scale (cd/m²) and white balance of a radiance map."""
