"""The live page in a browser: everything its reader can do, two pages at once, and what a closed page leaves behind."""

import json
import re
import statistics
import subprocess
import sys
import threading
import time
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from urllib.parse import parse_qs, urlsplit
from xml.etree import ElementTree

import numpy as np
import psutil
import pytest
from devtools import CHROMIUM, Browser
from PIL import Image
from places import OVER_PLATE

import spinlev as sl
from spinlev.geometry.scene.files import load_scene
from spinlev.studies.cli.options import Models
from spinlev.studies.run import equilibria_job

DESK, PHONE = (1400, 1250), (390, 844)
pytestmark = [
    pytest.mark.skipif(CHROMIUM is None, reason="no chromium here (Debian: apt-get install chromium)"),
    pytest.mark.browser,
]
AT = """const at = id => document.getElementById(id), text = id => at(id).textContent, box = id => {
  const r = at(id).getBoundingClientRect(); return [r.x + r.width / 2, r.y + r.height / 2]; };"""
COMPLETE = "/^All models/.test(text('sign'))"
MOVE = """(async (name, value) => {{ {at} const number = () => +(at('sign').dataset.number || 0), before = number();
  const began = performance.now();
  at(name).value = value;
  at(name).dispatchEvent(new Event('input'));
  while (number() <= before) await new Promise(done => setTimeout(done, 1));
  return performance.now() - began; }})({name}, {value})"""


def said(tab, program):
    """The value of a program in which `at` finds an element by its id, `text` what it says, `box` where it is."""
    return tab.run(f"(() => {{ {AT} return {program}; }})()")


def wait(tab, program, seconds=600.0):
    """Until it is true; tables are made first, on a machine that may have other work."""
    return tab.until(f"(() => {{ {AT} return {program}; }})()", seconds)


def click(tab, name):
    """In the middle of a button or chart."""
    said(tab, f"at('{name}').scrollIntoView({{block: 'center'}})")
    tab.mouse(tuple(said(tab, f"box('{name}')")))


def move(tab, name, value):
    """Move a slider; how long the numbers take to follow, ms."""
    return tab.run(MOVE.format(at=AT, name=json.dumps(name), value=value))


def choose(tab, name, value):
    """Choose of a list."""
    said(tab, f"(at('{name}').value = '{value}', at('{name}').dispatchEvent(new Event('change')))")


