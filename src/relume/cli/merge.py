"""`relume merge`: photographs in, a radiance map out."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from relume.cli.arguments import DryRun, Times, read_times, require_files, require_suffix
from relume.cli.console import Manner, note, speaking, tell


def merge(
    photographs: Annotated[list[Path], Parameter(help="The bracket: JPEG, PNG or TIFF, in any order.", negative="")],
    /,
    *,
    out: Annotated[Path, Parameter(alias="-o", help="The radiance map to write, .exr (all of it) or .hdr.")],
    times: Times = None,
    response: Annotated[
        Path | None, Parameter(help="A response.json of the same camera, instead of recovering it.")
    ] = None,
    save_response: Annotated[Path | None, Parameter(help="Also write the recovered response here, .json.")] = None,
    paper_weights: Annotated[bool, Parameter(negative="", help="Weigh as Debevec & Malik do (eq. 4).")] = False,
    dry_run: DryRun = False,
    manner: Manner = Manner(),
) -> None:
    """Recover the camera's response from a bracket and merge it into a radiance map with variance and clipped mask."""
    from relume.capture.bracket import read_bracket
    from relume.capture.calibration import DOUBTFUL_MISFIT, recover_response
    from relume.capture.merging import merge as merged
    from relume.capture.weighting import Hat, InverseVariance
    from relume.errors import UnreadableFile
    from relume.image import files
    from relume.image.radiance import BLACK, SATURATED
    from relume.image.response import Response

    with speaking(manner):
        require_files(photographs)
        require_suffix(out, ".exr", ".hdr")
        bracket = read_bracket(photographs, times=read_times(times))
        exposures = {p.name: f"{p.exposure.seconds:.6g} s" for p in bracket.photographs if p.exposure}
        if dry_run:
            tell(manner, {"would write": str(out), "exposures": exposures})
            return
        facts: dict[str, object] = {"written": str(out), "exposures": exposures}
        if response is not None:
            try:
                curve = Response.from_json(response.read_text())
            except (OSError, ValueError) as error:
                raise UnreadableFile(f"{response}: not a response that relume wrote ({error})") from None
        else:
            calibration = recover_response(bracket)
            curve = calibration.response.balanced_at(calibration.response.levels - 1)
            if calibration.residual.max() > DOUBTFUL_MISFIT:
                note(manner, "the response fits badly; are the exposure times right, and did nothing move?")
            facts |= {"residual": calibration.residual.round(4).tolist(), "noise": curve.noise.round(3).tolist()}
        picture = merged(bracket, curve, weighting=Hat() if paper_weights else InverseVariance())
        files.write(out, picture)
        if save_response is not None:
            files.write_text(save_response, curve.to_json())
            facts["response"] = str(save_response)
        clipped = picture.clipped
        if clipped is not None and clipped.any():
            saturated, black = int((clipped == SATURATED).sum()), int((clipped == BLACK).sum())
            note(
                manner, f"{saturated} pixels are saturated and {black} black in every photograph; they hold bounds only"
            )
            facts |= {"saturated": saturated, "black": black}
        tell(manner, facts)
