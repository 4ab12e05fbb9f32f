"""The server of the pages: on this machine alone, unless one says otherwise, and for those with the token."""

from __future__ import annotations

import logging
import secrets
import socket
from contextlib import suppress
from functools import partial
from importlib.resources import files

from bokeh.application import Application
from bokeh.application.handlers.function import FunctionHandler
from bokeh.core.templates import get_env
from bokeh.document import Document
from bokeh.server.server import BaseServer
from bokeh.server.tornado import BokehTornado
from tornado.httpserver import HTTPServer
from tornado.ioloop import IOLoop

from ...geometry.basics import ComputationError, InputError
from ...geometry.scenes import Scene
from ..live import PageState, first_state
from .gate import Gate
from .page import Page
from .processes import warm_up

LOOPBACK = "127.0.0.1"
GONE = 3000
"""Milliseconds after which a page that does not answer any more is taken to be closed."""


class Pages:
    """Where pages are served, until `stop`.

    Parameters
    ----------
    address : of the page, with its token
    server : Bokeh's
    opened : the pages that are open
    """

    def __init__(self, address: str, server: BaseServer, opened: set[Page]) -> None:
        self.address, self._server, self._opened = address, server, opened

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


def serve(scene: Scene, source: str = "scene", host: str = LOOPBACK, port: int = 0) -> Pages:
    """Begin to serve pages about a scene; the loop is the current one, and `run` starts it.

    Parameters
    ----------
    scene : where each page begins
    source : its name in messages
    host : address of this machine on which to listen
    port : 0 for any that is free

    Raises
    ------
    InputError : a port that cannot be
    ComputationError : the port is taken, or the address is not this machine's
    """
    if not 0 <= port <= 65535:
        raise InputError(f"Input port must be between 0 and 65535; instead received {port}.")
    try:
        family = socket.AF_INET6 if ":" in host else socket.AF_INET
        listening = socket.create_server((host, port), family=family)
    except (OSError, UnicodeError) as error:
        raise ComputationError(
            f"Cannot listen on {host}, port {port}: {error}. Take another --port, or leave it out for any that is free."
        ) from None
    listening.setblocking(False)
    warm_up()
    for talkative in ("bokeh", "tornado.access"):
        logging.getLogger(talkative).setLevel(logging.ERROR)
    token, port = secrets.token_urlsafe(24), listening.getsockname()[1]
    opened: set[Page] = set()
    begin = partial(_open, opened=opened, state=first_state(scene, source))
    pages = BokehTornado(
        {"/": Application(FunctionHandler(begin))},
        extra_websocket_origins=_origins(host, port),
        secret_key=secrets.token_bytes(32),
        sign_sessions=True,
        check_unused_sessions_milliseconds=1000,
        unused_session_lifetime_milliseconds=GONE,
        use_index=False,
    )
    http = HTTPServer(Gate(pages, token))
    http.add_socket(listening)
    server = BaseServer(IOLoop.current(), pages, http)
    server.start()
    return Pages(f"http://{_name(host)}:{port}/?token={token}", server, opened)


def _open(document: Document, opened: set[Page], state: PageState) -> None:
    """A page for a browser that asks for one."""
    context = document.session_context
    arguments = context.request.arguments if context is not None and context.request is not None else {}
    asked = {key: values[-1].decode(errors="replace") for key, values in arguments.items() if key != "token" and values}
    document.template = get_env().from_string(_text("page.html"))
    document.template_variables["style"] = _text("page.css")
    document.title = "spinlev: explore"
    page = Page(document, state, asked)
    opened.add(page)
    document.on_session_destroyed(lambda _: _closed(page, opened))


def _closed(page: Page, opened: set[Page]) -> None:
    page.close()
    opened.discard(page)


def _text(name: str) -> str:
    return files(__package__).joinpath(name).read_text(encoding="utf-8")


def _origins(host: str, port: int) -> list[str]:
    """Pages from which a page's own line to the server may come; anywhere else the token has to do."""
    return [f"{LOOPBACK}:{port}", f"localhost:{port}"] if host in (LOOPBACK, "localhost") else ["*"]


def _name(host: str) -> str:
    """The host in an address: where it listens on all, this machine's name."""
    if host in ("", "0.0.0.0", "::"):
        return socket.getfqdn()
    return f"[{host}]" if ":" in host else host
