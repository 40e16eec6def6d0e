"""A large plate's change, rendered tile by tile: rays where the change is, and no more memory than a tile takes.

Noise is seen in the picture that is looked at, whose pixels are means of many of a large plate's. So the rays of a
picture of a screen's size are spread over all pixels of a larger one, the tiles getting theirs by how noisy a small
render shows them to be; edges and reflections are as fine as the plate's own pixels. Each tile is denoised by itself,
with a border that its neighbours show too, and put away at once.
"""

from __future__ import annotations

import pickle
from collections.abc import Callable, Iterator
from dataclasses import dataclass, fields, replace
from math import ceil, sqrt
from pathlib import Path
from shutil import disk_usage
from typing import Any

import numpy as np

from relume.cluster.attempt import threads as worker_threads
from relume.cluster.renaming import remove
from relume.errors import CannotResume, Doubt, GatheredDoubts, OutputNotWritten, warn
from relume.image.files import replacing
from relume.project.stages import Stages
from relume.renderers.mitsuba.differential import Differential
from relume.renderers.mitsuba.path_tracer import require_here
from relume.renderers.progressive.accumulation import Preview, RenderSession, forget, pass_seed
from relume.renderers.progressive.allocation import weighed_variance
from relume.renderers.progressive.graceful_shutdown import HardStop
from relume.renderers.progressive.pass_workers import PassWorkers
from relume.renderers.renderer import Moments
from relume.renderers.results import Change
from relume.scene.cameras.camera import Camera
from relume.scene.motion.keyframes import Shutter
from relume.scene.scene import Scene

VIEWED = 2_000_000
"""Pixels of the picture that is looked at: a screen of 1920 × 1080 shows no more, and noise that is finer than its
pixels averages out in them. Larger pictures are traced in tiles with as many rays as this one."""
SIDE = 1024
"""Pixels along a tile: its sums and the rays of a pass take half a gigabyte."""
BORDER = 32
"""Pixels that a tile is rendered and denoised beyond its edges, so that no seam shows: the denoiser looks as far."""
PILOT, PILOT_RAYS = 200_000, 16
"""Pixels and rays a pixel of the small render that shows where the change is; two seconds of two cores."""
FEWEST, LEAST = 4, 2
"""Rays a pixel of a tile in which anything changes: edges are then steps of a quarter before the denoiser. And of one
in which the small render met no change at all, for its depth, and for what is too small to be met."""

Finish = Callable[[Change], Change]
"""What is done with a tile's change before it is put away."""
KEPT = 2
"""Times the picture's planes that the disk holds beside them: the tiles, and the whole as a kept step."""


@dataclass(frozen=True)
class Tile:
    """A part of the picture: rows and columns that it fills, and those it is rendered with."""

    top: int
    left: int
    bottom: int
    right: int

    def with_border(self, height: int, width: int) -> Tile:
        """The same with its border, within the picture; all of one size, so that the memory of one does for all."""
        down, across = (min(ceil(side / ceil(side / SIDE)) + 2 * BORDER, side) for side in (height, width))
        top = min(max(self.top - BORDER, 0), height - down)
        left = min(max(self.left - BORDER, 0), width - across)
        return Tile(top, left, top + down, left + across)

    def window(self, camera: Camera) -> Camera:
        """What a camera sees in it."""
        return camera.window(self.left, self.top, self.right - self.left, self.bottom - self.top)

    @property
    def place(self) -> tuple[slice, slice]:
        """Its pixels in the picture."""
        return slice(self.top, self.bottom), slice(self.left, self.right)

    def within(self, larger: Tile) -> tuple[slice, slice]:
        """Its pixels in a larger tile."""
        top, left = self.top - larger.top, self.left - larger.left
        return slice(top, top + self.bottom - self.top), slice(left, left + self.right - self.left)


def is_large(camera: Camera) -> bool:
    """Whether a picture has more pixels than are looked at one by one."""
    return camera.width * camera.height > VIEWED


