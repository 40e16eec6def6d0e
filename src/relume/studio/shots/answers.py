"""How the studio's server takes what a page sends, and says in one line what it refuses."""

from __future__ import annotations

import asyncio
import json
import time
from collections.abc import Callable
from typing import Any

from starlette.concurrency import run_in_threadpool
from starlette.exceptions import HTTPException
from starlette.requests import ClientDisconnect, Request
from starlette.responses import JSONResponse, Response
from starlette.websockets import WebSocket

import relume as rl
from relume.studio.library import Library
from relume.studio.routes import ALIVE, BEAT, UNKEPT, closed
from relume.studio.shots.document import Conflict, Document
from relume.studio.shots.folder import Folder
from relume.studio.shots.jobs import Jobs
from relume.studio.words import in_the_page

LARGEST_BODY = 1024**2
"""Bytes of a request that edits; the largest of ours has some thousand."""
LOOKED_AT_EVERY = 0.2
"""Seconds between looks at the shot file and the pictures for each window."""
JOB_LOOKED_AT_EVERY = 0.02
"""Seconds between looks at the job, which is a number in memory."""


def in_json(content: Any) -> Response:
    """An answer that is not kept."""
    return JSONResponse(content, headers=UNKEPT)


def taking_json(endpoint: Callable[[Request, dict[str, Any]], Response]) -> Callable[[Request], Any]:
    """An endpoint that takes a small JSON object; what it refuses is one line of JSON."""

    async def answer(request: Request) -> Response:
        body = b""
        async for chunk in request.stream():
            body += chunk
            if len(body) > LARGEST_BODY:
                return JSONResponse({"error": "the request is too large"}, 413, UNKEPT)
        try:
            content = json.loads(body or b"{}", parse_constant=_refuse_constant)
            if not isinstance(content, dict):
                raise ValueError
        except (ValueError, RecursionError):
            return JSONResponse({"error": "give a JSON object of finite numbers"}, 400, UNKEPT)
        return await run_in_threadpool(_refused_in_a_line(lambda: endpoint(request, content)))

    return answer


def taking_bytes(endpoint: Callable[[Request], Any]) -> Callable[[Request], Any]:
    """An endpoint whose body is bytes; a fault is answered by one line."""

    async def answer(request: Request) -> Response:
        try:
            return await endpoint(request)
        except HTTPException as error:
            return JSONResponse({"error": error.detail}, error.status_code, {**UNKEPT, "connection": "close"})
        except (rl.RelumeError, ValueError) as error:
            return JSONResponse({"error": in_the_page(str(error))}, 422, UNKEPT)
        except ClientDisconnect:
            return Response(status_code=400)

    return answer


async def say_changes(
    socket: WebSocket, document: Document, library: Library, jobs: Jobs, state: Callable[[], dict[str, Any]]
) -> None:  # fmt: skip
    """Says what a studio is, whenever that changes, until the window is closed."""
    await socket.accept()
    ended, seen, job = asyncio.create_task(closed(socket)), None, None
    stamps: list[tuple[int, int]] = []
    next_look = next_beat = 0.0
    while not ended.done():
        # Now and then; at once when a job begins, has a picture, or ends.
        if time.monotonic() >= next_look or jobs.seen != job:
            job = jobs.seen
            await run_in_threadpool(document.look)
            # Pictures that changed first: what is shown of them next is as they are now.
            before, stamps = stamps, await run_in_threadpool(library.stamps)
            for number, (old, stamp) in enumerate(zip(before, stamps, strict=False)):
                if old != stamp and not ended.done():
                    await socket.send_json({"changed": number})
            now = document.revision, document.fault, jobs.changes
            if now != seen and not ended.done():
                await socket.send_json({"state": await run_in_threadpool(state)})
                seen = now
            next_look = time.monotonic() + LOOKED_AT_EVERY
        if time.monotonic() >= next_beat and not ended.done():
            await socket.send_json(ALIVE)
            next_beat = time.monotonic() + BEAT
        await asyncio.wait([ended], timeout=JOB_LOOKED_AT_EVERY)


def _refused_in_a_line(act: Callable[[], Response]) -> Callable[[], Response]:
    def answer() -> Response:
        try:
            return act()
        except Conflict as error:
            return JSONResponse({"error": str(error)}, 409, UNKEPT)
        except LookupError:
            return JSONResponse({"error": "there is no such file in this folder"}, 404, UNKEPT)
        except (rl.RelumeError, ValueError) as error:
            return JSONResponse({"error": in_the_page(str(error))}, 422, UNKEPT)

    return answer


def _refuse_constant(name: str) -> float:
    raise ValueError(f"{name} is no number for a shot file")


def edit_as_asked(document: Document, folder: Folder, body: dict[str, Any], *, unfinished: bool) -> None:
    """Change a document by a request's body; raises ValueError for another body, and as `Document.edit` does."""
    changes, revision = body.get("changes"), body.get("revision")
    if not isinstance(changes, list) or not isinstance(revision, int):
        raise ValueError("give changes, a list, and the revision that they are made to")
    for change in changes:
        if not isinstance(change, dict):
            raise ValueError("a change is an object with set, remove or append")
        folder.refuse_outside(change.get("value"))
    document.edit(changes, revision=revision, unfinished=unfinished)


def undo_as_asked(document: Document, body: dict[str, Any]) -> None:
    """Undo as many steps as a request's body says; raises ValueError for another body."""
    by = body.get("by")
    if not isinstance(by, int):
        raise ValueError("by is how many steps to go back")
    document.undo(by)
