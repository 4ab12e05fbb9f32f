"""Imports go one way: between the floors, and between the modules of a floor."""

import ast
from graphlib import TopologicalSorter
from pathlib import Path

from places import ROOT, TESTS, modules

FLOORS = ("geometry", "fem", "dynamics", "studies")
LONGEST = 600
"""Lines of a module; one of a single subject has about 400."""


def imported(path: Path, body: list[ast.stmt]) -> set[Path]:
    """Modules of the house that statements of a module import."""
    package, found = ["spinlev", *path.relative_to(ROOT).parts[:-1]], set()
    for node in (each for statement in body for each in ast.walk(statement) if isinstance(each, ast.ImportFrom)):
        base = package[: len(package) - node.level + 1] if node.level else []
        base += node.module.split(".") if node.module else []
        if base[0] == "spinlev":
            place = ROOT.joinpath(*base[1:])
            found |= {place.with_suffix(".py")} if place.with_suffix(".py").exists() else {place / "__init__.py"}
    return found - {path}


def test_a_floor_knows_those_below_alone():
    wrong = []
    for path, tree in modules().items():
        floor = FLOORS.index(path.relative_to(ROOT).parts[0])
        known = {other.relative_to(ROOT).parts[0] for other in imported(path, tree.body)}
        wrong += [f"{path} imports from {other}" for other in known if FLOORS.index(other) > floor]
    assert wrong == []


def test_no_modules_import_each_other():
    """At their top; a command that calls another one late may."""
    graph = {}
    for path, tree in modules().items():
        top = [node for node in tree.body if isinstance(node, ast.ImportFrom)]
        graph[path] = imported(path, top)
    TopologicalSorter(graph).prepare()  # raises CycleError


def test_rooms_are_used_in_one_order():
    """At the top of their modules; a module that lies in no room counts as one."""
    graph: dict[tuple[str, ...], set[tuple[str, ...]]] = {}
    for path, tree in ((path, tree) for path, tree in modules().items() if path.name != "__init__.py"):
        top = [node for node in tree.body if isinstance(node, ast.ImportFrom)]
        graph.setdefault(room(path), set()).update({room(other) for other in imported(path, top)} - {room(path)})
    TopologicalSorter(graph).prepare()


def room(path: Path) -> tuple[str, ...]:
    return path.relative_to(ROOT).with_suffix("").parts[:2]


def test_the_tests_mirror_the_rooms():
    """Each test in its room's folder, in its floor's if several rooms are in it, or in `whole`; names are unique."""
    files = list(TESTS.rglob("test_*.py"))
    known = {path.parent.relative_to(ROOT) for path in modules()} | {Path("whole")}
    assert {path.parent.relative_to(TESTS) for path in files} <= known
    assert len({path.name for path in files}) == len(files)


def test_a_room_says_what_it_is_and_no_module_is_crowded():
    assert [path for path, tree in modules().items() if not ast.get_docstring(tree)] == []
    assert [path for path in modules() if path.read_text().count("\n") > LONGEST] == []


def test_dynamics_knows_no_mesh_and_geometry_and_dynamics_no_solver():
    for path, tree in modules().items():
        text, floor = path.read_text(), path.relative_to(ROOT).parts[0]
        if floor in ("dynamics", "studies"):
            assert "import ngsolve" not in text
            assert "from ngsolve" not in text
        if floor == "dynamics":
            meshes = [other for other in imported(path, tree.body) if "meshes" in other.parts]
            assert meshes == []
