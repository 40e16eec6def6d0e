"""What glTF's materials add to the paper: coats, and highlights of microfacets."""

from __future__ import annotations

import numpy as np

from relume._kernel import exact_small


@exact_small
def schlick(normal, grazing):
    """F0 + (1 − F0)·grazing per channel, with grazing = (1 − cos θ)⁵ (Schlick 1994, eq. 15)."""
    return (
        normal[0] + (1 - normal[0]) * grazing,
        normal[1] + (1 - normal[1]) * grazing,
        normal[2] + (1 - normal[2]) * grazing,
    )


@exact_small
def under_coat(colour, coat, grazing):
    """A colour below a coat that reflects `coat` along the normal and the `grazing` share of the rest."""
    rest = 1 - grazing
    return (
        colour[0] * (1 - coat[0]) * rest,
        colour[1] * (1 - coat[1]) * rest,
        colour[2] * (1 - coat[2]) * rest,
    )


@exact_small
def facets(alpha, aligned, cosine, facing):
    """π D G / (4 N·V) of GGX (Walter et al. 2007, eq. 33 and 34): a highlight that has N·L within it.

    aligned, cosine, facing : N·H, N·V and N·L
    """
    width = alpha * alpha
    spread = aligned * aligned * (width - 1) + 1
    return width / (spread * spread) * _unmasked(width, cosine) * _unmasked(width, facing) / (4 * cosine)


@exact_small
def shadowed(alpha, aligned, across, cosine, facing):
    """What masking leaves of a ray that a facet reflects, G (V·H) / (N·V N·H), at most 1; 0 below the surface."""
    if facing <= 0 or aligned <= 0:
        return 0.0
    width = alpha * alpha
    return min(_unmasked(width, cosine) * _unmasked(width, facing) * across / (cosine * aligned), 1.0)


@exact_small
def _unmasked(width, cosine):
    """Smith's share of facets that are seen."""
    return 2 * cosine / (cosine + np.sqrt(width + (1 - width) * cosine * cosine))
