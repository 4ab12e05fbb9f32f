"""The server of the pages: on this machine alone, unless one says otherwise, and for those with the token.

Beside the pages only their own programs are served; whatever else is asked for is not there.
"""

from __future__ import annotations

import hmac
import ipaddress
import logging
import re
import secrets
import socket
import threading
import time
from collections.abc import Awaitable
from contextlib import suppress
from importlib.resources import files
from typing import Any
from urllib.parse import urlsplit
from weakref import WeakSet

from bokeh.application import Application
from bokeh.application.handlers.function import FunctionHandler
from bokeh.core.templates import get_env
from bokeh.document import Document
from bokeh.models import Div
from bokeh.server.server import BaseServer
from bokeh.server.tornado import BokehTornado
from tornado.httpserver import HTTPServer
from tornado.httputil import HTTPHeaders, HTTPServerRequest
from tornado.ioloop import IOLoop
from tornado.iostream import IOStream
from tornado.web import OutputTransform, RequestHandler

from ...geometry.common import ComputationError, InputError
from ...geometry.scene.contents import Scene
from .page import Page
from .state import PageState, first_state
from .work import context

LOOPBACK = "127.0.0.1"
PAGES = ("/", "/ws")  # For which the token is asked
BOKEH = re.compile(r"/static/js/bokeh(-[a-z]+)?(\.min)?\.js")  # Bokeh's own programs
NOTEBOOKS = "'self' http://127.0.0.1:* http://localhost:* vscode-webview:"  # a source has no place for [::1]
"""Where a page may be in a frame: in notebooks on the reader's own machine."""
REFUSALS = {
    403: "The address needs the right token: the first line that spinlev said.",
    404: "There is no such page.",
    421: "This machine is not called so here: take the address that spinlev said.",
}
GONE = 3000  # Milliseconds after which a page that does not answer any more is taken to be closed
MOST_PAGES, MOST_LINES = 8, 64  # Open at a time: pages, each with some processes; connections
PATIENCE = 10.0  # Seconds that a connection may take for a request, and between two
HEADER, BODY, MESSAGE = 48_000, 1000, 1_000_000
"""Bytes of a request's header, with its address; of its body, of which none has any; of a page's message, as a file."""
FAULTS, PERIOD = 20, 60.0  # Lines about faults that are logged in a period, s
FULL = f"{MOST_PAGES} pages are open, and more are not served at a time. Close one and load this one again."


class Pages:
    """Where pages are served, until `stop`.

    Parameters
    ----------
    address : of the page, with its token
    local : whether no other machine can see them
    opened : the pages that are open
    server : Bokeh's
    """

    def __init__(self, address: str, local: bool, opened: set[Page], server: BaseServer) -> None:
        self.address, self.local, self.opened, self._server = address, local, opened, server
        self._faults = _OneLine()

    def run(self) -> None:
        """Serve until someone stops the program."""
        try:
            with suppress(KeyboardInterrupt):  # the way to stop it
                self._server.io_loop.start()
        finally:
            self.stop()

    def stop(self) -> None:
        """End the server and all that was computed for its pages."""
        for page in list(self.opened):
            page.close()
        self._server.stop()
        self._faults.remove()


def serve(scene: Scene, source: str = "scene", host: str = LOOPBACK, port: int = 0, framed: bool = False) -> Pages:
    """Begin to serve pages about a scene; the loop is the current one, and `run` starts it.

    Parameters
    ----------
    scene : where each page begins; no other files than its own are ever opened
    source : its name in messages
    host : address of this machine on which to listen
    port : 0 for any that is free
    framed : whether a notebook may show the pages

    Raises
    ------
    InputError : a host or a port that cannot be
    ComputationError : the port is taken, or the address is not this machine's
    """
    if not 0 <= port <= 65535:
        raise InputError(f"Input port must be between 0 and 65535; instead received {port}.")
    if not host:
        raise InputError(
            f'Input host must be an address of this machine, such as {LOOPBACK}; instead received "". All of them are '
            "0.0.0.0."
        )
    try:
        family = socket.AF_INET6 if ":" in host else socket.AF_INET
        listening = socket.create_server((host, port), family=family)
    except (OSError, UnicodeError) as error:
        raise ComputationError(
            f"Cannot listen on {host}, port {port}: {error}. Take another --port, or leave it out for any that is free."
        ) from None
    listening.setblocking(False)
    context()  # whose processes load the numeric libraries meanwhile
    token, (number, port) = secrets.token_urlsafe(24), listening.getsockname()[:2]
    opened: set[Page] = set()
    begin = first_state(scene, source)
    gate = _Gate(FunctionHandler(lambda document: _open(document, opened, begin)), token, host, framed)
    http = _Lines(
        gate, max_header_size=HEADER, max_body_size=BODY, idle_connection_timeout=PATIENCE, body_timeout=PATIENCE
    )
    http.add_socket(listening)
    server = BaseServer(IOLoop.current(), gate, http)
    server.start()
    named = f"[{host}]" if ":" in host else host
    name = socket.getfqdn() if host in ("0.0.0.0", "::") else named
    local = ipaddress.ip_address(number).is_loopback
    return Pages(f"http://{name}:{port}/?token={token}", local, opened, server)


def _open(document: Document, opened: set[Page], state: PageState) -> None:
    """A page for a browser that asks for one."""
    document.title = "spinlev: explore"
    if len(opened) >= MOST_PAGES:
        document.add_root(Div(text=FULL))
        return
    session = document.session_context
    arguments = session.request.arguments if session is not None and session.request is not None else {}
    asked = {key: values[-1].decode(errors="replace") for key, values in arguments.items() if key != "token" and values}
    document.template = get_env().from_string(program("page.html"))
    document.template_variables["style"] = program("page.css")
    page = Page(document, state, asked)
    opened.add(page)

    def closed(_: Any) -> None:
        page.close()
        opened.discard(page)

    document.on_session_destroyed(closed)


