"""The check of solvers' numbers: it names what has changed, and no comment."""

import shutil

import pytest
from check_formats import ALONE, ROOT, SOLVERS, faults, recorded

from spinlev.fem.cache import FORMATS

FEW = {name: FORMATS[name] for name in ("rotor", "edges", "code")}


@pytest.fixture
def copy(tmp_path):
    """The floors' text, to be changed."""
    for floor in ("geometry", "fem", "dynamics"):
        shutil.copytree(ROOT / floor, tmp_path / floor, ignore=shutil.ignore_patterns("__pycache__"))
    return tmp_path


def test_every_number_has_its_modules():
    assert FORMATS.keys() == SOLVERS.keys() | ALONE.keys()


@pytest.mark.parametrize(
    ("file", "old", "new", "said"),
    [
        ("fem/elements/ladder.py", "SAFETY = 1.25", "SAFETY = 1.26", ["rotor", "edges"]),
        ("geometry/common.py", "MU_0 = 4e-7", "MU_0 = 4.1e-7", ["rotor", "edges"]),
        ("fem/plate/slab.py", "ORDER, RULE = 2", "ORDER, RULE = 3", ["edges"]),
        ("dynamics/motion/equations.py", "import heyoka", "import numpy, heyoka", ["code"]),
        ("fem/elements/ladder.py", "SAFETY = 1.25", "SAFETY = 1.25  # more\n'''A text.'''\n", []),
        ("geometry/scene/messages.py", "import", "import sys, ", []),
    ],
)
def test_other_code_is_named_with_its_solvers(copy, file, old, new, said):
    record = recorded(FEW, copy)
    assert faults(FEW, record, copy) == []
    text = (copy / file).read_text()
    assert old in text
    (copy / file).write_text(text.replace(old, new, 1))
    found = faults(FEW, record, copy)
    assert [line.partition(":")[0] for line in found] == said
    assert all(file in line for line in found)


def test_a_number_that_was_raised_is_recorded(copy):
    record = recorded(FEW, copy)
    assert faults({**FEW, "rotor": 99}, record, copy) == ["rotor: number 99 is not recorded."]
