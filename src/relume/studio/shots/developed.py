"""Composites through other cameras: a preset, a film or a tone operator, with glare, as `relume develop` makes them."""

from __future__ import annotations

import hashlib
import json
import shlex
import tomllib
import warnings
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

import relume as rl
from relume.studio.shots.camera_parameters import flattened, nested, settings_of
from relume.studio.words import in_the_page

TONES = ("exposure", "reinhard", "reinhard-local", "histogram", "human", "tumblin-rushmeier", "ferwerda", "pattanaik")


GLARES = ("eye", "camera")
SOURCES = ("composite.exr", "preview.exr")
LAYERS = "layers.exr"
"""Beside the composite, with its depth."""
ENDINGS = {"pq": ".avif", "hlg": ".avif", "gain-map": ".jpg"}
"""Of pictures for HDR displays; those for others are PNG."""


@dataclass(frozen=True)
class Way:
    """A way to develop, as a page asks for it.

    preset, tone, glare : by name; "" for none
    exposure : stops on top
    settings : tables of a preset, which stand above all others
    """

    preset: str = ""
    tone: str = ""
    glare: str = ""
    exposure: float = 0.0
    settings: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)

    @staticmethod
    def of(body: Mapping[str, Any]) -> Way:
        """The way that a page asks for; raises ValueError for what there is none of."""
        given = {key: str(body[key]) for key in ("preset", "tone", "glare") if body.get(key)}
        for key, known in (("preset", presets()), ("tone", TONES), ("glare", GLARES)):
            if key in given and given[key] not in known:
                raise ValueError(f"there is no such {key}; there are {', '.join(known)}")
        exposure = body.get("exposure", 0)
        if isinstance(exposure, bool) or not isinstance(exposure, int | float) or not abs(exposure) <= 100:
            raise ValueError("exposure is a number of stops")
        return Way(**given, exposure=float(exposure), settings=settings_of(body.get("settings") or {}))

    @property
    def tables(self) -> dict[str, Any]:
        """What stands above the preset."""
        found: dict[str, Any] = {"exposure": self.exposure} if self.exposure else {}
        for key in ("tone", "glare"):
            if getattr(self, key):
                found[key] = {"kind": getattr(self, key)}
        for table, keys in self.settings.items():
            there = found.get(table, {})
            same = keys.get("kind", there.get("kind")) == there.get("kind")
            found[table] = (there if same else {}) | nested(keys)
        return found

    @property
    def name(self) -> str:
        """A name for a file."""
        stops = f"{self.exposure:+g}" if self.exposure else ""
        set_by = hashlib.blake2b(json.dumps(self.settings, sort_keys=True).encode(), digest_size=3).hexdigest()
        words = (self.preset, self.tone, self.glare, stops, set_by if self.settings else "")
        ending = ENDINGS.get(str(self.settings.get("display", {}).get("kind")), ".png")
        return "developed_" + "_".join(filter(None, words)) + ending

    def command(self, source: str, out: str, degrees: float) -> str:
        """The command that does the same."""
        words = ["relume", "develop", f"{out}/{source}", "-o", f"{out}/{self.name}"]
        chosen = {
            table for table, keys in self.settings.items() if keys.get("kind", "") not in ("", getattr(self, table, ""))
        }
        for key in ("preset", "tone", "glare"):
            words += [f"--{key}", getattr(self, key)] if getattr(self, key) and key not in chosen else []
        words += [f"--exposure={self.exposure:g}"] if self.exposure else []
        for table, keys in self.settings.items():
            words += [] if keys else ["--set", f"{table}={{}}"]
            for key, value in keys.items():
                if key != "kind" or table in chosen:
                    words += ["--set", f"{table}.{key}={_in_toml(value)}"]
        words += ["--depth", f"{out}/{LAYERS}"] if "defocus" in self.settings else []
        return shlex.join([*words, "--field-of-view", f"{degrees:.6g}"])

    def python(self, source: str, out: str, degrees: float) -> str:
        """The Python that does the same."""
        depth = f', depth=Path("{out}/{LAYERS}")' if "defocus" in self.settings else ""
        return (
            "import math\nfrom pathlib import Path\n\nimport relume as rl\n\n"
            f"preset = rl.CameraPreset.read({self.preset or None!r}, {self.tables})\n"
            f"settings = rl.DevelopSettings(preset=preset, field_of_view=math.radians({degrees:.6g}){depth})\n"
            f'rl.develop_file(Path("{out}/{source}"), Path("{out}/{self.name}"), settings)'
        )


