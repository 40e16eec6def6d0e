"""A node of the tree (Whitted 1980, §2): directions and coefficients, on triples of unit length; pictures on surfaces,
and normals that are turned as if the surface had bumps."""

from __future__ import annotations

import numpy as np

from relume.image.kernel import exact_kernel, exact_small, inlined, kernel


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


@kernel
def wrinkled(normal, point, waves, first, last, height):
    """The normal of a surface that waves through space displace (`Wrinkles`)."""
    x, y, z = 0.0, 0.0, 0.0
    for k in range(first, last):
        turns = (
            point[0] * waves[k, 0] + point[1] * waves[k, 1] + point[2] * waves[k, 2] + waves[k, 3]
        ) * (0.5 / np.pi)  # fmt: skip
        slope = _cosine(turns - np.floor(turns + 0.5))
        x, y, z = x + slope * waves[k, 0], y + slope * waves[k, 1], z + slope * waves[k, 2]
    gradient = (x * height, y * height, z * height)
    flat = along(gradient, normal, -dot(gradient, normal))
    return unit(along(normal, flat, -1.0))


@inlined
def _cosine(turns):
    """cos 2πt for t from −½ to ½, to 1e-9: its series about ¼, without a branch, so that waves are summed in fours."""
    t = 0.25 - abs(turns)
    s = t * t
    series = -15.094642576822984 + s * 3.8199525848482821
    series = 42.058693944897655 + s * series
    series = -76.705859753061386 + s * series
    series = 81.605249276075054 + s * series
    series = -41.341702240399755 + s * series
    return t * (6.2831853071795865 + s * series)


@exact_small
def bumped(normal, along_u, along_v, dp_du, dp_dv):
    """Blinn 1978, eq. 4 (`BumpMap`): N′ = N + (B_u N×P_v − B_v N×P_u) / |P_u × P_v|."""
    area = _cross(dp_du, dp_dv)
    length = np.sqrt(dot(area, area))
    if not length > 0:
        return normal
    scale = (-1.0 if dot(area, normal) < 0 else 1.0) / length
    return unit(along(along(normal, _cross(normal, dp_dv), along_u * scale), _cross(normal, dp_du), -along_v * scale))


@exact_small
def _cross(a, b):
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@exact_kernel
def picture_at(pixels, begin, rows, columns, which, uv):
    """Three channels of a picture repeated over the texture coordinates, bilinear; (0, 0) is the lower left corner."""
    height, width = rows[which], columns[which]
    x = (uv[0] - np.floor(uv[0])) * width - 0.5
    y = (1 - (uv[1] - np.floor(uv[1]))) * height - 0.5
    left, upper = np.floor(x), np.floor(y)
    right, down = x - left, y - upper
    column, row = np.int64(left) % width, np.int64(upper) % height
    next_column, next_row = (column + 1) % width, (row + 1) % height
    a, b = begin[which] + row * width, begin[which] + next_row * width
    first, second = (1 - right) * (1 - down), right * (1 - down)
    third, fourth = (1 - right) * down, right * down
    return (
        pixels[a + column, 0] * first + pixels[a + next_column, 0] * second
        + pixels[b + column, 0] * third + pixels[b + next_column, 0] * fourth,
        pixels[a + column, 1] * first + pixels[a + next_column, 1] * second
        + pixels[b + column, 1] * third + pixels[b + next_column, 1] * fourth,
        pixels[a + column, 2] * first + pixels[a + next_column, 2] * second
        + pixels[b + column, 2] * third + pixels[b + next_column, 2] * fourth,
    )  # fmt: skip


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
