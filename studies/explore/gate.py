"""Who comes in: a page is for those with the token; beside it only the page's own programs are served, nothing else."""

from __future__ import annotations

import hmac
import re
from collections.abc import Awaitable
from importlib.resources import files
from typing import Any

from tornado.httputil import HTTPMessageDelegate, HTTPServerRequest
from tornado.routing import Router
from tornado.web import Application, RequestHandler

PAGES = ("/", "/ws")
"""For which the token is asked."""
BOKEH = re.compile(r"/static/js/bokeh(-[a-z]+)?(\.min)?\.js")
"""Bokeh's own programs."""


class Gate(Router):
    """Sends a request to the pages, to a program of theirs, or away.

    Parameters
    ----------
    pages : Bokeh's application
    token : of the address
    """

    def __init__(self, pages: Application, token: str) -> None:
        self.pages, self.token = pages, token
        self.programs = Application([(r"/(plotly\.js|page\.js)", Program), (r".*", Refused, {"status": 404})])
        self.closed = Application([(r".*", Refused, {"status": 403})])

    def find_handler(self, request: HTTPServerRequest, **arguments: Any) -> HTTPMessageDelegate | None:
        """The application that answers; 403 without the token, 404 for whatever there is not."""
        application = self.programs
        if request.method in ("GET", "HEAD") and request.path in PAGES:
            application = self.pages if self._invited(request) else self.closed
        elif request.method in ("GET", "HEAD") and BOKEH.fullmatch(request.path):
            application = self.pages
        return application.find_handler(request, **arguments)

    def _invited(self, request: HTTPServerRequest) -> bool:
        given = request.arguments.get("token", [b""])
        return len(given) == 1 and hmac.compare_digest(given[0], self.token.encode())


class Refused(RequestHandler):
    """Says no."""

    def initialize(self, status: int) -> None:
        """How."""
        self.status = status

    def prepare(self) -> Awaitable[None] | None:
        """Whatever the method."""
        words = {
            403: "The address needs the right token: the first line that spinlev said.",
            404: "There is no such page.",
        }
        self.set_status(self.status)
        self.set_header("Content-Type", "text/plain; charset=utf-8")
        self.finish(words[self.status])
        return None


class Program(RequestHandler):
    """A program of the page."""

    def get(self, name: str) -> None:
        """Its text, from the installed packages."""
        self.set_header("Content-Type", "text/javascript; charset=utf-8")
        self.set_header("Cache-Control", "no-cache")  # asked for again, and not sent again
        self.finish(program(name))


def program(name: str) -> str:
    """The text of a program."""
    if name == "plotly.js":
        from plotly.offline import get_plotlyjs

        return str(get_plotlyjs())
    return files(__package__).joinpath(name).read_text(encoding="utf-8")
