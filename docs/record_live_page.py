"""Record the live page as pictures/explore.png and explore.gif: a slider moves, the floater is simulated and kicked.

Needs Chromium (Debian: apt-get install chromium). `.venv/bin/python docs/record_live_page.py`
"""

import subprocess
import sys
import tempfile
import time
from pathlib import Path

from PIL import Image

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT / "tests"))
from devtools import Browser  # noqa: E402

SIZE, WIDTH = (1400, 1260), 900
PICTURES = ROOT / "docs" / "pictures"
AT = "const at = id => document.getElementById(id);"
PACE = 0.25
"""Between pictures, s."""


def main() -> None:
    """Open a page, play with it, and keep what it looked like."""
    command = [Path(sys.executable).with_name("spinlev"), "explore", "--no-browser"]
    with (
        tempfile.TemporaryDirectory() as folder,
        subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as server,
    ):
        browser = Browser(Path(folder) / "profile")
        tab = browser.open(server.stdout.readline().strip(), *SIZE)
        shots: list[Image.Image] = []

        def run(program: str) -> object:
            return tab.run(f"(() => {{ {AT} return {program}; }})()")

        def shoot(count: int = 1) -> None:
            for _ in range(count):
                path = Path(folder) / "shot.png"
                tab.picture(path)
                with Image.open(path) as picture:
                    shots.append(picture.convert("RGB").crop((0, 0, *SIZE)).resize((WIDTH, WIDTH * SIZE[1] // SIZE[0])))
                time.sleep(PACE)

        tab.until("document.getElementById('map_says') !== null")
        ready = "/there\\.$/.test(at('map_says').textContent) && /^All/.test(at('sign').textContent)"
        while not run(ready):
            time.sleep(1)
        tab.picture(PICTURES / "explore.png")
        shoot(3)
        for frequency in (*range(132, 152, 4), *range(148, 128, -4)):
            before = run("at('sign').dataset.number")
            run(f"(at('frequency_hz').value = {frequency}, at('frequency_hz').dispatchEvent(new Event('input')))")
            while run("at('sign').dataset.number") == before:
                time.sleep(PACE)
            shoot()
        while not run(ready):
            time.sleep(1)
        for press in ("play", "up", "aside"):
            run(f"at('{press}').click()")
            while not run("/^t = /.test(at('says').textContent)"):
                time.sleep(PACE)
            shoot(7)
        browser.close()
        server.terminate()
    same = shots[0].quantize(96)
    frames = [shot.quantize(palette=same, dither=Image.Dither.NONE) for shot in shots]
    out = PICTURES / "explore.gif"
    frames[0].save(out, save_all=True, append_images=frames[1:], duration=350, loop=0, optimize=True)
    print(f"{out}: {len(frames)} pictures, {out.stat().st_size / 1e6:.1f} MB")


if __name__ == "__main__":
    main()
