"""The login of the page: which requests are answered at all.

A link that was printed admits one browser and is used up by that; a cookie identifies
the browser from then on. Host, origin and cookie are checked before a socket opens, so
nothing that was sent along with the request is ever read. Requests that no browser of
an operator makes get no answer: to a page that tries out ports this port looks closed.
"""

import secrets
from collections.abc import Callable
from hmac import compare_digest
from urllib.parse import parse_qs

from websockets.asyncio.server import ServerConnection
from websockets.datastructures import Headers
from websockets.http11 import Request, Response

# Names of this machine that a browser may request.
HOSTS = ("127.0.0.1", "localhost")

# Random bytes of a link and of a cookie.
SECRET = 24

# Longest name of a page that is kept.
NAME = 64


class Login:
    """Knows the browsers that were admitted.

    Attributes:
        port: The page's port; no browser is admitted before it is known.
        used: Called with the next link when one was used up, from the page's thread.
    """

    def __init__(self) -> None:
        self.port = 0
        self.used: Callable[[str], None] = lambda link: None
        self._token = secrets.token_urlsafe(SECRET)
        self._browsers: list[str] = []

    @property
    def link(self) -> str:
        """The link that admits the next browser, once."""
        return f"http://{HOSTS[0]}:{self.port}/?token={self._token}"

    @property
    def cookie(self) -> str:
        """Name of the cookie; browsers keep those of all ports of a host together."""
        return f"armguard-{self.port}"

    def names(self, port: int) -> set[str]:
        """Values of a request's `Host` that mean a port of this machine."""
        return {f"{host}:{port}" for host in HOSTS}

    def addressed(self, request: Request, port: int) -> bool:
        """Whether a request names the port of ours that it came to."""
        return bool(self.port) and only(request.headers, "Host") in self.names(port)

    def knows(self, request: Request) -> bool:
        """Whether a request comes from a browser that was admitted."""
        pairs = (
            part.strip().partition("=")
            for line in request.headers.get_all("Cookie")
            for part in line.split(";")
        )
        return any(
            compare_digest(value.encode(), browser.encode())
            for name, _, value in pairs
            if name == self.cookie
            for browser in self._browsers
        )

    def opens_socket(self, request: Request, port: int) -> bool:
        """Whether a request to a port opens a socket: of our page, if admitted."""
        origins = {f"http://{name}" for name in self.names(self.port)}
        return (
            self.addressed(request, port)
            and only(request.headers, "Origin") in origins
            and self.knows(request)
        )

    def admit(self, request: Request) -> str:
        """Use the link up, if the request follows it.

        Returns:
            The value for `Set-Cookie`; empty if this is not the link.
        """
        token = argument(request.path, "token")
        if not compare_digest(token.encode(), self._token.encode()):
            return ""
        self._token, browser = (secrets.token_urlsafe(SECRET) for _ in range(2))
        self._browsers.append(browser)
        self.used(self.link)
        return f"{self.cookie}={browser}; HttpOnly; SameSite=Strict; Path=/"


def only(headers: Headers, name: str) -> str:
    """The value of a header that is there once; else empty."""
    values = headers.get_all(name)
    return values[0] if len(values) == 1 else ""


def argument(path: str, name: str) -> str:
    """An argument in the query of a request's path; empty if it has none."""
    return parse_qs(path.partition("?")[2]).get(name, [""])[0]


def navigates(request: Request) -> bool:
    """Whether a request opens a page in a tab, or comes from no browser."""
    names = "Sec-Fetch-Mode", "Sec-Fetch-Dest"
    how = tuple(only(request.headers, name) for name in names)
    return how in (("navigate", "document"), ("", ""))


def from_within(request: Request) -> bool:
    """Whether a request for a part of the page comes from the page itself."""
    return only(request.headers, "Sec-Fetch-Site") in ("same-origin", "none", "")


def page_name(path: str) -> str:
    """The name a page has given itself for all its sockets; empty if none."""
    return argument(path, "page")[:NAME]


def abort(connection: ServerConnection) -> Response:
    """End a connection without an answer; what to return for that."""
    connection.transport.abort()
    return connection.respond(403, "")
