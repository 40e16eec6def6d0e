"""A camera in Dr.Jit: rays through its pixels, and where on the picture a point is seen."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from relume.renderers.mitsuba.transport import opaque
from relume.scene.cameras.camera import Camera

ROW_STEPS = 5
"""Repetitions to find the row that shows a point: each leaves a tenth of the error of a pan by a tenth of the picture.
"""
FAR = 1e5
"""Metres: the plane in focus of a lens that is focused at infinity."""


class Lens:
    """A camera with its distortion, its aperture and its rolling shutter."""

    def __init__(self, camera: Camera) -> None:
        self.camera = camera
        self.across, self.down = map(opaque.number, camera.principal_point)
        self.width, self.height = opaque.number(camera.width), opaque.number(camera.height)
        self.focus, self.focal_length = opaque.number(min(float(camera.focus), FAR)), opaque.number(camera.focal_length)
        self.turn, self.back = opaque.matrix(camera.rotation), opaque.matrix(camera.rotation.T)
        self.place = opaque.point(camera.position)
        self.aperture = opaque.number(camera.aperture)
        self.straight = None if camera.distortion is None else _straight(camera)
        self.rows = None if camera.rolling is None else _Rows(camera)

    def rays(self, x: Any, y: Any, aperture: Any) -> Any:
        """Rays through pixel coordinates; `aperture`, two numbers from 0 to 1, is where they go through the lens."""
        camera = self.camera
        if self.straight is None:
            across, up = (x - self.across) / self.focal_length, (self.down - y) / self.focal_length
        else:
            # Corner samples of the pixels, so that what lies between is within a thousandth of a pixel.
            u, v = (x + 0.5) / (self.width + 1), (y + 0.5) / (self.height + 1)
            across, up = self.straight.eval(mi.Point2f(u, v))
        towards, origin = mi.Vector3f(across, up, -1), self._on_lens(aperture)
        if camera.aperture > 0:
            towards = self.focus * towards - origin
        begin, way = self.turn @ origin, self.turn @ towards
        if self.rows is None:
            return mi.Ray3f(self.place + begin, dr.normalize(way))
        share = self.rows.share(y)
        start = self.place + self.rows.moved(share) + self.rows.turned(begin, share)
        return mi.Ray3f(start, dr.normalize(self.rows.turned(way, share)))

    def _on_lens(self, aperture: Any) -> Any:
        """Where a ray goes through the lens, from its middle and in the camera's frame."""
        if not self.camera.aperture > 0:
            return mi.Vector3f(0)
        disc = self.aperture * mi.warp.square_to_uniform_disk_concentric(aperture)
        return mi.Vector3f(disc.x, disc.y, 0)

    def seen_at(self, si: Any, aperture: Any, active: Any) -> tuple[Any, Any, Any]:
        """Where a point is seen, the picture's density there as a share of radiance, and the way to the camera.

        The share is f²/(cos³θ·r²): square pixels for a square metre that faces the camera, of what leaves it.
        """
        if self.rows is None:
            return self._seen_by(si, aperture, active, None)
        # The row that shows the point, which says where the camera was.
        share = mi.Float(0)
        for _ in range(ROW_STEPS):
            share = self.rows.share(self._seen_by(si, aperture, active, share)[0].y)
        return self._seen_by(si, aperture, active, share)

    def _seen_by(self, si: Any, aperture: Any, active: Any, share: Any) -> tuple[Any, Any, Any]:
        """`seen_at` at a share of the readout; None where all rows are of one moment."""
        camera, origin = self.camera, self._on_lens(aperture)
        lens = self.turn @ origin
        if self.rows is None:
            way = self.place + lens - si.p
            local = self.back @ -way
        else:
            way = self.place + self.rows.moved(share) + self.rows.turned(lens, share) - si.p
            local = self.back @ self.rows.turned(-way, share, back=True)
        depth = -local.z
        ahead = active & (depth > 1e-3)
        across, up = local.x / depth, local.y / depth
        if camera.aperture > 0:
            # Through the plane in focus, which the middle of the lens shows where the picture has it.
            across, up = across + origin.x / self.focus, up + origin.y / self.focus
        cosine, distance = depth / dr.norm(local), dr.norm(way)
        stretch = mi.Float(1)
        if camera.distortion is not None:
            across, down, stretch, upright = _distorted(camera, across, -up)
            up = -down
            ahead &= upright
        x = self.across + self.focal_length * across
        y = self.down - self.focal_length * up
        ahead &= (x >= 0) & (x < self.width) & (y >= 0) & (y < self.height)
        factor = dr.square(self.focal_length / distance) * stretch / (cosine * cosine * cosine)
        back = si.spawn_ray(way / distance)
        back.maxt = distance * (1 - 1e-4)
        return mi.Point2f(x, y), dr.select(ahead, factor, 0), back


