"""An open light stage: its field in memory, live pictures, `relight`'s own pictures, and maps of its surface."""

from __future__ import annotations

import threading
import warnings
from collections import OrderedDict
from collections.abc import Callable, Sequence
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

import relume as rl
from relume.studio.pictures import halved
from relume.studio.stage.lighting import Light

MOST_SIDE = 1024
"""Pixels along the longer side of live pictures; larger stages are halved until they fit."""
MOST_BYTES = 3 * 1024**3
"""Of a field in memory as float32."""
KEPT = 12
"""Pictures kept for reading pixels."""
SMALL_MEMORY = 1 << 26
"""Of a field at half its size, compressed at once."""

Sum = Callable[[np.ndarray], rl.RadianceMap]
"""A picture from the lights' irradiances (N, 3)."""


class OpenStage:
    """A stage and the maps that may light it; safe to use from several threads.

    It is read and compressed behind the page; live pictures come from the field itself until that is done.
    """

    def __init__(self, path: Path, maps: Sequence[Path]) -> None:
        self.path, self.map_files = path, tuple(maps)
        self.step, self.share, self.failed, self.notes = "reading the stage", 0.0, "", list[str]()
        self.reduced, self.axes = 1, np.eye(3)
        self.field: rl.lightstage.Pictures | None = None
        self.live: rl.lightstage.LiveField | None = None
        self._sum: Sum | None = None  # of the field; what is quickest so far
        self._small_sum: Sum | None = None  # at half its size
        self._maps: dict[int, rl.EnvironmentMap] = {}
        self._turning: dict[int, rl.lightstage.TurningMap] = {}
        self._pictures: OrderedDict[str, np.ndarray] = OrderedDict()
        self._count, self._exact_wish = 0, 0
        self._changing, self._mapping, self._exact, self._surface = (threading.Lock() for _ in range(4))
        self._preparing = threading.Lock()

    def start(self) -> None:
        """Read and compress it in a thread of its own, which ends with the process."""
        threading.Thread(target=self._prepare, daemon=True, name="stage").start()

    def _prepare(self) -> None:
        def report(share: float) -> None:
            self.share = share

        try:
            with warnings.catch_warnings(record=True) as caught:
                warnings.simplefilter("always")
                self.field = self._read()
                self.step, self.share = "making pictures under a grid of lights", 0.0
                live = rl.lightstage.live_field(self.field, progress=report)
                self.live, self._sum, self.step, self.share = live, live.relight, "compressing", 0.0
                # First what is done soonest. What a first picture compiles is compiled before it is asked for.
                nothing = np.zeros((len(live.lights), 3))
                small = rl.lightstage.compress_cosine(_halved_field(live.field), memory=SMALL_MEMORY).relight
                small(nothing)
                self._small_sum = small
                self.live = live.compress(progress=report)
                self._sum = self.live.relight
                self.notes += [str(each.message) for each in caught]
            self.step, self.share = "ready", 1.0
        except (rl.RelumeError, ValueError) as error:
            self.failed = " ".join(str(error).split())

    def _read(self) -> rl.lightstage.Pictures:
        """The field in memory, halved until it fits."""
        stage = rl.lightstage.read_stage(self.path)
        self.axes = np.eye(3) if stage.camera is None else stage.camera.rotation
        (height, width), count = stage.shape, len(stage.lights)
        while max(height, width) > MOST_SIDE or count * height * width * 12 > MOST_BYTES:
            height, width, self.reduced = -(-height // 2), -(-width // 2), 2 * self.reduced
        values = np.empty((count, height, width, 3), np.float32)
        for light in range(count):
            (picture,) = stage.block(slice(light, light + 1), slice(0, stage.shape[0]))
            for _ in range(self.reduced.bit_length() - 1):
                picture = halved(picture)
            values[light], self.share = picture, (light + 1) / count
        # A camera of another size, and noise of means, would be wrong of a smaller picture.
        whole = self.reduced == 1
        return rl.lightstage.Pictures(
            values, stage.lights, stage.camera if whole else None, stage.noise if whole else None
        )

    # What the page asks.

    def facts(self) -> dict[str, Any]:
        """What is known of it so far, for JSON."""
        found: dict[str, Any] = {
            "name": self.path.name, "path": str(self.path), "step": self.step, "share": self.share,
            "failed": self.failed, "notes": self.notes, "maps": [{"name": each.name} for each in self.map_files],
        }  # fmt: skip
        if self.field is None or self.live is None:
            return found
        error = self.live.error
        found |= {
            "size": [self.field.shape[1], self.field.shape[0]], "reduced": self.reduced,
            "lights": np.round(self.field.lights.directions, 5).tolist(),
            "axes": self.axes.tolist(),
            "error": None if error is None else {"random": error.random, "single": error.single},
            "surface": sorted(self.surface_if_there()),
        }  # fmt: skip
        return found

    def live_picture(self, light: Light, *, small: bool = False) -> np.ndarray:
        """The picture (H, W, 3) float32 while the light is moved; raises LookupError before there is one.

        small : at half its size, where that is known already, for who draws slowly
        """
        if self.live is None or self._sum is None:
            raise LookupError
        relit = (small and self._small_sum) or self._sum
        given = np.zeros((len(self.live.lights), 3))
        if light.map is not None:
            given += 2.0**light.stops * self._turning_map(light.map).irradiances(float(np.radians(light.turn)))
        if light.lamps:
            lamps = rl.lightstage.StageLighting(light_sets=(light.constellation(),))
            given += lamps.irradiances(self.live.lights)
        if not given.any():
            return np.zeros((*self.live.field.shape, 3), np.float32)
        return relit(given).radiance

    def exact_picture(self, light: Light) -> np.ndarray | None:
        """`rl.lightstage.relight`'s own picture of it; None where another was asked for meanwhile."""
        if self.field is None:
            raise LookupError
        with self._changing:
            self._exact_wish += 1
            wish = self._exact_wish
        with self._exact:
            if wish != self._exact_wish:
                return None
            lighting = light.lighting([self.map(number) for number in range(len(self.map_files))])
            if lighting is None:
                return np.zeros((*self.field.shape, 3), np.float32)
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")  # of each picture the same: the command says them
                return rl.lightstage.relight(self.field, lighting).radiance

    def map(self, number: int) -> rl.EnvironmentMap:
        """A map as it was when it was first asked for; raises LookupError, UnreadableFile."""
        if not 0 <= number < len(self.map_files):
            raise LookupError
        with self._mapping:
            if number not in self._maps:
                with warnings.catch_warnings():
                    warnings.simplefilter("ignore")
                    self._maps[number] = rl.read_environment(self.map_files[number])
            return self._maps[number]

    def map_picture(self, number: int) -> np.ndarray:
        """A map to look at, (64, 128, 3) float32, lat-long."""
        return self.map(number).remapped(rl.mappings.mapping_named("latlong"), 64).radiance

    def _turning_map(self, number: int) -> rl.lightstage.TurningMap:
        light, live = self.map(number), self.live
        assert live is not None
        with self._preparing:  # once, though two pictures are asked for at once
            if number not in self._turning:
                self._turning[number] = rl.lightstage.turning_map(live.lights, light)
            return self._turning[number]

    def surface_if_there(self) -> dict[str, np.ndarray]:
        """The maps of the surface to look at, where they were measured."""
        return self.__dict__.get("_surface_pictures", {})

    def surface(self) -> dict[str, np.ndarray]:
        """Normals, albedo and gloss as pictures (H, W, 3), measured when they are first asked for."""
        if self.field is None:
            raise LookupError
        with self._surface:
            return self._surface_pictures

    @cached_property
    def _surface_pictures(self) -> dict[str, np.ndarray]:
        assert self.field is not None
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            return rl.lightstage.measure_surface(self.field).pictures()

    # Pictures that were handed out, for their pixels.

    def keep(self, picture: np.ndarray) -> str:
        """The name under which its pixels can be read for a while."""
        with self._changing:
            self._count += 1
            name = str(self._count)
            self._pictures[name] = picture
            while len(self._pictures) > KEPT:
                self._pictures.popitem(last=False)
        return name

    def kept(self, name: str) -> np.ndarray:
        """A picture that was handed out; raises LookupError where it is gone."""
        with self._changing:
            return self._pictures[name]


def _halved_field(field: rl.lightstage.Pictures) -> rl.lightstage.Pictures:
    """The same at half its size, each pixel the mean of 2 × 2."""
    height, width = field.shape
    values = np.empty((len(field.lights), -(-height // 2), -(-width // 2), 3), np.float32)
    for picture, result in zip(field.values, values, strict=True):
        result[:] = halved(picture)
    return rl.lightstage.Pictures(values, field.lights)


def is_stage(path: Path) -> bool:
    """Whether a path is a light stage: a folder with stage.json or an .lp, one of these, or a store of one."""
    if path.is_file():
        return path.suffix.lower() == ".lp" or path.name == "stage.json"
    if not path.is_dir():
        return False
    try:
        described = (path / "zarr.json").read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError):
        described = ""
    listed = any(each.suffix.lower() == ".lp" and each.is_file() for each in path.iterdir())
    return (path / "stage.json").is_file() or listed or '"relume' in described
