"""What of a glTF material the older renderers have no place for, so that nothing is left out in silence."""

from __future__ import annotations

import numpy as np

from relume.errors import warn
from relume.scene.materials.materials import Material
from relume.scene.materials.whitted import WhittedMaterial


def warn_of_unsupported(material: Material, whose: str) -> None:
    """Warn of what of a material is not shown where only its base, its gloss and its transmission are.

    whose : the renderer, to begin the sentence
    """
    if found := unsupported_features(material):
        warn(
            f"{whose} not show {', '.join(found)} of {material.name or 'a material'!r}; "
            "use rl.Mitsuba (--renderer mitsuba)"
        )


def renderer_of(material: object) -> str:
    """What to use for a material that a teaching renderer does not show, as the end of a line."""
    if isinstance(material, WhittedMaterial):
        return "use rl.Whitted (--renderer whitted)"
    return "use rl.Mitsuba (--renderer mitsuba)"


def extra_lobes(material: Material) -> dict[str, bool]:
    """Which lobes a material has beside its base, its plain gloss and its transmission."""
    tints = (material.specular, material.specular_color)
    return {
        "clearcoat": bool(np.any(np.asarray(material.clearcoat) > 0)),
        "sheen": bool(np.any(np.asarray(material.sheen_color) > 0)),
        "anisotropy": material.anisotropy > 0,
        "specular": any(bool(np.any(np.asarray(tint) != 1)) for tint in tints),
    }


def unsupported_features(material: Material) -> tuple[str, ...]:
    """The names of what is set of a material beyond base colour, metallic, roughness, transmission and ior."""
    clear = bool(np.any(material.through))
    there = {
        "its normal map": material.normal is not None,
        "emission": material.emits,
        "alpha": bool(np.any(np.asarray(material.alpha) < 1)),
        **extra_lobes(material),
        "thinness": material.thin and clear,
        "what fills the body": material.medium is not None,
        "dispersion": material.dispersion > 0 and clear,
    }
    return tuple(name for name, is_there in there.items() if is_there)
