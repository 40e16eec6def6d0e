"""The tree of rays of every sample, followed without recursion (Whitted 1980, §2 and §3).

Rays that are yet to be traced wait on a stack, those towards the lights among them; each carries the share of the
pixel that eq. 2 gives to what it will find, so that nothing has to be gathered on the way back.
"""

from __future__ import annotations

import numpy as np

from relume.image.kernel import exact_kernel, exact_small
from relume.renderers.raytrace.kernel import meet, scratch, unowned
from relume.renderers.raytrace.surface import surface_at
from relume.renderers.whitted.kernel_data import DISTANT, EYE, LINEAR, NONE, REFLECTED, REFRACTED, SHADOW, SQUARE
from relume.renderers.whitted.materials import CHECKED, CONSTANT, FRESNEL, PICTURE, SCHLICK
from relume.renderers.whitted.optics import (
    along,
    bumped,
    dot,
    facets,
    fresnel,
    hashed,
    largest,
    perturbed,
    picture_at,
    reflected,
    refracted,
    schlick,
    shadowed,
    under_coat,
    unit,
    wrinkled,
)
from relume.sphere.bilinear_kernels import looked_up, polar_point

NEAR = 4e-6
"""A ray ignores what it meets within this share of the way from the eye: the surface that it leaves, and one that
coincides with it."""
CROSSINGS = 64
"""Transparent surfaces that a ray towards a light passes, at most, less the level of its node."""
THINNED = np.uint64(8)
"""A scattered ray's node asks one light of so many of a constellation, for all of them."""
MOST_RAYS = 1 << 16
"""After so many a tree grows no more branches: trees between parallel panes of glass double with every node."""
WORTH = 0.1
"""Samples count as seeing different things only where these carry more than this share of the pixel."""
CHANNELS = 12
"""Of a sample: radiance, object, anything, distance, normal, albedo."""


@exact_kernel
def trace(
    points, view, geometry, surfaces, materials, pictures, bumps, lights, sky, settings, begin, end, results, record
):
    """Follow the trees of samples begin … end; write their channels, what they saw first, and their number of rays.

    points : (N, 2) pixel coordinates
    view : the eye, the rotation's rows, the focal length and the middle of the picture: 16 numbers
    sky : the light map, padded and flat, and its number of rows
    results : values (N, CHANNELS) float32, keys (N,) int64, rays (N,) int32
    """
    depth, scattered = settings.depth, settings.rays
    capacity = (depth + 1) * (len(lights.place) + 2) + 2 * scattered + 4
    # Origin, direction, weight, limit, way from the eye, and by how many the weight was split; then the ray's kind,
    # level, its parent's node, and light.
    stack = (np.empty((capacity, 12)), np.empty((capacity, 4), np.int64), np.empty(capacity, np.uint64))
    world = (geometry, surfaces, materials, pictures, bumps, lights, sky)
    _follow(points, view, world, settings, begin, end, results, record, scratch(geometry), stack)


