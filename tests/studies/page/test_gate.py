"""Who is let in, what is served, and what is said where the page's libraries are missing."""

import contextlib
import http.client
import io
import re
import socket
import sys
import threading
import urllib.request
from pathlib import Path
from urllib.parse import urlsplit
from urllib.request import url2pathname

import psutil
import pytest
from places import OVER_PLATE

import spinlev as sl
from spinlev.geometry.common import ComputationError
from spinlev.geometry.scene.files import load_scene
from spinlev.studies.cli import main as cli
from spinlev.studies.page.server import program, serve


@pytest.fixture(scope="module")
def page():
    """A page that is served and waits for one second; no process is begun for it before someone asks."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("spinlev.studies.page.server.PATIENCE", 1)
        served = sl.explore(OVER_PLATE)
        yield served
        served.stop()


def answer(page, path, method="GET"):
    """Status and text of a request whose path is sent as it is."""
    connection = http.client.HTTPConnection("127.0.0.1", urlsplit(page.address).port, timeout=60)
    connection.putrequest(method, path, skip_host=False)
    connection.endheaders()
    found = connection.getresponse()
    text = found.read().decode(errors="replace")
    connection.close()
    return found.status, text


def test_the_address_is_this_machines_and_opens_the_page(page):
    parts = urlsplit(page.address)
    assert parts.hostname == "127.0.0.1"
    assert len(parts.query) > 30
    status, text = answer(page, f"/?{parts.query}")
    assert status == 200
    assert re.findall(r'(?:src|href)="(?!data:)([^"]*)"', text)
    for link in re.findall(r'(?:src|href)="(?!data:)([^"]*)"', text):
        assert not link.startswith(("http", "//")), link
        assert answer(page, f"/{link.lstrip('/')}")[0] == 200
    assert page.address.replace("&", "&amp;") in page._repr_html_()


@pytest.mark.parametrize("query", ["", "?token=", "?token=wrong", "?token=a&token=b", "?Token=", "?token=%00"])
@pytest.mark.parametrize("path", ["/", "/ws"])
def test_without_the_token_nobody_comes_in(page, path, query):
    assert answer(page, path + query)[0] == 403


def test_the_token_twice_is_not_the_token(page):
    query = urlsplit(page.address).query
    assert answer(page, f"/?{query}&{query}")[0] == 403
    assert answer(page, f"/?{query}x")[0] == 403


@pytest.mark.parametrize(
    "path",
    [
        *("/etc/passwd", "/../../../etc/passwd", "//etc/passwd", "/static/../../../../etc/passwd", "/%2e%2e/%2e%2e/x"),
        *("/static/js/../../server.py", "/static/js/..%2f..%2fserver.py", "/static/js/%2e%2e/server.py", "/static/"),
        *("/static/js/bokeh.min.js/../x", "/static/js/bokeh.min.js%00", "/page.css", "/page.html", "/page.js/"),
        *("/autoload.js", "/metadata", "/static/extensions/x", "/favicon.ico", "/\\..\\x", "/page.js/../page.py"),
        *("/scene.toml", "/index.html", "/ws/", "/./", "/page.js?x=../../y/.."),
    ],
)
def test_tricks_with_paths_find_nothing(page, path):
    token = urlsplit(page.address).query
    status, text = answer(page, path)
    if path.startswith("/page.js?"):  # a program, whatever is asked of it
        assert (status, text) == (200, program("/page.js"))
        return
    assert status == 404
    assert answer(page, f"{path}?{token}")[0] == 404
    assert "root:" not in text


@pytest.mark.parametrize("method", ["POST", "PUT", "DELETE", "OPTIONS"])
def test_nothing_can_be_written(page, method):
    assert answer(page, "/page.js", method)[0] in (404, 405)
    assert answer(page, f"/?{urlsplit(page.address).query}", method)[0] == 404


def raw(page, content):
    """The first line of what is answered to bytes, and the headers."""
    with socket.create_connection(("127.0.0.1", urlsplit(page.address).port), timeout=60) as line:
        line.sendall(content)
        return line.makefile("rb").read(4000).decode("latin-1")


@pytest.mark.parametrize(
    ("host", "status"),
    [
        ("127.0.0.1:{port}", 200),
        ("localhost:{port}", 200),
        ("[::1]:{port}", 200),
        ("evil.example:{port}", 421),
        ("evil.example", 421),
        ("127.0.0.1.evil.example:{port}", 421),
        ("localhost.evil.example", 421),
        ("[::1", 421),
    ],
)
def test_another_name_that_leads_to_this_machine_is_refused(page, host, status):
    """DNS rebinding: a page of that name would read what is answered to it."""
    port, query = urlsplit(page.address).port, urlsplit(page.address).query
    for path in (f"/?{query}", "/page.js"):
        said = raw(page, f"GET {path} HTTP/1.0\r\nHost: {host.format(port=port)}\r\n\r\n".encode())
        assert f" {status} " in said.split("\r\n")[0]


@pytest.mark.parametrize("more", ["Origin: http://evil.example", "Origin: null", "Origin: 127.0.0.1"])
@pytest.mark.parametrize("path", ["/", "/ws"])
def test_pages_of_others_are_refused(page, path, more):
    port, query = urlsplit(page.address).port, urlsplit(page.address).query
    said = raw(page, f"GET {path}?{query} HTTP/1.0\r\nHost: 127.0.0.1:{port}\r\n{more}\r\n\r\n".encode())
    assert " 403 " in said.split("\r\n")[0]


@pytest.mark.parametrize(("framed", "found"), [(True, "http://localhost:*"), (False, "'none'")])
def test_only_a_notebook_may_show_a_page_in_a_frame(framed, found):
    pages = serve(load_scene(OVER_PLATE), framed=framed)
    serving = threading.Thread(target=pages.run)
    serving.start()
    with urllib.request.urlopen(pages.address) as found_page:
        given = found_page.headers
    pages.stop()
    serving.join()
    assert found in given["Content-Security-Policy"]
    assert given.get("X-Frame-Options") == (None if framed else "DENY")
    assert given["Referrer-Policy"] == "no-referrer"


@pytest.mark.parametrize(
    "content",
    [
        b"POST / HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Length: 94000000\r\n\r\n" + bytes(100_000),
        b"GET /?" + b"x" * 70_000 + b" HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n",
        b"GET / HTTP/1.1\r\nHost: 127.0.0.1\r\nX: " + b"x" * 70_000 + b"\r\n\r\n",
        b"POST / HTTP/1.1\r\nHost: 127.0.0.1\r\nTransfer-Encoding: chunked\r\n\r\n" + b"1000\r\n" + bytes(5000),
        b"\x16\x03\x01\x02\x00",
    ],
    ids=["body", "address", "header", "chunks", "another protocol"],
)
def test_what_is_too_large_is_not_waited_for(page, content):
    try:
        said = raw(page, content)
    except ConnectionError:  # it was closed before all of it was sent
        said = ""
    assert not said or " 4" in said.split("\r\n")[0]
    assert answer(page, f"/?{urlsplit(page.address).query}")[0] == 200


def test_a_page_for_other_machines_says_so(monkeypatch, caplog):
    caplog.set_level("INFO", "spinlev")
    monkeypatch.setattr("spinlev.studies.page.server.LivePage.run", lambda pages: pages.stop())
    with cli.printing(), contextlib.redirect_stdout(io.StringIO()):
        for host in ("0.0.0.0", "::"):
            assert cli._status(["explore", str(OVER_PLATE), "--no-browser", "--host", host], io.StringIO()) == 0
            assert f"Other machines can open this page (--host {host})" in caplog.text
            caplog.clear()
        assert cli._status(["explore", str(OVER_PLATE), "--no-browser"], io.StringIO()) == 0
        assert "Other machines" not in caplog.text
        assert cli._status(["explore", str(OVER_PLATE), "--no-browser", "--host", ""], io.StringIO()) == 2
        assert "Input host must be an address of this machine" in caplog.text


def test_the_token_is_not_on_the_browsers_command_line(monkeypatch):
    """It is in a file that only its owner can read, and that is gone with the page."""
    seen = {}

    def opened(address):
        file = Path(url2pathname(urlsplit(address).path))
        seen.update(address=address, file=file, mode=file.stat().st_mode & 0o777, text=file.read_text())

    monkeypatch.setattr("webbrowser.open", opened)
    monkeypatch.setattr("spinlev.studies.page.server.LivePage.run", lambda pages: pages.stop())
    said = io.StringIO()
    assert cli._status(["explore", str(OVER_PLATE)], said) == 0
    token = said.getvalue().strip().partition("token=")[2]
    assert len(token) > 30
    assert token not in seen["address"]
    assert token in seen["text"]
    assert seen["mode"] == 0o600
    assert not seen["file"].exists()


def test_it_listens_on_this_machine_alone(page):
    port = urlsplit(page.address).port
    mine = [one.address for some in psutil.net_if_addrs().values() for one in some if one.family == socket.AF_INET]
    for address in [one for one in mine if not one.startswith("127.")]:
        with pytest.raises(OSError, match=r".*"), socket.create_connection((address, port), timeout=5):
            pass


def test_a_port_that_is_taken(page):
    with pytest.raises(ComputationError, match=r"Cannot listen on 127\.0\.0\.1, port \d+: .* Take another --port"):
        sl.explore(OVER_PLATE, port=urlsplit(page.address).port)


def test_the_libraries_are_missing(monkeypatch):
    for name in [name for name in sys.modules if name.startswith(("tornado", "spinlev.studies.page"))]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.delattr(sys.modules["spinlev.studies"], "explore", raising=False)
    monkeypatch.setitem(sys.modules, "tornado", None)
    with pytest.raises(ComputationError, match=r"tornado is needed.*pip install 'spinlev\[explore\]'"):
        sl.explore(OVER_PLATE)
