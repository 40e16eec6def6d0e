"""What settings, seeds and cameras have to be, or one line that says what was expected."""

from __future__ import annotations

from relume.errors import UnsupportedScene
from relume.scene.cameras.camera import Camera
from relume.scene.scene import Infinite, Scene


def require_whole(settings: object, **least: int) -> None:
    """Raise ValueError for settings that are no whole numbers from the least of each; None is left alone."""
    for name, lowest in least.items():
        value = getattr(settings, name)
        if value is not None and (not isinstance(value, int) or value < lowest):
            raise ValueError(f"{name} is {value}; expected a whole number from {lowest}")


def require_seed(seed: int) -> None:
    """Raise ValueError for a seed that is no whole number from 0."""
    if not isinstance(seed, int) or seed < 0:
        raise ValueError(f"seed is {seed}; expected a whole number from 0")


def require_far_light(scene: Scene, whose: str) -> None:
    """Raise UnsupportedScene for a light map on walls."""
    if not isinstance(scene.distant, Infinite):
        raise UnsupportedScene(
            f"{whose} sees its light map at infinity, and this scene's is on walls; use rl.Mitsuba "
            "(--renderer mitsuba), or an Infinite distant scene"
        )


def require_lit(lit: bool) -> None:
    """Raise UnsupportedScene for a scene of which nothing is lit."""
    if not lit:
        raise UnsupportedScene(
            "nothing shines in this scene: it has no lights, no emission, and its light map is black; add one"
        )


def require_pinhole(camera: Camera, whose: str) -> None:
    """Raise UnsupportedScene for a lens with an aperture."""
    if camera.aperture > 0:
        raise UnsupportedScene(
            f"{whose} shows what a pinhole sees, and this camera's lens has an aperture; use rl.Mitsuba "
            "(--renderer mitsuba), or an aperture of 0"
        )
