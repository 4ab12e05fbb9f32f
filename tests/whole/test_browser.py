"""Pages as a browser shows them: no error, no request to any network, a picture on the canvas, no text too wide."""

import functools
import http.server
import json
import re
import shutil
import subprocess
import threading

import pytest
from places import ROOT, SCENES

from spinlev.geometry.scenes import load_scene
from spinlev.studies.catalogue import report_job
from spinlev.studies.one_scene import simulate_job
from spinlev.studies.terminal import Models

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")
SITE = ROOT / "docs" / "_build" / "html"
PHONE, DESK = 390, 1400
HARMLESS = "[PST]: Changed to"
"""What the documentation's theme says of its colours."""
pytestmark = pytest.mark.skipif(CHROMIUM is None, reason="no chromium here (Debian: apt-get install chromium)")

FRAME = """<!doctype html><meta charset="utf-8"><link rel="icon" href="data:,">
<iframe id="page" src="PAGE" width="WIDTH" height="900"></iframe>
<pre id="found"></pre><script>
const frame = document.getElementById("page");
frame.onload = () => setTimeout(() => {
  const inner = frame.contentWindow, page = inner.document;
  const pixels = canvas => canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height).data;
  const painted = [...page.querySelectorAll("canvas")].map(canvas =>
    pixels(canvas).filter((value, k) => k % 4 == 3 && value > 0).length);
  document.getElementById("found").textContent = JSON.stringify({
    wide: page.documentElement.scrollWidth, painted, title: page.title,
    asked: inner.performance.getEntriesByType("resource").map(entry => entry.name),
    equations: page.querySelectorAll("mjx-container").length });
}, 1500);
</script>"""


class Quiet(http.server.SimpleHTTPRequestHandler):
    def log_message(self, *arguments):
        """Says nothing."""


def seen(folder, page, width, tmp_path):
    """What a browser finds on a page of a folder in a frame so wide; fails where the page says an error."""
    frame = folder / f"frame-{width}.html"
    frame.write_text(FRAME.replace("PAGE", page).replace("WIDTH", str(width)))
    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), functools.partial(Quiet, directory=str(folder))) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        address = f"http://127.0.0.1:{server.server_port}"
        how = ["--headless=new", "--no-sandbox", "--disable-gpu", "--disable-background-networking", "--no-first-run"]
        how += [f"--user-data-dir={tmp_path / 'profile'}", "--enable-logging=stderr", "--window-size=1500,1000"]
        how += ["--host-resolver-rules=MAP * ~NOTFOUND, EXCLUDE 127.0.0.1", "--virtual-time-budget=15000", "--dump-dom"]
        done = subprocess.run(
            [CHROMIUM, *how, f"{address}/{frame.name}"], capture_output=True, text=True, check=True, timeout=200
        )
        server.shutdown()
    frame.unlink()
    said = [line for line in done.stderr.splitlines() if "CONSOLE" in line and HARMLESS not in line]
    assert said == []
    found = json.loads(re.search(r'<pre id="found">(.*?)</pre>', done.stdout, re.DOTALL)[1].replace("&amp;", "&"))
    assert [name for name in found["asked"] if not name.startswith((address, "data:", "blob:"))] == []
    assert found["wide"] <= width
    return found


@pytest.fixture(scope="module")
def report(tmp_path_factory):
    folder = tmp_path_factory.mktemp("report")
    simulate_job(load_scene(SCENES / "vertical-24h.toml"), Models("dipole", "none"), 0.2, folder, resume=False)
    report_job(folder, folder)
    return folder


@pytest.mark.parametrize("width", [PHONE, DESK])
def test_the_report_is_whole(report, width, tmp_path):
    found = seen(report, "report.html", width, tmp_path)
    assert found["title"].startswith("spinlev: ")
    assert len(found["painted"]) == 1
    assert found["painted"][0] > 1000
    assert (report / "report.html").stat().st_size < 3_000_000


@pytest.mark.parametrize("width", [PHONE, DESK])
@pytest.mark.parametrize("page", ["index.html", "mathematics.html"])
def test_the_documentation_is_whole(page, width, tmp_path):
    if not (SITE / page).exists():
        pytest.skip("the documentation is not built here (make docs)")
    found = seen(SITE, page, width, tmp_path)
    assert found["equations"] > 10 or page == "index.html"
