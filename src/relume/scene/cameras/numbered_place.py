"""The cameras of a place's photographs as one that moves: the last number in each photograph's name is its frame's."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from relume.errors import UnreadableFile
from relume.scene.cameras.camera import Camera
from relume.scene.motion.keyframes import Slerp
from relume.scene.places.place import PlacePhotograph

BEYOND = 1.0
"""Frames before the first photograph and after the last for which their cameras count: a shutter reaches so far."""


def numbered_cameras(path: Path, photographs: Sequence[PlacePhotograph]) -> dict[int, Camera]:
    """The cameras by their frames, in order; raises UnreadableFile where two have one, or none has a number."""
    found: dict[int, PlacePhotograph] = {}
    for each in photographs:
        if not (digits := re.findall(r"\d+", Path(each.name).stem)):
            continue
        number = int(digits[-1])
        if number in found:
            raise UnreadableFile(f"{path}: {found[number].name} and {each.name} are both frame {number}; keep one")
        found[number] = each
    if not found:
        raise UnreadableFile(f"{path}: no photograph's name has a number; name each after its frame, as plate_0001.png")
    return {number: found[number].camera for number in sorted(found)}


def camera_at_frame(path: Path, cameras: dict[int, Camera], frame: float) -> Camera:
    """The camera at a frame; between two that follow one another all goes in straight lines and turns evenly.

    Raises UnreadableFile for a frame that no photograph has: a program that finds cameras may leave some out.
    """
    numbers = np.array(list(cameras))
    before, after = numbers[numbers <= frame], numbers[numbers >= frame]
    if not len(before) or not len(after):
        nearest = int(numbers[-1] if len(before) else numbers[0])
        if abs(frame - nearest) > BEYOND:
            raise UnreadableFile(
                f"{path}: has cameras of the frames {numbers[0]} to {numbers[-1]}, and frame {frame:g} was asked for"
            )
        return cameras[nearest]
    first, second = int(before[-1]), int(after[0])
    if second - first > 1:
        raise UnreadableFile(f"{path}: no photograph has the number of frame {frame:g}; its camera was not found")
    if first == second:
        return cameras[first]
    from scipy.spatial.transform import Rotation

    one, other, share = cameras[first], cameras[second], frame - first
    turns = Rotation.from_matrix(np.stack([one.rotation, other.rotation])).as_quat()
    turn = Slerp().between(np.array([0.0, 1.0]), turns, 0, share)
    return replace(
        one,
        position=(1 - share) * one.position + share * other.position,
        rotation=Rotation.from_quat(turn).as_matrix(),
        focal_length=(1 - share) * one.focal_length + share * other.focal_length,
    )