@pytest.fixture(scope="module")
def server():
    """`spinlev explore` of a scene, as a process; its first line is the address."""
    start = "import sys; from spinlev.studies.cli.start import main; sys.argv[0] = 'spinlev'; main()"
    command = [sys.executable, "-c", start, "explore", str(OVER_PLATE), "--no-browser"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        process.address = process.stdout.readline().strip()
        yield process
        process.terminate()
        assert process.wait(30) == 0


@pytest.fixture(scope="module")
def browser(tmp_path_factory):
    one = Browser(tmp_path_factory.mktemp("profile"))
    yield one
    one.close()


def opened(browser, address, size=DESK):
    """A page whose first complete answer is there."""
    tab = browser.open(address, *size)
    tab.until("document.getElementById('sign') !== null")
    wait(tab, COMPLETE)
    return tab


def assert_quiet(tab, address):
    """No error, and every request went to this machine."""
    tab.run("0")
    assert tab.errors == []
    parts = urlsplit(address)
    home = tuple(f"{kind}://{parts.netloc}/" for kind in ("http", "ws"))
    assert len(tab.asked) >= 3  # page, program, line
    assert [asked for asked in tab.asked if not asked.startswith((*home, "data:", "blob:"))] == []


def workers(process):
    """Processes that compute for pages."""
    return [one for one in psutil.Process(process.pid).children(recursive=True) if one.status() != "zombie"]


def test_everything_that_can_be_done(server, browser, tmp_path):
    tab = opened(browser, server.address)
    values, lines = equilibria_job(load_scene(OVER_PLATE), Models(), 0.0, tmp_path)
    assert said(tab, "text('headline')") == lines[0]
    assert_one_word(tab, values["equilibria"][0])
    assert said(tab, "text('command')") == "spinlev equilibria scene.toml --model fem --plate-model auto"
    shown = said(tab, "at('table').innerText").split()
    rows = len(values["equilibria"])
    listed = " ".join(lines[1 : 2 + rows]).split()
    assert shown[: len(listed)] == listed
    assert " ".join(shown[len(listed) :]) in lines  # what was left out
    eigenvalues = said(tab, "at('modes').innerText").split()
    for mode in values["equilibria"][0]["modes"]:
        assert f"{mode['growth_per_s']:.6g}" in eigenvalues
        assert f"{mode['frequency_hz']:.6g}" in eigenvalues

    choose(tab, "plate_model", "slab")  # of which a table takes a second
    wait(tab, f"{COMPLETE} && /infinite slab/.test(text('sign'))")
    moves = {
        "frequency_hz": [131 + k / 2 for k in range(5)],
        "rotor.angle_deg": [10.1 + k / 5 for k in range(5)],
        "rotor.edge_mm": [10.05, 10.1, 10.15],
        "floater.diameter_mm": [12.75, 12.8, 12.85],
        "spin": [0.01, 0.02, 0.03],
        "plate.center_mm.2": [-52.25, -52.5, -52.75],
    }
    latency = {name: [move(tab, name, value) for value in values] for name, values in moves.items()}
    every = [value for values in latency.values() for value in values]
    print(f"median latency of a slider: {statistics.median(every):.0f} ms;", end=" ")
    print(", ".join(f"{name} {statistics.median(values):.0f}" for name, values in latency.items()))
    wait(tab, COMPLETE)
    state = parse_qs(urlsplit(tab.run("location.href")).query)
    assert state["frequency_hz"] == ["133.0"]
    assert state["rotor.angle_deg"] == ["10.9"]
    assert state["token"] == parse_qs(urlsplit(server.address).query)["token"]

    wait(tab, "/^Blue/.test(text('map_says'))")  # by the dipole at first: it can be clicked from then on
    assert said(tab, "at('map').querySelectorAll('circle title').length") == 9  # tilts that the article tried
    click(tab, "map")
    wait(tab, "Math.abs(+at('frequency_hz').value - 160) < 30 && Math.abs(+at('rotor.angle_deg').value - 22) < 8")
    for name, value in (("frequency_hz", 130), ("rotor.angle_deg", 10)):
        move(tab, name, value)
    wait(tab, COMPLETE)

    click(tab, "play")
    wait(tab, "/^t = /.test(text('says')) && parseFloat(text('says').slice(4)) > 0.2")
    click(tab, "up")
    seen = "[...at('height').querySelectorAll('text[text-anchor=end]')].map(one => +one.textContent)"
    wait(tab, f"Math.max(...{seen}) - Math.min(...{seen}) > 0.15")
    click(tab, "play")
    wait(tab, "text('play') === 'Play'")
    choose(tab, "speed", "0.001")
    click(tab, "play")
    before = said(tab, "text('says')")
    wait(tab, f"text('says') !== {json.dumps(before)}")
    choose(tab, "speed", "1")

    assert_dragged(tab)
    assert_downloaded(tab, tmp_path)
    assert_quiet(tab, server.address)
    tab.close()


def assert_one_word(tab, first):
    """Finite elements as on the console and in JSON, with four digits; the point dipole's grey beside."""
    cells = said(tab, "[...at('models').children].map(cell => [...cell.children].map(one => one.textContent))")
    assert [name for name, *_ in cells] == ["finite elements", "point dipole"]
    distance, angle = -first["position_mm"][2], first["polar_angle_deg"]
    assert cells[0][1:] == [f"{distance:.4g} mm", f"{angle:.1f}°, {first['stability']}"]
    assert re.fullmatch(r"\d\d\.\d\d mm", cells[1][1])
    assert said(tab, "getComputedStyle(at('models').children[1]).color") == "rgb(107, 118, 137)"
    assert re.search(
        r"same conditions: levitation distance .* less than with finite elements", said(tab, "text('comparison')")
    )
    assert "over the finite plate" in said(tab, "text('sign')")


def assert_dragged(tab):
    """The ball, dragged a long way: out of reach of the plate's response, the page waits and says so; else it falls."""
    size = said(tab, "(r => [r.width, r.height])(at('ball').getBoundingClientRect())")
    assert abs(size[0] - size[1]) < 0.01 * size[0]  # a ball looks round

    def drag():
        said(tab, "at('side').scrollIntoView({block: 'center'})")
        x, y = said(tab, "box('ball')")
        x += 0.6 * size[0]  # beside it: it may have moved when the press is heard
        tab.mouse((x, y), (x + 20, y + 5), (x + 60, y + 15), (x + 90, y + 25))

    drag()
    refused = "/field of the plate's currents was computed/.test(text('says')) && text('play') === 'Play'"
    wait(tab, refused)
    tab.run("new Promise(done => setTimeout(done, 1000))")
    assert said(tab, refused)
    choose(tab, "plate_model", "none")
    wait(tab, f"{COMPLETE} && /without the plate/.test(text('sign'))")
    drag()
    wait(tab, "/^After .* s (touched|lost)/.test(text('says'))")
    click(tab, "reset")
    wait(tab, "text('says') === ''")
    choose(tab, "plate_model", "slab")
    wait(tab, f"{COMPLETE} && /infinite slab/.test(text('sign'))")


def assert_downloaded(tab, folder):
    """Each file arrives; the scene is that of the address, the result that of the command line."""
    tab.ask("Browser.setDownloadBehavior", behavior="allow", downloadPath=str(folder))
    for kind, name in (("toml", "scene.toml"), ("json", "equilibria.json"), ("figure", "explore.svg")):
        file = folder / name
        file.unlink(missing_ok=True)
        click(tab, kind if kind == "figure" else f"get_{kind}")
        end = time.monotonic() + 60
        while not file.exists():
            tab.run("0")
            assert time.monotonic() < end, f"{name} does not come"
            time.sleep(0.05)
    scene = load_scene(folder / "scene.toml")
    assert scene.frequency == 130.0
    found = json.loads((folder / "equilibria.json").read_text())
    other = folder / "again"
    known, _ = equilibria_job(scene, Models("fem", "slab"), 0.03, other)
    places = [[e["position_mm"] for e in one["equilibria"]] for one in (found, known)]
    assert np.allclose(*places, rtol=1e-12, atol=1e-12)
    figure = ElementTree.parse(folder / "explore.svg").getroot()
    assert len(figure.findall("{http://www.w3.org/2000/svg}svg")) == 4


def test_two_pages_do_not_disturb_each_other_and_a_killed_one_frees_its_work(server, browser):
    first = opened(browser, server.address)
    address = f"{server.address}&frequency_hz=150&model=cuboid&plate_model=none"
    second = opened(browser, address)
    click(second, "play")
    wait(second, "parseFloat(text('says').slice(4)) > 0.1")
    for tab, frequency in ((first, 130), (second, 150)):
        assert said(tab, "+at('frequency_hz').value") == frequency
    mine = said(first, "text('headline')")
    move(second, "frequency_hz", 151)
    assert said(first, "text('headline')") == mine
    assert said(first, "+at('frequency_hz').value") == 130
    busy = len(workers(server))
    second.close()
    first.run("0")
    end = time.monotonic() + 30
    while len(workers(server)) >= busy:
        assert time.monotonic() < end, "a closed page's processes go on"
        time.sleep(0.1)
    move(first, "frequency_hz", 132)
    assert_quiet(first, server.address)
    first.close()


def test_a_floater_turns_in_slow_motion_as_soon_as_the_page_opens(server, browser):
    """The distances by both models are there before the plate's currents are known, and nothing waits for these."""
    tab = browser.open(server.address, *DESK)
    tab.until("document.getElementById('sign') !== null")
    wait(tab, "/mm/.test(text('models')) && !document.querySelector('#table.loading, #side.loading')")
    seen = "at('picture').toDataURL()"
    first = said(tab, seen)
    assert "axial" in said(tab, "text('modes')")
    wait(tab, f"{seen} !== {json.dumps(first)}")
    said(tab, "(at('preset').value = 'horizontal', at('preset').dispatchEvent(new Event('change')))")
    wait(tab, "/being computed .*s\\)/.test(text('sign'))")  # said while it takes long
    wait(tab, "text('motion').startsWith('Slow motion') && document.getElementById('rotor.displacement_mm') !== null")
    assert_quiet(tab, server.address)
    tab.close()


def test_a_scene_that_cannot_be_is_a_message_in_the_page(server, browser):
    tab = opened(browser, f"{server.address}&frequency_hz=fast&floater.colour=red")
    text = said(tab, "text('message')")
    assert "frequency_hz" in text
    assert "floater.colour" in text
    assert said(tab, "at('message').offsetHeight") > 10
    assert said(tab, "+at('frequency_hz').value") == 130  # the scene of the command line
    assert_quiet(tab, server.address)
    tab.close()


def test_a_notebook_shows_it_in_a_frame(browser, tmp_path):
    """As Jupyter does: from another server, in a frame that `sl.explore` writes."""
    page = sl.explore(OVER_PLATE)
    (tmp_path / "notebook.html").write_text(
        f'<!DOCTYPE html><title>cell</title><link rel="icon" href="data:,">{page._repr_html_()}'
    )
    handler = partial(SimpleHTTPRequestHandler, directory=str(tmp_path))
    with ThreadingHTTPServer(("127.0.0.1", 0), handler) as notebook:
        threading.Thread(target=notebook.serve_forever, daemon=True).start()
        tab = browser.open(f"http://127.0.0.1:{notebook.server_port}/notebook.html", *DESK)
        tab.until("document.title === 'cell' && document.readyState === 'complete'")
        picture, end = tmp_path / "frame.png", time.monotonic() + 240  # 138 s on a busy machine
        while True:
            tab.picture(picture)
            with Image.open(picture) as seen:
                pixels = np.asarray(seen.convert("RGB")).reshape(-1, 3).astype(int)
            if (np.abs(pixels - (0x56, 0xB4, 0xE9)).max(axis=1) < 8).sum() > 500:  # the map's stable region
                break
            assert time.monotonic() < end, "the frame stays empty"
            time.sleep(0.3)
        assert tab.errors == []
        tab.close()
        notebook.shutdown()
    page.stop()


def test_a_phone_shows_it_without_scrolling_sideways(server, browser, tmp_path):
    tab = opened(browser, server.address, PHONE)
    assert tab.run("document.documentElement.scrollWidth") <= PHONE[0]
    tab.run("new Promise(done => setTimeout(done, 500))")
    picture = tmp_path / "phone.png"
    tab.picture(picture)
    with Image.open(picture) as seen:
        pixels = np.asarray(seen.convert("RGB")).reshape(-1, 3).astype(int)
    assert ((pixels[:, 0] > pixels[:, 2] + 80) & (pixels[:, 0] > 150)).sum() > 50  # the arrows of the moments
    assert_quiet(tab, server.address)
    tab.close()
