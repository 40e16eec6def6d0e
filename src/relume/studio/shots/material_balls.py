"""The materials of the Objects pane: balls under the measured light, made once for each light, view and material."""

from __future__ import annotations

import hashlib
import threading
import warnings
from pathlib import Path
from typing import Any

import numpy as np

import relume as rl


class MaterialBalls:
    """The balls that were asked for last; safe to use from several threads."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._pixels: tuple[str, bytes] = ("", b"")

    def facts(self, shot: Path, light: Path, camera: rl.Camera, out: Path) -> dict[str, Any]:
        """The balls' names, materials and size for JSON, and the digest that their pixels are asked for by.

        light : as it was measured; out : the folder of results, whose stages the balls are kept with
        Raises RelumeError, ValueError.
        """
        with self._lock, warnings.catch_warnings():
            warnings.simplefilter("ignore")  # a mesh's doubts are said where it is dropped and rendered
            balls = rl.report.material_balls(rl.read_shot(shot), rl.read_environment(light), camera, out)
            pixels = b"".join(_pixels(ball) for ball in balls)
            digest = hashlib.blake2b(pixels, digest_size=8).hexdigest()
            self._pixels = digest, pixels
        shown = [
            {"name": each.name, "table": each.table, "object": each.object, "left_out": list(each.left_out)}
            for each in balls
        ]
        return {"size": len(balls[0].matte), "digest": digest, "balls": shown}

    def pixels(self, digest: str) -> bytes:
        """Radiance and matte of all balls, four little-endian floats a pixel; raises LookupError once others came."""
        known, pixels = self._pixels
        if digest != known:
            raise LookupError
        return pixels


def _pixels(ball: rl.report.MaterialBall) -> bytes:
    return np.concatenate([ball.radiance, ball.matte[..., None]], axis=-1).astype("<f4").tobytes()
