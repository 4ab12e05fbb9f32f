"""Draws the pictures of scenes and studies in docs/pictures anew, by the commands that the pages name.

.venv/bin/python docs/draw_pictures.py [NAME ...]    # all: some two hours; finished points are kept
"""

import shutil
import sys
from pathlib import Path
from threading import Event

from spinlev.studies.catalogue.entries import CATALOGUE
from spinlev.studies.cli.main import run

ROOT = Path(__file__).parent.parent
SCENE = str(ROOT / "scenes" / "tilt-over-plate.toml")
COMMANDS = {"run": ["run", SCENE], "compare": ["compare", SCENE]} | {name: ["study", name] for name in CATALOGUE}

if __name__ == "__main__":
    for name in sys.argv[1:] or COMMANDS:
        out = ROOT / "out" / "pictures" / name
        if run([*COMMANDS[name], "--out", str(out)], Event()):
            sys.exit(f"{name} failed")
        for picture in (ROOT / "docs" / "pictures").glob("*.png"):
            if (out / picture.name).exists():
                shutil.copy(out / picture.name, picture)
