"""What the studio's server answers: the shot and its edits, photographs, the ball, jobs, uploads and results."""

from __future__ import annotations

import hashlib
from collections.abc import AsyncIterator, Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from starlette.applications import Starlette
from starlette.concurrency import run_in_threadpool
from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import FileResponse, JSONResponse, Response
from starlette.routing import Route, WebSocketRoute
from starlette.websockets import WebSocket

import relume as rl
from relume.studio.library import Library
from relume.studio.pages import page_routes
from relume.studio.routes import UNKEPT, answered, picture_routes
from relume.studio.shots.answers import edit_as_asked, in_json, say_changes, taking_bytes, taking_json, undo_as_asked
from relume.studio.shots.ball import unwrapped
from relume.studio.shots.bundles import LIST_THEM, LONGEST_LIST, Bundle, listed
from relume.studio.shots.camera_parameters import parameters
from relume.studio.shots.cameras import board_camera, camera_of
from relume.studio.shots.developed import TONES, developed, has_depth, preset_parameters, presets
from relume.studio.shots.document import Document
from relume.studio.shots.folder import LARGEST_UPLOAD, Folder
from relume.studio.shots.jobs import Jobs
from relume.studio.shots.light.edits import cut_rectangle
from relume.studio.shots.light.routes import LightAnswers, light_routes
from relume.studio.shots.material_balls import MaterialBalls
from relume.studio.shots.objects import PlacedObjects
from relume.studio.shots.photographs import Thumbnails, brackets
from relume.studio.words import in_the_page

LARGEST_MATTE = 64 * 1024**2
"""Bytes of a painted matte: as many as a plate of 60 megapixels may have."""
SHOWN_RESULTS = ("report.html", "composite.png", "preview.png")
RESULTS_POLICY = "default-src 'none'; img-src 'self' data:; style-src 'unsafe-inline'; sandbox"
"""Of the report: a page of its own without scripts, which may style itself."""


