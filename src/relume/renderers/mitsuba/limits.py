"""How much is traced at once, how often, and when a path ends."""

from __future__ import annotations

from relume.scene.cameras.camera import Camera

PASS_RAYS = 4_000_000
"""Rays traced at once: under about half a gigabyte, and about two seconds of two cores, so that a first Ctrl-C is
answered in time."""
PASSES = 16
"""Passes at least, where the samples allow it: the scatter of 16 estimates a pixel's variance to a third of itself."""
FEW_RAYS = 500_000
"""Samples of a pass below which starting it takes longer than tracing it."""
FEWEST_PASSES = 8
"""Of a small picture: their scatter estimates a pixel's variance to half of itself."""
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


def samples_a_pass(samples: int, camera: Camera, passes: int | None = None) -> int:
    """Many enough that a pass is worth its start, few enough that there are PASSES where the rays are many."""
    pixels = camera.width * camera.height
    passes = passes or (PASSES if samples * pixels > PASSES * FEW_RAYS else FEWEST_PASSES)
    return max(1, min(samples // passes, PASS_RAYS // pixels))
