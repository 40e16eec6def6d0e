"""The server of a page: on this machine alone unless more is asked for, ended by Ctrl-C."""

from __future__ import annotations

import os
import secrets
import socket
import webbrowser
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path

import relume as rl
from relume.studio.library import Library, readable_files

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

    files : of any kind that relume reads as pixels, or folders of them
    host : the address to listen at; this machine alone unless given, since whoever reaches the server reads the files
    port : 0 for a free one
    allow_remote : needed for a host that other machines reach
    open_browser : whether to open the page, as long as there is a browser
    say : called once with the address, which holds the token that lets in
    Raises ValueError for another host without `allow_remote` and for no files; UnreadableFile for one that is missing;
    RelumeError where the extra `studio` is not installed, or the port is taken.
    """
    # What is shown, and to whom.
    found = readable_files([Path(file) for file in files])
    if host not in LOOPBACK and not allow_remote:
        raise ValueError(
            f"host is {host}, which other machines reach; whoever has the address then reads these files: add "
            "allow_remote (--allow-remote) if that is meant"
        )
    try:
        import uvicorn

        from relume.studio.routes import application
        from relume.studio.security import Guard
    except ImportError as error:
        raise rl.RelumeError(
            f"{error.name} is not installed; the page needs it: pip install 'relume[studio]'"
        ) from None
    # Behind its guard, before its address is said.
    listening = _listening(host, port)
    port = listening.getsockname()[1]
    token = secrets.token_urlsafe(32)
    names = frozenset(f"{name}:{port}" for name in ("127.0.0.1", "localhost", "[::1]"))
    guarded = Guard(application(Library(found)), token, None if allow_remote else names, f"relume-{port}")
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
