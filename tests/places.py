"""Where the repository's files lie, and what is in its modules, for tests in any folder."""

import ast
from functools import cache
from pathlib import Path

TESTS = Path(__file__).parent
ROOT = TESTS.parent
DOCS = ROOT / "docs"
SCENES = ROOT / "scenes"
HORIZONTAL = SCENES / "horizontal.toml"
OVER_PLATE = SCENES / "tilt-over-plate.toml"
QUICK = TESTS / "data" / "quick"
"""Stored quick results of the studies."""


@cache
def modules() -> dict[Path, ast.Module]:
    """The tree of each module of the four floors, once for all tests that read them."""
    floors = ("geometry", "fem", "dynamics", "studies")
    return {path: ast.parse(path.read_text()) for floor in floors for path in sorted((ROOT / floor).rglob("*.py"))}
