"""How much is traced at once, how often, and when a path ends."""

from __future__ import annotations

from relume.renderers.progressive.convergence import LEAST
from relume.scene.cameras.camera import Camera

PASS_RAYS = 4_000_000
"""Rays traced at once: under about half a gigabyte, and about two seconds of two cores, so that a first Ctrl-C is
answered in time."""
PASSES = 16
"""Passes at least, where the samples allow it: the scatter of 16 estimates a pixel's variance to a third of itself."""
FEW_RAYS = 500_000
"""Samples of a pass below which starting it takes longer than tracing it."""
SPREAD_RAYS = 1_500_000
"""Samples of a pass over all pixels, from which on later passes trace those that need it: each has a start of its own,
which is a twentieth of some hundred thousand rays."""
FEWEST_PASSES = 8
"""Of a small picture: their scatter estimates a pixel's variance to half of itself."""
EVEN_SAMPLES = 16
"""Samples of a pass of a change, where a small picture has so many for `LEAST` passes: those of a pass lie evenly
beside each other, passes know nothing of each other. Four of 16 have 0.85 of the squared error of eight of 8."""
MATTE_SAMPLES = 64
"""Rays a pixel for the matte and the other planes: coverage to about a hundredth at edges."""
GUIDE_SAMPLES = 32
"""Rays a pixel for the planes of a whole picture: depth, normals and albedo. Pictures that are cleaned by the planes of
64 rays are no nearer to the truth."""
GUIDES = 4
"""Samples of depth, normals and albedo for each of the picture, where those are few: they cost a fifth of it."""
WALK = 10_000
"""Scatterings inside a body, at most: a white ball 67 mean free paths across keeps 0.98 of its light in 1000."""
FAIR = 1000
"""Of them before chance ends a path: ended earlier, a few lucky paths carry all the light."""


def passes_of_change(samples: int, camera: Camera) -> int:
    """Of how many passes a change is made at least, where memory allows so large ones."""
    if samples * camera.width * camera.height > PASSES * FEW_RAYS:
        return FEWEST_PASSES
    return min(max(samples // EVEN_SAMPLES, LEAST), FEWEST_PASSES)


def samples_a_pass(samples: int, camera: Camera, passes: int | None = None) -> int:
    """Many enough that a pass is worth its start, few enough that there are PASSES where the rays are many."""
    pixels = camera.width * camera.height
    passes = passes or (PASSES if samples * pixels > PASSES * FEW_RAYS else FEWEST_PASSES)
    return max(1, min(samples // passes, PASS_RAYS // pixels))
