"""The server of the pages: on this machine alone, unless one says otherwise, and for those with the token.

A page is a file with its program, and a line (WebSocket) over which it gets what to show. Whatever else is asked for
is not there.
"""

import asyncio
import hmac
import html
import ipaddress
import json
import logging
import secrets
import socket
import threading
import time
from contextlib import suppress
from importlib.resources import files
from typing import Any
from urllib.parse import urlsplit
from weakref import WeakSet

import numpy as np
from tornado.httpserver import HTTPServer
from tornado.httputil import HTTPServerRequest
from tornado.iostream import IOStream
from tornado.web import Application, RequestHandler
from tornado.websocket import WebSocketClosedError, WebSocketHandler

from ...geometry.common import ComputationError, InputError, SpinlevError
from ...geometry.scene.contents import Scene
from ..cli.options import PORTS, check_between
from ..plan import check_coils, levitating_scene
from .page import Page
from .state import PageState, first_state
from .work import Shown, preview
from .worker import context

LOOPBACK = "127.0.0.1"
PAGES = ("/", "/ws")  # For which the token is asked
PROGRAMS = {"/": "text/html", "/page.js": "text/javascript"}
CONTENT = (
    "default-src 'none'; script-src 'self'; style-src 'unsafe-inline'; img-src data: blob:; connect-src 'self'; "
    "frame-ancestors "
)  # What a page may load
NOTEBOOKS = "'self' http://127.0.0.1:* http://localhost:* vscode-webview:"  # a source has no place for [::1]
"""Where a page may be in a frame: in notebooks on the reader's own machine."""
REFUSALS = {
    403: "The address needs the right token: the first line that spinlev said.",
    404: "There is no such page.",
    421: "This machine is not called so here: take the address that spinlev said.",
}
GONE = 10  # Seconds after which a page that does not answer any more is taken to be closed
MOST_PAGES, MOST_LINES = 8, 64  # Open at a time: pages, each with some processes; connections
PATIENCE = 10.0  # Seconds that a connection may take for a request, and between two
HEADER, BODY, MESSAGE = 48_000, 1000, 1_000_000
"""Bytes of a request's header, with its address; of its body, of which none has any; of a page's message, as a file."""
FAULTS, PERIOD = 20, 60.0  # Lines about faults that are logged in a period, s
HEIGHT = 1000  # of the page in a notebook, pixels
FULL = f"{MOST_PAGES} pages are open, and more are not served at a time. Close one and load this one again."


class LivePage:
    """Pages at an `address` with a token, by `run` or in a thread from `begin` to `stop`; `local`: only from here."""

    def __init__(self, address: str, local: bool, gate: "_Gate", listening: socket.socket) -> None:
        self.address, self.local, self.opened = address, local, gate.opened
        self._gate, self._listening, self._over = gate, listening, asyncio.Event()
        self._loop: asyncio.AbstractEventLoop | None = None
        self._thread: threading.Thread | None = None

    def __repr__(self) -> str:
        return f"LivePage at {self.address}"

    def _repr_html_(self) -> str:
        return f'<iframe src="{html.escape(self.address)}" width="100%" height="{HEIGHT}" style="border:0"></iframe>'

    def begin(self) -> "LivePage":
        self._thread = threading.Thread(target=self.run, name="spinlev explore", daemon=True)
        self._thread.start()
        return self

    def run(self) -> None:
        """Serve in this thread until `stop`, or until someone stops the program."""
        faults = _OneLine()
        try:
            with suppress(KeyboardInterrupt):  # the way to stop it
                asyncio.run(self._serve())
        finally:
            faults.remove()

    def stop(self) -> None:
        """End the server, from any thread, and all that is computed for its pages."""
        if self._loop is None:
            self._over.set()
            self._listening.close()
        else:
            with suppress(RuntimeError):  # it has ended
                self._loop.call_soon_threadsafe(self._over.set)
        if self._thread is not None:
            self._thread.join()

    async def _serve(self) -> None:
        self._loop = asyncio.get_running_loop()
        if self._over.is_set():
            return
        limits: dict[str, Any] = {"max_header_size": HEADER, "max_body_size": BODY}
        http = _Lines(self._gate, **limits, idle_connection_timeout=PATIENCE, body_timeout=PATIENCE)
        http.add_socket(self._listening)
        try:
            await self._over.wait()
        finally:
            http.stop()
            for page in list(self.opened):
                page.close()
            await http.close_all_connections()


def serve(scene: Scene, source: str = "scene", host: str = LOOPBACK, port: int = 0, framed: bool = False) -> LivePage:
    """Listen for browsers that ask for pages about a `scene`, which `run` serves; no files but its own are ever opened.

    `source` is its name in messages, `host` an address of this machine, `port` 0 for any that is free; `framed` pages
    may be in a notebook. Raises InputError: a host, port or scene that cannot be; ComputationError: it cannot listen.
    """
    check_coils(levitating_scene(scene))
    check_between("port", port, PORTS)
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
    named = f"[{host}]" if ":" in host else host
    name = socket.getfqdn() if host in ("0.0.0.0", "::") else named
    gate = _Gate(first_state(scene, source), token, host, NOTEBOOKS if framed else "'none'")
    local = ipaddress.ip_address(number).is_loopback
    return LivePage(f"http://{name}:{port}/?token={token}", local, gate, listening)


