"""Pages as a browser shows them: no error, no request to any network, a picture on the canvas, no text too wide."""

import functools
import http.server
import json
import os
import re
import shutil
import subprocess
import threading
from dataclasses import replace

import numpy as np
import pytest
from PIL import Image
from places import ROOT, SCENES

from spinlev.fem.rotor.choice import rotor_table
from spinlev.geometry.scene.files import load_scene
from spinlev.studies.catalogue.report import report_job
from spinlev.studies.catalogue.runner import flight_of, read_result
from spinlev.studies.cli.options import Models
from spinlev.studies.figures.pictures import last_view
from spinlev.studies.figures.renderer import rendered, turnable_page, unavailable
from spinlev.studies.figures.view import View
from spinlev.studies.run import simulate_job

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")
SITE = ROOT / "docs" / "_build" / "unrun"
PHONE, DESK = 390, 1400
HARMLESS = ("[PST]: Changed to", "[PST]: Scrolled sidebar", '"scene,hashes"')
"""What the documentation's theme says of its colours, and the viewer of what it was given."""
pytestmark = [
    pytest.mark.skipif(CHROMIUM is None, reason="no chromium here (Debian: apt-get install chromium)"),
    pytest.mark.browser,
]

FRAME = """<!doctype html><meta charset="utf-8"><link rel="icon" href="data:,">
FRAMES<pre id="found"></pre><script>
const found = frame => {
  const inner = frame.contentWindow, page = inner.document;
  const views = [...page.querySelectorAll("iframe.view")].map(view => view.contentWindow);
  const asked = [inner, ...views].flatMap(one => one.performance.getEntriesByType("resource").map(entry => entry.name));
  return {
    wide: page.documentElement.scrollWidth, title: page.title, asked,
    canvases: views.map(one => one.document.querySelectorAll("canvas").length),
    equations: page.querySelectorAll("mjx-container").length };
};
window.onload = () => setTimeout(() => {
  const all = [...document.querySelectorAll("iframe")].map(found);
  document.getElementById("found").textContent = JSON.stringify(all);
}, 1500);
</script>"""


class Quiet(http.server.SimpleHTTPRequestHandler):
    def log_message(self, *arguments):
        """Says nothing."""


def browser(tmp_path, address, *what):
    """Chromium at the end of its work on a page, drawing in three dimensions without a graphics card."""
    how = ["--headless=new", "--no-sandbox", "--disable-background-networking", "--no-first-run"]
    how += ["--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--hide-scrollbars"]
    how += [f"--user-data-dir={tmp_path / 'profile'}", "--window-size=1500,1000"]
    how += ["--host-resolver-rules=MAP * ~NOTFOUND, EXCLUDE 127.0.0.1", "--virtual-time-budget=15000", *what]
    return subprocess.run([CHROMIUM, *how, address], capture_output=True, text=True, check=True, timeout=200)


def seen(folder, page, tmp_path):
    """What a browser finds on a page of a folder on a phone and on a desk; fails where the page says an error."""
    frame = folder / f"frame-{os.getpid()}.html"  # others may look at the same folder
    frames = [f'<iframe src="{page}" width="{width}" height="900"></iframe>' for width in (PHONE, DESK)]
    frame.write_text(FRAME.replace("FRAMES", "\n".join(frames)))
    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), functools.partial(Quiet, directory=str(folder))) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        address = f"http://127.0.0.1:{server.server_port}"
        done = browser(tmp_path, f"{address}/{frame.name}", "--enable-logging=stderr", "--dump-dom")
        server.shutdown()
    frame.unlink()
    said = [
        line for line in done.stderr.splitlines() if "CONSOLE" in line and not any(word in line for word in HARMLESS)
    ]
    assert said == []
    found = json.loads(re.search(r'<pre id="found">(.*?)</pre>', done.stdout, re.DOTALL)[1].replace("&amp;", "&"))
    for one, width in zip(found, (PHONE, DESK), strict=True):
        assert [name for name in one["asked"] if not name.startswith((address, "data:", "blob:"))] == []
        assert one["wide"] <= width
    return found


@pytest.fixture(scope="module")
def report(tmp_path_factory):
    folder = tmp_path_factory.mktemp("report")
    simulate_job(load_scene(SCENES / "vertical-24h.toml"), Models("dipole", "none"), 0.2, folder, resume=False)
    if unavailable() is not None:
        pytest.skip(unavailable())
    report_job(folder, folder)
    result = read_result(folder / "trajectory.nc")
    scene, motion = flight_of(result, "trajectory.nc")
    view = last_view(scene, rotor_table(scene.rotor, "dipole"), result["time"].values, motion)
    (folder / "trajectory-view.html").write_bytes(turnable_page(rendered(replace(view, turnable=True))))
    return folder


def test_the_report_is_whole(report, tmp_path):
    for found in seen(report, "report.html", tmp_path):
        assert found["title"].startswith("spinlev: ")
        assert found["canvases"] == [1]
    assert (report / "report.html").stat().st_size < 3_000_000


def test_the_view_to_turn_shows_rotor_and_floater(report, tmp_path):
    """The dark cubes, the grey sphere and the orange arrows, on white."""
    seen(report, "trajectory-view.html", tmp_path)
    picture = tmp_path / "view.png"
    browser(tmp_path, (report / "trajectory-view.html").as_uri(), f"--screenshot={picture}")
    pixels = np.asarray(Image.open(picture).convert("RGB")).reshape(-1, 3).astype(int)
    dark, orange = (pixels.max(axis=1) < 100), (pixels[:, 0] > pixels[:, 2] + 80)
    assert dark.sum() > 1000
    assert orange.sum() > 100
    assert 0.3 < (pixels.min(axis=1) > 250).mean() < 0.99
    assert (report / "trajectory-view.html").stat().st_size < 3_000_000


def test_the_view_to_turn_cuts_no_plate_off(tmp_path):
    """A deep plate that is wider than all else; the margin of the picture stays white."""
    if unavailable() is not None:
        pytest.skip(unavailable())
    place = np.array([0.0, 0.0, -0.019])
    view = View(load_scene(SCENES / "tilt-over-plate.toml"), place, np.array([0.0, 0.0, 1.0]), place[None].repeat(2, 0))
    (tmp_path / "view.html").write_bytes(turnable_page(rendered(replace(view, turnable=True))))
    picture = tmp_path / "view.png"
    browser(tmp_path, (tmp_path / "view.html").as_uri(), f"--screenshot={picture}")
    rows = np.asarray(Image.open(picture).convert("L"))
    assert (rows < 250).mean() > 0.1
    assert min(edge.min() for edge in (rows[:3], rows[-3:], rows[:, :3], rows[:, -3:])) > 250


@pytest.mark.parametrize(
    "page", ["index.html", "mathematics.html", "gallery/index.html", "gallery/kick.html", "api.html"]
)
def test_the_documentation_is_whole(page, tmp_path):
    if not (SITE / page).exists():
        pytest.skip("the documentation is not built here (make test-browser)")
    for found in seen(SITE, page, tmp_path):
        assert found["equations"] > 10 or page != "mathematics.html"
