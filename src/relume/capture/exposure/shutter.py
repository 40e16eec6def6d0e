"""The shutter speeds that cameras mark, and the powers of two that they stand for."""

from __future__ import annotations

# In the order of the dial, so that each is a step from the one before it; s, or 1/s for the fast ones.
_THIRDS_SLOW = (1, 1.3, 1.6, 2, 2.5, 3.2, 4, 5, 6, 8, 10, 13, 15, 20, 25, 30)
_THIRDS_FAST = (1, 1.25, 5 / 3, 2, 2.5, 10 / 3, 4, 5, 6, 8, 10, 13, 15, 20, 25, 30, 40, 50, 60, 80, 100, 125, 160, 200)
_THIRDS_FAST += (250, 320, 400, 500, 640, 800, 1000, 1250, 1600, 2000, 2500, 3200, 4000, 5000, 6400, 8000)
_HALVES_SLOW = (1.5, 3, 6, 10, 20)
_HALVES_FAST = (10 / 7, 10 / 3, 6, 10, 20, 45, 90, 180, 350, 750, 1500, 3000, 6000)
_MARKS = (
    *((seconds, step / 3) for step, seconds in enumerate(_THIRDS_SLOW)),
    *((1 / speed, -step / 3) for step, speed in enumerate(_THIRDS_FAST)),
    (3.0, 5 / 3),  # other makers' marks for 3.2 and 0.3
    (1 / 3, -5 / 3),
    *((seconds, step + 1 / 2) for step, seconds in enumerate(_HALVES_SLOW)),
    *((1 / speed, -step - 1 / 2) for step, speed in enumerate(_HALVES_FAST)),
)
_EXACT = 2e-3
"""How near a time must come to a mark: EXIF holds 1/60 as a fraction, lists print it with three or four digits."""


def true_shutter(seconds: float, shutter_speed: float | None = None) -> float:
    """The time for which a shutter marked `seconds` is open: 1/64 s for 1/60, 16 s for 15, 2^(−13/3) s for 1/20.

    seconds : as marked; any other time than a mark of a whole, half or third stop is returned as it is
    shutter_speed : −log₂ of the time as the camera wrote it beside (APEX ShutterSpeedValue); decides where a mark
        serves two scales (1/20 is the third stop 1/20.2 and the half stop 1/22.6), which else are taken for thirds

    "The actual exposure times varied by powers of two between stops, rather than the rounded numbers displayed"
    (Debevec & Malik 1997, footnote 4, of one camera whose shutter they recorded). An option and not the rule:
    telephones and electronic shutters write the time they measured, and those locked to mains light keep 1/60 for 1/60.
    Either mistake is 7 % at most, and refining the exposures from the pixels removes it.
    """
    steps = _steps(seconds)
    if not steps:
        return seconds
    if shutter_speed is None:
        return 2.0 ** steps[0]
    return 2.0 ** min(steps, key=lambda step: abs(step + shutter_speed))


def marked(seconds: float) -> bool:
    """Whether cameras mark this shutter speed."""
    return bool(_steps(seconds))


def _steps(seconds: float) -> list[float]:
    return [step for mark, step in _MARKS if abs(seconds - mark) <= _EXACT * mark]
