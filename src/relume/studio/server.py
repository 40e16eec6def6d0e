"""The server of a page: on this machine alone unless more is asked for, ended by Ctrl-C."""

from __future__ import annotations

import os
import secrets
import socket
import webbrowser
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

import relume as rl
from relume.studio.library import Library, readable_files
from relume.studio.ray_trees import SceneTrees
from relume.studio.stage.stage import is_stage

if TYPE_CHECKING:
    from starlette.applications import Starlette

LOOPBACK = ("127.0.0.1", "localhost", "::1")


def view(
    files: Sequence[str | os.PathLike[str]],
    *,
    host: str = "127.0.0.1",
    port: int = 0,
    allow_remote: bool = False,
    open_browser: bool = True,
    say: Callable[[str], None] | None = None,
) -> None:
    """Show pictures in the browser, until interrupted: exposure, values with errors, regions, comparisons, maps.

    files : of any kind that relume reads as pixels, or folders of them. A light stage is lit by lamps that are dragged
        and by the maps among the files. A scene file beside the picture that Whitted's method rendered from it shows
        the trees of rays behind its pixels
    host : the address to listen at; this machine alone unless given, since whoever reaches the server reads the files
    port : 0 for a free one
    allow_remote : needed for a host that other machines reach
    open_browser : whether to open the page, as long as there is a browser
    say : called once with the address, which holds the token that lets in
    Raises ValueError for another host without `allow_remote` and for no files; UnreadableFile for one that is missing;
    RelumeError where the extra `studio` is not installed, or the port is taken.
    """
    # What is shown: pictures, a light stage with maps, a picture with the scene that it shows.
    paths = [Path(file) for file in files]
    scenes = [path for path in paths if path.suffix.lower() == ".toml"]
    if len(scenes) > 1:
        raise ValueError(f"{scenes[1]} is a second scene file; the trees of rays are those of one")
    stage, found = _stage_among([path for path in paths if path not in scenes])
    trees = SceneTrees(scenes[0]) if scenes else None
    if trees is not None:
        _ = trees.read  # what is wrong with it is said before the page opens
    require_host(host, allow_remote, "reads these files")

    def application() -> Starlette:
        if stage is not None:
            from relume.studio.stage.routes import stage_application

            return stage_application(stage, found)
        library = Library(found)
        library.begin()
        from relume.studio.routes import application as answering

        return answering(library, trees)

    serve(application, host, port, allow_remote=allow_remote, open_browser=open_browser, say=say)


def require_host(host: str, allow_remote: bool, does: str) -> None:
    """Raises ValueError for a host that other machines reach, where that is not meant; `does`: what they then do."""
    if host not in LOOPBACK and not allow_remote:
        raise ValueError(
            f"host is {host}, which other machines reach; whoever has the address then {does}: add "
            "allow_remote (--allow-remote) if that is meant"
        )


def serve(
    application: Callable[[], Starlette],
    host: str,
    port: int,
    *,
    allow_remote: bool,
    open_browser: bool,
    say: Callable[[str], None] | None,
) -> None:
    """Serve an application behind its guard until interrupted; raises RelumeError, as `view` says."""
    try:
        import uvicorn

        from relume.studio.security import Guard

        answering = application()
    except ImportError as error:
        raise rl.RelumeError(
            f"{error.name} is not installed; the page needs it: pip install 'relume[studio]'"
        ) from None
    # Behind its guard, before its address is said.
    listening = _listening(host, port)
    port = listening.getsockname()[1]
    token = secrets.token_urlsafe(32)
    names = frozenset(f"{name}:{port}" for name in ("127.0.0.1", "localhost", "[::1]"))
    guarded = Guard(answering, token, None if allow_remote else names, f"relume-{port}")
    shown = f"[{host}]" if ":" in host else host
    address = f"http://{shown}:{port}/?token={token}"
    if say is not None:
        say(address)
    if open_browser:
        webbrowser.open(address)
    # Pixels are quick as they are: compressing 5 MB for the page next door took 20 times as long as sending it.
    settings = uvicorn.Config(
        guarded, log_level="critical", ws_per_message_deflate=False, server_header=False, timeout_graceful_shutdown=1
    )
    # Ctrl-C is how it ends, not how it fails.
    with suppress(KeyboardInterrupt):
        uvicorn.Server(settings).run(sockets=[listening])


def _stage_among(paths: Sequence[Path]) -> tuple[Path | None, list[Path]]:
    """The light stage that is to be shown, if one is, and the other files; raises ValueError for two stages."""
    stages = [path for path in paths if is_stage(path)]
    if len(stages) > 1:
        raise ValueError(f"{stages[1]} is a second light stage; show one at a time, with maps to light it by")
    others = [path for path in paths if path not in stages]
    return (stages[0] if stages else None), readable_files(others) if others or not stages else []


def _listening(host: str, port: int) -> socket.socket:
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    result = socket.socket(family, socket.SOCK_STREAM)
    result.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        result.bind((host, port))
    except OSError as error:
        result.close()
        raise rl.RelumeError(f"{host}:{port} cannot be listened at: {error.strerror}; give another port") from None
    result.listen(128)  # before the address is said: who reads it may ask at once
    return result
