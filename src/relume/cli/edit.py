"""`relume edit`: a radiance map in, the same map cut, scaled, combined, balanced, blurred or painted out."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from relume.cli.arguments import DryRun, require_files, require_suffix
from relume.cli.console import OutputOptions, print_facts, warnings_as_notes
from relume.cli.edit_options import Arithmetic, Blur, Colour, Frame
from relume.cli.edit_painter import Painter, cut_slice, paint_back
from relume.cli.edit_steps import Step, energy, note_losses, with_mapping

MAPS = (".exr", ".hdr")


def edit(
    light: Annotated[Path, Parameter(name="MAP", help="The radiance map, .exr, .hdr or another format.")],
    /,
    *,
    out: Annotated[Path, Parameter(alias="-o", help="The map to write, .exr or .hdr; with --slice a .png.")],
    told_mapping: Annotated[
        str | None,
        Parameter(
            name="--from",
            help="The mapping of a light map whose file tells none: latlong, angular, ball or another of `convert`.",
        ),
    ] = None,
    frame: Frame = Frame(),
    arithmetic: Arithmetic = Arithmetic(),
    colour: Colour = Colour(),
    blur: Blur = Blur(),
    painter: Painter = Painter(),
    dry_run: DryRun = False,
    output: OutputOptions = OutputOptions(),
) -> None:
    """Edit a radiance map in linear light: crop, resize, arithmetic, gain, balance, blur, in this order, or paint.

    Edits may be given together; they are done in the order in which they stand here, whatever the order of the
    words. Variance, marks of clipped pixels, unit and attributes go along. A map whose file tells its mapping is a
    light map: it is resized and blurred on the sphere. --slice writes an 8- or 16-bit exposure for any painter, and
    --paint puts the pixels that were changed there, and no others, back into the map.
    """
    with warnings_as_notes(output):
        require_files([light])
        steps = [*frame.steps(), *arithmetic.steps(), *colour.steps(), *blur.steps()]
        alone = "--paint" if painter.paint is not None else "--slice" if painter.cut is not None else ""
        _check(painter, alone, steps)
        if told_mapping is not None and alone:
            raise ValueError(f"--from is for edits of light maps; {alone} needs none")
        require_suffix(out, *([".png"] if alone == "--slice" else MAPS))
        if alone == "--slice":
            cut_slice(light, out, painter, dry_run, output)
        elif alone == "--paint":
            paint_back(light, out, painter, dry_run, output)
        else:
            _edit(light, out, told_mapping, steps, dry_run, output)


def _check(painter: Painter, alone: str, steps: list[Step]) -> None:
    if alone and steps:
        raise ValueError(f"{alone} and {steps[0].option}: paint on the map that is finished; give {alone} alone")
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
    if not alone and not steps:
        raise ValueError("nothing to do; give --crop, --resize, --add, --stops, --grey, --blur, --slice or another")


def _edit(
    source: Path, out: Path, told_mapping: str | None, steps: list[Step], dry_run: bool, output: OutputOptions
) -> None:
    from relume.image import files
    from relume.sphere.mappings.names import mapping_named

    mapping = None if told_mapping is None else mapping_named(told_mapping).name
    if dry_run:
        print_facts(output, {"would write": str(out), "edits": [step.words for step in steps]})
        return
    before = files.read_radiance(source)
    if mapping is not None:
        before = with_mapping(before, mapping)
    after = before
    for step in steps:
        after = step(after)
    # What was blurred as a light map is one, and was one before.
    if "mapping" in after.attributes and "mapping" not in before.attributes:
        before = with_mapping(before, after.attributes["mapping"])
    if {step.option for step in steps} == {"--resize"}:
        note_losses(before, after)
    files.write(out, after)
    told = {"written": str(out), "edits": [step.words for step in steps], "size": list(after.size), "unit": after.unit}
    print_facts(output, told | energy(before, "before") | energy(after, "after"))
