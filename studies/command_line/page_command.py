"""The command that serves a page: explore."""

import html
import tempfile
from pathlib import Path
from typing import Annotated

from cyclopts import App, Parameter

from ...geometry.basics import InputError
from ..terminal import Answer, Output, default_scene, note

LEADING = """<!DOCTYPE html><meta charset="utf-8"><title>spinlev</title><meta name="referrer" content="no-referrer">
<meta http-equiv="refresh" content="0; url={address}"><a href="{address}">spinlev</a>
"""
"""A page that leads to another."""


def add_page_command(app: App) -> None:
    """Let the command line know this command."""
    app.command(explore)


def explore(
    scene: Path | None = None,
    *,
    host: str = "127.0.0.1",
    port: int = 0,
    no_browser: Annotated[bool, Parameter(negative="")] = False,
    output: Output = Output(),
) -> Answer:
    """A page in the browser to play with a scene: sliders, equilibria at once, where it levitates, a live flight.

    It serves until Ctrl-C. The address is the first line of standard output; only who has its token sees the page.

    Parameters
    ----------
    scene
        Scene file (left out: the one that comes with the program).
    host
        Address of this machine on which the page is served; any other than 127.0.0.1 lets other machines in, and
        nothing is encrypted.
    port
        Port; 0 takes one that is free.
    no_browser
        Only print the address.
    """
    if not 0 <= port <= 65535:
        raise InputError(f"Input --port must be between 0 and 65535; instead received {port}.")
    from ...geometry.scenes import load_scene

    source = scene or default_scene()
    loaded = load_scene(source)
    from ..interface import page_server

    pages = page_server()(loaded, str(source), host, port)
    if not pages.local:
        note(
            f"Other machines can open this page (--host {host}). What it sends, the token in its address included, is "
            "not encrypted: whoever sees the network's traffic can read it. Without --host it stays on this machine."
        )

    def serving() -> None:
        if no_browser:
            pages.run()
            return
        import webbrowser

        # Any user of the machine can read the command line of a browser, but this file only its owner.
        with tempfile.NamedTemporaryFile("w", prefix="spinlev-", suffix=".html", encoding="utf-8") as leading:
            leading.write(LEADING.format(address=html.escape(pages.address)))
            leading.flush()
            webbrowser.open(Path(leading.name).as_uri())
            pages.run()

    return Answer({"address": pages.address}, [pages.address], output.json, serving)