def change_in_tiles(
    renderer: Differential,
    scene: Scene,
    camera: Camera,
    plate: np.ndarray,
    *,
    seed: int,
    made_from: object,
    stages: Stages,
    watch: RenderSession,
    finish: Callable[[tuple[slice, slice]], Finish],
    first: Preview | None,
    progress: Callable[[float], None],
    moments: Moments | None = None,
    shutter: Shutter = Shutter(0.0, 0.0),
) -> Change:
    """What the scene's objects change of a large picture, finished tile by tile.

    plate : (H, W, 3) what is seen without them
    made_from : what the pixels depend on, for tiles that an interrupted render has put away
    stages : where tiles are kept until all are there
    finish : given a tile's rows and columns in the plate, what is done with its change: denoising, or nothing; for
        workers a value that pickles
    first : is shown the small render as it grows
    moments, shutter : as in `Differential.change`
    Raises as `Differential.change` does.
    """
    # The scene is made ready once; what it is seen through changes.
    height, width = camera.height, camera.width
    tiles = list(_tiles(height, width))
    if watch.workers is not None:
        renderer = renderer.for_workers()
    if watch.restart:
        forget_tiles(stages)

    prepared = renderer.prepare(scene, camera)

    def part(seen_by: Callable[[Camera], Camera]) -> dict[str, Any]:
        """What is rendered through another part of the camera's picture."""
        seen = None
        if moments is not None:
            seen = lambda time, at=moments: _through(at(time), seen_by)  # noqa: E731
        return {"camera": seen_by(camera), "moments": seen, "shutter": shutter, "prepared": prepared}

    # A small render shows where the change is and how noisy.
    side = sqrt(PILOT / (height * width))
    across, down = max(1, round(width * side)), max(1, round(height * side))
    few = replace(renderer, samples=min(PILOT_RAYS, renderer.samples), noise=None)
    pilot = few.change(
        scene, **part(lambda its: its.resized(across, down)), seed=pass_seed(seed, len(tiles)),
        watch=replace(watch, checkpoint=None, preview=first, workers=None),
    )  # fmt: skip
    shares, _ = shares_of_tiles(pilot, plate[np.ix_(*_places(pilot, camera))], camera, renderer.samples)
    noise = None if renderer.noise is None else renderer.noise * sqrt(height * width / VIEWED)
    # Each tile with its border, put away as soon as it is finished.
    jobs = [
        TileJob(index, tile.with_border(height, width), replace(renderer, samples=samples, noise=noise),
                pass_seed(seed, index), made_from, watch.checkpoint and watch.checkpoint.absolute(), watch.restart)
        for index, (tile, samples) in enumerate(zip(tiles, shares, strict=True))
    ]  # fmt: skip
    if watch.workers is not None:
        shared = SharedByTiles(renderer, scene, camera, stages.folder.absolute())
        _by_workers(watch.workers, shared, jobs, plate, finish, progress)
    whole, traced = _empty(height, width, stages), 0
    doubts: list[Doubt] = []
    begun = np.concatenate([[0], np.cumsum(shares)]) / sum(shares)
    for job, tile in zip(jobs, tiles, strict=True):

        def report(share: float, index: int = job.index) -> None:
            low, high = begun[index : index + 2]
            if watch.workers is None:  # else the tiles are there
                progress(float(low + share * (high - low)))

        change, said = job.kept(
            stages, scene, part(job.tile.window), plate[job.tile.place], finish(job.tile.place), watch.force, report
        )
        doubts += said
        for field in fields(Change):
            plane = getattr(whole, field.name)
            if isinstance(plane, np.ndarray):
                plane[tile.place] = getattr(change, field.name)[tile.within(job.tile)]
        stages.mapped.release()
        traced += change.samples * (tile.bottom - tile.top) * (tile.right - tile.left)
        report(1.0)
    progress(1.0)
    _warn_once(doubts, len(tiles), renderer)
    return replace(whole, samples=ceil(traced / (height * width)))


