"""Pictures of materials: plots of a BRDF, and sheets of balls."""
