"""What the server answers: pages, pictures as tiles, exact values, statistics, and what changed on disk."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from pathlib import Path
from typing import Any

from starlette.applications import Starlette
from starlette.concurrency import run_in_threadpool
from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import FileResponse, JSONResponse, Response
from starlette.routing import Mount, Route, WebSocketRoute
from starlette.staticfiles import StaticFiles
from starlette.websockets import WebSocket, WebSocketDisconnect

from relume.errors import RelumeError
from relume.studio.library import Library
from relume.studio.measuring import Box, differences, statistics, value_at, values

PAGE = Path(__file__).parent / "page"
WATCHED_EVERY = 1.0
"""Seconds between looks at the files."""
FOREVER = "private, max-age=31536000, immutable"


def application(library: Library) -> Starlette:
    """The application over a library of pictures, not yet guarded."""

    def pictures(_request: Request) -> Response:
        return _json({"files": [{"name": file.name, "path": str(file)} for file in library.files]})

    def picture(request: Request) -> Response:
        return _json(library.picture(_whole(request, "number")).facts())

    def tile(request: Request) -> Response:
        number, layer = _whole(request, "number"), _whole(request, "layer")
        level, column, row = (_whole(request, name) for name in ("level", "column", "row"))
        found = library.layer(number, layer)[1]
        tag = f'"{found.digest}-{level}-{column}-{row}"'
        if request.path_params["digest"] != found.digest:
            raise HTTPException(410, "the file changed; open it again")
        headers = {"etag": tag, "cache-control": FOREVER}
        if tag in request.headers.get("if-none-match", ""):
            return Response(status_code=304, headers=headers)
        return Response(found.tile(level, column, row), media_type="application/octet-stream", headers=headers)

    def value(request: Request) -> Response:
        picture, layer = _asked(request)
        return _json(value_at(picture, layer, _number(request, "x"), _number(request, "y")))

    def box_of_values(request: Request) -> Response:
        _, layer = _asked(request)
        box = _box(request)
        if box is None:
            raise HTTPException(400, "box is missing; give x,y,width,height")
        return Response(values(layer, box).tobytes(), media_type="application/octet-stream", headers=_unkept())

    def region(request: Request) -> Response:
        picture, layer = _asked(request)
        return _json(statistics(picture, layer, _box(request)))

    def compared(request: Request) -> Response:
        _, layer = _asked(request)
        other, of = (_number(request, name) for name in ("other", "other_layer"))
        try:
            return _json(differences(layer, library.layer(other, of)[1], _box(request)))
        except ValueError as error:
            raise HTTPException(400, str(error)) from None

    def _asked(request: Request) -> Any:
        return library.layer(_whole(request, "number"), _number(request, "layer", 0))

    async def events(socket: WebSocket) -> None:
        await socket.accept()
        closed = asyncio.create_task(_closed(socket))
        seen = await run_in_threadpool(library.stamps)
        while not closed.done():
            await asyncio.wait([closed], timeout=WATCHED_EVERY)
            now = await run_in_threadpool(library.stamps)
            for number, (before, stamp) in enumerate(zip(seen, now, strict=True)):
                if before != stamp and not closed.done():
                    await socket.send_json({"changed": number})
            seen = now

    def index(_request: Request) -> Response:
        return FileResponse(PAGE / "view.html", headers={"cache-control": "no-store"})

    return Starlette(
        routes=[
            Route("/", index),
            Route("/pictures", _answered(pictures)),
            Route("/pictures/{number:int}", _answered(picture)),
            Route("/tiles/{number:int}/{layer:int}/{digest}/{level:int}/{column:int}/{row:int}", _answered(tile)),
            Route("/pictures/{number:int}/value", _answered(value)),
            Route("/pictures/{number:int}/values", _answered(box_of_values)),
            Route("/pictures/{number:int}/statistics", _answered(region)),
            Route("/pictures/{number:int}/difference", _answered(compared)),
            WebSocketRoute("/events", events),
            Mount("/page", StaticFiles(directory=PAGE)),
        ]
    )


def _answered(endpoint: Callable[[Request], Response]) -> Callable[[Request], Response]:
    """The endpoint, with what cannot be answered as one line of JSON."""

    def answer(request: Request) -> Response:
        try:
            return endpoint(request)
        except LookupError:
            return JSONResponse({"error": "there is no such picture, layer, tile or pixel"}, 404, _unkept())
        except RelumeError as error:
            return JSONResponse({"error": " ".join(str(error).split())}, 422, _unkept())
        except HTTPException as error:
            return JSONResponse({"error": error.detail}, error.status_code, _unkept())

    return answer


async def _closed(socket: WebSocket) -> None:
    try:
        while True:
            await socket.receive_text()
    except (WebSocketDisconnect, KeyError):
        return


def _json(content: Any) -> Response:
    return JSONResponse(content, headers=_unkept())


def _unkept() -> dict[str, str]:
    return {"cache-control": "no-store"}


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
