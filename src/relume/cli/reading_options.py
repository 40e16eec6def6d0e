"""How much of a file a command accepts, and how it is read where the file leaves a choice: options of every reader."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated, Literal

from cyclopts import Parameter

import relume as rl
from relume.cli.option_types import numbers

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

    def reading(self) -> rl.ReadOptions:
        """The same for `rl.read`; raises ValueError that names the option."""
        limits = rl.ReadOptions()
        pixels = limits.pixels
        if self.largest is not None:
            if not (math.isfinite(self.largest) and self.largest * _MEGAPIXEL >= 1):
                raise ValueError(f"--largest is {self.largest:g} megapixels; give a number like 500")
            pixels = int(self.largest * _MEGAPIXEL)
        return rl.ReadOptions(
            # Who raises the area means long strips too; memory is still held against what the machine has free.
            side=limits.side if pixels <= limits.pixels else pixels,
            pixels=pixels,
            decoded=max(limits.decoded, _BYTES * pixels),
            salvage=self.salvage,
            mantissa_middle=self.mantissa_middle,
            float_size=self.float_size,
            float_order=self.float_order,
        )
