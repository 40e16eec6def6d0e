"""What the server answers about a light stage: its facts, pictures under a light, single pixels, maps, the surface."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from starlette.applications import Starlette
from starlette.concurrency import run_in_threadpool
from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import JSONResponse, Response
from starlette.routing import Route

import relume as rl
from relume.studio.pages import page_routes
from relume.studio.stage.lighting import light_of
from relume.studio.stage.stage import OpenStage

UNKEPT = {"cache-control": "no-store"}
LARGEST_REQUEST = 64 * 1024
LARGEST_HALF = 65504.0


@dataclass(frozen=True)
class StageAnswers:
    """What is answered about one stage."""

    stage: OpenStage

    def facts(self, _request: Request) -> Response:
        """How far it is read, what it holds."""
        return JSONResponse(self.stage.facts(), headers=UNKEPT)

    async def picture(self, request: Request) -> Response:
        """The subject under the light of the request's body: quickly, with `small` at half its size where that is
        quicker, or with `exact` by `rl.lightstage.relight`."""
        body = b""
        async for part in request.stream():
            body += part
            if len(body) > LARGEST_REQUEST:
                raise HTTPException(413, "the light is too long")
        try:
            asked = json.loads(body)
            light = light_of(asked, len(self.stage.map_files))
        except ValueError as error:
            raise HTTPException(400, " ".join(str(error).split())) from None
        if asked.get("exact"):
            found = await run_in_threadpool(self.stage.exact_picture, light)
            if found is None:
                return JSONResponse({"error": "another was asked for"}, 409, UNKEPT)
        else:
            found = await run_in_threadpool(self.stage.live_picture, light, small=bool(asked.get("small")))
        return _pixels(self.stage.keep(found), found)

    def surface(self, request: Request) -> Response:
        """A map of the surface, measured when one is first asked for."""
        pictures = self.stage.surface()
        name = request.path_params["name"]
        if name not in pictures:
            raise LookupError
        return _pixels(self.stage.keep(pictures[name]), pictures[name])

    def map(self, request: Request) -> Response:
        """A map, small."""
        found = self.stage.map_picture(int(request.path_params["number"]))
        return _pixels("", found)

    def value(self, request: Request) -> Response:
        """A pixel of a picture that was handed out, as the float32 that it is."""
        picture = self.stage.kept(request.query_params.get("picture", ""))
        try:
            x, y = (int(request.query_params.get(name, "")) for name in "xy")
        except ValueError:
            raise HTTPException(400, "x and y are whole numbers") from None
        if not (0 <= y < picture.shape[0] and 0 <= x < picture.shape[1]):
            raise LookupError
        rgb = [float(str(each)) for each in picture[y, x]]
        luminance = 0.2126 * rgb[0] + 0.7152 * rgb[1] + 0.0722 * rgb[2]
        return JSONResponse({"x": x, "y": y, "rgb": rgb, "luminance": luminance}, headers=UNKEPT)


def stage_application(path: Path, maps: Sequence[Path]) -> Starlette:
    """The page of a stage that is read from now on, and what it asks; not yet guarded."""
    stage = OpenStage(path, maps)
    stage.start()
    answers = StageAnswers(stage)

    async def picture(request: Request) -> Response:
        try:
            return await answers.picture(request)
        except (LookupError, rl.RelumeError, ValueError, HTTPException) as error:
            return _refused(error)

    return Starlette(
        routes=[
            *page_routes("stage/stage.html"),
            Route("/stage", _answered(answers.facts)),
            Route("/stage/picture", picture, methods=["POST"]),
            Route("/stage/surface/{name}", _answered(answers.surface)),
            Route("/stage/maps/{number:int}", _answered(answers.map)),
            Route("/stage/value", _answered(answers.value)),
        ]
    )


def _pixels(name: str, picture: np.ndarray) -> Response:
    """RGB rows of halves, or of floats where halves cannot hold them; the name for reading single pixels."""
    half = bool(np.abs(picture).max(initial=0) <= LARGEST_HALF)  # False for what is not finite too
    headers = {
        "x-picture": name, "x-half": str(int(half)), "x-size": f"{picture.shape[1]},{picture.shape[0]}", **UNKEPT
    }  # fmt: skip
    content = np.ascontiguousarray(picture, "<f2" if half else "<f4").data
    return Response(bytes(content), media_type="application/octet-stream", headers=headers)


def _answered(endpoint: Callable[[Request], Response]) -> Callable[[Request], Response]:
    def answer(request: Request) -> Response:
        try:
            return endpoint(request)
        except (LookupError, rl.RelumeError, ValueError, HTTPException) as error:
            return _refused(error)

    return answer


def _refused(error: Exception) -> Response:
    """What cannot be answered, as one line."""
    if isinstance(error, HTTPException):
        return JSONResponse({"error": error.detail}, error.status_code, UNKEPT)
    if isinstance(error, LookupError):
        return JSONResponse({"error": "there is no such picture or pixel, or not yet"}, 404, UNKEPT)
    return JSONResponse({"error": " ".join(str(error).split())}, 422, UNKEPT)
