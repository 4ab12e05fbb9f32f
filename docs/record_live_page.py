"""Record the live page as pictures/explore.gif: a slider moves, the floater flies and is kicked.

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

SIZE, WIDTH = (1400, 1150), 900
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
                    shots.append(picture.convert("RGB").resize((WIDTH, picture.height * WIDTH // picture.width)))
                time.sleep(PACE)

        tab.until("document.getElementById('map_says') !== null")
        tab.until(f"(() => {{ {AT} return /Click to go/.test(at('map_says').textContent); }})()", 120)
        time.sleep(3)
        shoot(3)
        for frequency in (*range(132, 152, 4), *range(148, 128, -4)):
            run(f"(at('frequency_hz').value = {frequency}, at('frequency_hz').dispatchEvent(new Event('input')))")
            time.sleep(PACE)
            shoot()
        time.sleep(3)
        for press in ("play", "up", "aside"):
            run(f"at('{press}').click()")
            shoot(7)
        browser.close()
        server.terminate()
    same = shots[0].quantize(96)
    frames = [shot.quantize(palette=same, dither=Image.Dither.NONE) for shot in shots]
    out = ROOT / "docs" / "pictures" / "explore.gif"
    frames[0].save(out, save_all=True, append_images=frames[1:], duration=350, loop=0, optimize=True)
    print(f"{out}: {len(frames)} pictures, {out.stat().st_size / 1e6:.1f} MB")


if __name__ == "__main__":
    main()
