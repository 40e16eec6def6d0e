"""A virtual matchmove: a camera carried past a ball on a checked floor, filmed row by row through a lens that bends.

The pictures are made here, pixel by pixel, by plain geometry and OpenCV's model of the lens; nothing of relume's
cameras or renderers takes part.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
import trimesh

import relume as rl
from relume.image.files.video import Movie

WIDTH, HEIGHT, RATE = 192, 128, 24.0
FOCAL_LENGTH = 190.0
K1, K2 = -0.12, 0.03
CENTRE, RADIUS = np.array([0.05, 0.06, -0.1]), 0.06
"""Of the ball, metres."""
SHOT = """\
[plate]
photographs = "plates/plate_0101.png"
[camera]
file = {{ path = "track.chan"{file} }}
{camera}
[light]
map = "light.exr"
surface_reflectance = 0.4
[[local]]
shape = "plane"
size = [3.0, 3.0]
[sequence]
frames = "{frames}"
plates = "{plates}"
{sequence}
[[objects]]
mesh = "ball.ply"
material = {{ base_color = [0.05, 0.05, 0.05], roughness = 1.0, specular = 0.0 }}
[match]
sharpness = false
grain = {grain}
[render]
samples = {samples}
preview = false
"""


@dataclass(frozen=True)
class Matchmove:
    """How it is filmed.

    readout : seconds from the first row to the last
    lens : whether it bends
    check : side of the floor's checks, metres
    """

    readout: float = 0.0
    lens: bool = False
    check: float = 0.08

    def pose(self, frame: float) -> tuple[np.ndarray, np.ndarray]:
        """Position, and (3, 3) world-from-camera, at a frame: a walk past the ball, panning after it."""
        t = (frame - 101) / RATE
        position = np.array([-0.25 + 1.2 * t, 0.42 + 0.02 * np.sin(9 * t), 0.75 - 0.1 * t])
        yaw, tilt, roll = 0.33 - 0.9 * t, -0.28 + 0.03 * np.sin(7 * t), 0.03 * np.sin(5 * t)
        about_y = np.array([[np.cos(yaw), 0, np.sin(yaw)], [0, 1, 0], [-np.sin(yaw), 0, np.cos(yaw)]])
        about_x = np.array([[1, 0, 0], [0, np.cos(tilt), -np.sin(tilt)], [0, np.sin(tilt), np.cos(tilt)]])
        about_z = np.array([[np.cos(roll), -np.sin(roll), 0], [np.sin(roll), np.cos(roll), 0], [0, 0, 1]])
        # The reversed yaw turns to the right, as the camera walks to the right of the ball.
        return position, about_y.T @ about_x @ about_z

    def focal_length(self, frame: float) -> float:
        """Pixels: a slow zoom."""
        return FOCAL_LENGTH * (1 + 0.004 * (frame - 101))

    def chan(self, frames: range) -> str:
        """The camera as a tracker writes it, of Nuke's order of rotations."""
        lines = []
        for frame in frames:
            position, turn = self.pose(frame)
            tilt = np.degrees(np.arcsin(-turn[1, 2]))
            yaw = np.degrees(np.arctan2(turn[0, 2], turn[2, 2]))
            roll = np.degrees(np.arctan2(turn[1, 0], turn[1, 1]))
            field = np.degrees(2 * np.arctan(HEIGHT / 2 / self.focal_length(frame)))
            lines.append(" ".join(f"{value:.9f}" for value in (*position, tilt, yaw, roll, field)))
        return "\n".join(f"{frame} {line}" for frame, line in zip(frames, lines, strict=True)) + "\n"

    def seen(self, frame: int, fine: int = 4) -> tuple[np.ndarray, np.ndarray]:
        """The picture (H, W, 3), linear, and the share of each pixel (H, W) that the ball covers."""
        x = (np.arange(WIDTH * fine) + 0.5) / fine
        picture, covered = np.zeros((HEIGHT * fine, WIDTH * fine, 3)), np.zeros((HEIGHT * fine, WIDTH * fine))
        focal = self.focal_length(frame)
        for row in range(HEIGHT * fine):
            y = (row + 0.5) / fine
            eye, turn = self.pose(frame + (y / HEIGHT - 0.5) * self.readout * RATE)
            points = np.stack([x, np.full_like(x, y)], axis=-1)
            matrix = np.array([[focal, 0, WIDTH / 2], [0, focal, HEIGHT / 2], [0, 0, 1]])
            bent = np.array([K1, K2, 0, 0, 0]) if self.lens else np.zeros(5)
            enough = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 100, 1e-12)
            straight = cv2.undistortPoints(points[:, None], matrix, bent, criteria=enough)[:, 0]
            ways = np.stack([straight[:, 0], -straight[:, 1], -np.ones(len(x))], axis=-1) @ turn.T
            ways /= np.linalg.norm(ways, axis=1, keepdims=True)
            along = ways @ (CENTRE - eye)
            ball = np.linalg.norm(CENTRE - eye - along[:, None] * ways, axis=1) < RADIUS
            with np.errstate(divide="ignore", invalid="ignore"):
                ground = eye + np.where(ways[:, 1:2] < 0, -eye[1] / ways[:, 1:2], np.nan) * ways
            checks = (np.floor(ground[:, 0] / self.check) + np.floor(ground[:, 2] / self.check)) % 2
            floor = np.where(np.isfinite(ground[:, :1]), 0.25 + 0.15 * checks[:, None], 0.25) * [1.0, 0.95, 0.9]
            picture[row], covered[row] = np.where(ball[:, None], 0.05, floor), ball
        whole = picture.reshape(HEIGHT, fine, WIDTH, fine, 3).mean((1, 3))
        return whole, covered.reshape(HEIGHT, fine, WIDTH, fine).mean((1, 3))

    def write(
        self, folder: Path, frames: range, *, noise: float = 0.0, plates: str = "plates/*.png", samples: int = 32,
        sequence: str = "", file: str = "",
    ) -> Path:  # fmt: skip
        """Write plates, track, light, ball and shot; returns the shot file.

        noise : of the plates, codes of 8 bits
        """
        (folder / "plates").mkdir(parents=True, exist_ok=True)
        random = np.random.default_rng(7)
        coded = []
        for frame in frames:
            codes = 255 * _srgb(self.seen(frame)[0]) + random.normal(0, noise, (HEIGHT, WIDTH, 3)) * (noise > 0)
            coded.append(np.rint(np.clip(codes, 0, 255)).astype(np.uint8))
            rl.write(folder / f"plates/plate_{frame:04d}.png", rl.Photograph(coded[-1]))
        if plates.endswith(".mp4"):
            with Movie(folder / plates, RATE) as movie:
                for each in coded:
                    movie.add(each)
        (folder / "track.chan").write_text(self.chan(range(frames.start - 1, frames.stop + 1)))
        rl.write(folder / "light.exr", rl.as_radiance_map(rl.EnvironmentMap(np.ones((16, 32, 3), np.float32))))
        ball = trimesh.creation.icosphere(4, RADIUS).apply_translation(CENTRE)
        (folder / "ball.ply").write_bytes(bytes(ball.export(file_type="ply")))
        lines = [f"readout = {self.readout}"] if self.readout else []
        lines += [f"distortion = {{ k1 = {K1}, k2 = {K2} }}"] if self.lens else []
        shot = SHOT.format(
            file=file, camera="\n".join(lines), frames=f"{frames.start}-{frames.stop - 1}", plates=plates,
            sequence=sequence, grain=str(noise > 0).lower(), samples=samples,
        )  # fmt: skip
        (folder / "shot.toml").write_text(shot)
        return folder / "shot.toml"


def middle_of(share: np.ndarray) -> np.ndarray:
    """The mean place (2,) of what covers pixels by a share (H, W), x right and y down."""
    y, x = np.mgrid[: share.shape[0], : share.shape[1]] + 0.5
    return np.array([np.sum(x * share), np.sum(y * share)]) / np.sum(share)


def _srgb(linear: np.ndarray) -> np.ndarray:
    return np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * np.maximum(linear, 1e-9) ** (1 / 2.4) - 0.055)
