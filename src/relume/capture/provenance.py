"""What a radiance map remembers of the photographs it was measured from."""

from __future__ import annotations

from collections.abc import Sequence

from relume.image.photograph import Photograph


def provenance(photographs: Sequence[Photograph]) -> dict[str, str]:
    """Attributes of the radiance map of a bracket: what all its photographs share, when it began, and its exposures.

    camera, lens, serial, iso, focal_length (mm) : where all photographs tell the same
    taken : of the first photograph, YYYY:MM:DD hh:mm:ss
    exposure_times : s, from the least to the most exposed
    """
    first = photographs[0]
    shared: dict[str, str | None] = {
        "camera": first.camera if all(p.camera == first.camera for p in photographs) else None,
        "lens": _one({p.settings.lens for p in photographs}),
        "serial": _one({p.settings.serial for p in photographs}),
        "focal_length": _one({_number(p.settings.focal_length) for p in photographs}),
        "iso": _one({_number(p.exposure.iso) if p.exposure else None for p in photographs}),
    }
    taken = [p.settings.taken for p in photographs if p.settings.taken]
    if taken:
        shared["taken"] = min(taken).strftime("%Y:%m:%d %H:%M:%S")
    shared["exposure_times"] = " ".join(f"{p.exposure.seconds:.6g}" for p in photographs if p.exposure)
    return {key: value for key, value in shared.items() if value}


def _one(values: set[str | None]) -> str | None:
    return next(iter(values)) if len(values) == 1 else None


def _number(value: float | None) -> str | None:
    return None if value is None else f"{value:g}"