def _in_toml(value: Any) -> str:
    """A value as `--set` takes it."""
    return value if isinstance(value, str) else json.dumps(value)


def presets() -> dict[str, str]:
    """The built-in cameras whose pictures a page can show, name → what it is."""
    known = rl.CameraPreset.builtin()
    return {name: title for name, title in known.items() if "display" not in tomllib.loads(rl.CameraPreset.text(name))}


def preset_parameters(name: str) -> dict[str, dict[str, Any]]:
    """What a built-in camera sets, by table and key as `camera_parameters` has them."""
    tables = tomllib.loads(rl.CameraPreset.text(name))
    return {table: flattened(keys) for table, keys in tables.items() if isinstance(keys, dict)}


def has_depth(results: Path, source: str) -> bool:
    """Whether the depth of a result is known."""
    return source == SOURCES[0] and (results / source).is_file() and (results / LAYERS).is_file()


def developed(
    body: Mapping[str, Any], *, results: Path, named: str, scratch: Path, camera: rl.Camera | None
) -> dict[str, Any]:
    """Develop a result, beside the others where it is to be kept; the facts of that for JSON.

    body : of, the result; the way, as `Way.of` has it; keep, whether among the results
    named : what the folder of results is called in a command
    camera : of the plate, whose angle of view glare and acuity ask for
    Raises RelumeError, ValueError.
    """
    source, way = body.get("of"), Way.of(body)
    if source not in SOURCES or not (results / str(source)).is_file():
        raise ValueError("nothing is rendered yet; take a quick look first")
    across = 50.0 if camera is None else float(np.degrees(2 * np.arctan(camera.width / 2 / camera.focal_length)))
    degrees = float(f"{across:.6g}")  # as the command says it
    if "defocus" in way.settings and not has_depth(results, str(source)):
        raise ValueError("depth of field needs the composite's depth; render the composite first")
    settings = rl.DevelopSettings(
        preset=rl.CameraPreset.read(way.preset or None, way.tables), field_of_view=float(np.radians(degrees)),
        depth=results / LAYERS if "defocus" in way.settings else None,
    )  # fmt: skip
    keep = body.get("keep") is True
    # The side that was not changed is there already: the page asks for both at each change of one.
    made_of = f"{way} {degrees} {_stamps(results, str(source))}"
    note = scratch / f"{way.name}.json"
    doubts = None if keep else _doubts_of(note, made_of)
    if doubts is None:
        note.unlink(missing_ok=True)
        with warnings.catch_warnings(record=True) as said:
            warnings.simplefilter("always")
            rl.develop_file(results / str(source), (results if keep else scratch) / way.name, settings)
        doubts = [in_the_page(str(each.message)) for each in said]
        if not keep:
            note.write_text(json.dumps([made_of, doubts]), encoding="utf-8")
    return {
        "path": way.name, "where": "results" if keep else "scratch", "doubts": doubts,
        "command": way.command(str(source), named, degrees), "python": way.python(str(source), named, degrees),
    }  # fmt: skip


def _stamps(results: Path, source: str) -> list[tuple[int, int]]:
    """By what one result and its layers differ from the next of the same name: size and time of writing."""
    there = [path.stat() for path in (results / source, results / LAYERS) if path.is_file()]
    return [(each.st_size, each.st_mtime_ns) for each in there]


def _doubts_of(note: Path, made_of: str) -> list[str] | None:
    """What was doubted of a picture that was made of just this; None where it has to be made."""
    try:
        known, doubts = json.loads(note.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return None
    return doubts if known == made_of and note.with_suffix("").is_file() else None
