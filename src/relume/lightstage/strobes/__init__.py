"""Films under strobes that repeat: a performance with all lights at every moment (Light Stage 4)."""