@exact_kernel
def _follow(points, view, world, settings, begin, end, results, record, waiting_room, stack):
    """`trace`, with what it needs of scratch; all arrays are arguments, so that they can be unowned."""
    points, view = unowned(points), unowned(view)
    geometry, surfaces, materials, pictures, bumps, lights, sky = unowned(world)
    boxes, children, root, _, corners, form, whose, measures, planes = geometry
    kind_of, first_of, sizes, smooth, textured, faces, vertices, normals, mesh_uv = surfaces[:9]
    primitive_of, material_of = surfaces[9], surfaces[10]
    diffuse, second_colour, ambient, specular, transmission, highlight, coat = materials[:7]
    exponent, ior, law, roughness, alpha, tint, stained, everywhere, paint, picture, size, bump, by_uv = materials[7:]
    pixels, picture_begin, picture_rows, picture_columns = pictures
    waves, first_wave, last_wave, wave_height, slope_picture = bumps
    place, strength, falloff, reach, shines, glow = lights
    entries, rows = sky
    values, keys, counts = unowned(results)
    ends, share, sent, parent_of, ray_kind, node_shape, node_light, node_inside, limits, node_count = unowned(record)
    waiting, entry, pieces = unowned(waiting_room)
    rays, notes, seeds = unowned(stack)
    depth, contribution, attenuation, attenuation_reach, scattered, clear, background = settings[:7]
    first_object, footprint, seed = settings[7:]
    for i in range(begin, end):
        across, up = points[i, 0] - view[13], view[14] - points[i, 1]
        direction = unit(
            (
                view[3] * across + view[4] * up - view[5] * view[12],
                view[6] * across + view[7] * up - view[8] * view[12],
                view[9] * across + view[10] * up - view[11] * view[12],
            )
        )
        sample_seed = hashed(hashed(np.int64(seed), np.int64(points[i, 0] * 4096)), np.int64(points[i, 1] * 4096))
        red, green, blue, key, traced = 0.0, 0.0, 0.0, 0, 0
        for channel in range(3, CHANNELS):
            values[i, channel] = 0
        _push(rays, 0, (view[0], view[1], view[2]), direction, (1.0, 1.0, 1.0), np.inf, 0.0, 1.0)
        notes[0, 0], notes[0, 1], notes[0, 2], notes[0, 3], seeds[0] = EYE, 0, -1, -1, sample_seed
        top = 1
        while top > 0:
            top -= 1
            origin = (rays[top, 0], rays[top, 1], rays[top, 2])
            direction = (rays[top, 3], rays[top, 4], rays[top, 5])
            weight = (rays[top, 6], rays[top, 7], rays[top, 8])
            limit, way, split = rays[top, 9], rays[top, 10], rays[top, 11]
            kind, level, parent, light = notes[top, 0], notes[top, 1], notes[top, 2], notes[top, 3]
            node_seed = seeds[top]
            beyond = NEAR * way + 1e-9 * (abs(origin[0]) + abs(origin[1]) + abs(origin[2])) if way > 0 else 0.0
            distance, slot, second, third = meet(
                boxes, children, root, corners, form, whose, measures, planes,
                origin, direction, beyond, limit, footprint, kind == SHADOW and not clear, waiting, entry, pieces,
            )  # fmt: skip
            traced += 1

            s = whose[slot] if slot >= 0 else -1
            m = np.uint64(material_of[s] if slot >= 0 else 0)
            node = -1
            if len(parent_of) > node_count[0]:
                node = node_count[0]
                node_count[0] += 1
                parent_of[node], ray_kind[node], node_shape[node], node_light[node] = parent, kind, s, light
                length = distance if slot >= 0 else min(limit, 1e6)
                limits[node, 0], limits[node, 1] = beyond, limit
                for j in range(3):
                    ends[node, j], ends[node, j + 3] = origin[j], origin[j] + length * direction[j]
                    share[node, j], sent[node, j] = weight[j], 0.0

            if slot < 0:
                arrived = weight
                if kind != SHADOW:
                    if (kind == EYE and not background) or len(entries) == 0:
                        continue
                    u, v = polar_point(np.float32(direction[0]), np.float32(direction[1]), np.float32(direction[2]))
                    r, g, b, _ = looked_up(entries, 0, rows, u, v)
                    arrived = (weight[0] * r, weight[1] * g, weight[2] * b)
                red, green, blue = red + arrived[0], green + arrived[1], blue + arrived[2]
                if node >= 0:
                    for j in range(3):
                        sent[node, j] += arrived[j]
                continue
            through = (transmission[m, 0], transmission[m, 1], transmission[m, 2])
            if kind == SHADOW and not (clear and largest(through) > 0):
                if level == 0 and shines[light] > 0:
                    key += np.int64(hashed(light + 1, 77) >> np.uint64(1))
                continue

            point = along(origin, direction, distance)
            way += distance
            if kind == SHADOW and law[m] == CONSTANT and not stained[m] > 0:
                if coat[m, 0] >= 0:
                    through = under_coat(through, (coat[m, 0], coat[m, 1], coat[m, 2]), 0.0)
                top = _dim(rays, notes, top, node, point, weight, through, limit - distance, way)
                continue
            geometric, shading, uv, dp_du, dp_dv = surface_at(
                kind_of, first_of, sizes, smooth, textured, faces, vertices, normals, mesh_uv,
                s, primitive_of[slot], second, third, point, by_uv[m] > 0,
            )  # fmt: skip
            # The normal has to point to the side that the ray comes from, and the index goes with it (§2); what lets
            # no light through has no inside to come from, whichever way its faces were put together.
            side = -1.0 if dot(geometric, direction) > 0 else 1.0
            index = ior[m] if side > 0 or not largest(through) > 0 else 1 / ior[m]
            if bump[m] >= 0:
                which = np.int64(bump[m])
                if slope_picture[which] < 0:
                    shading = wrinkled(shading, point, waves, first_wave[which], last_wave[which], wave_height[which])
                else:
                    along_u, along_v, _ = picture_at(
                        pixels, picture_begin, picture_rows, picture_columns, slope_picture[which], uv
                    )
                    shading = bumped(shading, along_u, along_v, dp_du, dp_dv)
            outward = (side * geometric[0], side * geometric[1], side * geometric[2])
            normal = (side * shading[0], side * shading[1], side * shading[2])
            if dot(normal, direction) > -1e-3:
                # A normal that is turned from the viewer shows him the back of what he sees the front of.
                normal = unit(along(normal, direction, -dot(normal, direction) - 2e-3))

            cosine = -dot(direction, normal)
            back = (specular[m, 0], specular[m, 1], specular[m, 2])
            colour = (diffuse[m, 0], diffuse[m, 1], diffuse[m, 2])
            cell = 0
            if paint[m] == CHECKED:
                # A little inside the surface, for one that lies where two cubes meet would show both.
                deep = along(point, geometric, -1e-4 * size[m])
                cell_x, cell_z = np.floor(deep[0] / size[m]), np.floor(deep[2] / size[m])
                cell_y = np.floor(deep[1] / size[m] + 0.5)
                if np.int64(cell_x + cell_y + cell_z) & 1:
                    colour = (second_colour[m, 0], second_colour[m, 1], second_colour[m, 2])
                cell = np.int64(cell_x) * 73856093 ^ np.int64(cell_y) * 19349663 ^ np.int64(cell_z) * 83492791
            elif paint[m] == PICTURE:
                r, g, b = picture_at(pixels, picture_begin, picture_rows, picture_columns, np.int64(picture[m]), uv)
                back = (back[0] + tint[m] * r, back[1] + tint[m] * g, back[2] + tint[m] * b)
                if stained[m] > 0:
                    through = (through[0] * np.sqrt(r), through[1] * np.sqrt(g), through[2] * np.sqrt(b))
                colour = (colour[0] * r, colour[1] * g, colour[2] * b)
            straight = back
            grazing = 0.0
            if law[m] == FRESNEL:
                grazing = fresnel(cosine, index)
                back = (back[0] * grazing, back[1] * grazing, back[2] * grazing)
            elif law[m] == SCHLICK:
                grazing = (1 - cosine) ** 5
                back = schlick(back, grazing)
            if coat[m, 0] >= 0:
                kept = (coat[m, 0], coat[m, 1], coat[m, 2]) if law[m] != FRESNEL else (0.0, 0.0, 0.0)
                colour, through = under_coat(colour, kept, grazing), under_coat(through, kept, grazing)
            elif law[m] == FRESNEL:
                through = under_coat(through, (0.0, 0.0, 0.0), grazing)

            if kind == SHADOW:
                top = _dim(rays, notes, top, node, point, weight, through, limit - distance, way)
                continue

            if largest(weight) > WORTH:
                key += np.int64(hashed(4 * (64 * s + level) + kind, cell) >> np.uint64(1))
            if kind == EYE:
                values[i, 3] = 1.0 if s >= first_object else 0.0
                values[i, 4], values[i, 5] = 1.0, distance
                for j in range(3):
                    values[i, 6 + j] = normal[j]
                    values[i, 9 + j] = min(colour[j] + back[j] + through[j], 1.0)
            else:
                kept = _kept(attenuation, attenuation_reach, distance)
                weight = (weight[0] * kept, weight[1] * kept, weight[2] * kept)
            if node >= 0:
                node_inside[node] = side < 0
                for j in range(3):
                    share[node, j] = weight[j]
            # I_a
            own = (ambient[m, 0], ambient[m, 1], ambient[m, 2]) if ambient[m, 0] >= 0 else colour
            own = (weight[0] * own[0] * glow[0], weight[1] * own[1] * glow[1], weight[2] * own[2] * glow[2])
            red, green, blue = red + own[0], green + own[1], blue + own[2]
            if node >= 0:
                for j in range(3):
                    sent[node, j] += own[j]

            shiny = largest((highlight[m, 0], highlight[m, 1], highlight[m, 2])) > 0
            # k_d Σ (N·L) and k_s Σ (N·L′)ⁿ: a ray to every light that the surface faces.
            for light in range(len(place)):
                far = np.inf
                towards = (place[light, 0], place[light, 1], place[light, 2])
                arriving = 1.0
                if shines[light] == 0 and split > 1:
                    # One of many scattered rays: together they see all of the constellation.
                    if (np.uint64(light) + node_seed) % THINNED != 0:
                        continue
                    arriving = np.float64(THINNED)
                if falloff[light] != DISTANT:
                    towards = (towards[0] - point[0], towards[1] - point[1], towards[2] - point[2])
                    far = np.sqrt(dot(towards, towards))
                    arriving = _fallen(falloff[light], reach[light], far)
                    towards = unit(towards)
                facing = dot(normal, towards)
                if facing <= 0 or dot(outward, towards) <= 0 or arriving <= 0:
                    continue
                shine = (0.0, 0.0, 0.0)
                if (shiny or alpha[m] > 0) and (shines[light] > 0 or everywhere[m] > 0):
                    half = unit((towards[0] - direction[0], towards[1] - direction[1], towards[2] - direction[2]))
                    aligned = max(dot(normal, half), 0.0)
                    if alpha[m] > 0:
                        # Of eq. 1 only the place is left: a facet's reflectance is that at the halfway vector.
                        across = -dot(direction, half)
                        if law[m] == FRESNEL:
                            f = fresnel(across, index)
                            shine = (straight[0] * f, straight[1] * f, straight[2] * f)
                        else:
                            shine = schlick(straight, (1 - across) ** 5 if law[m] == SCHLICK else 0.0)
                        f = facets(alpha[m], aligned, cosine, facing)
                        shine = (shine[0] * f, shine[1] * f, shine[2] * f)
                    elif shiny and exponent[m] * (1 - aligned) < 25:
                        # Further from a highlight it is e^(−25) and less, which is not worth a power.
                        f = aligned ** exponent[m]
                        shine = (highlight[m, 0] * f, highlight[m, 1] * f, highlight[m, 2] * f)
                reaching = (
                    weight[0] * (colour[0] * facing + shine[0]) * strength[light, 0] * arriving,
                    weight[1] * (colour[1] * facing + shine[1]) * strength[light, 1] * arriving,
                    weight[2] * (colour[2] * facing + shine[2]) * strength[light, 2] * arriving,
                )
                if largest(reaching) > 0:
                    # A lamp that lies on a surface is not in that surface's shadow.
                    _push(rays, top, point, towards, reaching, far * (1 - NEAR), way, split)
                    notes[top, 0], notes[top, 1], notes[top, 2], notes[top, 3] = SHADOW, level, node, light
                    top += 1

            # k_s S and k_t T
            if level + 1 >= depth or traced >= MOST_RAYS:
                continue
            back = (weight[0] * back[0], weight[1] * back[1], weight[2] * back[2])
            through = (weight[0] * through[0], weight[1] * through[1], weight[2] * through[2])
            reflects = everywhere[m] == 0 and largest(back) * split >= contribution
            refracts = largest(through) * split >= contribution
            if not reflects and not refracts:
                continue
            many = scattered if roughness[m] > 0 and level == 0 else 1
            back = (back[0] / many, back[1] / many, back[2] / many)
            through = (through[0] / many, through[1] / many, through[2] / many)
            for which in range(many):
                facet = normal
                if roughness[m] > 0:
                    facet = perturbed(normal, roughness[m], which, many, hashed(node_seed, level))
                    if dot(facet, direction) > -1e-3:
                        facet = normal
                if reflects and largest(back) > 0:
                    towards = reflected(direction, facet)
                    sent_on = back
                    if alpha[m] > 0 and roughness[m] > 0:
                        f = shadowed(alpha[m], dot(facet, normal), -dot(direction, facet), cosine, dot(towards, normal))
                        sent_on = (back[0] * f, back[1] * f, back[2] * f)
                    under = dot(towards, outward)
                    if under <= 0:
                        # A turned normal sent it below the surface: it grazes instead.
                        towards = unit(along(towards, outward, 1e-3 - under))
                    _push(rays, top, point, towards, sent_on, np.inf, way, split * many)
                    notes[top, 0], notes[top, 1], notes[top, 2], notes[top, 3] = REFLECTED, level + 1, node, -1
                    seeds[top] = hashed(node_seed, 2 * which + 1)
                    top += 1
                if refracts and largest(through) > 0:
                    towards = refracted(direction, facet, index)
                    above = dot(towards, outward)
                    if towards[0] == 0 and towards[1] == 0 and towards[2] == 0:
                        continue
                    if above >= 0:
                        towards = unit(along(towards, outward, -1e-3 - above))
                    _push(rays, top, point, towards, through, np.inf, way, split * many)
                    notes[top, 0], notes[top, 1], notes[top, 2], notes[top, 3] = REFRACTED, level + 1, node, -1
                    seeds[top] = hashed(node_seed, 2 * which + 2)
                    top += 1
        values[i, 0], values[i, 1], values[i, 2] = red, green, blue
        keys[i], counts[i] = key, traced


