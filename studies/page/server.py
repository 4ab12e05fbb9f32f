"""The server of the pages: on this machine alone, unless one says otherwise, and for those with the token."""

from __future__ import annotations

import ipaddress
import logging
import secrets
import socket
import threading
import time
from contextlib import suppress
from functools import partial
from importlib.resources import files
from typing import Any

from bokeh.application import Application
from bokeh.application.handlers.function import FunctionHandler
from bokeh.core.templates import get_env
from bokeh.document import Document
from bokeh.models import Div
from bokeh.server.server import BaseServer
from bokeh.server.tornado import BokehTornado
from tornado.httpserver import HTTPServer
from tornado.ioloop import IOLoop
from tornado.iostream import IOStream

from ...geometry.common import ComputationError, InputError
from ...geometry.scene.contents import Scene
from .gate import Gate
from .page import Page
from .processes import warm_up
from .state import PageState, first_state

LOOPBACK = "127.0.0.1"
GONE = 3000
"""Milliseconds after which a page that does not answer any more is taken to be closed."""
MOST_PAGES, MOST_LINES = 8, 64
"""Open at a time: pages, each with some processes; connections."""
PATIENCE = 10.0
"""Seconds that a connection may take for a request, and between two."""
HEADER, BODY, MESSAGE = 48_000, 1000, 1_000_000
"""Bytes of a request's header, with its address; of its body, of which none has any; of a page's message, as a file."""
FAULTS, PERIOD = 20, 60.0
"""Lines about faults that are logged in a period, s."""
FULL = f"{MOST_PAGES} pages are open, and more are not served at a time. Close one and load this one again."


class _Lines(HTTPServer):
    """Serves so many connections and no more: the oldest of those that were not let in makes room."""

    def initialize(self, *arguments: Any, **more: Any) -> None:
        super().initialize(*arguments, **more)
        self._open: dict[IOStream, None] = {}

    def handle_stream(self, stream: IOStream, address: tuple[Any, ...]) -> None:
        """Begin with a connection."""
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
        self._thread, self._began, self._said = threading.get_ident(), time.monotonic(), 0
        names = ("asyncio", *logging.root.manager.loggerDict)
        self._loggers = [logging.getLogger(n) for n in names if n.partition(".")[0] in ("asyncio", "bokeh", "tornado")]
        for logger in self._loggers:
            logger.addFilter(self)

    def remove(self) -> None:
        """Leave the libraries as they were."""
        for logger in self._loggers:
            logger.removeFilter(self)

    def filter(self, record: logging.LogRecord) -> bool:
        """Whether a record is logged."""
        if record.thread != self._thread:
            return True
        if record.levelno < logging.ERROR:
            return False
        now = time.monotonic()
        if now - self._began > PERIOD:
            self._began, self._said = now, 0
        self._said += 1
        error = record.exc_info[1] if record.exc_info else None
        text = f"{record.getMessage()}: {type(error).__name__}: {error}" if error else record.getMessage()
        record.msg, record.args = " ".join(text.split())[:300], ()
        record.exc_info = record.exc_text = record.stack_info = None
        if self._said == FAULTS:
            record.msg += f" (what follows is left out for up to {PERIOD:g} s)"
        return self._said <= FAULTS


class Pages:
    """Where pages are served, until `stop`.

    Parameters
    ----------
    address : of the page, with its token
    server : Bokeh's
    opened : the pages that are open
    local : whether no other machine can see them
    faults : what is logged of them
    """

    def __init__(self, address: str, server: BaseServer, opened: set[Page], local: bool, faults: _OneLine) -> None:
        self.address, self.local, self._server, self._opened, self._faults = address, local, server, opened, faults

    def run(self) -> None:
        """Serve until someone stops the program."""
        try:
            with suppress(KeyboardInterrupt):  # the way to stop it
                self._server.io_loop.start()
        finally:
            self.stop()

    def stop(self) -> None:
        """End the server and all that was computed for its pages."""
        for page in list(self._opened):
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
    warm_up()
    token, (number, port) = secrets.token_urlsafe(24), listening.getsockname()[:2]
    opened: set[Page] = set()
    begin = partial(_open, opened=opened, state=first_state(scene, source))
    pages = BokehTornado(
        {"/": Application(FunctionHandler(begin))},
        extra_websocket_origins=["*"],  # the gate asks
        secret_key=secrets.token_bytes(32),
        sign_sessions=True,
        include_headers=[],
        include_cookies=[],
        check_unused_sessions_milliseconds=1000,
        unused_session_lifetime_milliseconds=GONE,
        websocket_max_message_size_bytes=MESSAGE,
        use_index=False,
    )
    names = {"localhost", host, socket.gethostname(), socket.getfqdn()}
    http = _Lines(
        Gate(pages, token, names, framed),
        max_header_size=HEADER,
        max_body_size=BODY,
        idle_connection_timeout=PATIENCE,
        body_timeout=PATIENCE,
    )
    http.add_socket(listening)
    server = BaseServer(IOLoop.current(), pages, http)
    server.start()
    local = ipaddress.ip_address(number).is_loopback
    return Pages(f"http://{_name(host)}:{port}/?token={token}", server, opened, local, _OneLine())


def _open(document: Document, opened: set[Page], state: PageState) -> None:
    """A page for a browser that asks for one."""
    document.title = "spinlev: explore"
    if len(opened) >= MOST_PAGES:
        document.add_root(Div(text=FULL))
        return
    context = document.session_context
    arguments = context.request.arguments if context is not None and context.request is not None else {}
    asked = {key: values[-1].decode(errors="replace") for key, values in arguments.items() if key != "token" and values}
    document.template = get_env().from_string(_text("page.html"))
    document.template_variables["style"] = _text("page.css")
    page = Page(document, state, asked)
    opened.add(page)
    document.on_session_destroyed(lambda _: _closed(page, opened))


def _closed(page: Page, opened: set[Page]) -> None:
    page.close()
    opened.discard(page)


def _text(name: str) -> str:
    return files(__package__).joinpath(name).read_text(encoding="utf-8")


def _name(host: str) -> str:
    """The host in an address: where it listens on all, this machine's name."""
    if host in ("0.0.0.0", "::"):
        return socket.getfqdn()
    return f"[{host}]" if ":" in host else host
