"""Who may speak to the server: this browser, by a token; pages of this server, by their origin; no other host's name.

The rules are Jupyter's: a name other than this machine's is refused against DNS rebinding, a token in the address once
becomes a cookie that scripts cannot read, and an origin that is not this server's is refused wherever something
changes and on every WebSocket, which browsers open across origins without asking.
"""

from __future__ import annotations

import hmac
from http.cookies import CookieError, SimpleCookie
from urllib.parse import parse_qs, urlencode

from starlette.datastructures import Headers, MutableHeaders
from starlette.responses import PlainTextResponse, RedirectResponse
from starlette.types import ASGIApp, Message, Receive, Scope, Send

SAFE = ("GET", "HEAD")
HEADERS = {
    "content-security-policy": "default-src 'self'; img-src 'self' blob: data:; style-src 'self'; connect-src 'self'; "
    "object-src 'none'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'",
    "x-content-type-options": "nosniff",
    "referrer-policy": "no-referrer",
    "cross-origin-opener-policy": "same-origin",
    "cross-origin-resource-policy": "same-origin",
}


class Guard:
    """The application behind its checks, as ASGI's middleware.

    token : who knows it is let in
    hosts : the values of the Host header that are this server, like 127.0.0.1:8765; None for any, where the user opened
        the server to other machines
    cookie : the cookie's name; cookies are shared by all ports of a machine, so it names the port
    """

    def __init__(self, app: ASGIApp, token: str, hosts: frozenset[str] | None, cookie: str) -> None:
        self.app, self.token, self.hosts, self.cookie = app, token, hosts, cookie

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] == "lifespan":
            await self.app(scope, receive, send)
            return
        # Whoever sent it: the name of the server, and the origin where something changes.
        headers = Headers(scope=scope)
        refused = self._refused(scope, headers)
        if scope["type"] == "websocket":
            if refused or not self._known(headers):
                await send({"type": "websocket.close", "code": 4403})
                return
            await self.app(scope, receive, send)
            return

        async def send_with_headers(message: Message) -> None:
            if message["type"] == "http.response.start":
                given = MutableHeaders(scope=message)
                for name, rule in HEADERS.items():
                    given.setdefault(name, rule)
            await send(message)

        # Pages and pixels; every answer carries the browser's rules.
        if refused:
            await PlainTextResponse(refused, 403)(scope, receive, send_with_headers)
            return
        # The token in the address, once: it becomes a cookie.
        query = parse_qs(scope["query_string"].decode("latin-1"), keep_blank_values=True)
        given = query.pop("token", [""])[0]
        if given and scope["method"] in SAFE:
            if not self._is_token(given):
                await PlainTextResponse("wrong token; open the address that relume printed", 403)(
                    scope, receive, send_with_headers
                )
                return
            # The address is cleaned: it may be shown, copied, kept in the browser's history.
            rest = urlencode(query, doseq=True)
            answer = RedirectResponse(scope["path"] + (f"?{rest}" if rest else ""), 303)
            answer.set_cookie(self.cookie, self.token, httponly=True, samesite="strict", path="/")
            answer.headers["cache-control"] = "no-store"
            await answer(scope, receive, send_with_headers)
            return
        if not self._known(headers):
            await PlainTextResponse("no token; open the address that relume printed", 403)(
                scope, receive, send_with_headers
            )
            return
        await self.app(scope, receive, send_with_headers)

    def _refused(self, scope: Scope, headers: Headers) -> str:
        """Why a request is refused whoever sent it; "" where it is not."""
        host = headers.get("host", "")
        if self.hosts is not None and host.lower() not in self.hosts:
            return "this is not the name of this server"
        changing = scope["type"] == "websocket" or scope["method"] not in SAFE
        if changing and headers.get("origin", "").lower() not in (f"http://{host.lower()}", f"https://{host.lower()}"):
            return "asked by a page of another origin"
        return ""

    def _is_token(self, given: str) -> bool:
        return hmac.compare_digest(given.encode(), self.token.encode())

    def _known(self, headers: Headers) -> bool:
        """Whether the request carries the token: as cookie, or as `Authorization: token …` of a script."""
        scheme, _, given = headers.get("authorization", "").partition(" ")
        if scheme.lower() == "token" and self._is_token(given.strip()):
            return True
        try:
            cookies = SimpleCookie(headers.get("cookie", ""))
        except CookieError:
            return False
        return self.cookie in cookies and self._is_token(cookies[self.cookie].value)
