"""How files are read: what relume will decode, and what it does where a file leaves a choice.

The limits stand between a header and the allocation it asks for: a file of fifty bytes may claim any size. Bounds on
sides alone are not enough (nothings/stb#1996), so areas, decoded bytes and their ratio to the file are bounded too.
"""

from __future__ import annotations

import os
from dataclasses import dataclass
from typing import Literal

from relume.errors import UnreadableFile

OR_SALVAGE = "copy it again from where it came, or salvage what is there (--salvage)"
"""What to do about a file that ends early."""
_SMALL = 2**26  # bytes decoded; below, no ratio is absurd


@dataclass(frozen=True)
class ReadOptions:
    """What is accepted of a file, and how it is understood; every default is right for pictures of photographs.

    side, pixels : of a picture, at most
    channels : of a picture, at most
    decoded : bytes in memory, at most; half of what the machine has free where that is less
    ratio : of decoded bytes to those of the file, at most, above 64 MiB: no photograph packs tighter
    metadata : bytes of one header or block of metadata, at most
    parts : of an EXR, or folders of a TIFF, at most; our own maps of a BRDF have 264
    salvage : read a file that ends early as far as it goes; what is missing is 0 and marked OUTSIDE, with a warning
    mantissa_middle : read Radiance mantissas as the middle of their step, c + ½, as programs do that write by
        truncation (old Radiance, Mitsuba, OpenImageIO); off because rounding writers, as ours, mean c itself
    float_size : (width, height) of a raw .float file, which stores none; a square one is inferred
    float_order : byte order of a raw .float file; None takes the one of the two that makes sense
    """

    side: int = 2**16
    pixels: int = 2**28
    channels: int = 64
    decoded: int = 2**33
    ratio: int = 10_000
    metadata: int = 2**24
    parts: int = 1024
    salvage: bool = False
    mantissa_middle: bool = False
    float_size: tuple[int, int] | None = None
    float_order: Literal["little", "big"] | None = None

    def __post_init__(self) -> None:
        for name in ("side", "pixels", "channels", "decoded", "ratio", "metadata", "parts"):
            if getattr(self, name) < 1:
                raise ValueError(f"{name} is {getattr(self, name)}; a limit is at least 1")
        if self.float_size is not None and min(self.float_size) < 1:
            raise ValueError(f"float_size is {self.float_size}; expected (width, height) in pixels")
        if self.float_order not in (None, "little", "big"):
            raise ValueError(f'float_order is "{self.float_order}"; expected "little" or "big"')


def refuse_absurd_size(
    path: str | os.PathLike[str],
    width: int,
    height: int,
    options: ReadOptions = ReadOptions(),
    *,
    where: str = "its header",
) -> None:
    """Raise UnreadableFile when `where` claims no pixels, or more than `options` allows."""
    if width < 1 or height < 1:
        raise UnreadableFile(f"{path}: {where} claims {width} x {height} pixels; the file is damaged")
    if max(width, height) > options.side or width * height > options.pixels:
        raise UnreadableFile(
            f"{path}: {where} claims {width} x {height} pixels; relume reads sides up to {options.side}"
            f" and {options.pixels} pixels in all: copy it again, or raise that (--largest MEGAPIXELS) if that is so"
        )


def refuse_absurd_amount(
    path: str | os.PathLike[str], decoded: int, stored: int, options: ReadOptions = ReadOptions(), *, flat: bool = False
) -> None:
    """Raise UnreadableFile when decoding takes more memory than `options` and the machine allow, or too little file.

    decoded, stored : bytes in memory and in the file
    flat : the format stores an even picture in next to nothing (ZIP, PIZ), so that no ratio is absurd
    """
    allowed = min(options.decoded, _half_of_free_memory())
    if decoded > allowed:
        raise UnreadableFile(
            f"{path}: its header claims {decoded} bytes of pixels; relume decodes {allowed} here: scale it down"
        )
    if not flat and decoded > max(_SMALL, options.ratio * stored):
        raise UnreadableFile(
            f"{path}: its header claims {decoded} bytes of pixels, which {stored} bytes of file cannot hold; copy it "
            "again from where it came"
        )


def _half_of_free_memory() -> int:
    """Half the memory that the machine, and the container it may be, can give now; no bound where that is unknown."""
    free = 2**63
    try:
        with open("/proc/meminfo", encoding="ascii") as file:
            for line in file:
                if line.startswith("MemAvailable:"):
                    free = int(line.split()[1]) * 1024
        with open("/sys/fs/cgroup/memory.max", encoding="ascii") as most:
            with open("/sys/fs/cgroup/memory.current", encoding="ascii") as used:
                free = min(free, int(most.read()) - int(used.read()))  # "max" where there is no bound
    except (OSError, ValueError):
        pass
    return max(free, 0) // 2
