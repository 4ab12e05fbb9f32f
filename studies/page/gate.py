"""Who comes in: a page is for those with the token; beside it only the page's own programs are served, nothing else."""

from __future__ import annotations

import hmac
import ipaddress
import re
from collections.abc import Awaitable, Collection
from functools import cache
from importlib.resources import files
from typing import Any
from urllib.parse import urlsplit
from weakref import WeakSet

from tornado.httputil import HTTPHeaders, HTTPMessageDelegate, HTTPServerRequest
from tornado.routing import Router
from tornado.web import Application, OutputTransform, RequestHandler

PAGES = ("/", "/ws")
"""For which the token is asked."""
BOKEH = re.compile(r"/static/js/bokeh(-[a-z]+)?(\.min)?\.js")
"""Bokeh's own programs."""
NOTEBOOKS = "'self' http://127.0.0.1:* http://localhost:* http://[::1]:* vscode-webview:"
"""Where a page may be in a frame: in notebooks on the reader's own machine."""
REFUSALS = {
    403: "The address needs the right token: the first line that spinlev said.",
    404: "There is no such page.",
    421: "This machine is not called so here: take the address that spinlev said.",
}


class Gate(Router):
    """Sends a request to the pages, to a program of theirs, or away.

    Parameters
    ----------
    pages : Bokeh's application
    token : of the address
    names : what this machine may be called in an address, beside its numbers
    framed : whether a notebook may show the pages
    """

    def __init__(self, pages: Application, token: str, names: Collection[str], framed: bool) -> None:
        self.pages, self.token, self.names = pages, token, {name.lower() for name in names}
        self.guests: WeakSet[Any] = WeakSet()
        """Streams of connections that were let in."""
        transform = _Framed if framed else _Alone
        self.pages.add_transform(transform)
        programs: list[Any] = [(r"/(plotly\.js|page\.js)", Program), (r".*", Refused, {"status": 404})]
        self.programs = Application(programs, transforms=[transform])
        self.closed, self.elsewhere = (
            Application([(r".*", Refused, {"status": status})], transforms=[transform]) for status in (403, 421)
        )

    def find_handler(self, request: HTTPServerRequest, **arguments: Any) -> HTTPMessageDelegate | None:
        """The application that answers; 403 without the token, 404 for whatever there is not, 421 for another host."""
        application = self.programs
        if not self._named(request):
            application = self.elsewhere
        elif request.method in ("GET", "HEAD") and request.path in PAGES:
            application = self.closed
            if self._invited(request):
                connection: Any = request.connection
                self.guests.add(connection.stream)
                application = self.pages
        elif request.method in ("GET", "HEAD") and BOKEH.fullmatch(request.path):
            application = self.pages
        return application.find_handler(request, **arguments)

    def _named(self, request: HTTPServerRequest) -> bool:
        """Whether a request is for this machine; another's name may lead here for its pages to read ours."""
        try:
            name = urlsplit(f"//{request.host}").hostname or ""
        except ValueError:
            return False
        return name in self.names or _is_number(name)

    def _invited(self, request: HTTPServerRequest) -> bool:
        """Whether it has the token, comes from a page of ours if from any, and leaves sessions to Bokeh."""
        given, origin = request.arguments.get("token", [b""]), request.headers.get("Origin")
        own = origin is None or origin.partition("://")[2].lower() == request.host.lower()
        session = "Bokeh-Session-Id" in request.headers or any(key.startswith("bokeh-") for key in request.arguments)
        return own and not session and len(given) == 1 and hmac.compare_digest(given[0], self.token.encode())


def _is_number(name: str) -> bool:
    try:
        ipaddress.ip_address(name)
    except ValueError:
        return False
    return True


class _Alone(OutputTransform):
    """Lets no other page show an answer in a frame, nor guess what it is."""

    ancestors = "'none'"

    def transform_first_chunk(
        self, status_code: int, headers: HTTPHeaders, chunk: bytes, finishing: bool
    ) -> tuple[int, HTTPHeaders, bytes]:
        headers["Content-Security-Policy"] = f"frame-ancestors {self.ancestors}"
        headers["X-Content-Type-Options"] = "nosniff"
        headers["Referrer-Policy"] = "no-referrer"
        if self.ancestors == "'none'":
            headers["X-Frame-Options"] = "DENY"
        return status_code, headers, chunk


class _Framed(_Alone):
    ancestors = NOTEBOOKS


class Refused(RequestHandler):
    """Says no."""

    def initialize(self, status: int) -> None:
        """How."""
        self.status = status

    def prepare(self) -> Awaitable[None] | None:
        """Whatever the method."""
        self.set_status(self.status)
        self.set_header("Content-Type", "text/plain; charset=utf-8")
        self.finish(REFUSALS[self.status])
        return None


class Program(RequestHandler):
    """A program of the page."""

    def get(self, name: str) -> None:
        """Its text, from the installed packages."""
        self.set_header("Content-Type", "text/javascript; charset=utf-8")
        self.set_header("Cache-Control", "no-cache")  # asked for again, and not sent again
        self.finish(program(name))


@cache
def program(name: str) -> str:
    """The text of a program."""
    if name == "plotly.js":
        from plotly.offline import get_plotlyjs

        return str(get_plotlyjs())
    return files(__package__).joinpath(name).read_text(encoding="utf-8")
