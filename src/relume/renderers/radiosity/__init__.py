"""Radiosity by progressive refinement (Cohen, Chen, Wallace & Greenberg 1988)."""
