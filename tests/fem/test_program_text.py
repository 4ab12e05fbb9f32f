"""A table's key changes with the text of the modules that make it, and with no other."""

import json
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import spinlev
from spinlev.fem.cache import LIBRARIES, ROOT, digest_of, modules_of, program_of
from spinlev.fem.rotor.choice import rotor_key
from spinlev.geometry.rotor import horizontal

INSTALLED = Path(spinlev.__file__).parent
FLOORS = ("geometry", "fem", "dynamics", "studies")
ROTOR, PLATE, SCENE = "spinlev.fem.rotor.choice", "spinlev.fem.plate.driven", "spinlev.studies.levitation"


@pytest.fixture
def copy(tmp_path):
    """The program's text, to be changed."""
    for floor in FLOORS:
        shutil.copytree(INSTALLED / floor, tmp_path / floor, ignore=shutil.ignore_patterns("__pycache__"))
    return tmp_path


def another(copy):
    """Which of the three packages have another digest."""
    return [package for package in (ROTOR, PLATE, SCENE) if digest_of(package, root=copy) != digest_of(package)]


def test_the_same_text_has_the_same_digest_wherever_it_lies(copy):
    assert another(copy) == []
    assert len({digest_of(package) for package in (ROTOR, PLATE, SCENE)}) == 3


@pytest.mark.parametrize(
    ("file", "constant", "expected"),
    [
        ("fem/elements/ladder.py", "SAFETY = 1.25", [ROTOR, PLATE, SCENE]),
        ("geometry/common.py", "MU_0 = 4e-7", [ROTOR, PLATE, SCENE]),
        ("fem/plate/field_functions.py", "SPACING = 2.5", [PLATE, SCENE]),
        ("dynamics/flights/compiled.py", "TOLERANCE = 1e-16", [SCENE]),
        ("studies/sweep.py", "TRIES = 3", []),
    ],
)
def test_a_changed_constant_changes_the_keys_of_what_is_made_with_it(copy, file, constant, expected):
    text = (copy / file).read_text()
    assert text.count(constant) == 1
    (copy / file).write_text(text.replace(constant, f"{constant}1"))
    assert another(copy) == expected


def test_a_module_of_another_name_changes_the_digest(copy):
    table = copy / "fem" / "rotor" / "pose.py"
    table.write_text(table.read_text() + "# more")
    assert digest_of(ROTOR, root=copy) != digest_of(ROTOR)


@pytest.mark.parametrize("package", [ROTOR, pytest.param(PLATE, marks=pytest.mark.slow), SCENE])
def test_no_module_that_another_loads_is_missed(package):
    """Python itself says in a fresh process which modules it has loaded."""
    code = f"import sys, json, {package}; print(json.dumps([m for m in sys.modules if m.startswith('spinlev.')]))"
    done = subprocess.run([sys.executable, "-P", "-c", code], capture_output=True, text=True, check=True)
    known = {".".join(("spinlev", *path.relative_to(ROOT).with_suffix("").parts)) for path in modules_of(package)}
    packages = {name.rpartition(".")[0] for name in known}
    assert {name for name in json.loads(done.stdout) if name not in packages and name.count(".") > 1} <= known


def test_a_package_that_is_none_of_the_program_is_refused():
    with pytest.raises(FileNotFoundError, match="must be modules of this program"):
        digest_of("spinlev.fem.nowhere")


def test_the_key_of_a_table_has_the_text_and_the_libraries(monkeypatch):
    said = program_of(ROTOR)
    assert digest_of(ROTOR) in said
    assert all(name in said for name in LIBRARIES)
    key = rotor_key(horizontal(0.002, 0.01, 1.305, 1.05), "fem", 1e-5)
    monkeypatch.setattr("spinlev.fem.rotor.choice.program_of", lambda _: "another program")
    assert rotor_key(horizontal(0.002, 0.01, 1.305, 1.05), "fem", 1e-5) != key
