"""`relume edit`: a radiance map in, the same map cropped, scaled, combined, balanced, blurred or painted over."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

import relume as rl
from relume.cli.arguments import DryRun, require_files, require_suffix
from relume.cli.console import OutputOptions, finish, print_facts, warnings_as_notes
from relume.cli.edit_options import ArithmeticOptions, BlurOptions, ColourOptions, FrameOptions, PaintOptions
from relume.cli.light_input import From, mapping_of

MAPS = (".exr", ".hdr")


def edit(
    light: Annotated[Path, Parameter(name="MAP", help="The radiance map, .exr, .hdr or another format.")],
    /,
    *,
    out: Annotated[Path, Parameter(alias="-o", help="The map to write, .exr or .hdr; with --slice a .png.")],
    from_: From = None,
    frame: FrameOptions = FrameOptions(),
    arithmetic: ArithmeticOptions = ArithmeticOptions(),
    colour: ColourOptions = ColourOptions(),
    blur: BlurOptions = BlurOptions(),
    painter: PaintOptions = PaintOptions(),
    dry_run: DryRun = False,
    output: OutputOptions = OutputOptions(),
) -> None:
    """Edit a radiance map in linear light: crop, resize, arithmetic, gain, balance, blur, in this order, or paint.

    Edits may be given together; they are done in the order in which they stand here, whatever the order of the
    words. Variance, marks of clipped pixels, unit and attributes go along. A map whose file stores its mapping is an
    environment map: it is resized and blurred on the sphere. --slice writes an 8- or 16-bit exposure for any paint
    program, and --paint puts the pixels that were changed there, and no others, back into the map.
    """
    with warnings_as_notes(output):
        require_files([light])
        edits = [*frame.edits(), *arithmetic.edits(), *colour.edits(), *blur.edits()]
        alone = "--paint" if painter.paint is not None else "--slice" if painter.cut is not None else ""
        _check(painter, alone, edits)
        if from_ is not None and alone:
            raise ValueError(f"--from is for edits of environment maps; {alone} needs none")
        require_suffix(out, *([".png"] if alone == "--slice" else MAPS))
        if alone == "--slice":
            _write_slice(light, out, painter, dry_run, output)
        elif alone == "--paint":
            _paint_over(light, out, painter, dry_run, output)
        else:
            mapping = mapping_of(from_)
            if dry_run:
                print_facts(output, {"would write": str(out), "edits": [str(each) for each in edits]})
                return
            edited = rl.light.edit(rl.read_radiance(light), edits, mapping)
            rl.write(out, edited.picture)
            print_facts(output, {"written": str(out), **edited.facts()})


def _write_slice(light: Path, out: Path, painter: PaintOptions, dry_run: bool, output: OutputOptions) -> None:
    if dry_run:
        paths = [str(out), str(rl.light.slice_sidecar(out))]
        print_facts(output, {"would write": paths, "stops": painter.cut})
        return
    print_facts(output, rl.light.write_slice(rl.read_radiance(light), out, painter.stops, painter.bits))


def _paint_over(light: Path, out: Path, painter: PaintOptions, dry_run: bool, output: OutputOptions) -> None:
    assert painter.paint is not None
    require_files([path for path in (painter.paint, painter.original) if path is not None])
    painted = rl.light.PaintedSlice(
        painter.paint, painter.original, painter.stops, painter.bits, painter.scale, painter.tolerance
    )
    if dry_run:
        method = "scale" if painter.scale else "replace"
        print_facts(output, {"would write": str(out), "stops": painted.description().stops, "method": method})
        return
    result = rl.light.paint_over(rl.read_radiance(light), painted, str(light))
    rl.write(out, result.picture)
    print_facts(output, {"written": str(out), **result.facts})
    finish(output, result.doubts, accept=painter.accept)


def _check(painter: PaintOptions, alone: str, edits: list[rl.light.Edit]) -> None:
    """Refuse options that contradict each other or would do nothing."""
    if alone and edits:
        raise ValueError(f"{alone} and {edits[0].name}: paint on the map that is finished; give {alone} alone")
    for option, given in (
        ("--original", painter.original is not None),
        ("--scale", painter.scale),
        ("--tolerance", painter.tolerance != 0),
        ("--accept", painter.accept),
    ):
        if given and alone != "--paint":
            raise ValueError(f"{option} is for what was painted; give --paint too")
    if painter.bits != 8 and not alone:
        raise ValueError("--bits is for a slice; give --slice too")
    if not alone and not edits:
        raise ValueError("nothing to do; give --crop, --resize, --add, --stops, --grey, --blur, --slice or another")
