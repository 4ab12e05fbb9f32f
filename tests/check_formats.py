"""Whether the number of each solver, `FORMATS` in fem/cache.py, still belongs to its code.

From the repository's root:

    python tests/check_formats.py             # names each solver whose code has changed since it was recorded
    python tests/check_formats.py --record    # records the code: its number was raised, or its answers are the same

Comments and docstrings are no code. A solver is a module with all that it imports of the floors below.
"""

import ast
import hashlib
import json
import sys
from functools import cache
from pathlib import Path

from spinlev.fem.cache import FORMATS

ROOT = Path(__file__).parent.parent
RECORD = ROOT / "tests" / "data" / "formats.json"
SOLVERS = {
    "rotor": "fem/rotor/choice.py",
    "mutual": "fem/mutual/making.py",
    "map": "fem/maps_of_B/table.py",
    "plate": "fem/plate/tables.py",
    "driven-plate": "fem/plate/tables.py",
    "changed-share": "fem/plate/tables.py",
    "plate-currents": "fem/plate/currents.py",
    "slab": "fem/plate/tables.py",
    "edges": "fem/plate/slab.py",
    "rotor-losses": "fem/rotor_metal.py",
    "floater-currents": "fem/floater_metal.py",
    "floating": "fem/plate/floating.py",
    "floating-free": "fem/plate/floating.py",
    "equilibria": "dynamics/equilibria/search.py",
    "flight": "dynamics/flights/flight.py",
    "experiment": "studies/catalogue/experiment_design.py",
}
"""The module that makes the tables of each number."""
ALONE = {"code": ("dynamics/motion/equations.py", "dynamics/motion/rates.py", "fem/compiled_code.py")}
"""Modules that count by themselves: formulas are in the keys of what is compiled from them."""
BESIDE = (
    *("studies/", "geometry/scene/", "geometry/files.py", "geometry/step_file.py"),
    *("fem/cache.py", "fem/compiled_code.py"),
)
"""What reads, writes and speaks: no number of a table is from there but by what is in its key. Of scenes what they hold
counts all the same."""
COUNTED = ("geometry/scene/contents.py", *SOLVERS.values())


def modules(name, root=ROOT):
    """Paths from the root of a solver's module and of all that it imports, directly or not, in the floors below."""
    if name in ALONE:
        return list(ALONE[name])
    found, new = set(), {SOLVERS[name]}
    while new:
        found |= new
        new = {path for module in new for path in _imported(module, root)} - found
    return sorted(path for path in found if path in COUNTED or not path.startswith(BESIDE))


def _imported(module, root):
    """Modules that one imports; inside the program all imports are relative."""
    floor = module.split("/")[0]
    for level, name, names in _parsed((root / module).read_text("utf-8"))[0]:
        place = Path(*Path(module).parts[:-level], *name.split("."))
        for path in (place.with_suffix(".py"), *(place / f"{inner}.py" for inner in names)):
            # What an experiment asks of the rest of its floor is how a scene is computed, which is counted below.
            if (root / path).is_file() and not (floor == "studies" and path.parts[0] == "studies"):
                yield path.as_posix()


def digest(text):
    """SHA-256 of a module's code."""
    return _parsed(text)[1]


@cache
def _parsed(text):
    """Relative imports of a module, and the digest of its code."""
    tree = ast.parse(text)
    imports = [node for node in ast.walk(tree) if isinstance(node, ast.ImportFrom) and node.level]
    code = hashlib.sha256(repr(_plain(tree)).encode()).hexdigest()[:16]
    return [(node.level, node.module or "", [name.name for name in node.names]) for node in imports], code


def _plain(node):
    """A syntax tree without docstrings, places and what is empty, so that every version of Python has the same."""
    if isinstance(node, list):
        return [_plain(item) for item in node if not _is_text(item)]
    if not isinstance(node, ast.AST):
        return node
    inner = {name: value for name, value in ast.iter_fields(node) if value not in (None, [])}
    return type(node).__name__, {name: _plain(value) for name, value in inner.items()}


def _is_text(node):
    return isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant) and isinstance(node.value.value, str)


def faults(numbers, record, root=ROOT):
    """A sentence for each solver whose number or code is not the recorded one."""
    found, known = [], record["modules"]
    for name, number in numbers.items():
        changed = [p for p in modules(name, root) if known.get(p) != digest((root / p).read_text("utf-8"))]
        if number != record["numbers"].get(name):
            found.append(f"{name}: number {number} is not recorded.")
        elif changed:
            found.append(f"{name}: number {number}, but other code in {', '.join(changed)}.")
    return found


def recorded(numbers, root=ROOT):
    """What is recorded of the code as it is."""
    paths = sorted({path for name in numbers for path in modules(name, root)})
    return {"numbers": numbers, "modules": {p: digest((root / p).read_text("utf-8")) for p in paths}}


def main():
    """The command; its exit status."""
    if sys.argv[1:] == ["--record"]:
        RECORD.write_text(f"{json.dumps(recorded(FORMATS), indent=1)}\n")
        return 0
    if not (found := faults(FORMATS, json.loads(RECORD.read_text()))):
        return 0
    print(*found, sep="\n")
    print(
        "Where tables come out otherwise, or their fields are others, raise the number in fem/cache.py: kept tables of "
        "the old code are then not read. In both cases end with: python tests/check_formats.py --record"
    )
    return 1


if __name__ == "__main__":
    sys.exit(main())
