"""What the studio's server answers about the light: edits of the whole map, and the maps that follow one another."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from starlette.requests import Request
from starlette.responses import Response

import relume as rl
from relume.studio.shots.answers import in_json
from relume.studio.shots.document import Document
from relume.studio.shots.folder import Folder
from relume.studio.shots.light.edits import cut_slice, diffuse_map, edited_map, painted_map, pointed_at
from relume.studio.shots.light.film import LightFilm


@dataclass(frozen=True)
class LightAnswers:
    """The answers about the light of a studio's shot.

    folder, document, scratch : the studio's
    state : all that a window shows
    named : the photographs of a table, as files of the folder by their names
    """

    folder: Folder
    document: Document
    scratch: Path
    state: Callable[[], dict[str, Any]]
    named: Callable[[object], list[str]]
    film: LightFilm = field(default_factory=LightFilm)

    def edited_light(self, _request: Request, body: dict[str, Any]) -> Response:
        """The light turned, brightened or converted, as the shot's finished map."""
        return self._as_light(*edited_map(self._light(), self.folder, body), body)

    def painted_light(self, _request: Request, body: dict[str, Any]) -> Response:
        """The light with what was painted on its slice, as the shot's finished map."""
        return self._as_light(*painted_map(self._light(), self.folder, body), body)

    def slice(self, _request: Request, body: dict[str, Any]) -> Response:
        """A slice of the light to paint on."""
        return in_json(cut_slice(self._light(), self.folder, body))

    def diffuse_light(self, _request: Request, _body: dict[str, Any]) -> Response:
        """The light as matte surfaces reflect it, which is shown and not kept."""
        diffuse_map(self._light(), self.scratch / "diffuse.exr")
        return in_json({"path": "diffuse.exr", "where": "scratch"})

    def _light(self) -> Path:
        """The shot's finished map, or the map that was measured last."""
        light = self.document.table.get("light", {})
        if isinstance(light, dict) and isinstance(light.get("map"), str):
            return self.folder.path(light["map"])
        if not (self.scratch / "light.exr").is_file():
            raise ValueError("the light is not measured yet; measure it first")
        return self.scratch / "light.exr"

    def _as_light(self, path: Path, facts: dict[str, Any], body: dict[str, Any]) -> Response:
        """The shot with another map for its light; the map goes where the edit is refused."""
        table, revision = self.document.table, body.get("revision")
        views = self.named((table.get("light", {}).get("balls") or [{}])[0])
        try:
            if not isinstance(revision, int):
                raise ValueError("give the revision that this is made to")
            photograph = views[len(views) // 2] if views else None
            changes = pointed_at(table, self.folder.name(path), photograph)
            self.document.edit(changes, revision=revision, unfinished=self.document.fault is not None)
        except (rl.RelumeError, ValueError):
            with suppress(OSError):  # why the edit was refused is what is said
                rl.files.remove(path)
            raise
        return in_json({"state": self.state(), "facts": facts})

    def frame(self, _request: Request, body: dict[str, Any]) -> Response:
        """A map of those that follow one another, its lights, and what a matte ball gets of it."""
        number = body.get("frame", 1)
        if not isinstance(number, int) or isinstance(number, bool):
            raise ValueError("frame is a whole number, 1 for the first map")
        return in_json(self.film.facts(self.document.table.get("light"), self.folder, number))


def light_routes(light: LightAnswers) -> dict[str, Callable[[Request, dict[str, Any]], Response]]:
    """The addresses of the light and what answers there."""
    return {
        "/light/edited": light.edited_light,
        "/light/slice": light.slice,
        "/light/diffuse": light.diffuse_light,
        "/light/painted": light.painted_light,
        "/light/frame": light.frame,
    }
