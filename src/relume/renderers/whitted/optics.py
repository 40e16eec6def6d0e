"""The directions and coefficients of a node of the tree (Whitted 1980, §2), on triples of unit length."""

from __future__ import annotations

import numpy as np

from relume._kernel import exact_small


@exact_small
def dot(a, b):
    """The inner product."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@exact_small
def largest(v):
    """The largest of three."""
    larger = v[0] if v[0] > v[1] else v[1]
    return larger if larger > v[2] else v[2]


@exact_small
def along(origin, direction, distance):
    """The point at a distance on a ray, or any sum of a vector and a scaled one."""
    return (
        origin[0] + distance * direction[0],
        origin[1] + distance * direction[1],
        origin[2] + distance * direction[2],
    )


@exact_small
def unit(v):
    """The vector at unit length; 0 where it has none."""
    length = np.sqrt(dot(v, v))
    scale = 1 / length if length > 0 else 0.0
    return v[0] * scale, v[1] * scale, v[2] * scale


@exact_small
def reflected(incoming, normal):
    """R = V′ + 2N with V′ = V / |V·N|, as long as V: V + 2|V·N| N.

    incoming : V, which points to the surface: V·N < 0
    """
    return along(incoming, normal, 2 * abs(dot(incoming, normal)))


@exact_small
def refracted(incoming, normal, ior):
    """P = k_f (N + V′) − N, made unit, with k_f = (k_n² |V′|² − |V′ + N|²)^(−1/2); 0 where k_f is imaginary.

    Times |V·N|, k_f is 1/√u with u = k_n² − |V + |V·N| N|², and P's length is k_n/√u.

    ior : k_n, of the far side to the near side
    """
    cosine = abs(dot(incoming, normal))
    across = along(incoming, normal, cosine)
    under = ior * ior - dot(across, across)
    if not under > 0:
        return 0.0, 0.0, 0.0
    x, y, z = along(across, normal, -np.sqrt(under))
    return x / ior, y / ior, z / ior


@exact_small
def fresnel(cosine, ior):
    """The exact unpolarised reflectance of a smooth dielectric, as `weights.Fresnel`; 1 beyond the critical angle.

    ior : of the far side to the near side
    """
    c = min(max(cosine, 0.0), 1.0)
    square = ior * ior - 1 + c * c
    if square <= 0 or c == 0:
        return 1.0
    g = np.sqrt(square)
    across = (g - c) / (g + c)
    along_it = (c * (g + c) - 1) / (c * (g - c) + 1)
    return min(0.5 * across * across * (1 + along_it * along_it), 1.0)


@exact_small
def hashed(a, b):
    """Sixty-four well mixed bits from two numbers (the finaliser of MurmurHash3)."""
    x = np.uint64(a) * np.uint64(0x9E3779B97F4A7C15) + np.uint64(b) + np.uint64(0x7F4A7C15)
    x = (x ^ (x >> np.uint64(33))) * np.uint64(0xFF51AFD7ED558CCD)
    x = (x ^ (x >> np.uint64(33))) * np.uint64(0xC4CEB9FE1A85EC53)
    return x ^ (x >> np.uint64(33))


@exact_small
def fraction(bits):
    """A number from 0 to 1, 1 excluded, from the upper bits of a hash."""
    return np.float64(bits >> np.uint64(11)) * 2.0**-53


@exact_small
def perturbed(normal, deviation, which, count, seed):
    """The normal of a random microfacet: slopes drawn from a normal distribution (§2), one of `count` that spread well.

    The radius is stratified, the azimuth goes on by the golden angle, and the seed turns and shifts them all.
    """
    share = (which + fraction(hashed(seed, which))) / count
    radius = deviation * np.sqrt(-2 * np.log(1 - share))
    turn = 2 * np.pi * (which * 0.6180339887498949 + fraction(hashed(seed, 0x5BD1E995)))
    # Two directions across the normal without a branch for the poles (Duff et al. 2017).
    sign = np.copysign(1.0, normal[2])
    a = -1 / (sign + normal[2])
    b = normal[0] * normal[1] * a
    u = radius * np.cos(turn)
    v = radius * np.sin(turn)
    first = (1 + sign * normal[0] * normal[0] * a, sign * b, -sign * normal[0])
    second = (b, sign + normal[1] * normal[1] * a, -normal[1])
    return unit(along(along(normal, first, u), second, v))
