"""Runs every example of the gallery and writes its picture; from the repository's root: python docs/draw_gallery.py."""

import runpy
import sys
from pathlib import Path

import matplotlib as mpl

from spinlev.studies.results.style import STYLE

DOCS = Path(__file__).parent


def drawn(name):
    """The variables of an example after it has run, `figure` among them."""
    with mpl.rc_context(STYLE):
        return runpy.run_path(str(DOCS / "examples" / f"{name}.py"))


if __name__ == "__main__":
    for path in sorted((DOCS / "examples").glob("*.py")):
        if not sys.argv[1:] or path.stem in sys.argv[1:]:
            figure = drawn(path.stem)["figure"]
            with mpl.rc_context(STYLE):
                figure.savefig(DOCS / "pictures" / f"gallery-{path.stem}.png")
