"""What the server of a place file answers: the file and its edits, photographs, blocks' bodies, the job."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import Response
from starlette.routing import Route, WebSocketRoute
from starlette.websockets import WebSocket

import relume as rl
from relume.studio.library import Library
from relume.studio.pages import page_routes
from relume.studio.places.found import found_facts
from relume.studio.routes import UNKEPT, answered, picture_routes
from relume.studio.shots.answers import edit_as_asked, in_json, say_changes, taking_json, undo_as_asked
from relume.studio.shots.document import Document
from relume.studio.shots.folder import Folder
from relume.studio.shots.jobs import Jobs
from relume.studio.shots.photographs import Thumbnails
from relume.studio.words import in_the_page

JOB = "model"


@dataclass
class PlaceStudio:
    """One place file with its folder, open pictures and worker.

    bodies : of the blocks, as the file had them when it was last sound
    solved : the user's own text from which each text of what was found came, as far as that is known
    """

    folder: Folder
    document: Document
    library: Library
    jobs: Jobs
    thumbnails: Thumbnails = field(default_factory=Thumbnails)
    bodies: dict[str, rl.scene.Body] = field(default_factory=dict)
    solved: dict[str, str] = field(default_factory=dict)
    begun: str | None = None

    def state(self) -> dict[str, Any]:
        """All that a window shows: the file, its blocks' edges, what was found, the job."""
        document = self.document.state()
        own, found = self._parts()
        if found and found not in self.solved:
            ours = self.jobs.state["status"] in ("running", "done")
            self.solved[found] = (self.begun if ours else None) or own
        if document["fault"] is None:
            self.bodies = rl.scene.read_place_bodies(self.document.path)
        bodies = {name: _names(body) for name, body in self.bodies.items()}
        return document | {
            "folder": str(self.folder.root), "bodies": bodies, "kinds": rl.scene.BLOCK_KINDS, "job": self.jobs.state,
            "there": [path is not None for path in self._photographs()],
            "stale": bool(found) and self.solved[found] != own,
        } | self._found()  # fmt: skip

    def _parts(self) -> tuple[str, str]:
        """The user's own text, and the text of what was found."""
        own = rl.scene.without_found(self.document.text).rstrip()
        return own, self.document.text[len(own) :].strip()

    def _found(self) -> dict[str, Any]:
        try:
            return {"found": found_facts(self.document.path), "lacks": None}
        except rl.RelumeError as error:
            line = str(error).removeprefix(f"{self.document.path}: ")
            return {"found": None, "lacks": in_the_page(line)}

    def _photographs(self) -> list[Path | None]:
        """The photographs' files in the order of the place file; None of one that is not there."""
        tables = self.document.table.get("photographs", [])
        tables = tables if isinstance(tables, list) else []
        names = [each.get("file") if isinstance(each, dict) else None for each in tables]
        paths = [self.folder.root / name if isinstance(name, str) and name else None for name in names]
        return [path if path is not None and path.is_file() else None for path in paths]

    def place(self, _request: Request) -> Response:
        """The place file as it is now."""
        self.document.look()
        return in_json(self.state())

    def edit(self, _request: Request, body: dict[str, Any]) -> Response:
        """Change the place file."""
        edit_as_asked(self.document, self.folder, body, unfinished=self.document.fault is not None)
        return in_json(self.state())

    def undo(self, _request: Request, body: dict[str, Any]) -> Response:
        """Go back in the file's history, or on where `by` is negative."""
        undo_as_asked(self.document, body)
        return in_json(self.state())

    def others(self, _request: Request) -> Response:
        """The folder's pictures that the place does not name yet."""
        named = {path.resolve() for path in self._photographs() if path is not None}
        found = [path for path in self.folder.pictures(self.folder.root / "out") if path not in named]
        return in_json({"files": [self.folder.name(path) for path in found]})

    def thumbnail(self, request: Request) -> Response:
        """A small picture of a photograph, by its number in the file."""
        content, doubt = self.thumbnails.of(self._photograph(request.path_params["number"]))
        return Response(content, media_type="image/jpeg", headers={"x-doubt": doubt, **UNKEPT})

    def opened(self, _request: Request, body: dict[str, Any]) -> Response:
        """The number under which a photograph is shown."""
        return in_json({"number": self.library.add(self._photograph(body.get("photograph")))})

    def _photograph(self, number: Any) -> Path:
        paths = self._photographs()
        path = paths[number] if isinstance(number, int) and 0 <= number < len(paths) else None
        if path is None:
            raise LookupError
        return path

    def body(self, request: Request) -> Response:
        """A block's body in its unit cube, and a block's size, metres, as far as that is known."""
        name = request.query_params.get("block", "")
        body = self.bodies.get(name)
        if body is None:
            raise LookupError
        return in_json({"vertices": body.vertices.tolist(), "faces": body.faces, "edges": body.edges,
                        "corners": body.corners, "flat": body.flat})  # fmt: skip

    def start(self, _request: Request, _body: dict[str, Any]) -> Response:
        """Find cameras and sizes, in place of the job that runs."""
        self.document.look()
        if self.document.fault is not None:
            raise ValueError(f"the place file is not sound: {self.document.fault}")
        self.begun = self._parts()[0]
        path = self.document.path
        return in_json({"number": self.jobs.start(JOB, path, path.parent)})

    def stop(self, _request: Request, _body: dict[str, Any]) -> Response:
        """Stop the job that runs."""
        self.jobs.stop()
        return in_json({})

    async def events(self, socket: WebSocket) -> None:
        """Says what the place is, whenever that changes, until the window is closed."""
        await say_changes(socket, self.document, self.library, self.jobs, self.state)


def _names(body: rl.scene.Body) -> dict[str, list[str]]:
    """What of a body may be marked; of two names of one edge, as a ring and the bottom, the first."""
    rings = {ring: name for name, ring in reversed(body.edges.items())}
    edges = [name for name, ring in body.edges.items() if rings[ring] == name]
    curved = [name for name in body.edges if len(body.edges[name]) > 2]
    return {"edges": edges, "corners": list(body.corners), "curved": curved}


def place_application(studio: PlaceStudio) -> Starlette:
    """The application of a place file, not yet guarded."""

    def posted(path: str, endpoint: Callable[[Request, dict[str, Any]], Response]) -> Route:
        return Route(path, taking_json(endpoint), methods=["POST"])

    return Starlette(
        routes=[
            *page_routes("place/place.html"),
            Route("/place", answered(studio.place)),
            posted("/place/edit", studio.edit),
            posted("/place/undo", studio.undo),
            Route("/place/body", answered(studio.body)),
            Route("/photographs", answered(studio.others)),
            Route("/photographs/{number:int}", answered(studio.thumbnail)),
            posted("/opened", studio.opened),
            posted("/jobs/start", studio.start),
            posted("/jobs/stop", studio.stop),
            *picture_routes(studio.library),
            WebSocketRoute("/events", studio.events),
        ]
    )
