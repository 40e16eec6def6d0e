"""The state of an interrupted render on disk: the sums of its passes, what they belong to, and a checksum of it all.

A file is eight bytes that name the format, the SHA-256 of what follows, the length of a JSON header, the header and
the planes' bytes. The file of the time before stays beside it as .previous, so that one that a dying disk damaged
costs no more than the passes between the two.
"""

from __future__ import annotations

import hashlib
import json
import os
import struct
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from relume.cluster.renaming import put_in_place, remove
from relume.errors import CannotResume, OutputNotWritten, warn
from relume.image.files import replacing

MAGIC = b"relumeC1"
_READABLE = 40
"""Characters of a part of a key that are shown to the user; a hash is longer."""


@dataclass(frozen=True, eq=False)
class Checkpoint:
    """What a render had done.

    key : what it belongs to, a name and a value each, as {"scene": its hash, "samples": "256"}
    planes : float64 sums by name
    passes : how many passes they hold
    state : small numbers that the loop goes on with
    """

    key: Mapping[str, str]
    planes: Mapping[str, np.ndarray]
    passes: int
    state: Mapping[str, int] = field(default_factory=dict)


def write_checkpoint(path: Path, checkpoint: Checkpoint) -> None:
    """Write it whole or not at all; what was there becomes `path` with .previous added.

    Raises OutputNotWritten in one line where the disk is full; the file that was there stays.
    """
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OutputNotWritten(f"{path.parent}: cannot be made ({error.strerror}); choose another -o") from None
    header = json.dumps(
        {
            "key": dict(checkpoint.key),
            "passes": checkpoint.passes,
            "state": dict(checkpoint.state),
            "planes": [[name, plane.dtype.str, plane.shape] for name, plane in checkpoint.planes.items()],
        }
    ).encode()
    parts = [struct.pack("<Q", len(header)), header]
    parts += [np.ascontiguousarray(plane).tobytes() for plane in checkpoint.planes.values()]
    digest = hashlib.sha256()
    for part in parts:
        digest.update(part)
    with replacing(path) as temporary:
        with open(temporary, "wb") as file:
            for part in (MAGIC, digest.digest(), *parts):
                file.write(part)
            file.flush()
            os.fsync(file.fileno())
        # Last, so that a disk which is full leaves both generations where they were.
        if path.exists():
            put_in_place(path, previous(path))


def read_checkpoint(path: Path, key: Mapping[str, str]) -> Checkpoint | None:
    """The latest whole state kept for `key`, or None where there is none that is whole.

    Warns of a file that is damaged. Raises CannotResume, naming what differs, where what is kept is whole but belongs
    to another key.
    """
    whole = [kept for kept in (_read(path), _read(previous(path))) if kept is not None]
    ours = [kept for kept in whole if dict(kept.key) == dict(key)]
    if ours:
        return max(ours, key=lambda kept: kept.passes)
    if whole:
        raise CannotResume(
            f"{path}: was begun with another {', '.join(_differences(whole[0].key, key))}; give restart=True "
            "to begin anew, or put back what it was begun with"
        )
    return None


def remove_checkpoint(path: Path) -> None:
    """Remove both generations, and temporary files that a killed process left; raises OutputNotWritten."""
    try:
        for file in (path, previous(path), *_left_behind(path)):
            remove(file)
    except OSError as error:
        raise OutputNotWritten(f"{path}: cannot be removed ({error.strerror}); choose another -o") from None


def previous(path: Path) -> Path:
    """Where the generation before lies."""
    return path.with_name(path.name + ".previous")


def _left_behind(path: Path) -> Iterator[Path]:
    """Temporary files of `replacing`, which are a point, the name and eight hexadecimal digits."""
    if path.parent.is_dir():
        yield from path.parent.glob(f".{path.stem[:80]}.{'[0-9a-f]' * 8}{path.suffix}")


def _differences(was: Mapping[str, str], now: Mapping[str, str]) -> list[str]:
    words = []
    for name in dict.fromkeys([*was, *now]):
        before, after = was.get(name, "none"), now.get(name, "none")
        if was.get(name) != now.get(name):
            words.append(f"{name} ({before}, now {after})" if max(len(before), len(after)) <= _READABLE else name)
    return words


def _read(path: Path) -> Checkpoint | None:
    """A whole file's contents, or None for one that is missing or damaged, of which it warns."""
    try:
        data = path.read_bytes()
    except OSError:
        return None
    start = len(MAGIC) + 32
    if data[: len(MAGIC)] != MAGIC or hashlib.sha256(data[start:]).digest() != data[len(MAGIC) : start]:
        warn(f"{path}: is damaged; its passes are traced again")
        return None
    # From here on the bytes are those that were written.
    length = struct.unpack_from("<Q", data, start)[0]
    header = json.loads(data[start + 8 : start + 8 + length])
    planes, offset = {}, start + 8 + length
    for name, kind, shape in header["planes"]:
        count = int(np.prod(shape, dtype=np.int64))
        planes[name] = np.frombuffer(data, kind, count, offset).reshape(shape)
        offset += planes[name].nbytes
    return Checkpoint(header["key"], planes, header["passes"], header["state"])