@dataclass(frozen=True)
class Studio:
    """One studio: its folder, document, folder of results, scratch folder, open pictures and worker."""

    folder: Folder
    document: Document
    out: Path
    scratch: Path
    library: Library
    jobs: Jobs
    thumbnails: Thumbnails = field(default_factory=Thumbnails)
    materials: MaterialBalls = field(default_factory=MaterialBalls)
    placed: PlacedObjects = field(default_factory=PlacedObjects)

    def state(self) -> dict[str, Any]:
        """All that a window shows: the shot, which files its photographs are, the job, what was written."""
        document = self.document.state()
        table = document["table"]
        light = table.get("light")
        views = light.get("balls") if isinstance(light, dict) else None
        views = views if isinstance(views, list) else []
        results = sorted(each.name for each in self.out.iterdir() if each.is_file()) if self.out.is_dir() else []
        return document | {
            "folder": str(self.folder.root), "out": _beside(self.out, self.folder.root),
            "plate": self.named(table.get("plate")), "balls": [self.named(view) for view in views],
            "job": self.jobs.state, "measured": self.jobs.measured, "merged": self.jobs.merged,
            "results": [name for name in results if not name.startswith(".")], "new_render": rl.Shot.new_render,
        }  # fmt: skip

    def named(self, table: object) -> list[str]:
        """The photographs of a table, as files of the folder by their names."""
        names = table.get("photographs", []) if isinstance(table, dict) else []
        names = [names] if isinstance(names, str) else names
        if not isinstance(names, list) or not all(isinstance(name, str) for name in names):
            return []
        return [self.folder.name(path) for path in self.folder.named(names)]

    def shot(self, _request: Request) -> Response:
        """The shot as it is now."""
        self.document.look()
        return in_json(self.state())

    def edit(self, _request: Request, body: dict[str, Any]) -> Response:
        """Change the shot file."""
        edit_as_asked(self.document, self.folder, body, unfinished=body.get("unfinished") is True)
        return in_json(self.state())

    def undo(self, _request: Request, body: dict[str, Any]) -> Response:
        """Go back in the shot's history, or on where `by` is negative."""
        undo_as_asked(self.document, body)
        return in_json(self.state())

    def brackets(self, _request: Request) -> Response:
        """The folder's photographs, sorted."""
        return in_json({"brackets": brackets(self.folder, self.out)})

    def thumbnail(self, request: Request) -> Response:
        """A small picture of a photograph."""
        content, doubt = self.thumbnails.of(self.folder.path(request.query_params.get("path", "")))
        return Response(content, media_type="image/jpeg", headers={"x-doubt": doubt, **UNKEPT})

    def opened(self, _request: Request, body: dict[str, Any]) -> Response:
        """The number under which a picture is shown: of the folder, of the results, or of the scratch folder."""
        return in_json({"number": self.library.add(self._shown(body))})

    def crop(self, _request: Request, body: dict[str, Any]) -> Response:
        """A rectangle of a picture that is shown, as a picture of its own."""
        return in_json(cut_rectangle(self._shown(body), self.folder, body))

    def _shown(self, body: dict[str, Any]) -> Path:
        name, where = str(body.get("path", "")), body.get("where")
        roots = {"results": Folder(self.out.resolve()), "scratch": Folder(self.scratch.resolve())}
        return roots.get(str(where), self.folder).path(name)

    def ball(self, _request: Request, body: dict[str, Any]) -> Response:
        """The ball in one photograph, and the number of the map that it shows."""
        path, rim = self.folder.path(str(body.get("path", ""))), body.get("rim")
        if rim is not None and not (isinstance(rim, list) and all(isinstance(each, int | float) for each in rim)):
            raise ValueError("a rim is a list of numbers")
        target = self.scratch / f"ball-{hashlib.blake2b(str(path).encode(), digest_size=6).hexdigest()}.exr"
        try:
            found = unwrapped(path, rim, target)
        except rl.errors.BallNotFound as error:
            candidates = [[round(float(v), 1) for v in each] for each in error.candidates]
            return JSONResponse({"error": in_the_page(str(error)), "candidates": candidates}, 422, UNKEPT)
        return in_json(found | {"number": self.library.add(target)})

    def board(self, _request: Request, body: dict[str, Any]) -> Response:
        """The board in a photograph, as the camera that sees it so."""
        return in_json({"camera": board_camera(self.folder.path(str(body.get("photograph", ""))), body)})

    def mirrored(self, _request: Request, body: dict[str, Any]) -> Response:
        """Where the light is that a point of an object mirrors into the plate's camera."""
        x, y = body.get("x"), body.get("y")
        if not isinstance(x, int | float) or not isinstance(y, int | float):
            raise ValueError("x and y are a pixel of the plate")
        if self.jobs.measured is None:
            raise ValueError("the camera is not known yet; find it under Camera")
        camera = camera_of(self.jobs.measured["camera"])
        found = rl.report.mirrored_light(rl.read_shot(self.document.path), camera, x, y)
        if found is None:
            raise ValueError("there is no object at this point; click one where it shall mirror the light")
        return in_json({"direction": found.direction, "point": found.point, "normal": found.normal})

    def start(self, _request: Request, body: dict[str, Any]) -> Response:
        """Start a job, in place of the one that runs."""
        self.document.look()
        if self.document.fault is not None:
            raise ValueError(f"the shot is not finished: {self.document.fault}")
        about = body.get("about")
        if about is not None and not (
            isinstance(about, list)
            and len(about) == 2
            and all(isinstance(v, int | float) and 0 <= v <= 1 for v in about)
        ):
            raise ValueError("about is a place, shares of the picture's width and height, 0 to 1")
        place = None if about is None else (float(about[0]), float(about[1]))
        return in_json({"number": self.jobs.start(str(body.get("kind")), self.document.path, self.out, place)})

    def stop(self, _request: Request, _body: dict[str, Any]) -> Response:
        """Stop the job that runs."""
        self.jobs.stop()
        return in_json({})

    def pause(self, _request: Request, body: dict[str, Any]) -> Response:
        """Hold the job that runs, or let it go on."""
        self.jobs.pause(body.get("paused") is True)
        return in_json({})

    def objects(self, _request: Request) -> Response:
        """Where the objects stand."""
        return in_json({"objects": self.placed.facts(self.document.path), "presets": sorted(rl.scene.PRESETS)})

    def material_balls(self, _request: Request) -> Response:
        """The materials that objects may have, as balls under the measured light."""
        if self.jobs.measured is None:
            raise HTTPException(409, "the light is not measured yet; take a quick look first")
        camera = camera_of(self.jobs.measured["camera"])
        light = self.scratch / self.jobs.measured["light"]
        return in_json(self.materials.facts(self.document.path, light, camera, self.out))

    def material_pixels(self, request: Request) -> Response:
        """Those balls' pixels."""
        content = self.materials.pixels(request.path_params["digest"])
        return Response(content, media_type="application/octet-stream", headers=UNKEPT)

    def mesh(self, request: Request) -> Response:
        """An object's triangles in the world."""
        content = self.placed.mesh_bytes(self.document.path, int(request.path_params["number"]))
        return Response(content, media_type="application/octet-stream", headers=UNKEPT)

    def ways(self, _request: Request) -> Response:
        """The cameras and tone operators by which a composite may be developed."""
        depth = has_depth(self.out, "composite.exr")
        known = presets()
        own = {name: preset_parameters(name) for name in known}
        return in_json({"presets": known, "own": own, "tones": TONES, "parameters": parameters(depth=depth)})

    def develop(self, _request: Request, body: dict[str, Any]) -> Response:
        """A result through another camera."""
        camera = None if self.jobs.measured is None else camera_of(self.jobs.measured["camera"])
        named = _beside(self.out, self.folder.root)
        return in_json(developed(body, results=self.out, named=named, scratch=self.scratch, camera=camera))

    def result(self, request: Request) -> Response:
        """A file of the results that a browser shows by itself."""
        name = request.path_params["name"]
        if name not in SHOWN_RESULTS:
            raise LookupError
        headers = {"content-security-policy": RESULTS_POLICY, **UNKEPT}
        return FileResponse(Folder(self.out.resolve()).path(name), headers=headers)

    async def upload(self, request: Request) -> Response:
        """Take a dropped file into the folder, under a name of its own."""
        said = request.headers.get("content-length", "")
        room = min(LARGEST_UPLOAD, await run_in_threadpool(self.folder.room))
        if said.isdecimal() and int(said) > room:
            raise HTTPException(413, f"{int(said) / 1e6:.0f} MB is too much; up to {room / 1e6:.0f} MB are taken")
        with self.folder.upload(request.query_params.get("name", "")) as (file, target):
            taken = 0
            async for chunk in request.stream():
                taken += len(chunk)
                if taken > room:
                    raise HTTPException(413, f"the file is too large; up to {room / 1e6:.0f} MB are taken")
                await run_in_threadpool(file.write, chunk)
        return in_json({"path": self.folder.name(target)})

    async def upload_together(self, request: Request) -> Response:
        """Take meshes with the files that they name into a folder of their own: a line that lists them, then all."""
        room, chunks, line = min(LARGEST_UPLOAD, await run_in_threadpool(self.folder.room)), request.stream(), b""
        while b"\n" not in line:
            chunk = await anext(chunks, b"")
            line += chunk
            if not chunk or len(line.partition(b"\n")[0]) > LONGEST_LIST:
                raise ValueError(LIST_THEM)
        line, _, rest = line.partition(b"\n")
        files = listed(line)
        if (size := sum(each.size for each in files)) > room:
            raise HTTPException(413, f"{size / 1e6:.0f} MB is too much; up to {room / 1e6:.0f} MB are taken")

        async def following() -> AsyncIterator[bytes]:
            yield rest
            async for chunk in chunks:
                yield chunk

        bundle = await run_in_threadpool(Bundle, self.folder, files)
        try:
            await bundle.take((each async for each in following() if each), run_in_threadpool)
            return in_json(await run_in_threadpool(bundle.settled))
        finally:
            await run_in_threadpool(bundle.discard)

    async def keep_matte(self, request: Request) -> Response:
        """Keep what was painted in front of the objects."""
        content = bytearray()
        async for chunk in request.stream():
            content += chunk
            if len(content) > LARGEST_MATTE:
                raise HTTPException(413, f"the matte is too large; up to {LARGEST_MATTE / 1e6:.0f} MB are taken")
        return in_json({"path": self.folder.name(await run_in_threadpool(self.folder.matte, bytes(content)))})

    def matte(self, request: Request) -> Response:
        """A painted matte of the folder, as it is."""
        path = self.folder.path(request.query_params.get("path", ""))
        if rl.files.kind_of(path) not in ("PNG", "JPEG"):
            raise rl.errors.UnreadableFile(f"{path.name}: a browser shows no such matte; it counts all the same")
        return FileResponse(path, headers=UNKEPT)

    async def events(self, socket: WebSocket) -> None:
        """Says what the studio is, whenever that changes, until the window is closed."""
        await say_changes(socket, self.document, self.library, self.jobs, self.state)


