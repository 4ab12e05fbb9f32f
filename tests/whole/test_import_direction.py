"""Imports go one way: between floors, between the rooms of a floor, and through the faces of rooms."""

import ast
from pathlib import Path

from places import ROOT, TESTS

FLOORS = {
    "geometry": ["basics", "bodies", "scenes", "meshes"],
    "fem": [
        *(
            "storage",
            "harmonics",
            "closed_forms",
            "elements",
            "magnetostatics",
            "rotor_tables",
            "floaters",
            "measured_maps",
        ),
        *(
            "mutual",
            "eddy_currents",
            "plate_currents",
            "plate_network",
            "plate_tables",
            "rotor_losses",
            "slab",
            "verification",
        ),
    ],
    "dynamics": [
        *("motion", "local_plates", "effects", "steady", "equilibria", "branches", "maps", "flights", "ensembles"),
        "slow_drift",
    ],
    "studies": [
        *(
            "terminal",
            "rendering",
            "results",
            "pictures",
            "one_scene",
            "exchange",
            "sweeps",
            "article",
            "field_quality",
            "levitation",
        ),
        *("margins", "plates", "capture", "experiment", "catalogue", "live", "explore", "interface", "command_line"),
    ],
}
ORDER = [(floor, room) for floor, rooms in FLOORS.items() for room in rooms]
LARGEST = 13
"""Modules in a room, its face not counted."""
SOURCES = [path for floor in FLOORS for path in sorted((ROOT / floor).glob("*/*.py"))]


def imported(path: Path) -> set[tuple[str, ...]]:
    """Modules of the house that a module imports, as (floor, room) or (floor, room, file)."""
    package, found = ["spinlev", *path.relative_to(ROOT).parts[:-1]], set()
    for node in ast.walk(ast.parse(path.read_text())):
        names = [alias.name.split(".") for alias in node.names] if isinstance(node, ast.Import) else []
        if isinstance(node, ast.ImportFrom):
            base = package[: len(package) - node.level + 1] if node.level else []
            base += node.module.split(".") if node.module else []
            names = [base] if len(base) > 2 else [[*base, alias.name] for alias in node.names]
        found |= {tuple(name[1:]) for name in names if name[0] == "spinlev"}
    return found


IMPORTS = {path: imported(path) for path in SOURCES}


def test_the_rooms_are_known():
    there = {tuple(path.relative_to(ROOT).parts[:-1]) for path in SOURCES}
    assert there == set(ORDER)
    assert [path for floor in FLOORS for path in (ROOT / floor).glob("*.py") if path.name != "__init__.py"] == []


def test_the_tests_mirror_the_rooms():
    """Each test in its room's folder, in its floor's if several rooms are in it, or in `whole`; names are unique."""
    files = list(TESTS.rglob("test_*.py"))
    known = {*ORDER, *((floor,) for floor in FLOORS), ("whole",)}
    assert {path.relative_to(TESTS).parts[:-1] for path in files} <= known
    assert len({path.name for path in files}) == len(files)


def test_a_module_imports_only_from_rooms_before_its_own_and_from_their_faces():
    wrong = []
    for path, modules in IMPORTS.items():
        own = path.relative_to(ROOT).parts[:-1]
        for module in (each for each in modules if each[:2] != own):
            if len(module) != 2:
                wrong.append(f"{path}: {'.'.join(module)} is not the face of a room")
            elif ORDER.index(module) >= ORDER.index(own):
                wrong.append(f"{path}: {'.'.join(module)} comes after its own room")
    assert wrong == []


def test_a_room_says_its_question_and_is_not_crowded():
    wrong = []
    for room in ORDER:
        folder = ROOT / Path(*room)
        face = ast.parse((folder / "__init__.py").read_text())
        if (ast.get_docstring(face) or "").partition("\n")[0].count("?") != 1:
            wrong.append(f"{folder}: its first line is no question")
        if (stub := folder / "__init__.pyi").exists():  # a face whose names are loaded when they are used
            face = ast.parse(stub.read_text())
        modules = {path.stem for path in folder.glob("*.py")} - {"__init__"}
        if len(modules) > LARGEST:
            wrong.append(f"{folder}: {len(modules)} modules, at most {LARGEST}")
        public = {alias.name for node in face.body if isinstance(node, ast.ImportFrom) for alias in node.names}
        wrong += [f"{folder}: {name} is a module and a name that the room gives out" for name in public & modules]
    assert wrong == []


def test_dynamics_knows_no_mesh_and_geometry_and_dynamics_no_solver():
    for path in SOURCES:
        text, floor = path.read_text(), path.relative_to(ROOT).parts[0]
        if floor in ("dynamics", "studies"):
            assert "import ngsolve" not in text
            assert "from ngsolve" not in text
        if floor == "dynamics":
            assert ("geometry", "meshes") not in IMPORTS[path]