def program(path: str) -> str:
    """The text of the page, or of a file of its program, at a `path` of an address; OSError where there is none."""
    return files(__package__).joinpath("page.html" if path == "/" else path[1:]).read_text(encoding="utf-8")


class _Gate(Application):
    """Pages for those with the token, the programs for those who call this machine by its name, and no more."""

    def __init__(self, begin: PageState, token: str, host: str, ancestors: str) -> None:
        limits: dict[str, Any] = {"websocket_max_message_size": MESSAGE, "websocket_ping_interval": GONE}
        super().__init__([("/ws", _Line), ("/.*", _Program)], **limits)
        self.begin, self.ancestors = begin, ancestors
        self.opened: set[Page] = set()
        self.preview: Shown | None = None  # of `begin`: a page shows something as soon as it opens
        with suppress(SpinlevError):  # which the page will say
            self.preview = preview(begin)
        self._token = token.encode()
        self._names = {name.lower() for name in ("localhost", host, socket.gethostname(), socket.getfqdn())}
        self.guests: WeakSet[Any] = WeakSet()  # streams of connections that were let in

    def log_request(self, handler: RequestHandler) -> None:
        """Nothing: an address has the token."""

    def find_handler(self, request: HTTPServerRequest, **arguments: Any) -> Any:
        if status := self._refusal(request):
            return self.get_handler_delegate(request, _Program, {"status": status})
        if request.path in PAGES:
            connection: Any = request.connection
            self.guests.add(connection.stream)
        return super().find_handler(request, **arguments)

    def _refusal(self, request: HTTPServerRequest) -> int:
        # Another name may lead to this machine, so that its owner's pages can read ours (DNS rebinding).
        try:
            name = urlsplit(f"//{request.host}").hostname or ""
            if name not in self._names:
                ipaddress.ip_address(name)
        except ValueError:
            return 421
        if request.path not in (*PAGES, *PROGRAMS) or request.method not in ("GET", "HEAD"):
            return 404
        given, origin = request.arguments.get("token", [b""]), request.headers.get("Origin")
        own = origin is None or origin.partition("://")[2].lower() == request.host.lower()
        invited = own and len(given) == 1 and hmac.compare_digest(given[0], self._token)
        return 0 if invited or request.path not in PAGES else 403


class _Answer(RequestHandler):
    application: _Gate

    def log_exception(self, *error: Any) -> None:
        logging.getLogger("tornado.application").error("A page failed", exc_info=error)  # no address: it has the token


class _Program(_Answer):
    def initialize(self, status: int = 200) -> None:
        self.status = status

    def set_default_headers(self) -> None:
        ancestors = self.application.ancestors
        self.set_header("Content-Security-Policy", CONTENT + ancestors)
        self.set_header("X-Content-Type-Options", "nosniff")
        self.set_header("Referrer-Policy", "no-referrer")
        self.set_header("Cache-Control", "no-cache")  # asked for again, and not sent again
        if ancestors == "'none'":
            self.set_header("X-Frame-Options", "DENY")

    def prepare(self) -> None:
        if self.status in REFUSALS:
            self.set_status(self.status)
            self.set_header("Content-Type", "text/plain; charset=utf-8")
            self.finish(REFUSALS[self.status])

    def get(self) -> None:
        self.set_header("Content-Type", f"{PROGRAMS[self.request.path]}; charset=utf-8")
        self.finish(program(self.request.path))

    head = get


class _Line(_Answer, WebSocketHandler):
    page: Page | None = None  # in a browser, for which this computes

    def check_origin(self, origin: str) -> bool:
        return True  # as the gate has found

    def open(self, *_: str) -> None:
        opened = self.application.opened
        if len(opened) >= MOST_PAGES:
            self._tell(message=FULL)
            self.close()
            return
        given = self.request.arguments.items()
        asked = {key: values[-1].decode(errors="replace") for key, values in given if key != "token" and values}
        self.page = Page(self._tell, self.application.begin)
        opened.add(self.page)  # before it tells anything, so that a reader's answer finds it
        self.page.begin(self.application.preview, asked)

    def on_message(self, message: str | bytes) -> None:
        if self.page is not None:
            verb, *values = json.loads(message)
            self.page.does[verb](*values)

    def on_close(self) -> None:
        if self.page is not None:
            self.page.close()
            self.application.opened.discard(self.page)

    def _tell(self, **what: Any) -> None:
        with suppress(WebSocketClosedError):
            sent = self.write_message(json.dumps(what, default=np.ndarray.tolist))
            sent.add_done_callback(lambda done: done.cancelled() or done.exception())  # the page has gone


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
        self._loggers = [logging.getLogger(n) for n in names if n.partition(".")[0] in ("asyncio", "tornado")]
        for logger in self._loggers:
            logger.addFilter(self)

    def remove(self) -> None:
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
