"""What the server answers: pages, pictures as tiles, exact values, statistics, and what changed on disk."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from starlette.applications import Starlette
from starlette.concurrency import run_in_threadpool
from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import JSONResponse, Response
from starlette.routing import Route, WebSocketRoute
from starlette.websockets import WebSocket, WebSocketDisconnect

import relume as rl
from relume.studio.library import Library
from relume.studio.measuring import Box, differences, statistics, value_at, values
from relume.studio.pages import page_routes
from relume.studio.pictures import Layer, OpenPicture
from relume.studio.ray_trees import SceneTrees
from relume.studio.words import in_the_page

BEAT, ALIVE = 2.0, {"alive": True}
"""Seconds between words that say no more than that the server is there: a page says so when they stay away."""
WATCHED_EVERY = 1.0
"""Seconds between looks at the files."""
UNKEPT = {"cache-control": "no-store"}
FOREVER = "private, max-age=31536000, immutable"
BYTES = "application/octet-stream"


@dataclass(frozen=True)
class Answers:
    """What is answered about a library's pictures."""

    library: Library
    trees: SceneTrees | None = None

    def pictures(self, _request: Request) -> Response:
        """The files, in the order in which they were named, and the scene file whose trees of rays are known."""
        files = [{"name": file.name, "path": str(file)} for file in self.library.files]
        return _json({"files": files, "scene": None if self.trees is None else self.trees.path.name})

    def tree(self, request: Request) -> Response:
        """The tree of rays behind a pixel."""
        if self.trees is None:
            raise LookupError
        try:
            return _json(self.trees.of(_number(request, "x"), _number(request, "y")))
        except ValueError as error:
            raise HTTPException(422, " ".join(str(error).split())) from None

    def picture(self, request: Request) -> Response:
        """A file's facts and layers, with the names of their contents."""
        return _json(self.library.picture(_whole(request, "number")).facts())

    def tile(self, request: Request) -> Response:
        """A tile's pixels under an address that names its content, so that it never changes."""
        number, layer = _whole(request, "number"), _whole(request, "layer")
        level, column, row = (_whole(request, name) for name in ("level", "column", "row"))
        found = self.library.layer(number, layer)[1]
        if request.path_params["digest"] != found.digest:
            raise HTTPException(410, "the file changed; open it again")
        headers = {"etag": f'"{found.digest}-{level}-{column}-{row}"', "cache-control": FOREVER}
        if headers["etag"] in request.headers.get("if-none-match", ""):
            return Response(status_code=304, headers=headers)
        return Response(found.tile(level, column, row), media_type=BYTES, headers=headers)

    def value(self, request: Request) -> Response:
        """One pixel, exactly."""
        picture, layer = self._asked(request)
        return _json(value_at(picture, layer, _number(request, "x"), _number(request, "y")))

    def values(self, request: Request) -> Response:
        """The pixels of a small box, exactly."""
        box = _box(request)
        if box is None:
            raise HTTPException(400, "box is missing; give x,y,width,height")
        return Response(values(self._asked(request)[1], box).tobytes(), media_type=BYTES, headers=UNKEPT)

    def statistics(self, request: Request) -> Response:
        """Those of a box, or of the whole picture."""
        return _json(statistics(*self._asked(request), _box(request)))

    def difference(self, request: Request) -> Response:
        """How far a layer is from another one, in a box or everywhere."""
        other = self.library.layer(_number(request, "other"), _number(request, "other_layer"))[1]
        try:
            gain = float(request.query_params.get("gain", "1"))
            return _json(differences(self._asked(request)[1], other, _box(request), gain))
        except ValueError as error:
            raise HTTPException(400, str(error)) from None

    async def events(self, socket: WebSocket) -> None:
        """Says which files changed on disk, until the page is closed."""
        await socket.accept()
        ended = asyncio.create_task(closed(socket))
        next_beat = 0.0
        seen = await run_in_threadpool(self.library.stamps)
        while not ended.done():
            await asyncio.wait([ended], timeout=WATCHED_EVERY)
            now = await run_in_threadpool(self.library.stamps)
            for number, (before, stamp) in enumerate(zip(seen, now, strict=True)):
                if before != stamp and not ended.done():
                    await socket.send_json({"changed": number})
            seen = now
            if time.monotonic() >= next_beat and not ended.done():
                await socket.send_json(ALIVE)
                next_beat = time.monotonic() + BEAT

    def _asked(self, request: Request) -> tuple[OpenPicture, Layer]:
        return self.library.layer(_whole(request, "number"), _number(request, "layer", 0))


def application(library: Library, trees: SceneTrees | None = None) -> Starlette:
    """The application over a library of pictures, not yet guarded."""
    answers = Answers(library, trees)

    return Starlette(
        routes=[
            *page_routes("view.html"),
            *picture_routes(library, trees),
            Route("/tree", answered(answers.tree)),
            WebSocketRoute("/events", answers.events),
        ]
    )


def picture_routes(library: Library, trees: SceneTrees | None = None) -> list[Route]:
    """What is answered about a library's pictures, wherever they are shown."""
    answers = Answers(library, trees)
    return [
        Route("/pictures", answered(answers.pictures)),
        Route("/pictures/{number:int}", answered(answers.picture)),
        Route("/pictures/{number:int}/value", answered(answers.value)),
        Route("/pictures/{number:int}/values", answered(answers.values)),
        Route("/pictures/{number:int}/statistics", answered(answers.statistics)),
        Route("/pictures/{number:int}/difference", answered(answers.difference)),
        Route("/tiles/{number:int}/{layer:int}/{digest}/{level:int}/{column:int}/{row:int}", answered(answers.tile)),
    ]


def answered(endpoint: Callable[[Request], Response]) -> Callable[[Request], Response]:
    """The endpoint, with what cannot be answered as one line of JSON."""

    def answer(request: Request) -> Response:
        try:
            return endpoint(request)
        except LookupError:
            return JSONResponse({"error": "there is no such picture, layer, tile or pixel"}, 404, UNKEPT)
        except rl.RelumeError as error:
            return JSONResponse({"error": in_the_page(str(error))}, 422, UNKEPT)
        except HTTPException as error:
            return JSONResponse({"error": error.detail}, error.status_code, UNKEPT)

    return answer


async def closed(socket: WebSocket) -> None:
    """Wait until the page at the other end has gone."""
    try:
        while True:
            await socket.receive_text()
    except (WebSocketDisconnect, KeyError):
        return


def _json(content: Any) -> Response:
    return JSONResponse(content, headers=UNKEPT)


def _whole(request: Request, name: str) -> int:
    return int(request.path_params[name])


def _number(request: Request, name: str, otherwise: int | None = None) -> int:
    text = request.query_params.get(name)
    if text is None and otherwise is not None:
        return otherwise
    try:
        return int(text or "")
    except ValueError:
        raise HTTPException(400, f'{name} is "{(text or "")[:20]}"; give a whole number') from None


def _box(request: Request) -> Box | None:
    """x,y,width,height from the query; None where it has no box."""
    text = request.query_params.get("box")
    if text is None:
        return None
    try:
        x, y, width, height = (int(part) for part in text.split(","))
    except ValueError:
        raise HTTPException(400, f'box is "{text[:40]}"; give x,y,width,height in whole pixels') from None
    return x, y, width, height