def studio_application(studio: Studio) -> Starlette:
    """The application of a studio, not yet guarded."""

    def posted(path: str, endpoint: Callable[[Request, dict[str, Any]], Response]) -> Route:
        return Route(path, taking_json(endpoint), methods=["POST"])

    light = LightAnswers(studio.folder, studio.document, studio.scratch, studio.state, studio.named)
    return Starlette(
        routes=[
            *page_routes("studio.html"),
            Route("/shot", answered(studio.shot)),
            posted("/shot/edit", studio.edit),
            posted("/shot/undo", studio.undo),
            Route("/brackets", answered(studio.brackets)),
            Route("/thumbnail", answered(studio.thumbnail)),
            posted("/opened", studio.opened),
            posted("/crop", studio.crop),
            posted("/ball", studio.ball),
            posted("/board", studio.board),
            posted("/light/mirrored", studio.mirrored),
            *(posted(path, endpoint) for path, endpoint in light_routes(light).items()),
            posted("/jobs/start", studio.start),
            posted("/jobs/stop", studio.stop),
            posted("/jobs/pause", studio.pause),
            Route("/objects", answered(studio.objects)),
            Route("/objects/{number:int}", answered(studio.mesh)),
            Route("/materials", answered(studio.material_balls)),
            Route("/materials/{digest}", answered(studio.material_pixels)),
            Route("/ways", answered(studio.ways)),
            posted("/developed", studio.develop),
            Route("/results/{name}", answered(studio.result)),
            Route("/occluder", answered(studio.matte), methods=["GET"]),
            Route("/occluder", taking_bytes(studio.keep_matte), methods=["POST"]),
            Route("/uploads", taking_bytes(studio.upload), methods=["POST"]),
            Route("/uploads/together", taking_bytes(studio.upload_together), methods=["POST"]),
            *picture_routes(studio.library),
            WebSocketRoute("/events", studio.events),
        ]
    )


def _beside(path: Path, root: Path) -> str:
    return path.relative_to(root).as_posix() if path.is_relative_to(root) else str(path)
