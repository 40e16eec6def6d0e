"""Words of the command line that several commands share, and how they are read."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter

import relume as rl
from relume.cli.option_types import numbers

Clamp = Annotated[
    bool, Parameter(negative="", help="Set negative pixels, which a resize may leave, to 0; refused unless given.")
]
From = Annotated[
    str | None,
    Parameter(
        name="--from",
        help="Mapping of the map where the file does not store it: latlong, angular, ball or another of `convert`.",
    ),
]


def mapping_of(name: str | None, option: str = "--from") -> rl.mappings.Mapping | None:
    """The mapping of an option's word, None for none; raises ValueError naming the option."""
    if name is None:
        return None
    try:
        return rl.mappings.mapping_named(name)
    except ValueError as error:
        raise ValueError(f"{option}: {error}") from None


_MEGAPIXEL = 1e6
_BYTES = 32  # a pixel being read: its floats, those of the file, and a mask or two


@Parameter(name="*")
@dataclass(frozen=True)
class ReadingOptions:
    """What a user may say of the files a command reads; the same for every command that reads any picture."""

    largest: Annotated[
        float | None,
        Parameter(help="Megapixels of a picture, at most; 268 unless given, so that no damaged file fills the memory."),
    ] = None
    salvage: Annotated[
        bool,
        Parameter(negative="", help="Read a file that ends early as far as it goes; the rest is black and marked."),
    ] = False
    mantissa_middle: Annotated[
        bool,
        Parameter(
            negative="",
            help="Read Radiance .hdr values half a step higher, as Radiance does: right for files of programs that "
            "round down.",
        ),
    ] = False
    float_size: Annotated[
        tuple[int, int] | None,
        numbers(
            "WIDTHxHEIGHT",
            like="640x480",
            above=0,
            help="Size of a raw .float file, as WIDTHxHEIGHT; that of a square one is inferred.",
        ),
    ] = None
    float_order: Annotated[
        Literal["little", "big"] | None,
        Parameter(help="Byte order of a raw .float file; the one that makes sense unless given."),
    ] = None

    def reading(self) -> rl.files.ReadOptions:
        """The same for `rl.read`; raises ValueError that names the option."""
        limits = rl.files.ReadOptions()
        pixels = limits.pixels
        if self.largest is not None:
            if not (math.isfinite(self.largest) and self.largest * _MEGAPIXEL >= 1):
                raise ValueError(f"--largest is {self.largest:g} megapixels; give a number like 500")
            pixels = int(self.largest * _MEGAPIXEL)
        return rl.files.ReadOptions(
            # Who raises the area means long strips too; memory is still held against what the machine has free.
            side=limits.side if pixels <= limits.pixels else pixels,
            pixels=pixels,
            decoded=max(limits.decoded, _BYTES * pixels),
            salvage=self.salvage,
            mantissa_middle=self.mantissa_middle,
            float_size=self.float_size,
            float_order=self.float_order,
        )


@Parameter(name="*")
@dataclass(frozen=True)
class MapsOptions:
    """Maps that follow one another, of which a folder is given."""

    rate: Annotated[
        float | None,
        Parameter(
            help="Of a folder of maps: maps a second, under pictures that are 24 a second; a picture for each map "
            "unless given."
        ),
    ] = None
    interpolation: Annotated[
        Literal["linear", "none"] | None,
        Parameter(help="Of a folder of maps: linear between two, or none, each until the next; linear unless given."),
    ] = None

    def sequence(self, folder: Path, mapping: rl.mappings.Mapping | None = None, *, clamp: bool = False):
        """The maps of a folder as light that changes with time."""
        words = {"mapping": mapping, "clamp": clamp}
        return rl.light.LightSequence.found(
            folder.absolute(), 24.0 if self.rate is None else self.rate, self.interpolation or "linear", **words
        )

    def refuse(self) -> None:
        """Refuse the options where one map is given."""
        for name in ("rate", "interpolation"):
            if getattr(self, name) is not None:
                raise ValueError(f"--{name} is of maps that change with time; give a folder of them, or leave it out")


Threads = Annotated[int | None, Parameter(help="Threads to render with; all cores unless given.")]
Accept = Annotated[bool, Parameter(negative="", help="Exit with 0 although the result is doubtful.")]
ClusterWord = Annotated[
    str | None,
    Parameter(
        name="--cluster",
        help="Do it by Dask's workers: local for one a core, local:4 for four, the address of a scheduler like "
        "tcp://HOST:8786, the path of its scheduler.json, or env for DASK_SCHEDULER_ADDRESS. What is written "
        "is the same to the bit.",
    ),
]
MapFile = Annotated[Path, Parameter(name="MAP", help="The environment map, .exr, .hdr or another format.")]
LatLongOut = Annotated[
    Path, Parameter(alias="-o", help="The equirectangular (lat-long) environment map to write, .exr or .hdr.")
]
DryRun = Annotated[bool, Parameter(negative="", help="Say what would be done, and do nothing.")]


def require_files(paths: Sequence[Path]) -> None:
    """Refuse paths that are not files, so that a dry run reports them too."""
    for path in paths:
        if path.is_dir():
            raise rl.errors.UnreadableFile(f"{path}: a folder; name the files in it, like {path}/*.jpg")
        if not path.is_file():
            raise rl.errors.UnreadableFile(f"{path}: no such file; check the path")


def require_pictures(pictures: Sequence[Path], out: Path, *, each: bool) -> None:
    """Refuse paths that cannot be read or written; with --each pictures may be folders, and -o is one."""
    if each:
        refuse_file_for_folder(out)
    else:
        require_files(pictures)
        refuse_input(out, pictures)


def made_folder(out: Path) -> Path:
    """The folder of -o, made where it is missing; raises OutputNotWritten."""
    try:
        out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise rl.errors.OutputNotWritten(
            f"-o {out}: cannot be made a folder ({error.strerror}); choose another"
        ) from None
    return out


def refuse_input(out: Path, paths: Sequence[Path]) -> None:
    """Refuse an output that is one of the inputs: an original stays as it was."""
    for path in paths:
        if out.exists() and path.exists() and out.samefile(path):
            raise ValueError(f"-o {out}: the input itself; give another name, so that the original stays as it was")


def require_suffix(out: Path, *suffixes: str, option: str = "-o") -> None:
    """Refuse an output that cannot be written, before any work is done."""
    if not out.name.lower().endswith(suffixes):
        raise ValueError(f"{option} {out}: the file must end in {' or '.join(suffixes)}")
    if not out.parent.is_dir():
        raise rl.errors.OutputNotWritten(f"{option} {out}: no folder {out.parent}; make it first or choose another")


def refuse_file_for_folder(out: Path) -> None:
    """Refuse the name of a file where --each writes into a folder."""
    if out.suffix and not out.is_dir():
        raise ValueError(f"-o {out}: with --each it is a folder for a file of each; leave {out.suffix} away")
    require_output_folder(out)


def require_output_folder(out: Path) -> None:
    """Refuse a file where a folder is to be written."""
    if out.exists() and not out.is_dir():
        raise rl.errors.OutputNotWritten(f"-o {out}: a file, not a folder; choose another name")