class _Rows:
    """`RollingShutter` in Dr.Jit."""

    def __init__(self, camera: Camera) -> None:
        rolling = camera.rolling
        assert rolling is not None
        self.middle, self.rows = opaque.number(rolling.middle), opaque.number(rolling.rows)
        self.moves = [opaque.point(each) for each in rolling.moves]
        self.turns = [opaque.point(each) for each in rolling.turns]

    def share(self, y: Any) -> Any:
        return dr.clip((y - self.middle) / self.rows, -1.5, 1.5)

    def moved(self, share: Any) -> Any:
        return mi.Vector3f(share * self.moves[0] + share * share * self.moves[1])

    def turned(self, way: Any, share: Any, back: bool = False) -> Any:
        vector = mi.Vector3f(share * self.turns[0] + share * share * self.turns[1])
        angle = dr.norm(vector)
        axis = vector / dr.maximum(angle, 1e-12)
        sine, cosine = dr.sincos(-angle if back else angle)
        along = dr.dot(axis, way) * axis
        return along + (way - along) * cosine + dr.cross(axis, way) * sine


def _straight(camera: Camera) -> Any:
    """The slopes of the undistorted rays, right and up, at the corners of all pixels."""
    x, y = np.meshgrid(np.arange(camera.width + 1.0), np.arange(camera.height + 1.0))
    still = replace(camera, rolling=None)
    local = still.rays_through(np.stack([x, y], axis=-1)) @ camera.rotation
    slopes = local[..., :2] / -local[..., 2:]
    pixels = mi.TensorXf(slopes.astype(np.float32))
    return mi.Texture2f(pixels, wrap_mode=dr.WrapMode.Clamp, use_accel=False)  # pyright: ignore[reportCallIssue]


def _distorted(camera: Camera, x: Any, y: Any) -> tuple[Any, Any, Any, Any]:
    """`Distortion.distorted` in Dr.Jit; also by how much it stretches areas, and whether it has not folded over."""
    bent = camera.distortion
    assert bent is not None
    k1, k2, k3, p1, p2 = bent.k1, bent.k2, bent.k3, bent.p1, bent.p2
    square = x * x + y * y
    radial = 1 + square * (k1 + square * (k2 + square * k3))
    slope = k1 + square * (2 * k2 + square * 3 * k3)
    moved_x = x * radial + 2 * p1 * x * y + p2 * (square + 2 * x * x)
    moved_y = y * radial + p1 * (square + 2 * y * y) + 2 * p2 * x * y
    xx = radial + 2 * x * x * slope + 2 * p1 * y + 6 * p2 * x
    xy = 2 * x * y * slope + 2 * p1 * x + 2 * p2 * y
    yy = radial + 2 * y * y * slope + 6 * p1 * y + 2 * p2 * x
    area = xx * yy - xy * xy
    reach = min(bent.reach, 1e6)
    return moved_x, moved_y, area, (area > 0) & (square < reach * reach)
