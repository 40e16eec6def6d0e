"""How the studio's server takes what a page sends, and says in one line what it refuses."""

from __future__ import annotations

import json
from collections.abc import Callable
from typing import Any

from starlette.concurrency import run_in_threadpool
from starlette.exceptions import HTTPException
from starlette.requests import ClientDisconnect, Request
from starlette.responses import JSONResponse, Response

import relume as rl
from relume.studio.routes import UNKEPT
from relume.studio.shots.document import Conflict
from relume.studio.words import in_the_page

LARGEST_BODY = 1024**2
"""Bytes of a request that edits; the largest of ours has some thousand."""


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
