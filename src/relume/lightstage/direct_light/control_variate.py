"""Relighting with a mesh: direct light is computed, and only what it leaves over is interpolated (a control variate).

Interpolated reflectance functions show two faint shadows where one should stand between them. With a mesh of the
subject, direct light (cosine, gloss and shadow, `surface`) is fitted to each pixel, and only the remainder is
interpolated: R(ω) = Σ_i w_i(ω) (R_i − M_i) + M(ω). Pixels whose functions are spikes that direct light does not
explain, as a mirror's, take weights that are never below 0 (`spike_interpolation`). The model and the weights of a
pixel depend on the field alone, so a picture is linear in the light of given directions; with directions that
`quadtree_lights` chose for a map, up to that choice.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from time import perf_counter

import numpy as np

from relume.cluster.attempt import threads as worker_threads
from relume.lightstage.blocks import Cluster, by_bands
from relume.lightstage.direct_light.light_directions import DirectedLight
from relume.lightstage.direct_light.model import (
    DirectLightSettings,
    DirectModel,
    direct_model,
    direct_picture,
    left_over,
)
from relume.lightstage.direct_light.surface import Geometry
from relume.lightstage.field.field import ReflectanceField
from relume.lightstage.relighting.relighting import MEMORY, Progress, cut
from relume.scene.shapes.shapes import Mesh

_LIGHT_BYTES = 96
"""Bytes that each light and pixel of a block of rows takes, with what is computed from them."""
_TIMED_PLACES, _TIMED_PIXELS, _TIMED_LIGHTS = 3, 2048, 100


def relight_with_mesh(
    source: ReflectanceField,
    light: DirectedLight,
    geometry: Sequence[Mesh],
    settings: DirectLightSettings = DirectLightSettings(),
    progress: Progress | None = None,
    *,
    threads: int | None = None,
    memory: int = MEMORY,
    cluster: Cluster = None,
    place: Path | str | None = None,
) -> np.ndarray:
    """The picture (H, W, 3) float32 under light from many directions, with direct light computed on a mesh.

    The picture under several lights together is the sum of their pictures, to rounding.

    light : as `quadtree_lights` makes it from a map
    geometry : meshes of the subject in the stage's frame
    threads : every core unless given
    memory : bytes that a block of rows may take; they change no more than the last bits
    cluster, place : whose workers do the blocks, and where these lie (`blocks.by_bands`)
    Raises ValueError for a mesh without a camera or outside the picture, and for less memory than a row takes.
    """
    # For what direct light leaves over.
    irradiances, spike_irradiances = (
        by.gathered(source.lights, light.directions, light.irradiances)
        for by in (settings.remainder, settings.spike_interpolation)
    )
    blocks = row_blocks(source, memory)
    alpha = direct_model(source, geometry, settings, threads).alpha
    shared = _OnMesh(
        source, light, tuple(geometry), replace(settings, alpha=alpha), threads, irradiances, spike_irradiances,
        # Of several blocks each says that it is done; one would be silent to its end.
        progress if len(blocks) == 1 and cluster is None and place is None else None,
    )  # fmt: skip
    made = by_bands(_lit_rows, shared, blocks, cluster=cluster, place=place, progress=progress, memory=memory)
    return made.whole("radiance")


@dataclass(frozen=True, eq=False)
class _OnMesh:
    """What every block of rows needs: the arguments of `relight_with_mesh`, and the irradiances of what is left over.

    settings : with the width of gloss that was found in all of the field
    progress : of the directions of a block
    """

    source: ReflectanceField
    light: DirectedLight
    geometry: tuple[Mesh, ...]
    settings: DirectLightSettings
    threads: int | None
    irradiances: np.ndarray
    spike_irradiances: np.ndarray
    progress: Progress | None = None

    @cached_property
    def model(self) -> DirectModel:
        """Made once in each process."""
        own = self.threads if self.threads is not None else worker_threads()
        camera, alpha = self.source.camera, self.settings.alpha
        assert camera is not None and alpha is not None
        return DirectModel(self.source, Geometry.of(self.geometry), camera, self.settings, alpha, own)


def _lit_rows(shared: _OnMesh, rows: slice) -> dict[str, np.ndarray]:
    """The rows of the picture."""
    model = shared.model
    wide, samples = model.samples(rows)
    left, scales = left_over(model, samples, wide, rows, shared.irradiances, shared.spike_irradiances)
    lit = direct_picture(model, samples, wide, rows, shared.light, shared.progress)
    direct = np.einsum("bkc,kbc->kc", lit, scales)
    return {"radiance": (left + direct).reshape(-1, shared.source.shape[1], 3).astype(np.float32)}


def row_blocks(source: ReflectanceField, memory: int) -> tuple[slice, ...]:
    """The rows of a field that are relit at once with so many bytes; raises ValueError where one row takes more."""
    height, width = source.shape
    row = len(source.lights) * width * _LIGHT_BYTES
    # Pixels gather light from the rows beside them too.
    step = int(memory // row) - 2
    if step < 1:
        raise ValueError(
            f"memory is {memory / 1e6:.1f} MB; rows of {width} pixels under {len(source.lights)} lights need at least "
            f"{np.ceil(3 * row / 1e5) / 10:.1f} MB"
        )
    return cut(height, step)


def estimate_seconds(
    source: ReflectanceField,
    light: DirectedLight,
    geometry: Sequence[Mesh],
    settings: DirectLightSettings = DirectLightSettings(),
    *,
    threads: int | None = None,
) -> float:
    """About how long `relight_with_mesh` takes with a mesh: some rows are fitted and lit by some directions.

    Raises ValueError as `relight_with_mesh`.
    """
    begin = perf_counter()
    model = direct_model(source, geometry, settings, threads)
    once, height = perf_counter() - begin, source.shape[0]
    size = min(height, -(-_TIMED_PIXELS // source.shape[1]))
    places = np.unique(np.linspace(0, height - size, _TIMED_PLACES + 2).astype(int)[1:-1])
    some = slice(0, len(light.directions), max(1, len(light.directions) // _TIMED_LIGHTS))
    few = DirectedLight(light.directions[some], light.irradiances[some], light.radii[some], light.looked_at()[some])
    fitting, lighting, timed = 0.0, 0.0, 0
    for place in places:
        rows = slice(int(place), int(place) + size)
        first = perf_counter()
        wide, samples = model.samples(rows)
        model.fitted(samples, wide, rows)
        second = perf_counter()
        direct_picture(model, samples, wide, rows, few)
        fitting, lighting = fitting + second - first, lighting + perf_counter() - second
        timed += wide.stop - wide.start
    lighting *= len(light.directions) / max(len(few.directions), 1)
    return once + (fitting + lighting) * height / timed