@exact_small
def _dim(rays, notes, top, node, point, weight, through, limit, way):
    """Send the ray at the top of the stack on behind a transparent shape, unless nothing is left; the stack's size."""
    weight = (weight[0] * through[0], weight[1] * through[1], weight[2] * through[2])
    if notes[top, 1] >= CROSSINGS or largest(weight) <= 1e-9:
        return top
    rays[top, 0], rays[top, 1], rays[top, 2] = point
    rays[top, 6], rays[top, 7], rays[top, 8] = weight
    rays[top, 9], rays[top, 10] = limit, way
    notes[top, 1] += 1
    if node >= 0:
        notes[top, 2] = node
    return top + 1


@exact_small
def _push(rays, top, origin, direction, weight, limit, way, split):
    """Put a ray on the stack, but for what its notes and its seed say."""
    rays[top, 0], rays[top, 1], rays[top, 2] = origin
    rays[top, 3], rays[top, 4], rays[top, 5] = direction
    rays[top, 6], rays[top, 7], rays[top, 8] = weight
    rays[top, 9], rays[top, 10], rays[top, 11] = limit, way, split


@exact_small
def _fallen(falloff, reach, distance):
    """The share of a light that arrives over a distance."""
    if falloff == SQUARE:
        return 1 / (distance * distance)
    return max(1 - distance / reach, 0.0) if falloff == LINEAR else 1.0


@exact_small
def _kept(attenuation, reach, distance):
    """The share of a node's intensity that arrives at its parent (§2): never more than all."""
    return 1.0 if attenuation == NONE else min(_fallen(attenuation, reach, distance), 1.0)
