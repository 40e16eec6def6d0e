"""A camera in Dr.Jit: rays through its pixels, and where on the picture a point is seen."""

from __future__ import annotations

from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from relume.renderers.mitsuba.transport import opaque
from relume.scene.cameras.camera import Camera

FAR = 1e5
"""Metres: the plane in focus of a lens that is focused at infinity."""


class Lens:
    """A camera with its distortion and its aperture."""

    def __init__(self, camera: Camera) -> None:
        self.camera = camera
        self.across, self.down = map(opaque.number, camera.principal_point)
        self.focus, self.focal_length = opaque.number(min(float(camera.focus), FAR)), opaque.number(camera.focal_length)
        self.turn, self.back = opaque.matrix(camera.rotation), opaque.matrix(camera.rotation.T)
        self.place = opaque.point(camera.position)
        self.aperture = opaque.number(camera.aperture)
        self.straight = None if camera.distortion is None else _straight(camera)

    def rays(self, x: Any, y: Any, aperture: Any) -> Any:
        """Rays through pixel coordinates; `aperture`, two numbers from 0 to 1, is where they go through the lens."""
        camera = self.camera
        if self.straight is None:
            across, up = (x - self.across) / self.focal_length, (self.down - y) / self.focal_length
        else:
            # Corner samples of the pixels, so that what lies between is within a thousandth of a pixel.
            u, v = (x + 0.5) / (camera.width + 1), (y + 0.5) / (camera.height + 1)
            across, up = self.straight.eval(mi.Point2f(u, v))
        towards, origin = mi.Vector3f(across, up, -1), self._on_lens(aperture)
        if camera.aperture > 0:
            towards = self.focus * towards - origin
        return mi.Ray3f(self.place + self.turn @ origin, dr.normalize(self.turn @ towards))

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
        camera, origin = self.camera, self._on_lens(aperture)
        lens = self.place + self.turn @ origin
        way = lens - si.p
        local = self.back @ -way
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
        ahead &= (x >= 0) & (x < camera.width) & (y >= 0) & (y < camera.height)
        factor = dr.square(self.focal_length / distance) * stretch / (cosine * cosine * cosine)
        back = si.spawn_ray(way / distance)
        back.maxt = distance * (1 - 1e-4)
        return mi.Point2f(x, y), dr.select(ahead, factor, 0), back


def _straight(camera: Camera) -> Any:
    """The slopes of the undistorted rays, right and up, at the corners of all pixels."""
    x, y = np.meshgrid(np.arange(camera.width + 1.0), np.arange(camera.height + 1.0))
    local = camera.rays_through(np.stack([x, y], axis=-1)) @ camera.rotation
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
