"""Options that the commands of a light stage share: which stage, which camera, memory, and what may be written."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter, Token

import relume as rl
from relume.cli.arguments import require_output_folder, require_suffix

_UNITS = {"K": 1 << 10, "M": 1 << 20, "G": 1 << 30, "T": 1 << 40}


def _bytes(kind: Any, tokens: Sequence[Token]) -> int:
    """Bytes from "500M", "4G" or a plain number."""
    text = tokens[-1].value
    word = text.strip().upper().removesuffix("B").removesuffix("I")
    try:
        size = int(float(word.rstrip("KMGT")) * _UNITS.get(word[-1:], 1))
    except (OverflowError, ValueError):
        raise ValueError(f'"{text}" is not a size; write bytes, like 500M or 4G') from None
    if size < 1 << 24:
        raise ValueError(f'"{text}" is less than the 16M that a block of pictures needs')
    return size


def place(kind: Any, tokens: Sequence[Token]) -> Path | str:
    """A URL as it is, anything else as a path."""
    text = tokens[-1].value
    return text if "://" in text else Path(text)


Stage = Annotated[
    Path | str,
    Parameter(
        converter=place,
        n_tokens=1,
        help="A folder with stage.json or one .lp, such a file, or a store of `relume stage import`, by its path or an "
        "fsspec URL like s3://bucket/cat.zarr.",
    ),
]
Camera = Annotated[str | None, Parameter(help="The camera whose pictures are used; the stage's first unless given.")]
MaxMemory = Annotated[
    int,
    Parameter(
        converter=_bytes,
        n_tokens=1,
        metavar="SIZE",
        show_default=lambda size: f"{size >> 30}G",
        help="Memory for pictures at most, like 500M or 4G.",
    ),
]
MEMORY = 2 << 30
Exposure = Annotated[float, Parameter(allow_leading_hyphen=True, help="Stops to brighten .png, .jpg and .mp4 by.")]


def existing_parent(out: Path) -> Path:
    """The nearest folder above an output that is there: what blocks write lies in it until it is put together."""
    return next((folder for folder in out.absolute().parents if folder.is_dir()), Path.cwd())


def work_facts(work: rl.lightstage.Work) -> dict[str, object]:
    """What a dry run prints of the work."""
    rows, columns = work.shape
    facts: dict[str, object] = {"lights": work.lights, "size": [columns, rows]}
    facts["values as floats"] = _readable(work.value_bytes)
    if work.seconds is not None:
        facts |= {"memory": _readable(work.memory), "seconds, about": float(f"{work.seconds:.2g}")}
    return facts


def rounded(values: Any, digits: int = 4) -> list[float]:
    """Numbers as a terminal shows them."""
    return [float(f"{value:.{digits}g}") for value in values]


def require_picture(out: Path) -> None:
    """Refuse a name that no picture can be written to."""
    require_suffix(out, ".exr", ".hdr", ".png", ".jpg", ".jpeg")


def require_frames(out: Path, frames: int) -> None:
    """Refuse a number or a name that no frames can be written to."""
    if frames < 2:
        raise ValueError(f"--frames is {frames}; give 2 or more, like 72")
    if out.suffix.lower() == ".mp4":
        require_suffix(out, ".mp4")
    elif out.suffix:
        raise ValueError(f"-o {out}: --frames writes a folder or an .mp4; give one of them")
    else:
        require_output_folder(out)


def _readable(size: int) -> str:
    for letter in ("G", "M", "K"):
        if size >= _UNITS[letter]:
            return f"{size / _UNITS[letter]:.3g} {letter}iB"
    return f"{size} B"
