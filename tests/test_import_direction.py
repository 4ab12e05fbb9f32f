"""Imports go one way: geometry <- fem <- dynamics <- studies."""

import ast
from pathlib import Path

import pytest

ORDER = ["geometry", "fem", "dynamics", "studies"]
ROOT = Path(__file__).parent.parent
SOURCES = [path for folder in ORDER for path in sorted((ROOT / folder).glob("*.py"))]


def imported_siblings(path: Path) -> set[str]:
    """Names of the packages of the house that a module imports, relative or absolute."""
    found = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.ImportFrom) and node.level == 2:
            found.add((node.module or node.names[0].name).split(".")[0])
        names = [a.name for a in node.names] if isinstance(node, ast.Import) else []
        if isinstance(node, ast.ImportFrom) and node.level == 0:
            names = [node.module or ""]
        found |= {name.split(".")[1] for name in names if name.startswith("spinlev.")}
    return found


@pytest.mark.parametrize("path", SOURCES, ids=lambda p: f"{p.parent.name}/{p.name}")
def test_a_module_imports_only_from_rooms_before_its_own(path):
    allowed = ORDER[: ORDER.index(path.parent.name)]
    assert imported_siblings(path) <= set(allowed)


def test_dynamics_knows_no_mesh_and_geometry_and_dynamics_no_solver():
    for path in SOURCES:
        text = path.read_text()
        if path.parent.name in ("dynamics", "studies"):
            assert "import ngsolve" not in text
            assert "from ngsolve" not in text
        if path.parent.name == "dynamics":
            assert "geometry.mesh" not in text


def test_folders_are_flat():
    nested = [path for folder in ORDER for path in (ROOT / folder).glob("*/*.py")]
    assert nested == []