@dataclass(frozen=True)
class TileJob:
    """One tile that is to be rendered, finished and put away, in whatever process.

    tile : with its border
    renderer : with the tile's own rays
    made_from : what the whole picture's pixels depend on
    checkpoint : of the whole picture; None keeps no state
    """

    index: int
    tile: Tile
    renderer: Differential
    seed: int
    made_from: object
    checkpoint: Path | None
    restart: bool

    def kept(
        self, stages: Stages, scene: Scene, seen: dict[str, Any], plate: np.ndarray, finish: Finish,
        force: HardStop | None, progress: Callable[[float], None],
    ) -> tuple[Change, tuple[Doubt, ...]]:  # fmt: skip
        """The tile's change and what rendering it warned of; made now, unless it is among the stages.

        seen : through what the scene is seen, as `Differential.change` takes it
        plate : the tile's part of it
        """
        path = None if self.checkpoint is None else self.checkpoint.with_suffix(f".tile_{self.index:03d}")
        session = RenderSession(path, self.restart, force=force)

        def make() -> tuple[Change, tuple[Doubt, ...]]:
            # Its warnings are put away with it, for a render that goes on.
            with GatheredDoubts() as gathered:
                change = _begun_anew_if_another(session, lambda watch: self.renderer.change(
                    scene, **seen, seed=self.seed, watch=watch, plate=plate, progress=progress,
                ))  # fmt: skip
                change = finish(change)
            return change, gathered.doubts

        made_from = [self.made_from, self.index, self.renderer.samples]
        made, _ = stages.get(f"render_tile_{self.index:03d}", made_from, make)
        forget(session)
        return made


@dataclass(frozen=True, eq=False)
class SharedByTiles:
    """What all tiles share, for workers: each tile is a part, by the file with its job, its plate and its finish.

    folder : of the stages
    """

    renderer: Differential
    scene: Scene
    camera: Camera
    folder: Path

    def ready(self) -> Callable[[Path], dict[str, np.ndarray]]:
        """The function that makes and keeps one tile, and says nothing of it."""
        require_here(self.renderer.variant)
        threads = self.renderer.threads or worker_threads()
        prepared = replace(self.renderer, threads=threads).prepare(self.scene, self.camera)
        stages = Stages(self.folder)

        def make(path: Path) -> dict[str, np.ndarray]:
            job, plate, finish = pickle.loads(path.read_bytes())
            job = replace(job, renderer=replace(job.renderer, threads=self.renderer.threads or worker_threads()))
            seen = {"camera": job.tile.window(self.camera), "prepared": prepared}
            job.kept(stages, self.scene, seen, plate, finish, None, lambda share: None)
            stages.mapped.release()
            return {}

        return make


def _by_workers(
    workers: PassWorkers, shared: SharedByTiles, jobs: list[TileJob], plate: np.ndarray,
    finish: Callable[[tuple[slice, slice]], Finish], progress: Callable[[float], None],
) -> None:  # fmt: skip
    """Have all tiles put away among the stages. Raises Incomplete where some were not; the others stay."""
    with workers.sharing(shared) as parts:
        files: list[Path] = []
        for job in jobs:
            files.append(parts.folder / f"tile_{job.index:03d}.pickle")
            with replacing(files[-1]) as temporary:
                place = job.tile.place
                temporary.write_bytes(pickle.dumps((job, np.array(plate[place]), finish(place))))
        parts.traced(
            files, [f"part {job.index + 1} of the picture" for job in jobs],
            progress=lambda done, failed, to_go, left: progress(0.99 * (done + failed) / len(jobs)),
        )  # fmt: skip


def _begun_anew_if_another(session: RenderSession, render: Callable[[RenderSession], Change]) -> Change:
    """A part of the picture, without what another render left of it; the parts that are done stay."""
    try:
        return render(session)
    except CannotResume as error:
        what = str(error).partition(";")[0]
        warn(f"cannot resume the saved render: {what}; that part of the picture starts over")
        return render(replace(session, restart=True))


def _warn_once(doubts: list[Doubt], tiles: int, renderer: Differential) -> None:
    """What tiles warned of, each once; of a noise that some did not reach, how many those were."""
    missed = [doubt for doubt in doubts if "was not reached" in doubt.line]
    for doubt in dict.fromkeys(doubt for doubt in doubts if doubt not in missed):
        warn(doubt.line, doubt.effect)
    if missed:
        warn(
            f"the noise asked for, {renderer.noise:g}, was not reached in {len(missed)} of {tiles} parts "
            f"of the picture with {renderer.samples} samples; give more samples"
        )


def _through(moment: tuple[Scene, Camera], seen_by: Callable[[Camera], Camera]) -> tuple[Scene, Camera]:
    return moment[0], seen_by(moment[1])


