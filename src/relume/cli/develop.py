"""`relume develop`: a radiance map in, a picture out."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from relume.cli.arguments import DryRun, require_suffix
from relume.cli.console import Manner, speaking, tell


def develop(
    picture: Annotated[Path, Parameter(help="The radiance map, .exr, .hdr or another format.")],
    /,
    *,
    out: Annotated[Path, Parameter(alias="-o", help="The picture to write, .png or .jpg.")],
    exposure: Annotated[
        float, Parameter(help="Stops to brighten by; negative darkens.", allow_leading_hyphen=True)
    ] = 0.0,
    response: Annotated[
        Path | None,
        Parameter(help="A profile or response that merge or insert wrote, or a curve of pfstools or hdrgen."),
    ] = None,
    seconds: Annotated[
        float | None,
        Parameter(help="With --response: exposure per unit of radiance; chosen from the picture unless given."),
    ] = None,
    dry_run: DryRun = False,
    manner: Manner = Manner(),
) -> None:
    """Develop a radiance map by a camera's own response or the sRGB curve, bright parts near white unless told."""
    import numpy as np

    from relume.capture.profile import read_profile
    from relume.develop.film import Film
    from relume.develop.film import develop as developed
    from relume.image import files

    with speaking(manner):
        require_suffix(out, ".png", ".jpg", ".jpeg")
        radiance = files.read_radiance(picture).radiance
        curve, top = None, 1.0
        if response is not None:
            curve = read_profile(response).response
            if curve is None:
                raise ValueError(f"{response.name}: a profile of camera raws, which holds no response; give another")
            top = float(np.exp(curve.log_exposure[:, 248 * curve.levels // 256].mean()))
        bright = float(np.percentile(radiance[np.isfinite(radiance)], 99)) if np.isfinite(radiance).any() else 0.0
        film = Film(seconds or top / max(bright, 1e-30), curve).brighter(exposure)
        if dry_run:
            tell(manner, {"would write": str(out), "exposure": film.exposure})
            return
        files.write(out, developed(np.nan_to_num(radiance, posinf=3.4e38), film))
        tell(manner, {"written": str(out), "exposure": film.exposure})
