"""Who is let in, what is served, and what is said where the page's libraries are missing."""

import http.client
import re
import socket
import sys
from urllib.parse import urlsplit

import pytest
from places import OVER_PLATE

import spinlev as sl
from spinlev.geometry.basics import ComputationError
from spinlev.studies.explore.gate import program


@pytest.fixture(scope="module")
def page():
    """A page that is served; no process is begun for it before someone asks."""
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
        *("/autoload.js", "/metadata", "/static/extensions/x", "/favicon.ico", "/\\..\\x", "/plotly.js/../page.py"),
        *("/scene.toml", "/index.html", "/ws/", "/./", "/page.js?x=../../y/.."),
    ],
)
def test_tricks_with_paths_find_nothing(page, path):
    token = urlsplit(page.address).query
    status, text = answer(page, path)
    if path.startswith("/page.js?"):  # a program, whatever is asked of it
        assert (status, text) == (200, program("page.js"))
        return
    assert status == 404
    assert answer(page, f"{path}?{token}")[0] == 404
    assert "root:" not in text


@pytest.mark.parametrize("method", ["POST", "PUT", "DELETE", "OPTIONS"])
def test_nothing_can_be_written(page, method):
    assert answer(page, "/page.js", method)[0] in (404, 405)
    assert answer(page, f"/?{urlsplit(page.address).query}", method)[0] == 404


def test_it_listens_on_this_machine_alone(page):
    port = urlsplit(page.address).port
    others = {info[4][0] for info in socket.getaddrinfo(socket.gethostname(), None, socket.AF_INET)} - {"127.0.0.1"}
    for address in [one for one in others if not one.startswith("127.")]:
        with pytest.raises(OSError, match=r".*"), socket.create_connection((address, port), timeout=5):
            pass


def test_a_port_that_is_taken(page):
    with pytest.raises(ComputationError, match=r"Cannot listen on 127\.0\.0\.1, port \d+: .* Take another --port"):
        sl.explore(OVER_PLATE, port=urlsplit(page.address).port)


def test_the_libraries_are_missing(monkeypatch):
    for name in [name for name in sys.modules if name.startswith(("bokeh", "spinlev.studies.explore"))]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.delattr(sys.modules["spinlev.studies"], "explore", raising=False)
    monkeypatch.setitem(sys.modules, "bokeh", None)
    with pytest.raises(ComputationError, match=r"needs bokeh.*pip install 'spinlev\[explore\]'"):
        sl.explore(OVER_PLATE)
