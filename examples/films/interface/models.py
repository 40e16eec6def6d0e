"""The bodies of the film: `python models.py` writes the robot's and the woman's parts beside this file.

Each is a profile turned about +Y: radius and height from the foot up, metres.
"""

from pathlib import Path

import numpy as np

SIDES = 40
PARTS = {
    # The robot: a barrel of a body, and an arm whose shoulder is the origin. Its head is a sphere of the scene file.
    "robot_body.obj": [
        (0.0, 0.0), (0.2, 0.01), (0.26, 0.05), (0.27, 0.15), (0.25, 0.28), (0.2, 0.4), (0.12, 0.47), (0.07, 0.5),
        (0.055, 0.53), (0.06, 0.56), (0.0, 0.57),
    ],
    "robot_arm.obj": [
        (0.0, -0.06), (0.04, -0.05), (0.055, -0.02), (0.05, 0.04), (0.035, 0.1), (0.03, 0.2), (0.035, 0.3),
        (0.05, 0.34), (0.06, 0.39), (0.045, 0.44), (0.0, 0.46),
    ],
    # The woman: a long dress, hair, and an arm.
    "woman_dress.obj": [
        (0.0, 0.0), (0.34, 0.0), (0.3, 0.25), (0.22, 0.6), (0.15, 0.95), (0.16, 1.1), (0.19, 1.28), (0.15, 1.38),
        (0.06, 1.43), (0.05, 1.5), (0.0, 1.52),
    ],
    "woman_hair.obj": [
        (0.0, -0.16), (0.08, -0.16), (0.125, -0.1), (0.14, 0.0), (0.13, 0.08), (0.09, 0.14), (0.0, 0.165),
    ],
    "woman_arm.obj": [
        (0.0, -0.03), (0.035, -0.02), (0.04, 0.03), (0.032, 0.25), (0.028, 0.5), (0.04, 0.55), (0.03, 0.62),
        (0.0, 0.63),
    ],
}  # fmt: skip


def turned(profile: list[tuple[float, float]]) -> str:
    """An .obj of a profile turned about +Y, with smooth normals, counter-clockwise from outside."""
    points = np.array(profile)
    segments = np.diff(points, axis=0)
    across = np.stack([segments[:, 1], -segments[:, 0]], axis=1)
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    across = np.vstack([across[:1], across[:-1] + across[1:], across[-1:]])
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    lines = ["# By models.py; metres, +Y up."]
    for (radius, height), (out, up) in zip(points, across, strict=True):
        for angle in 2 * np.pi * np.arange(SIDES) / SIDES:
            lines.append(f"v {radius * np.cos(angle):.4f} {height:.4f} {radius * np.sin(angle):.4f}")
            lines.append(f"vn {out * np.cos(angle):.3f} {up:.3f} {out * np.sin(angle):.3f}")
    for ring in range(len(points) - 1):
        for side in range(SIDES):
            here, there = ring * SIDES + side + 1, ring * SIDES + (side + 1) % SIDES + 1
            if points[ring, 0] > 0:
                lines.append(f"f {here}//{here} {there + SIDES}//{there + SIDES} {there}//{there}")
            if points[ring + 1, 0] > 0:
                lines.append(f"f {here}//{here} {here + SIDES}//{here + SIDES} {there + SIDES}//{there + SIDES}")
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    for name, profile in PARTS.items():
        Path(__file__).with_name(name).write_text(turned(profile), encoding="utf-8")
