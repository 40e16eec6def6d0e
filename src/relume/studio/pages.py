"""The pages as they are sent: each names in its head all modules that it imports, directly or not.

So the browser asks for them at once; else it would learn of each only from the one that imports it.
"""

from __future__ import annotations

import posixpath
import re
from functools import lru_cache
from pathlib import Path

from starlette.requests import Request
from starlette.responses import HTMLResponse, Response
from starlette.routing import BaseRoute, Mount, Route
from starlette.staticfiles import StaticFiles

PAGE = Path(__file__).parent / "page"
ENTRY = re.compile(r'<script type="module" src="/page/([^"]+)"></script>')
IMPORTED = re.compile(r'^(?:import|export|\}).* from "(\.[^"]+)"', re.MULTILINE)


def page_routes(name: str) -> list[BaseRoute]:
    """A page, by its path in the folder of pages, and the files that pages are made of."""

    def index(_request: Request) -> Response:
        return HTMLResponse(with_modules(name), headers={"cache-control": "no-store"})

    return [Route("/", index), Mount("/page", StaticFiles(directory=PAGE))]


@lru_cache
def with_modules(name: str) -> str:
    """The text of a page, its modules named in its head."""
    text = (PAGE / name).read_text("utf-8")
    found, waiting = list[str](), ENTRY.findall(text)
    while waiting:
        module = waiting.pop()
        for imported in IMPORTED.findall((PAGE / module).read_text("utf-8")):
            path = posixpath.normpath(posixpath.join(posixpath.dirname(module), imported))
            if path not in found:
                found.append(path)
                waiting.append(path)
    links = "".join(f'<link rel="modulepreload" href="/page/{path}">\n' for path in found)
    return ENTRY.sub(lambda script: links + script[0], text, count=1)