def forget_tiles(stages: Stages) -> None:
    """Remove the tiles, once the picture that they are parts of is safe."""
    for path in stages.folder.glob("render_tile_*.npz"):
        remove(path)


def _tiles(height: int, width: int) -> Iterator[Tile]:
    """The picture in parts of about SIDE, row by row, as even as may be."""
    down, across = ceil(height / SIDE), ceil(width / SIDE)
    for row in range(down):
        for column in range(across):
            yield Tile(
                row * height // down, column * width // across,
                (row + 1) * height // down, (column + 1) * width // across,
            )  # fmt: skip


def shares_of_tiles(
    pilot: Change, plate: np.ndarray, camera: Camera, samples: int
) -> tuple[list[int], list[int]]:  # fmt: skip
    """Rays a pixel of each tile of a large picture, and the tile's pixels, by what a small render shows.

    plate : (h, w, 3) of the small render's size, what is seen without the objects
    """
    tiles = list(_tiles(camera.height, camera.width))
    areas = [(tile.bottom - tile.top) * (tile.right - tile.left) for tile in tiles]
    return _rays(pilot, plate, camera, tiles, samples), areas


def _rays(pilot: Change, plate: np.ndarray, camera: Camera, tiles: list[Tile], samples: int) -> list[int]:
    """Rays a pixel of each tile: in proportion to the standard deviation (Neyman 1934)."""
    rows, columns = _places(pilot, camera)
    backdrop = (1 - pilot.matte[..., None]) * plate
    variance = pilot.objects_variance + pilot.difference_variance
    error = np.sqrt(weighed_variance(pilot.objects + pilot.difference + backdrop, variance))
    touched = (pilot.matte > 0) | np.any(pilot.difference != 0, axis=-1)
    means = []
    for tile in tiles:
        # A small pixel more on each side, for what begins between two.
        larger = tile.with_border(camera.height, camera.width)
        top, bottom = np.searchsorted(rows, [larger.top, larger.bottom])
        left, right = np.searchsorted(columns, [larger.left, larger.right])
        part = slice(max(top - 1, 0), bottom + 1), slice(max(left - 1, 0), right + 1)
        means.append(float(error[part].mean()) if touched[part].any() else 0.0)
    areas = np.array([(tile.bottom - tile.top) * (tile.right - tile.left) for tile in tiles])
    noisy, budget = np.array(means), float(samples * VIEWED)
    each = budget * noisy / max(float((noisy * areas).sum()), 1e-30)
    fewest = [min(FEWEST if mean > 0 else LEAST, samples) for mean in means]
    return [int(np.clip(round(n), low, samples)) for n, low in zip(each, fewest, strict=True)]


def _places(pilot: Change, camera: Camera) -> tuple[np.ndarray, np.ndarray]:
    """The rows and columns of the large picture in the middle of each pixel of the small one."""
    height, width = pilot.matte.shape
    rows = np.minimum(((np.arange(height) + 0.5) * camera.height / height).astype(int), camera.height - 1)
    return rows, np.minimum(((np.arange(width) + 0.5) * camera.width / width).astype(int), camera.width - 1)


def _require_room(folder: Path, needed: int) -> None:
    """Raise OutputNotWritten where the disk would be full after hours of tracing."""
    # What an earlier run left counts as room: it is part of what is needed.
    free = disk_usage(folder).free + sum(path.stat().st_size for path in folder.glob("render_tile_*.npz"))
    if free < needed:
        raise OutputNotWritten(
            f"{folder}: {needed / 1e9:.1f} GB are needed while a picture of this size is rendered, and "
            f"{free / 1e9:.1f} are free; make room, or choose another place"
        )


def _empty(height: int, width: int, stages: Stages) -> Change:
    """A change of nothing, whose planes are beside the stages on disk and not in memory."""
    stages.folder.mkdir(parents=True, exist_ok=True)
    objects, difference, normal, albedo, objects_variance, difference_variance = stages.mapped.zeros(
        stages.folder, [(height, width, 3)] * 6
    )
    matte, depth = stages.mapped.zeros(stages.folder, [(height, width)] * 2)
    _require_room(stages.folder, KEPT * (6 * 3 + 2) * 4 * height * width)
    return Change(objects, difference, matte, depth, normal, albedo, objects_variance, difference_variance)