def program(name: str) -> str:
    """The text of a program of the page, from the installed packages."""
    if name == "plotly.js":
        from plotly.offline import get_plotlyjs

        return str(get_plotlyjs())
    return files(__package__).joinpath(name).read_text(encoding="utf-8")


class _Gate(BokehTornado):  # type: ignore[misc]  # which has no types
    """Bokeh's pages for those with the token, the programs for those who call this machine by its name, and no more."""

    def __init__(self, page: FunctionHandler, token: str, host: str, framed: bool) -> None:
        super().__init__(
            {"/": Application(page)},
            extra_patterns=[(r"/(plotly\.js|page\.js)", _Program)],
            extra_websocket_origins=["*"],  # asked for here
            secret_key=secrets.token_bytes(32),
            sign_sessions=True,
            include_headers=[],
            include_cookies=[],
            check_unused_sessions_milliseconds=1000,
            unused_session_lifetime_milliseconds=GONE,
            websocket_max_message_size_bytes=MESSAGE,
            use_index=False,
        )
        self._token = token.encode()
        self._names = {name.lower() for name in ("localhost", host, socket.gethostname(), socket.getfqdn())}
        self.guests: WeakSet[Any] = WeakSet()
        """Streams of connections that were let in."""
        self.add_transform(_Framed if framed else _Alone)

    def find_handler(self, request: HTTPServerRequest, **arguments: Any) -> Any:
        status = self._refusal(request)
        if status:
            return self.get_handler_delegate(request, _Refused, {"status": status})
        if request.path in PAGES:
            connection: Any = request.connection
            self.guests.add(connection.stream)
        return super().find_handler(request, **arguments)

    def _refusal(self, request: HTTPServerRequest) -> int:
        """The status with which a request is sent away; 0 for one that is answered."""
        try:
            name = urlsplit(f"//{request.host}").hostname or ""
        except ValueError:
            return 421
        # Another name may lead to this machine, so that its owner's pages can read ours (DNS rebinding).
        if name not in self._names and not _is_number(name):
            return 421
        path = request.path
        known = path in PAGES or path in ("/plotly.js", "/page.js") or BOKEH.fullmatch(path)
        if not known or request.method not in ("GET", "HEAD"):
            return 404
        given, origin = request.arguments.get("token", [b""]), request.headers.get("Origin")
        own = origin is None or origin.partition("://")[2].lower() == request.host.lower()
        # Sessions are Bokeh's to name.
        foreign = "Bokeh-Session-Id" in request.headers or any(key.startswith("bokeh-") for key in request.arguments)
        invited = own and not foreign and len(given) == 1 and hmac.compare_digest(given[0], self._token)
        return 0 if invited or path not in PAGES else 403


def _is_number(name: str) -> bool:
    try:
        return bool(ipaddress.ip_address(name))
    except ValueError:
        return False


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


class _Refused(RequestHandler):
    def initialize(self, status: int) -> None:
        self.status = status

    def prepare(self) -> Awaitable[None] | None:
        self.set_status(self.status)
        self.set_header("Content-Type", "text/plain; charset=utf-8")
        self.finish(REFUSALS[self.status])
        return None


class _Program(RequestHandler):
    def get(self, name: str) -> None:
        self.set_header("Content-Type", "text/javascript; charset=utf-8")
        self.set_header("Cache-Control", "no-cache")  # asked for again, and not sent again
        self.finish(program(name))


class _Lines(HTTPServer):
    """Serves so many connections and no more: the oldest of those that were not let in makes room."""

    def initialize(self, *arguments: Any, **more: Any) -> None:
        super().initialize(*arguments, **more)
        self._open: dict[IOStream, None] = {}

    def handle_stream(self, stream: IOStream, address: tuple[Any, ...]) -> None:
        self._open = {one: None for one in self._open if not one.closed()}
        if len(self._open) >= MOST_LINES:
            gate: Any = self.request_callback
            next((one for one in self._open if one not in gate.guests), stream).close()
        self._open[stream] = None
        super().handle_stream(stream, address)


class _OneLine(logging.Filter):
    """Of the libraries in this thread: one line of a fault, without its traceback, and of many not all."""

    def __init__(self) -> None:
        super().__init__()
        self._thread, self._ends, self._said = threading.get_ident(), 0.0, 0
        names = ("asyncio", *logging.root.manager.loggerDict)
        self._loggers = [logging.getLogger(n) for n in names if n.partition(".")[0] in ("asyncio", "bokeh", "tornado")]
        for logger in self._loggers:
            logger.addFilter(self)

    def remove(self) -> None:
        """Leave the libraries as they were."""
        for logger in self._loggers:
            logger.removeFilter(self)

    def filter(self, record: logging.LogRecord) -> bool:
        if record.thread != self._thread:
            return True
        if record.levelno < logging.ERROR:
            return False
        if time.monotonic() > self._ends:
            self._ends, self._said = time.monotonic() + PERIOD, 0
        self._said += 1
        error = record.exc_info[1] if record.exc_info else None
        text = f"{record.getMessage()}: {type(error).__name__}: {error}" if error else record.getMessage()
        left_out = f" (what follows is left out for up to {PERIOD:g} s)" if self._said == FAULTS else ""
        record.msg, record.args = " ".join(text.split())[:300] + left_out, ()
        record.exc_info = record.exc_text = record.stack_info = None
        return self._said <= FAULTS
