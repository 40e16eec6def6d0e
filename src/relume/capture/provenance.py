"""What a radiance map remembers of the photographs it was measured from."""

from __future__ import annotations

from collections.abc import Sequence

from relume.image.files.metadata.gps import text_of
from relume.image.photograph import Photograph


def provenance(photographs: Sequence[Photograph]) -> dict[str, str]:
    """Attributes of the radiance map of a bracket: what all its photographs share, when it began, and its exposures.

    camera, lens, serial, iso, focal_length (mm), owner, copyright, comments : where all photographs hold the same
    camera_make : the make alike, where it is known; `camera` is then the model alone, as EXIF and other files have them
    latitude, longitude : degrees north and east, alike
    taken : of the first photograph, YYYY:MM:DD hh:mm:ss
    exposure_times : s, from the least to the most exposed; exposure_ratios to the least where they were estimated
    """
    first = photographs[0]
    # Photographs of one camera may differ in what they hold of its make: one that an editor stripped.
    make, model = "", first.camera if all(p.camera == first.camera for p in photographs) else ""
    if len({p.make_and_model for p in photographs}) == 1:
        make, model = first.make_and_model
    shared: dict[str, str | None] = {
        "camera": model,
        "camera_make": make,
        "lens": _one({p.settings.lens for p in photographs}),
        "serial": _one({p.settings.serial for p in photographs}),
        "focal_length": _one({_number(p.settings.focal_length) for p in photographs}),
        "iso": _one({_number(p.exposure.iso) if p.exposure else None for p in photographs}),
        "owner": _one({p.settings.owner for p in photographs}),
        "copyright": _one({p.settings.copyright for p in photographs}),
        "comments": _one({p.settings.comments for p in photographs}),
        "latitude": _one({_degrees(p.settings.latitude) for p in photographs}),
        "longitude": _one({_degrees(p.settings.longitude) for p in photographs}),
    }
    taken = [p.settings.taken for p in photographs if p.settings.taken]
    if taken:
        shared["taken"] = min(taken).strftime("%Y:%m:%d %H:%M:%S")
    exposures = [p.exposure for p in photographs if p.exposure]
    # Of estimated exposures only their ratios are known.
    guessed = any(exposure.source == "estimated" for exposure in exposures)
    least = exposures[0].seconds if guessed else 1.0
    name = "exposure_ratios" if guessed else "exposure_times"
    shared[name] = " ".join(f"{exposure.seconds / least:.6g}" for exposure in exposures)
    return {key: value for key, value in shared.items() if value}


def _one(values: set[str | None]) -> str | None:
    return next(iter(values)) if len(values) == 1 else None


def _number(value: float | None) -> str | None:
    return None if value is None else f"{value:g}"


def _degrees(value: float | None) -> str | None:
    return None if value is None else text_of(value)
