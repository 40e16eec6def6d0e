"""The loop of `surface.direct_light` over what a light reaches."""

from __future__ import annotations

import numpy as np

from relume.image.kernel import exact_kernel

REFLECTANCE = np.float32(0.04)
"""Of a dielectric of index 1.5 at normal incidence; what is fitted scales it."""
GRAZING = np.float32(1e-3)
"""The least cosine between normal and eye: a surface seen edge-on would reflect without bound."""


@exact_kernel
def add_light(found, pixels, normals, towards_eye, light, incident, lit, alpha):
    """Add irradiance and reflected gloss of the samples `lit` to their pixels of `found` (2, pixels) float32.

    Microfacets D F G / (4 n·v): GGX (Walter et al. 2007, eq. 20, 33, 34), Schlick's Fresnel term.

    light : (3,) float32, towards the light, of irradiance 1
    incident : (K,) float32, n·l
    alpha : float32, width of the slopes
    """
    one, squared, pi = np.float32(1), alpha * alpha, np.float32(np.pi)
    for k in lit:
        hx, hy, hz = towards_eye[k, 0] + light[0], towards_eye[k, 1] + light[1], towards_eye[k, 2] + light[2]
        length = np.sqrt(hx * hx + hy * hy + hz * hz)
        hx, hy, hz = hx / length, hy / length, hz / length
        nx, ny, nz = normals[k, 0], normals[k, 1], normals[k, 2]
        ex, ey, ez = towards_eye[k, 0], towards_eye[k, 1], towards_eye[k, 2]
        cosine, outgoing = incident[k], max(nx * ex + ny * ey + nz * ez, GRAZING)
        middle = nx * hx + ny * hy + nz * hz
        slope = middle * middle * (squared - one) + one
        distribution = squared / (pi * (slope * slope))
        masked = outgoing * np.sqrt(squared + (one - squared) * (cosine * cosine))
        shadowed = cosine * np.sqrt(squared + (one - squared) * (outgoing * outgoing))
        attenuation = np.float32(2) * cosine * outgoing / (masked + shadowed)
        miss = one - (ex * hx + ey * hy + ez * hz)
        fresnel = REFLECTANCE + (one - REFLECTANCE) * (miss * miss * miss * miss * miss)
        found[0, pixels[k]] += cosine
        found[1, pixels[k]] += distribution * attenuation * fresnel / (np.float32(4) * outgoing)
