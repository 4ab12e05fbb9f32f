"""Where the repository's files lie, for tests in any folder."""

from pathlib import Path

TESTS = Path(__file__).parent
ROOT = TESTS.parent
DOCS = ROOT / "docs"
SCENES = ROOT / "scenes"
HORIZONTAL = SCENES / "horizontal.toml"
OVER_PLATE = SCENES / "tilt-over-plate.toml"
QUICK = TESTS / "data" / "quick"
"""Stored quick results of the studies."""
